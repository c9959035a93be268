// SPDX-License-Identifier: Apache-2.0
#include "render/common/method.h"

#include <stdexcept>
#include <string>

#include "render/common/focal_surface.h"

namespace raystage::render {

RaySurface Method::surface(const SurfaceRequest& request) const {
  return focal_surface(*request.instant.rig, request.focal_plane);
}

Contribution Method::contribute(const ViewRequest& /*request*/) const {
  throw std::logic_error(std::string(name()) + " is not distributed");
}

RenderedView Method::combine(const ViewRequest& /*request*/,
                             std::vector<PixelValues> /*planes*/) const {  // NOLINT: as the others
  throw std::logic_error(std::string(name()) + " is not distributed");
}

}  // namespace raystage::render
