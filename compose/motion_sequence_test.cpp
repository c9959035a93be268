// SPDX-License-Identifier: Apache-2.0
// The AOV `motion` in files: what a pixel shows is in the adjacent frames where it says.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <array>
#include <fstream>

#include "base/atomic_file.h"
#include "images/exr_reader.h"
#include "testing/compose/sequence_test_data.h"

namespace raystage::compose {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using ::testing::HasSubstr;

class MotionSequence : public testing::SequenceTest {
 protected:
  void SetUp() override {
    SequenceTest::SetUp();
    std::ofstream(folder_.path() / "square.obj")
        << "o sign\nv -0.5 -0.5 0\nv 0.5 -0.5 0\nv 0.5 0.5 0\nv -0.5 0.5 0\nf 1 2 3 4\n";
    schemas::ShotDocument::Layer layer;
    layer.name = "square";
    schemas::ShotDocument::Geometry geometry{.file = "square.obj"};
    geometry.material = schemas::ShotDocument::Material{.kind = "diffuse", .color = {{1, 1, 1}}};
    geometry.keys = {{.frame = 101, .position = {{-0.3, -0.03, -2}}},
                     {.frame = 106, .position = {{0.4, 0.1, -2.4}}}};
    geometry.samples = 1;
    layer.geometry = geometry;
    shot_.layers.push_back(layer);
    shot_.lights = {{.ambient = {{0.5, 0.5, 0.5}}}};
    shot_.merge = schemas::ShotDocument::Merge::kDepth;
    shot_.output.aovs = {"P", "N", "motion"};
    options_.existing = ExistingFiles::kOverwrite;
  }

  std::vector<float> values(int frame, const char* channel) const {
    const images::ExrChannel channels[] = {{channel}};
    return images::read_exr_channels(file(frame), channels, "").values;
  }
  /// Returns the pixel of a point at a frame of the shot.
  static Vector2d pixel_of(const ShotPlan& plan, int frame, const Vector3d& point) {
    const render::VirtualCamera view = plan.camera(frame, Eye::kBoth);
    const Vector3d seen = view.pose.camera_from_world(point);
    return {view.intrinsics.cx - view.intrinsics.fx * seen.x() / seen.z(),
            view.intrinsics.cy + view.intrinsics.fy * seen.y() / seen.z()};
  }
};

TEST_F(MotionSequence, IsThatOfTheCameraAndOfMeshes) {
  run();
  const ShotPlan plan(shot_file());
  constexpr int kFrame = 103;
  const std::vector<float> z = values(kFrame, "Z"), normal = values(kFrame, "N.Z");
  const std::array<std::vector<float>, 3> p{values(kFrame, "P.X"), values(kFrame, "P.Y"),
                                            values(kFrame, "P.Z")};
  const std::array<std::vector<float>, 4> motion{
      values(kFrame, "motion.X"), values(kFrame, "motion.Y"), values(kFrame, "motion.Z"),
      values(kFrame, "motion.W")};
  const auto mesh_at = [&](int frame) {
    return plan.geometry(1)->instance_at(frame).world_from_object;
  };
  const render::VirtualCamera view = plan.camera(kFrame, Eye::kBoth);
  int of_mesh = 0, of_wall = 0;
  for (int y = 0; y < shot_.height; ++y) {
    for (int x = 0; x < shot_.width; ++x) {
      const auto i = static_cast<std::size_t>(y * shot_.width + x);
      const bool is_mesh = normal[i] != 0;
      (is_mesh ? of_mesh : of_wall) += 1;
      const Vector3d now = is_mesh ? Vector3d(p[0][i], p[1][i], p[2][i])
                                   : render::point_at_depth(view, x + 0.5, y + 0.5, z[i]);
      const auto moved = [&](int frame) -> Vector3d {
        if (!is_mesh) return now;
        return mesh_at(frame) * (mesh_at(kFrame).inverse() * now);
      };
      const Vector2d here = pixel_of(plan, kFrame, now);
      const Vector2d before = pixel_of(plan, kFrame - 1, moved(kFrame - 1)) - here,
                     after = here - pixel_of(plan, kFrame + 1, moved(kFrame + 1));
      EXPECT_NEAR(motion[0][i], before.x(), 1e-3) << x << ' ' << y;
      EXPECT_NEAR(motion[1][i], -before.y(), 1e-3);
      EXPECT_NEAR(motion[2][i], after.x(), 1e-3);
      EXPECT_NEAR(motion[3][i], -after.y(), 1e-3);
    }
  }
  EXPECT_GT(of_mesh, 50);
  EXPECT_GT(of_wall, 50);
}

// What moves in the next frame only changes this one.
TEST_F(MotionSequence, AdjacentFramesCountForWhatIsOutOfDate) {
  run();
  options_.existing = ExistingFiles::kSkip;
  EXPECT_EQ(run().rendered, 0);
  shot_.layers[1].geometry->keys[1].position = {{0.5, 0.1, -2.4}};
  EXPECT_EQ(run().rendered, 6);
  options_.frames = {101};
  shot_.camera.keys.back().position = {{0.05, -0.03, 0}};
  EXPECT_EQ(run().rendered, 1) << "frame 102 has another camera";
}

TEST_F(MotionSequence, IsNotOfEquirectangularViews) {
  shot_.camera.projection = schemas::ShotDocument::Camera::Projection::kEquirectangular;
  shot_.width = 60;
  shot_.camera.keys.resize(1);
  shot_.camera.keys[0].focal_length_mm.reset();
  EXPECT_THAT(refusal(), HasSubstr("motion"));
}

}  // namespace
}  // namespace raystage::compose
