// SPDX-License-Identifier: Apache-2.0
// Tests of option `temporal` of method depth on a noisy take with motion and missing frames.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <set>

#include "base/large_buffer.h"
#include "render/depth/depth.h"
#include "render/depth/depth_file.h"
#include "render/depth/matching_image.h"
#include "render/depth/temporal_filter.h"
#include "render/depth/temporal_motion.h"
#include "render/renderer.h"
#include "testing/render/synthetic_take.h"

namespace raystage::render::temporal_take_test {
namespace {

namespace fs = std::filesystem;

constexpr int kCameras = 6, kTicks = 4, kWidth = 96, kHeight = 72;
constexpr int kDropping = 4, kDropped = 2;    ///< this camera has no frame at this tick
constexpr double kDepth = 4, kStillFrom = 0;  ///< nothing to the right of this x (metres) moves
constexpr Nanoseconds kInterval = kNanosecondsPerSecond / 15;

/// Returns a wall whose left part changes from frame to frame.
testing::SceneFunction wall(int frame) {
  return [frame](const Eigen::Vector3d& from, const Eigen::Vector3d& direction) {
    const Eigen::Vector3d hit = from - (from.z() + kDepth) / direction.z() * direction;
    const double moved = hit.x() < kStillFrom ? 1.7 * frame : 0.0;
    const auto coarse = testing::painted_plane(2 * hit.x() + moved, 2 * hit.y());
    const auto fine = testing::painted_plane(5 * hit.x() + 1 + moved, 5 * hit.y());
    return std::array<double, 3>{(coarse[0] + fine[1]) / 2, (coarse[1] + fine[2]) / 2,
                                 (coarse[2] + fine[0]) / 2};
  };
}

class TemporalTake : public ::testing::Test {
 protected:
  TemporalTake() {
    testing::SyntheticTake settings;
    settings.cameras = testing::camera_grid(2, 3, 0.1, kWidth, kHeight);
    schemas::TakeDocument document;
    schemas::RigDocument rig;
    document.name = rig.name = "noisy";
    document.created_by = "raystage test";
    document.nominal_fps = 15;
    document.color_space = "srgb_texture";
    document.depth_range = schemas::DepthRange{2.5, 7};
    for (const schemas::CameraGeometry& camera : settings.cameras) {
      document.cameras.push_back({camera.id, "", "", ""});
      rig.cameras.push_back({camera, {}});
    }
    store::TakeWriter writer(folder_.path() / "take", document, rig);
    std::mt19937 random(7);
    std::normal_distribution<double> noise(0, 1.2);  // codes
    for (int frame = 0; frame < kTicks; ++frame) {
      settings.scene = wall(frame);
      for (int camera = 0; camera < kCameras; ++camera) {
        if (camera == kDropping && frame == kDropped) continue;
        store::RgbImage image = render_camera_image(settings.cameras[camera], settings);
        for (std::size_t i = 0; i < image.values.size(); i += 3) {
          const double grey = noise(random);
          for (std::size_t c = i; c < i + 3; ++c) {
            image.values[c] =
                static_cast<std::uint8_t>(std::clamp(image.values[c] + grey, 0.0, 255.0));
          }
        }
        writer.archive(camera).append(store::encode_jpeg(image, {}), frame * kInterval);
      }
    }
    writer.commit();
    take_ = std::make_unique<store::Take>(folder_.path() / "take");
    timeline_ = store::build_timeline(*take_, 15, 0);
    cache_ = std::make_unique<store::FrameCache>(*take_, std::size_t{1} << 26,
                                                 store::BlendSpace::kPerceptual);
  }

  LightFieldFrame at(int tick) const {
    LightFieldFrame instant;
    instant.take = take_.get();
    instant.rig = &take_->rig();
    instant.cache = cache_.get();
    instant.frame_of_camera = timeline_.ticks[tick].frame;
    std::vector<int> present;
    for (int camera = 0; camera < kCameras; ++camera) {
      instant.included_cameras.push_back(camera);
      if (instant.is_present(camera)) present.push_back(camera);
    }
    instant.present = std::make_shared<rig::Topology>(rig::make_topology(take_->rig(), present));
    instant.complete =
        std::make_shared<rig::Topology>(rig::make_topology(take_->rig(), instant.included_cameras));
    return instant;
  }

  CameraDepths depths(const LightFieldFrame& instant, bool temporal) const {
    const MethodOptions options(depth_method().options(),
                                {{"temporal", temporal}, {"store_depths", false}}, "test");
    const VirtualCamera view = virtual_camera_with_fov(40, 30, 0.5, {});
    ResultCache kept(std::size_t{1} << 28);
    BufferPool buffers;
    const auto plan =
        depth::plan({view, instant, {0, 0, 0, 1}, options, kept, std::size_t{1} << 28, buffers});
    return *plan.value().depths;
  }

  RenderedView render(int tick, std::vector<int> excluded_cameras = {}) const {
    RendererOptions settings;
    settings.ticks = timeline_.ticks;
    settings.excluded_cameras = std::move(excluded_cameras);
    return LightFieldRenderer(*take_, settings)
        .render(virtual_camera_with_fov(40, 30, 0.5, {}), timeline_.ticks[tick],
                {"depth", {0, 0, 0, 1}, {{"temporal", true}}});
  }

  std::size_t stored_depth_files() const {
    std::size_t files = 0;
    for (const auto& entry : fs::recursive_directory_iterator(take_->folder() / "depth")) {
      files += entry.is_regular_file() ? 1 : 0;
    }
    return files;
  }

  testing::TestFolder folder_;
  std::unique_ptr<store::Take> take_;
  store::Timeline timeline_;
  std::unique_ptr<store::FrameCache> cache_;
};

TEST_F(TemporalTake, WhatStandsStillComesNearerToTheTruthAndWhatMovesDoesNotLeaveIt) {
  LightFieldFrame instant = at(1);
  const CameraDepths alone = depths(instant, true);  // without neighbours
  instant.adjacent_frames = {at(0).frame_of_camera, at(2).frame_of_camera};
  const CameraDepths steady = depths(instant, true);
  const CameraDepths unasked = depths(instant, false);
  double before = 0, after = 0, before_moving = 0, after_moving = 0;
  int still_pixels = 0, moving_pixels = 0;
  for (std::size_t i = 0; i < kCameras; ++i) {
    EXPECT_EQ(unasked.maps[i].values, alone.maps[i].values);
    const double x0 = take_->rig().cameras[i].pose.position.x();
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const float was = alone.maps[i].at(x, y), is = steady.maps[i].at(x, y);
        if (was < 0) continue;
        const schemas::Intrinsics& k = take_->rig().cameras[i].model.intrinsics();
        const double on_wall = x0 + kDepth * (x + 0.5 - k.cx) / k.fx;
        if (on_wall > kStillFrom + 0.3) {
          before += std::abs(static_cast<double>(was) - 1 / kDepth);
          after += std::abs(static_cast<double>(is) - 1 / kDepth);
          ++still_pixels;
        } else if (on_wall < kStillFrom - 0.3) {
          before_moving += std::abs(static_cast<double>(was) - 1 / kDepth);
          after_moving += std::abs(static_cast<double>(is) - 1 / kDepth);
          ++moving_pixels;
        }
      }
    }
  }
  ASSERT_GT(still_pixels, 10'000);
  ASSERT_GT(moving_pixels, 10'000);
  EXPECT_LT(after, 0.9 * before);
  EXPECT_LE(after_moving, before_moving);  // some is followed, from one stripe to the next
}

TEST_F(TemporalTake, AgreesWithInstantsFetchedOneByOne) {
  for (const int tick : {1, 2, 3}) {
    LightFieldFrame instant = at(tick);
    std::vector<LightFieldFrame> beside{at(tick - 1)};
    if (tick + 1 < kTicks) beside.push_back(at(tick + 1));
    for (const LightFieldFrame& other : beside)
      instant.adjacent_frames.push_back(other.frame_of_camera);
    const CameraDepths fast = depths(instant, true);

    DepthEstimationOptions settings;
    settings.scene = {2.5, 7};
    const auto solved = [&](const LightFieldFrame& of) {
      CameraDepths found = estimate_camera_depths(of, settings, std::size_t{1} << 28);
      for (InverseDepthMap& map : found.maps) quantise_depths(map);
      return found;
    };
    const CameraDepths now = solved(instant);
    std::vector<CameraDepths> then;
    for (const LightFieldFrame& other : beside) then.push_back(solved(other));
    int changed = 0;
    for (std::size_t i = 0; i < kCameras; ++i) {
      const auto picture = [&](const LightFieldFrame& of) {
        std::int64_t decoded = 0;
        const auto frame = cache_->fetch(static_cast<int>(i), of.frame_of_camera[i], {}, decoded);
        const VirtualCamera& pinhole = now.pinholes[i];
        const MatchingImage image(*frame, cache_->scale(), take_->rig().cameras[i], pinhole);
        return Luma(pinhole.width, pinhole.height, image.plane());
      };
      if (!instant.is_present(static_cast<int>(i))) {
        EXPECT_TRUE(fast.maps[i].values.empty());
        continue;
      }
      std::vector<PictureWithDepths> moved;
      std::vector<TemporalNeighbour> others;
      moved.reserve(2);
      store::OpticalFlowEstimator flow;
      for (std::size_t j = 0; j < beside.size(); ++j) {
        if (!beside[j].is_present(static_cast<int>(i))) continue;
        moved.push_back(
            moved_along_flow(picture(instant), {picture(beside[j]), then[j].maps[i]}, flow));
        others.push_back({&moved.back().luma, &moved.back().depths});
      }
      const InverseDepthMap expected = temporal_filter_reference(
          now.maps[i], picture(instant), others,
          static_cast<float>(settings.tolerance_px * now.inverse_depth_per_pixel));
      for (std::size_t p = 0; p < expected.values.size(); ++p) {
        ASSERT_NEAR(fast.maps[i].values[p], expected.values[p], 1e-5) << "tick " << tick;
        changed += fast.maps[i].values[p] == now.maps[i].values[p] ? 0 : 1;
      }
    }
    EXPECT_GT(changed, 5000) << "tick " << tick;
  }
}

TEST_F(TemporalTake, TheInstantsBesideAreTheTicks) {
  ASSERT_EQ(timeline_.ticks.size(), static_cast<std::size_t>(kTicks));
  ASSERT_EQ(timeline_.ticks[kDropped].frame[kDropping], -1);
  ASSERT_EQ(timeline_.ticks[3].frame[kDropping], 2);  // the archive's frame number
  render(1);
  EXPECT_EQ(stored_depth_files(), 3U);
  for (int tick = 0; tick < kTicks; ++tick) render(tick);
  EXPECT_EQ(stored_depth_files(), static_cast<std::size_t>(kTicks));
  render(2, {0});  // a camera is excluded from the neighbours too
  EXPECT_EQ(stored_depth_files(), kTicks + 3U);
}

TEST_F(TemporalTake, WithoutATimelineThereIsNothingBeside) {
  const LightFieldRenderer renderer(*take_, {});
  renderer.render(virtual_camera_with_fov(40, 30, 0.5, {}), timeline_.ticks[1],
                  {"depth", {0, 0, 0, 1}, {{"temporal", true}}});
  EXPECT_EQ(stored_depth_files(), 1U);
}

}  // namespace
}  // namespace raystage::render::temporal_take_test
