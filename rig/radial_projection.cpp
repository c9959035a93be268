// SPDX-License-Identifier: Apache-2.0
#include "rig/radial_projection.h"

#include <stdexcept>

namespace raystage::rig {

const RadialProjection& radial_projection(schemas::Projection projection) {
  switch (projection) {
    case schemas::Projection::kFisheye:
    case schemas::Projection::kFtheta:
      return equidistant_projection();
    case schemas::Projection::kEquisolid:
      return equisolid_projection();
    case schemas::Projection::kOrthographic:
      return orthographic_projection();
    case schemas::Projection::kPinhole:
      break;
  }
  throw std::logic_error("a pinhole has no radial projection");
}

}  // namespace raystage::rig
