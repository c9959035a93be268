// SPDX-License-Identifier: Apache-2.0
#include "render/sampling/source_view.h"

#include <algorithm>
#include <cmath>

namespace raystage::render {

SourceView make_source_view(const rig::CameraModel& camera,
                            const Eigen::Matrix3d& ideal_from_pixel) {
  SourceView s;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) s.ideal_from_pixel[3 * r + c] = ideal_from_pixel(r, c);
  }
  const schemas::Intrinsics& k = camera.intrinsics();
  s.fx = static_cast<float>(k.fx);
  s.fy = static_cast<float>(k.fy);
  s.cx = static_cast<float>(k.cx);
  s.cy = static_cast<float>(k.cy);
  s.k1 = static_cast<float>(k.distortion.k1);
  s.k2 = static_cast<float>(k.distortion.k2);
  s.k3 = static_cast<float>(k.distortion.k3);
  s.p1 = static_cast<float>(k.distortion.p1);
  s.p2 = static_cast<float>(k.distortion.p2);
  s.distorted = camera.has_distortion();
  s.fold_radius_squared = static_cast<float>(camera.fold_radius_squared());
  if (const rig::FisheyeLens* lens = camera.fisheye()) {
    s.is_fisheye = true;
    const double across = std::max(k.cx, camera.width() - k.cx) / k.fx;
    const double down = std::max(k.cy, camera.height() - k.cy) / k.fy;
    s.fisheye = fit_fisheye(*lens, std::hypot(across, down));
  }
  s.width = camera.width();
  s.height = camera.height();
  return s;
}

}  // namespace raystage::render
