// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <map>

#include "compose/shot_plan.h"
#include "render/methods.h"
#include "store/timeline.h"
#include "testing/render/synthetic_take.h"
#include "testing/render/test_matte.h"

namespace raystage::compose {
namespace {

constexpr int kWidth = 96, kHeight = 64;

/// Returns the colour of a checkerboard, 1 m wide, 2.5 m away, in front of the painted plane.
std::array<double, 3> board_before_plane(const Eigen::Vector3d& eye, const Eigen::Vector3d& ray) {
  const Eigen::Vector3d near = eye - ray * ((2.5 + eye.z()) / ray.z());
  if (std::abs(near.x()) < 0.5 && std::abs(near.y()) < 0.4) {
    const bool dark = (std::lround(near.x() * 12) + std::lround(near.y() * 12)) % 2 == 0;
    return {dark ? 0.1 : 0.7, 0.4 + 0.3 * std::sin(9 * near.x()), dark ? 0.5 : 0.2};
  }
  const Eigen::Vector3d far = eye - ray * ((4 + eye.z()) / ray.z());
  return testing::painted_plane(far.x(), far.y());
}

/// Statistics of a picture that change if more than a few codes change. All channels are treated
/// alike, so that one is enough.
struct Signature {
  double red = 0, across = 0, down = 0, alpha = 0, coverage = 0, nearness = 0;
};

Signature signature_of(const render::RenderedView& view) {
  Signature sum;
  const double pixels = kWidth * kHeight;
  const auto at = [&](int x, int y) { return static_cast<std::size_t>(y * kWidth + x); };
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const double red = static_cast<double>(view.rgba[4 * at(x, y)]);
      const auto step = [&](int dx, int dy) {
        return std::abs(red - static_cast<double>(view.rgba[4 * at(x - dx, y - dy)]));
      };
      sum.red += red / pixels;
      if (x > 0) sum.across += step(1, 0) / pixels;
      if (y > 0) sum.down += step(0, 1) / pixels;
      sum.alpha += static_cast<double>(view.rgba[4 * at(x, y) + 3]) / pixels;
      sum.coverage += static_cast<double>(view.coverage[at(x, y)]) / pixels;
      sum.nearness += 1 / static_cast<double>(view.z[at(x, y)]) / pixels;
    }
  }
  return sum;
}

std::string text_of(const Signature& s) {
  return fmt::format("{{{:.5f}, {:.5f}, {:.5f}, {:.5f}, {:.5f}, {:.5f}}}", s.red, s.across, s.down,
                     s.alpha, s.coverage, s.nearness);
}

// `--existing skip` keeps frames whose fingerprint is this run's. Where pixels change on purpose,
// raise kReconstructionVersion and write the new figures here.
TEST(ReconstructionVersion, FourteenHasThesePixels) {
  static_assert(kReconstructionVersion == 14);
  const std::map<std::string, Signature> known{
      {"focal_plane", {0.39299, 0.05084, 0.04782, 1.00000, 1.00000, 0.33883}},
      {"nearest", {0.39383, 0.05239, 0.04965, 1.00000, 1.00000, 0.33883}},
      {"aperture", {0.39205, 0.04959, 0.04661, 1.00000, 1.00000, 0.33883}},
      {"lumigraph", {0.39301, 0.05086, 0.04818, 1.00000, 1.00000, 0.33883}},
      {"slabs", {0.39295, 0.05063, 0.04787, 1.00000, 1.00000, 0.33883}},
      {"plane_sweep", {0.39925, 0.06425, 0.06189, 1.00000, 1.00000, 0.30190}},
      {"depth", {0.39960, 0.06425, 0.06188, 1.00000, 1.00000, 0.30526}},
      {"visual_hull", {0.18407, 0.03569, 0.03864, 0.48014, 0.48014, 0.49310}},
      {"auto", {0.39312, 0.05114, 0.04823, 1.00000, 1.00000, 0.35608}},
  };
  const testing::TestFolder folder;
  testing::SyntheticTake settings;
  settings.cameras = testing::camera_grid(4, 4, 0.06, kWidth, kHeight);
  settings.scene = board_before_plane;
  settings.samples = 2;
  settings.depth_range = schemas::DepthRange{2, 5};
  write_synthetic_take(settings, folder.path() / "take");
  for (const schemas::CameraGeometry& camera : settings.cameras) {
    std::vector<std::uint8_t> codes(static_cast<std::size_t>(kWidth) * kHeight, 0);
    for (int y = 16; y < 48; ++y) {
      std::fill_n(codes.begin() + y * kWidth + 24, 48, std::uint8_t{255});
    }
    testing::write_matte(folder.path() / "take", camera.id, 0, kWidth, kHeight, codes);
  }
  const store::Take take(folder.path() / "take");
  rig::Pose pose;
  pose.position = {0.013, -0.021, -0.05};
  pose.world_from_camera_rotation =
      Eigen::AngleAxisd(0.05, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  const render::VirtualCamera view = render::virtual_camera_with_fov(kWidth, kHeight, 0.8, pose);
  const render::LightFieldRenderer renderer(take, {});
  for (const render::Method* method : render::methods()) {
    const std::string name(method->name());
    const Signature found = signature_of(renderer.render(
        view, store::select_frames(take, 0, kNanosecondsPerSecond),
        {.method = name, .focal_plane = rig::fronto_parallel_plane(take.rig(), 3), .options = {}}));
    const auto entry = known.find(name);
    // The last digits depend on the processor.
    constexpr double kSame = 5e-5;
    const Signature s = entry == known.end() ? Signature{} : entry->second;
    EXPECT_TRUE(std::abs(found.red - s.red) < kSame && std::abs(found.across - s.across) < kSame &&
                std::abs(found.down - s.down) < kSame && std::abs(found.alpha - s.alpha) < kSame &&
                std::abs(found.coverage - s.coverage) < kSame &&
                std::abs(found.nearness - s.nearness) < kSame)
        << fmt::format("{{\"{}\", {}}},", name, text_of(found));
  }
}

}  // namespace
}  // namespace raystage::compose
