// SPDX-License-Identifier: Apache-2.0
#include "store/processing/frames/interpolated_frames.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <stdexcept>

#include "store/jpeg/encode.h"
#include "store/processing/frames/frame_cache.h"
#include "store/processing/motion/frame_interpolation.h"
#include "store/take.h"
#include "testing/store/test_scene.h"
#include "testing/test_folder.h"

namespace raystage::store {
namespace {

using testing::MovingBoard;

TEST(InterpolatedFrames, NumbersAreOfTheSources) {
  InterpolatedFrames frames;
  const InterpolatedFrames::Sources a{3, 4, 0.25}, b{3, 4, 0.5};
  const int of_a = frames.number_of(a), of_b = frames.number_of(b);
  EXPECT_NE(of_a, of_b);
  EXPECT_EQ(frames.number_of(a), of_a);
  EXPECT_EQ(frames.sources_of(of_b), b);
  EXPECT_TRUE(InterpolatedFrames::is_interpolated(of_a));
  EXPECT_FALSE(InterpolatedFrames::is_interpolated(1'000'000));
  EXPECT_FALSE(InterpolatedFrames::is_interpolated(-1));
}

TEST(InterpolatedFrames, ForgetsThoseUsedLeastRecently) {
  InterpolatedFrames frames;
  const int oldest = frames.number_of({0, 1, 0.5}), old = frames.number_of({1, 2, 0.5});
  for (int i = 2; i < static_cast<int>(InterpolatedFrames::kMaxFrames); ++i) {
    frames.number_of({i, i + 1, 0.5});
  }
  EXPECT_EQ(frames.number_of({0, 1, 0.5}), oldest);  // used again
  frames.number_of({-1, 0, 0.5});
  EXPECT_EQ(frames.sources_of(oldest).second, 1);
  EXPECT_THROW(frames.sources_of(old), std::logic_error);
}

class InterpolatedCache : public ::testing::Test {
 protected:
  void SetUp() override {
    schemas::TakeDocument take;
    take.name = "board";
    take.created_by = "test";
    take.nominal_fps = 10;
    take.color_space = "srgb_texture";
    schemas::RigDocument rig;
    rig.name = "one";
    schemas::RigDocument::Camera camera;
    camera.geometry.id = "c";
    camera.geometry.width = board_.width;
    camera.geometry.height = board_.height;
    camera.geometry.intrinsics = {100, 100, board_.width / 2.0, board_.height / 2.0, {}};
    rig.cameras.push_back(camera);
    take.cameras.push_back({"c", "", "", ""});
    TakeWriter writer(folder_.path() / "take", take, rig);
    JpegEncodeOptions fine;
    fine.quality = 98;
    for (int frame = 0; frame < 3; ++frame) {
      writer.archive(0).append(encode_jpeg(board_.at(frame), fine), frame * 100'000'000LL);
    }
    writer.commit();
    take_ = std::make_unique<Take>(folder_.path() / "take");
  }

  /// Returns the PSNR of a frame of a cache against the board at a time.
  double psnr_at(FrameCache& cache, int frame, double time) const {
    std::int64_t pixels = 0;
    const auto decoded = cache.fetch(0, frame, {}, pixels);
    RgbImage codes(decoded->width, decoded->height);
    for (std::size_t i = 0; i < codes.values.size(); ++i) {
      codes.values[i] = static_cast<std::uint8_t>(
          std::lround(decoded->rgba[i / 3 * 4 + i % 3] / 65535.0 * cache.full_scale() * 255));
    }
    return testing::psnr(codes, board_.at(time));
  }

  testing::TestFolder folder_;
  MovingBoard board_;
  std::unique_ptr<Take> take_;
};

TEST_F(InterpolatedCache, ShowsTheTimeBetween) {
  const auto frames = std::make_shared<InterpolatedFrames>();
  FrameCache cache(*take_, 1 << 26, BlendSpace::kPerceptual, nullptr, frames);
  for (const double part : {0.25, 0.5, 0.75}) {
    const int between = frames->number_of({0, 1, part});
    EXPECT_EQ(cache.sources_of(between)->second, 1);
    EXPECT_FALSE(cache.layout(0, between)->regions_decodable());
    EXPECT_GT(psnr_at(cache, between, part), 30) << part;
    EXPECT_GT(psnr_at(cache, between, part), 4 + psnr_at(cache, part < 0.5 ? 0 : 1, part)) << part;
    EXPECT_TRUE(cache.is_fully_decoded(0, between));
  }
}

// As the slow way does it: decoded pictures, interpolated in 8 bits.
TEST_F(InterpolatedCache, IsTheInterpolationOfTheDecodedFrames) {
  const auto frames = std::make_shared<InterpolatedFrames>();
  FrameCache cache(*take_, 1 << 26, BlendSpace::kPerceptual, nullptr, frames);
  std::int64_t pixels = 0;
  const auto between = cache.fetch(0, frames->number_of({1, 2, 0.4}), {}, pixels);
  JpegDecoder decoder;
  const FlowImage a = make_flow_image(decoder.decode(take_->archive(0).jpeg(1), "1")),
                  b = make_flow_image(decoder.decode(take_->archive(0).jpeg(2), "2"));
  OpticalFlowEstimator estimator;
  const RgbImage slow = interpolate_frame(a, b, estimator.estimate(a.luma, b.luma),
                                          estimator.estimate(b.luma, a.luma), {0.4, 0});
  double squares = 0;
  for (std::size_t i = 0; i < slow.values.size(); ++i) {
    const double code = between->rgba[i / 3 * 4 + i % 3] / 65535.0 * 255;
    squares += (code - slow.values[i]) * (code - slow.values[i]);
  }
  EXPECT_LT(std::sqrt(squares / static_cast<double>(slow.values.size())), 0.6);
}

TEST_F(InterpolatedCache, RowsOfARollingShutterAreThoseOfTheSlowWay) {
  const auto frames = std::make_shared<InterpolatedFrames>();
  FrameCache cache(*take_, 1 << 26, BlendSpace::kPerceptual, nullptr, frames);
  const InterpolatedFrames::Sources sources{1, 2, 0.0, 0.8 / board_.height};
  EXPECT_NE(frames->number_of(sources), frames->number_of({1, 2, 0.0, 0}));
  std::int64_t pixels = 0;
  const auto between = cache.fetch(0, frames->number_of(sources), {}, pixels);
  JpegDecoder decoder;
  const FlowImage a = make_flow_image(decoder.decode(take_->archive(0).jpeg(1), "1")),
                  b = make_flow_image(decoder.decode(take_->archive(0).jpeg(2), "2"));
  OpticalFlowEstimator estimator;
  const RgbImage slow =
      interpolate_frame(a, b, estimator.estimate(a.luma, b.luma),
                        estimator.estimate(b.luma, a.luma), {0.0, sources.line_part});
  double squares = 0;
  for (std::size_t i = 0; i < slow.values.size(); ++i) {
    const double code = between->rgba[i / 3 * 4 + i % 3] / 65535.0 * 255;
    squares += (code - slow.values[i]) * (code - slow.values[i]);
  }
  EXPECT_LT(std::sqrt(squares / static_cast<double>(slow.values.size())), 0.6);
}

TEST_F(InterpolatedCache, KeepsToItsBudget) {
  const auto frames = std::make_shared<InterpolatedFrames>();
  const auto bytes = static_cast<std::size_t>(board_.width) * (board_.height + 1) * 8 + 8;
  FrameCache cache(*take_, 3 * bytes, BlendSpace::kPerceptual, nullptr, frames);
  for (int i = 1; i < 9; ++i) {
    std::int64_t pixels = 0;
    cache.fetch(0, frames->number_of({0, 1, 0.1 * i}), {}, pixels);
    EXPECT_LE(cache.bytes_held(), 3 * bytes);
  }
}

}  // namespace
}  // namespace raystage::store
