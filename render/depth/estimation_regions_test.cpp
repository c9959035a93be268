// SPDX-License-Identifier: Apache-2.0
// Which parts of the cameras a view needs, and that nothing else is missed.
#include "render/depth/estimation_regions.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "render/common/blending_field.h"
#include "render/common/image_quality.h"
#include "render/depth/inverse_depth_map.h"
#include "testing/render/test_depth.h"
#include "testing/render/test_poses.h"

namespace raystage::render::estimation_regions_test {
namespace {

using testing::make_pose;

constexpr schemas::DepthRange kScene{2, 6};

/// A frame of 5 x 5 cameras, 10 cm apart.
class Regions : public testing::DepthTest {
 protected:
  Regions() : take_(write(slanted(5, 5, {}))) {
    instant_.take = &take_;
    instant_.rig = &take_.rig();
    instant_.frame_of_camera.assign(25, 0);
  }
  EstimationRegions of(const std::vector<VirtualCamera>& views, int cameras = 6) {
    instant_.shown_views = views;
    return needed_regions(instant_, kScene, cameras);
  }
  double share_of(const EstimationRegions& regions) const {
    double sum = 0, all = 0;
    for (std::size_t i = 0; i < regions.size(); ++i) {
      const rig::CameraModel& model = take_.rig().cameras[i].model;
      all += model.width() * model.height();
      sum += (regions[i].right - regions[i].left) * (regions[i].bottom - regions[i].top);
    }
    return sum / all;
  }

  const store::Take take_;
  LightFieldFrame instant_;
};

TEST_F(Regions, AreThoseOfTheCamerasNearTheView) {
  const VirtualCamera narrow = virtual_camera_with_fov(70, 50, 0.3, make_pose({-0.15, 0.15, 0}, 0));
  const EstimationRegions regions = of({narrow});
  ASSERT_EQ(regions.size(), 25U);
  EXPECT_LT(share_of(regions), 0.2);
  EXPECT_GT(share_of(regions), 0);
  const EstimationRegions both =
      of({narrow, virtual_camera_with_fov(70, 50, 0.3, make_pose({0.15, 0.15, 0}, 0))});
  for (std::size_t i = 0; i < regions.size(); ++i) {
    if (regions[i].is_empty()) continue;
    EXPECT_LE(both[i].left, regions[i].left);
    EXPECT_GE(both[i].right, regions[i].right);
  }
}

TEST_F(Regions, AreAllWhereViewsAreUnknownOrNeedMostOfThem) {
  EXPECT_TRUE(of({}).empty());
  EXPECT_TRUE(of({virtual_camera_with_fov(70, 50, 1.2, make_pose({0, 0, 1.5}, 0))}, 25).empty());
  EXPECT_TRUE(of({equirectangular_camera(64, 32, make_pose({0, 0, 0}, 0))}).empty());
  EXPECT_TRUE(of({virtual_camera_with_fov(70, 50, 0.3, make_pose({0, 0, 0}, 180))}).empty())
      << "the view shows nothing";
}

// Drafts find the depths of the final frames, and samples those of their frame.
TEST_F(Regions, DoNotDependOnTheResolutionOfTheView) {
  for (const double x : {-0.2, -0.03, 0.11}) {
    const auto view = [&](int scale) {
      return virtual_camera_with_fov(72 * scale, 48 * scale, 0.4, make_pose({x, 0.05, 0.1}, 5));
    };
    EXPECT_EQ(of({view(1)}), of({view(4)}));
    EXPECT_EQ(of({view(1)}), of({view(30)}));
  }
}

// Every point of the scene that a tile of any resolution reads with weight lies in the region of
// its camera.
TEST_F(Regions, ContainWhatViewsRead) {
  std::size_t read = 0, outside = 0;
  for (int i = 0; i < 40; ++i) {
    const double x = 0.3 * std::sin(1.7 * i), y = 0.3 * std::cos(2.3 * i), z = 0.4 * std::sin(i);
    const VirtualCamera view = virtual_camera_with_fov(
        300, 200, 0.3 + 0.02 * (i % 20), make_pose({x, y, z}, 20 * std::sin(0.7 * i)));
    constexpr int kCameras = 8;
    const EstimationRegions regions = of({view}, kCameras);
    const InverseDepthRange range = inverse_depth_range_in_view(view, take_.rig(), kScene);
    const BlendingField field(view, take_.rig(), instant_.present_cameras(), range, kCameras);
    for (const BlendingField::Tile& tile : field.tiles()) {
      for (const BlendingField::TileCamera& chosen : tile.cameras) {
        const auto camera = static_cast<std::size_t>(chosen.camera);
        if (*std::ranges::max_element(chosen.share) < 0.6F / kCameras) continue;
        const VirtualCamera pinhole =
            undistorted(take_.rig().cameras[camera].model, take_.rig().cameras[camera].pose);
        const PixelTransfer to = pixel_transfer(pinhole, view);
        const double px = (tile.left + tile.right) / 2.0, py = (tile.top + tile.bottom) / 2.0;
        for (const double part : {0.0, 0.3, 0.6, 1.0}) {
          const double q = range.farthest + part * (range.nearest - range.farthest);
          const auto row = [&](std::size_t r) {
            const double* m = to.direction.data() + 3 * r;
            return m[0] * px + m[1] * py + m[2] + q * to.parallax[r];
          };
          const double u = row(0) / row(2), v = row(1) / row(2);
          const bool is_seen =
              row(2) > 0 && u >= 0 && v >= 0 && u < pinhole.width && v < pinhole.height;
          if (!is_seen) continue;
          ++read;
          if (regions.empty()) continue;
          const PixelRectangle& region = regions[camera];
          outside += u < region.left || u > region.right || v < region.top || v > region.bottom;
        }
      }
    }
  }
  EXPECT_GT(read, 10'000U);

  // The tiles here are finer than those by which the parts are found.
  EXPECT_LT(outside, read / 100);
}

TEST_F(Regions, ShowWhatAllDepthsShow) {
  for (const VirtualCamera& view :
       {virtual_camera_with_fov(70, 50, 0.4, make_pose({0.03, 0.02, 0.1}, 4)),
        virtual_camera_with_fov(90, 50, 0.5, make_pose({-0.16, 0.1, -0.3}, -6))}) {
    const schemas::OptionValues options{{"cameras", 6.0}, {"store_depths", false}};
    RendererOptions slow;
    slow.reference = true;
    const RenderedView all = render(take_, view, options);
    const RenderedView shown = render_shown(take_, view, options);
    const std::vector<std::uint8_t> everywhere(all.coverage.size(), 1);
    const double psnr = compare_images(srgb_image(shown), srgb_image(all), everywhere).psnr_db;
    EXPECT_GT(psnr, 45);
    EXPECT_NEAR(testing::mean_alpha(shown), testing::mean_alpha(all), 1e-6);
    testing::expect_equal(shown, render_shown(take_, view, options, slow));
  }
}

// With something in front, measures of coverage, and weights that end at the parts' borders.
TEST_F(Regions, ShowWhatIsHiddenAndCountCamerasAsTheReference) {
  const std::filesystem::path folder = folder_.path() / "steps";
  testing::SyntheticTake steps = step_edge(5, 5);
  write_synthetic_take(steps, folder);
  const store::Take take(folder);
  RendererOptions measuring, slow;
  measuring.measure_coverage = slow.measure_coverage = slow.reference = true;
  for (const double cameras : {1.0, 6.0, 16.0}) {
    const VirtualCamera view = virtual_camera_with_fov(70, 50, 0.4, make_pose({0.1, 0.02, 0.1}, 4));
    const schemas::OptionValues options{{"cameras", cameras}, {"store_depths", false}};
    const RenderedView fast = render_shown(take, view, options, measuring);
    const RenderedView expected = render_shown(take, view, options, slow);
    testing::expect_equal(fast, expected);
    for (std::size_t i = 0; i < fast.cameras.size(); ++i) {
      ASSERT_NEAR(fast.cameras[i], expected.cameras[i], 0.02F * expected.cameras[i] + 1e-3F);
    }
    const RenderedView all = render(take, view, options, measuring);
    const std::vector<std::uint8_t> everywhere(all.coverage.size(), 1);
    EXPECT_GT(compare_images(srgb_image(fast), srgb_image(all), everywhere).psnr_db, 38)
        << cameras << " cameras";
  }
}

}  // namespace
}  // namespace raystage::render::estimation_regions_test
