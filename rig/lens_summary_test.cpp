// SPDX-License-Identifier: Apache-2.0
#include "rig/lens_summary.h"

#include <gtest/gtest.h>

#include <numbers>

namespace raystage::rig {
namespace {

using schemas::Projection;

schemas::RigDocument::Camera lens_camera(const std::string& id, Projection projection, double f,
                                         std::optional<double> half_angle = {}) {
  schemas::RigDocument::Camera camera;
  camera.geometry.id = id;
  camera.geometry.width = 400;
  camera.geometry.height = 300;
  schemas::Intrinsics& lens = camera.geometry.intrinsics;
  lens.fx = lens.fy = f;
  lens.cx = 200;
  lens.cy = 150;
  lens.projection = projection;
  lens.half_angle = half_angle;
  return camera;
}

std::string lenses_of(std::vector<schemas::RigDocument::Camera> cameras) {
  schemas::RigDocument document;
  document.cameras = std::move(cameras);
  return format_lenses(summarise_lenses(rig_from_document(document)));
}

TEST(LensSummary, StatesTheFieldOfViewOfTheWholePicture) {
  EXPECT_EQ(lenses_of({lens_camera("a", Projection::kPinhole, 200)}), "pinhole, 90 degrees");
  // The corner is 250 px from the middle, or 2.5 focal lengths.
  EXPECT_EQ(lenses_of({lens_camera("a", Projection::kFtheta, 100)}), "f-theta, 286.5 degrees");
  EXPECT_EQ(lenses_of({lens_camera("a", Projection::kFtheta, 100, 1.57079632679)}),
            "f-theta, 180 degrees");
  EXPECT_EQ(lenses_of({lens_camera("a", Projection::kFisheye, 10)}), "fisheye, 360 degrees");
  EXPECT_EQ(lenses_of({lens_camera("a", Projection::kOrthographic, 100)}),
            "orthographic, 180 degrees");
}

TEST(LensSummary, ListsTheMostFrequentFirst) {
  EXPECT_EQ(lenses_of({lens_camera("a", Projection::kPinhole, 200),
                       lens_camera("b", Projection::kEquisolid, 100, 1.0),
                       lens_camera("c", Projection::kEquisolid, 100, std::numbers::pi / 4)}),
            "2 equisolid, 90 to 114.6 degrees; 1 pinhole, 90 degrees");
}

}  // namespace
}  // namespace raystage::rig
