// SPDX-License-Identifier: Apache-2.0
// Tests of the results of method depth: their cost, where they are stored, and their reuse.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "base/atomic_file.h"
#include "base/error.h"
#include "testing/render/test_depth.h"

namespace raystage::render {
namespace {

namespace fs = std::filesystem;

using testing::default_view;
using testing::mean_alpha;
using testing::SyntheticTake;

class DepthFound : public testing::DepthTest {};

TEST_F(DepthFound, SameBytesForAnyNumberOfThreadsAndAnyMemory) {
  const store::Take take = write(slanted(3, 3));
  std::vector<RenderedView> images;
  for (const std::size_t threads : {1, 2, 5}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    RendererOptions settings;
    if (threads == 5) settings.working_bytes = 2'000'000;  // camera by camera
    images.push_back(render(take, default_view(), {{"store_depths", false}}, settings));
  }
  EXPECT_EQ(images[0].rgba, images[1].rgba);
  EXPECT_EQ(images[0].rgba, images[2].rgba);
  EXPECT_EQ(images[0].z, images[2].z);
  EXPECT_TRUE(stored_depth_files().empty());
}

TEST_F(DepthFound, SaysHowMuchMemoryItTakesAndWhereThatIsMoreThanItsShare) {
  const store::Take take = write(slanted(3, 3));
  constexpr std::size_t kPixels = 90 * 64;
  const std::size_t solved = render(take, default_view()).statistics.working_bytes;
  const RenderedView kept = render(take, default_view());
  EXPECT_GT(solved, 9U * 8 * 96 * 72);  // minimum: images and second maps of all cameras
  EXPECT_GE(kept.statistics.working_bytes, 16 * kPixels);
  EXPECT_LT(kept.statistics.working_bytes, solved);
  const auto beyond = ::testing::Contains(
      ::testing::HasSubstr("a view of 90x64 needs more working memory than its budget of 0 MB"));
  EXPECT_THAT(kept.notes, ::testing::Not(beyond));
  RendererOptions little;
  little.working_bytes = kept.statistics.working_bytes - 1;
  const RenderedView in_bands = render(take, default_view(), {}, little);
  EXPECT_LE(in_bands.statistics.working_bytes, little.working_bytes);
  EXPECT_THAT(in_bands.notes, ::testing::Not(beyond));
  EXPECT_EQ(in_bands.rgba, kept.rgba);
  little.working_bytes = 0;
  const RenderedView least = render(take, default_view(), {}, little);
  EXPECT_EQ(least.rgba, kept.rgba);
  EXPECT_THAT(least.notes, beyond);
}

TEST_F(DepthFound, KeepsDepthsInTheTakeAndUsesThem) {
  const store::Take take = write(slanted(2, 3));
  const RenderedView first = render(take, default_view());
  ASSERT_EQ(stored_depth_files().size(), 1U);
  const fs::path file = stored_depth_files()[0];
  const auto written = fs::last_write_time(file);
  EXPECT_EQ(render(take, default_view()).rgba, first.rgba);
  EXPECT_EQ(fs::last_write_time(file), written);
  EXPECT_EQ(render(take, default_view(), {{"store_depths", false}}).rgba,
            first.rgba);  // cached or read: equal
  // Other settings have another file; a damaged file is replaced.
  render(take, default_view(), {{"far", 9.0}});
  EXPECT_EQ(stored_depth_files().size(), 2U);
  const std::string whole = read_file(file);
  write_file_atomically(file, std::string_view(whole).substr(0, whole.size() / 2));
  EXPECT_EQ(render(take, default_view()).rgba, first.rgba);
  EXPECT_EQ(read_file(file), whole);
}

TEST_F(DepthFound, RaysMeetWhatViewsWithTheSameOptionsShow) {
  SyntheticTake painted = slanted(2, 3);
  painted.frames = 3;
  const store::Take take = write(painted);
  const store::FrameSelection frames =
      store::select_frames(take, kNanosecondsPerSecond / 15, 30'000'000);
  const auto answered = [&](schemas::OptionValues options, std::shared_ptr<ResultCache> kept) {
    RendererOptions settings;
    settings.result_cache = std::move(kept);
    const WorldRay ahead{{0.02, 0.013, 0}, {0, 0, -1}};
    RaySample sample;
    LightFieldRenderer(take, settings)
        .query({&ahead, 1}, frames, {"depth", {0, 0, 0, 1}, std::move(options)}, {&sample, 1});
    return sample.depth;
  };
  for (const schemas::OptionValues::value_type& option :
       {schemas::OptionValues::value_type{"near", 2.0},
        {"far", 9.0},
        {"plane_px", 1.0},
        {"neighbours", 2.0},
        {"support_views", 3.0},
        {"temporal", true}}) {
    const schemas::OptionValues options{{"store_depths", false}, option};
    RendererOptions settings;
    settings.result_cache = std::make_shared<ResultCache>(std::size_t{1} << 28);
    EXPECT_NEAR(answered(options, settings.result_cache), 4, 0.1) << option.first;
    const std::size_t held = settings.result_cache->bytes_held();
    render(take, default_view(), options, settings, 1);
    EXPECT_EQ(settings.result_cache->bytes_held(), held) << option.first << " had no say";
  }
  EXPECT_TRUE(stored_depth_files().empty());
  answered({}, nullptr);
  ASSERT_EQ(stored_depth_files().size(), 1U);
  render(take, default_view(), {}, {}, 1);
  EXPECT_EQ(stored_depth_files().size(), 1U);
}

TEST_F(DepthFound, RaysOfAPlaneSweepEndBetweenItsDepths) {
  SyntheticTake painted = slanted(2, 3);
  painted.has_depth_range = false;
  const store::Take take = write(painted);
  RendererOptions settings;
  settings.use_take_folder = false;
  const LightFieldRenderer renderer(take, settings);
  const WorldRay ahead{{0.02, 0.013, 0}, {0, 0, -1}};
  RaySample sample;
  const auto ask = [&](schemas::OptionValues options) {
    renderer.query({&ahead, 1}, store::select_frames(take, 0, 1),
                   {"plane_sweep", {0, 0, 1, 1}, std::move(options)}, {&sample, 1});
  };
  ask({{"near", 2.5}, {"far", 7.0}});
  EXPECT_NEAR(sample.depth, 4, 0.1);
  ask({{"near", 5.0}, {"far", 7.0}});
  EXPECT_GE(sample.depth, 4.999F);
  EXPECT_THROW(ask({}), Error);
  EXPECT_TRUE(stored_depth_files().empty());
}

TEST_F(DepthFound, TheViewThatDepthsAreFoundForSaysWhatTheyTook) {
  SyntheticTake settings = slanted(2, 3);
  settings.frames = 3;
  const store::Take take = write(settings);
  constexpr std::int64_t kFrames = 6 * 96 * 72;  // pixels of an instant
  RendererOptions counting;
  counting.count_needed_pixels = true;
  const auto decoded = [&](const schemas::OptionValues& options, bool by_reference = false) {
    counting.reference = by_reference;
    const store::FrameSelection frames =
        store::select_frames(take, kNanosecondsPerSecond / 15, 30'000'000);
    const RenderStatistics found =
        LightFieldRenderer(take, counting)
            .render(default_view(), frames, {"depth", {0, 0, 0, 1}, options})
            .statistics;
    EXPECT_GE(found.pixels_decoded, found.pixels_needed);
    return found.pixels_decoded;
  };
  EXPECT_EQ(decoded({}), kFrames);
  EXPECT_LT(decoded({{"cameras", 2.0}}), kFrames);  // depths are there
  EXPECT_EQ(decoded({{"store_depths", false}}), kFrames);
  EXPECT_EQ(decoded({{"store_depths", false}}, true), kFrames);
  const auto timeline = store::build_timeline(take, 15, 0);
  counting.ticks = timeline.ticks;
  EXPECT_EQ(decoded({{"store_depths", false}, {"temporal", true}}), 3 * kFrames);
}

TEST_F(DepthFound, RendersATakeThatItMayNotWriteTo) {
  const store::Take take = write(slanted(2, 2));
  write_file_atomically(take_folder() / "depth", std::string_view("in the way"));
  const RenderedView image = render(take, default_view());
  EXPECT_GT(mean_alpha(image), 0.9);
  EXPECT_THAT(image.notes, ::testing::Contains(::testing::HasSubstr("depths cannot be stored")));
}

}  // namespace
}  // namespace raystage::render
