// SPDX-License-Identifier: Apache-2.0
#include "store/processing/frames/frame_cache.h"

#include <gtest/gtest.h>

#include <atomic>
#include <optional>
#include <thread>
#include <vector>

#include "store/jpeg/encode.h"
#include "store/take.h"
#include "testing/test_folder.h"

namespace raystage::store {
namespace {

constexpr int kCameras = 2, kFrames = 6, kWidth = 128, kHeight = 64;
constexpr std::size_t kFrameBytes = (kWidth * (kHeight + 1) + 1) * 8;
constexpr std::int64_t kFramePixels = kWidth * kHeight;

class Cache : public ::testing::Test {
 protected:
  void SetUp() override {
    schemas::TakeDocument take;
    take.name = "greys";
    take.created_by = "test";
    take.nominal_fps = 10;
    take.color_space = "srgb_texture";
    schemas::RigDocument rig;
    rig.name = "two";
    for (int i = 0; i < kCameras; ++i) {
      schemas::RigDocument::Camera camera;
      camera.geometry.id = "c" + std::to_string(i);
      camera.geometry.width = kWidth;
      camera.geometry.height = kHeight;
      camera.geometry.intrinsics = {60, 60, kWidth / 2.0, kHeight / 2.0, {}};
      camera.geometry.world_from_camera[3] = 0.1 * i;
      rig.cameras.push_back(camera);
      take.cameras.push_back({camera.geometry.id, "", "", ""});
    }
    TakeWriter writer(folder_.path() / "take", take, rig);
    for (int camera = 0; camera < kCameras; ++camera) {
      for (int frame = 0; frame < kFrames; ++frame) {
        RgbImage image{kWidth, kHeight, std::vector<std::uint8_t>()};
        image.values.assign(static_cast<std::size_t>(kFramePixels) * 3,
                            static_cast<std::uint8_t>(20 + 30 * frame + camera));
        writer.archive(camera).append(encode_jpeg(image, {}), frame * 100'000'000LL);
      }
    }
    writer.commit();
    take_.emplace(folder_.path() / "take");
  }

  /// Returns the pixels decoded to fetch a frame: all of it or only the first MCU.
  std::int64_t decoded(FrameCache& cache, int camera, int frame, bool whole = true) {
    if (!whole) return decoded_of(cache, camera, frame, {0}, FrameCache::kUngrouped);
    std::int64_t pixels = 0;
    cache.fetch(camera, frame, {}, pixels);
    return pixels;
  }
  /// Returns the pixels decoded to fetch some MCUs of a frame.
  static std::int64_t decoded_of(FrameCache& cache, int camera, int frame,
                                 const std::vector<std::size_t>& mcus,
                                 FrameCache::FetchGroup look) {
    McuMask wanted(static_cast<std::size_t>(cache.layout(camera, frame)->mcu_count()), 0);
    for (const std::size_t mcu : mcus) wanted[mcu] = 1;
    std::int64_t pixels = 0;
    cache.fetch(camera, frame, wanted, pixels, look);
    return pixels;
  }

  testing::TestFolder folder_;
  std::optional<Take> take_;
};

TEST_F(Cache, ForgetsWhatWasUsedLeastRecentlyAndKeepsToItsBytes) {
  // An eighth of the budget is for the memory of evicted frames.
  FrameCache cache(*take_, 4 * kFrameBytes, BlendSpace::kPerceptual);
  for (int frame = 0; frame < 3; ++frame) EXPECT_EQ(decoded(cache, 0, frame), kFramePixels);
  EXPECT_EQ(cache.bytes_held(), 3 * kFrameBytes);
  EXPECT_EQ(decoded(cache, 0, 0), 0);  // now frame 1 is the least recently used
  EXPECT_EQ(decoded(cache, 0, 3), kFramePixels);
  EXPECT_EQ(cache.bytes_held(), 3 * kFrameBytes);
  EXPECT_EQ(decoded(cache, 0, 0), 0);
  EXPECT_EQ(decoded(cache, 0, 2), 0);
  EXPECT_EQ(decoded(cache, 0, 1), kFramePixels);
}

TEST_F(Cache, AFrameInUseOutlivesItsPlace) {
  FrameCache cache(*take_, 1, BlendSpace::kPerceptual);
  std::int64_t pixels = 0;
  const auto first = cache.fetch(0, 0, {}, pixels);
  const std::uint16_t before = first->rgba[0];
  for (int frame = 1; frame < kFrames; ++frame) decoded(cache, 0, frame);
  EXPECT_EQ(first->rgba[0], before);
  EXPECT_LE(cache.bytes_held(), kFrameBytes);  // only the last
}

TEST_F(Cache, DecodesAPartAndAtTheSecondLookAll) {
  FrameCache cache(*take_, 16 * kFrameBytes, BlendSpace::kPerceptual);
  const std::int64_t part = decoded(cache, 1, 2, false);
  EXPECT_GT(part, 0);
  EXPECT_LT(part, kFramePixels / 4);
  EXPECT_EQ(decoded(cache, 1, 2, false), 0);
  EXPECT_FALSE(cache.is_fully_decoded(1, 2));
  EXPECT_EQ(decoded(cache, 1, 2), kFramePixels);
  EXPECT_TRUE(cache.is_fully_decoded(1, 2));
  EXPECT_EQ(cache.bytes_held(), kFrameBytes);
}

TEST_F(Cache, PartsOfOneLookAddUp) {
  FrameCache cache(*take_, 16 * kFrameBytes, BlendSpace::kPerceptual);
  const FrameCache::FetchGroup look = cache.new_fetch_group(), other = cache.new_fetch_group();
  constexpr std::int64_t kMcu = 64;
  EXPECT_EQ(decoded_of(cache, 0, 1, {0}, look), kMcu);
  EXPECT_EQ(decoded_of(cache, 0, 1, {0, 20}, look), kMcu);
  EXPECT_EQ(decoded_of(cache, 0, 1, {0, 20}, look), 0);
  EXPECT_EQ(decoded_of(cache, 0, 1, {0}, other), 0);
  EXPECT_EQ(decoded_of(cache, 0, 1, {40}, look), kMcu);
  EXPECT_FALSE(cache.is_fully_decoded(0, 1));
  EXPECT_EQ(cache.bytes_held(), kFrameBytes);
  EXPECT_EQ(decoded_of(cache, 0, 1, {60}, other), kFramePixels);  // second request
  EXPECT_TRUE(cache.is_fully_decoded(0, 1));
  EXPECT_EQ(decoded_of(cache, 0, 1, {80}, look), 0);
}

TEST_F(Cache, DecodesAFrameOnceHoweverManyAsk) {
  FrameCache cache(*take_, 16 * kFrameBytes, BlendSpace::kPerceptual);
  std::atomic<std::int64_t> pixels = 0;
  std::vector<std::jthread> threads;
  for (int i = 0; i < 8; ++i) {
    threads.emplace_back([&] {
      for (int frame = 0; frame < kFrames; ++frame) pixels += decoded(cache, 0, frame);
    });
  }
  threads.clear();
  EXPECT_EQ(pixels, kFrames * kFramePixels);
}

TEST_F(Cache, ReadsAheadFramesOfCamerasInUseThatItDoesNotHold) {
  FrameCache cache(*take_, 16 * kFrameBytes, BlendSpace::kPerceptual);
  cache.read_ahead(0, 0);  // no camera is in use yet
  cache.read_ahead(0, 2);
  cache.read_ahead(1, 0);
  EXPECT_EQ(cache.frames_read_ahead(), 0);
  decoded(cache, 0, 0);
  EXPECT_EQ(cache.frames_read_ahead(), 1);  // the pending ones except this frame
  cache.read_ahead(0, 0);                   // in the cache
  cache.read_ahead(1, 1);                   // a camera that is not in use
  EXPECT_EQ(cache.frames_read_ahead(), 1);
  cache.read_ahead(0, 1);
  EXPECT_EQ(cache.frames_read_ahead(), 2);
  decoded(cache, 1, 5);
  EXPECT_EQ(cache.frames_read_ahead(), 4);
}

TEST_F(Cache, ReadsAFrameAheadOnceUntilItIsForgotten) {
  FrameCache cache(*take_, 2 * kFrameBytes, BlendSpace::kPerceptual);  // holds one frame
  decoded(cache, 0, 0);
  for (int times = 0; times < 3; ++times) cache.read_ahead(0, 1);
  EXPECT_EQ(cache.frames_read_ahead(), 1);
  decoded(cache, 0, 1);
  cache.read_ahead(0, 1);
  EXPECT_EQ(cache.frames_read_ahead(), 1);
  decoded(cache, 0, 2);
  cache.read_ahead(0, 1);
  EXPECT_EQ(cache.frames_read_ahead(), 2);
}

}  // namespace
}  // namespace raystage::store
