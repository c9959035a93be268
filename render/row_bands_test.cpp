// SPDX-License-Identifier: Apache-2.0
// Tests of views with less resolution than the light field whose samples are rendered in bands of
// rows.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <numbers>

#include "base/atomic_file.h"
#include "base/large_buffer.h"
#include "render/common/footprint.h"
#include "render/common/memory_overrun_note.h"
#include "render/methods.h"
#include "render/renderer.h"
#include "testing/render/synthetic_take.h"
#include "testing/render/test_matte.h"

namespace raystage::render::row_bands_test {
namespace {

constexpr int kWidth = 20, kHeight = 15, kFactor = 6;
/// Rows of a band: as many as fit, and as many in whole tiles of 16 samples.
constexpr int kRowsThatFit = 11, kRows = 8;
constexpr std::size_t kBytesOfSample = 24;  // RGBA, coverage, depth
const Eigen::Vector4d kPlane(0, 0, 1, 4);

/// Cameras of 160x120, each with a matte of their middle.
class Bands : public ::testing::Test {
 protected:
  Bands() {
    testing::SyntheticTake settings;
    settings.cameras = testing::camera_grid(3, 3, 0.06, 160, 120);
    settings.jpeg.quality = 98;
    write_synthetic_take(settings, folder_.path() / "take");
    std::vector<std::uint8_t> codes(std::size_t{160} * 120, 0);
    for (int y = 30; y < 90; ++y) std::fill_n(codes.begin() + y * 160 + 40, 80, std::uint8_t{255});
    for (const schemas::CameraGeometry& camera : settings.cameras) {
      testing::write_matte(folder_.path() / "take", camera.id, 0, 160, 120, codes);
    }
    write_file_atomically(folder_.path() / "take" / "wall.obj",
                          "v -9 -9 -4\nv 9 -9 -4\nv 9 9 -4\nv -9 9 -4\nf 1 2 3 4\n");
    take_.emplace(folder_.path() / "take");
    in_bands_.measure_coverage = true;
    in_bands_.supersampling_bytes = kBytesOfSample * kFactor * kFactor * kWidth * kRowsThatFit;
  }

  /// Returns a view behind the array, whose rows pass between different cameras.
  static VirtualCamera view() {
    rig::Pose pose;
    pose.position = {0.013, 0.01, 0.1};
    return virtual_camera_with_fov(kWidth, kHeight, 50 * std::numbers::pi / 180, pose);
  }
  store::FrameSelection frames() const { return store::select_frames(*take_, 0, 1); }
  RenderedView render(const RendererOptions& settings, const ReconstructionOptions& how) const {
    return LightFieldRenderer(*take_, settings).render(view(), frames(), how);
  }

  testing::TestFolder folder_;
  std::optional<store::Take> take_;
  RendererOptions in_bands_;
};

ReconstructionOptions by(const std::string& method, const schemas::OptionValues& options = {}) {
  return {method, kPlane, options};
}

std::vector<ReconstructionOptions> in_rows() {
  return {by("focal_plane"),
          by("nearest"),
          by("aperture"),
          by("aperture", {{"f_number", 0.2}, {"focus_distance", 3.0}}),
          by("lumigraph"),
          by("lumigraph", {{"weights", std::string("blending_field")}}),
          by("lumigraph", {{"proxy", std::string("mesh")}, {"mesh", std::string("wall.obj")}}),
          by("slabs"),
          by("slabs", {{"layout", std::string("box")}}),
          by("visual_hull")};
}

TEST_F(Bands, ShowWhatTheWholeShows) {
  RendererOptions whole = in_bands_;
  whole.supersampling_bytes = RendererOptions{}.supersampling_bytes;
  for (const ReconstructionOptions& how : in_rows()) {
    SCOPED_TRACE(how.method);
    const RenderedView image = render(in_bands_, how), expected = render(whole, how);
    EXPECT_EQ(image.statistics.supersampling, kFactor);
    EXPECT_TRUE(image.notes.empty());
    EXPECT_EQ(image.height, kHeight);
    ASSERT_EQ(image.rgba.size(), expected.rgba.size());
    ASSERT_EQ(image.empty_space.size(), expected.empty_space.size());
    double alpha = 0;
    for (std::size_t i = 0; i < image.coverage.size(); ++i) {
      for (std::size_t c = 4 * i; c < 4 * i + 4; ++c) {
        ASSERT_NEAR(image.rgba[c], expected.rgba[c], 1e-4) << "pixel " << i;
      }
      alpha += static_cast<double>(image.rgba[4 * i + 3]);
      ASSERT_NEAR(image.coverage[i], expected.coverage[i], 1e-4);
      if (std::isfinite(image.z[i]) || std::isfinite(expected.z[i])) {
        ASSERT_NEAR(image.z[i] / expected.z[i], 1, 3e-4) << "pixel " << i;
      }
      ASSERT_NEAR(image.cameras[i], expected.cameras[i], 1e-3);
      if (std::isfinite(image.nearest_ray[i]) || std::isfinite(expected.nearest_ray[i])) {
        ASSERT_NEAR(image.nearest_ray[i], expected.nearest_ray[i], 1e-5);
      }
      if (!image.empty_space.empty()) {
        ASSERT_NEAR(image.empty_space[i], expected.empty_space[i], 1e-4);
      }
    }
    EXPECT_GT(alpha, 0.1 * kWidth * kHeight);
    EXPECT_LE(image.statistics.working_bytes, expected.statistics.working_bytes);
  }
}

/// Bands depend on the view alone; the working memory of a method within a band depends on its
/// budget.
TEST_F(Bands, SameBytesForAnyMemoryAndThreadsWithinTheShare) {
  for (const ReconstructionOptions& how : in_rows()) {
    SCOPED_TRACE(how.method);
    const RenderedView image = render(in_bands_, how);
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 1);
    RendererOptions little = in_bands_;
    little.cache_bytes = little.result_cache_bytes = 0;
    little.working_bytes = image.statistics.working_bytes * 3 / 4;
    const RenderedView same = render(little, how);
    EXPECT_EQ(same.rgba, image.rgba);
    EXPECT_EQ(same.coverage, image.coverage);
    EXPECT_EQ(same.z, image.z);
    EXPECT_EQ(same.cameras, image.cameras);
    EXPECT_EQ(same.nearest_ray, image.nearest_ray);
    EXPECT_EQ(same.empty_space, image.empty_space);
    EXPECT_LE(same.statistics.working_bytes, little.working_bytes);
    EXPECT_EQ(same.statistics.cameras_used, image.statistics.cameras_used);
    const bool in_little =
        how.method == "focal_plane" || how.method == "nearest" || how.method == "aperture";
    EXPECT_EQ(image.statistics.working_bytes == 0, in_little);
  }
}

TEST_F(Bands, HoldTheSamplesOfOneAtATime) {
  for (const ReconstructionOptions& how : in_rows()) {
    const std::size_t bytes =
        LightFieldRenderer(*take_, in_bands_).view_bytes(view(), frames(), how);
    // Cameras and nearest_ray are measured; the hull also marks empty space.
    const std::size_t of_pixel = how.method == "visual_hull" ? 36 : 32;
    const std::size_t of_band = std::size_t{kWidth} * kRows * (kFactor * kFactor + 1);
    EXPECT_EQ(bytes, (std::size_t{kWidth} * kHeight + of_band) * of_pixel) << how.method;
  }
}

/// For bands of the view and bands of a method: what one band has decoded of a frame is not decoded
/// again for the next, and parts that no band needs are not decoded.
TEST_F(Bands, DecodeLittleMoreThanTheWhole) {
  testing::SyntheticTake settings;
  settings.cameras = testing::camera_grid(2, 2, 0.06, 640, 480);
  settings.jpeg.chroma =
      store::JpegEncodeOptions::Chroma::k420;  // reaches across the bands' borders
  write_synthetic_take(settings, folder_.path() / "fine");
  const store::Take take(folder_.path() / "fine");
  constexpr int kWide = 80, kHigh = 60, kTimes = 6, kRowsOfBand = 24;
  rig::Pose pose;
  pose.position = {0.013, 0.01, 0};
  const VirtualCamera view =
      virtual_camera_with_fov(kWide, kHigh, 50 * std::numbers::pi / 180, pose);
  const auto rendered = [&](const RendererOptions& with, const ReconstructionOptions& how) {
    RenderedView image =
        LightFieldRenderer(take, with).render(view, store::select_frames(take, 0, 1), how);
    EXPECT_EQ(image.statistics.supersampling, kTimes);
    return image;
  };
  const auto expect_alike = [](const RenderedView& image, const RenderedView& expected) {
    ASSERT_EQ(image.rgba.size(), expected.rgba.size());
    for (std::size_t i = 0; i < image.rgba.size(); ++i) {
      ASSERT_NEAR(image.rgba[i], expected.rgba[i], 1e-4) << "value " << i;
    }
    const auto decoded = static_cast<double>(image.statistics.pixels_decoded);
    EXPECT_LE(decoded, 1.2 * static_cast<double>(expected.statistics.pixels_decoded));
  };
  RendererOptions in_bands;
  in_bands.supersampling_bytes = kBytesOfSample * kTimes * kTimes * kWide * kRowsOfBand;
  for (const ReconstructionOptions& how : {by("focal_plane"), by("aperture"), by("lumigraph")}) {
    SCOPED_TRACE(how.method);
    const RenderedView whole = rendered({}, how);
    EXPECT_LT(whole.statistics.pixels_decoded, 4 * 640 * 480 * 0.8);  // there is room for more
    expect_alike(rendered(in_bands, how), whole);
    if (whole.statistics.working_bytes == 0) continue;
    RendererOptions little;
    little.working_bytes = whole.statistics.working_bytes / 3;
    expect_alike(rendered(little, how), whole);
  }
}

/// Without memory to cache images of nodes, bands make the images that they share again.
TEST_F(Bands, OfSlabsMakeImagesOfSharedNodesAlone) {
  const auto decoded = [&](std::size_t supersampling_bytes) {
    RendererOptions keeps_nothing = in_bands_;
    keeps_nothing.supersampling_bytes = supersampling_bytes;
    keeps_nothing.result_cache_bytes = keeps_nothing.cache_bytes = 0;
    return render(keeps_nothing, by("slabs")).statistics.pixels_decoded;
  };
  constexpr double kFrame = 160 * 120;  // each node's image takes part of one, decoded anew
  const auto at_once = static_cast<double>(decoded(RendererOptions{}.supersampling_bytes));
  const auto in_bands = static_cast<double>(decoded(in_bands_.supersampling_bytes));
  EXPECT_LT(at_once, 0.5 * 9 * kFrame);
  // The upper band uses all three rows of nodes, the lower one the last two. Each band makes the
  // parts of the images that it reads.
  EXPECT_GT(in_bands, at_once);
  EXPECT_LT(in_bands, 1.2 * at_once);
}

/// Bands of a view are independent: a pixel that several bands need counts in each.
TEST_F(Bands, OfTheViewCountPixelsAtTheirBordersInEach) {
  RendererOptions counting;
  counting.count_needed_pixels = true;
  RendererOptions in_bands = counting;
  in_bands.supersampling_bytes = in_bands_.supersampling_bytes;
  for (const ReconstructionOptions& how : {by("focal_plane"), by("lumigraph"), by("slabs")}) {
    SCOPED_TRACE(how.method);
    const auto whole = static_cast<double>(render(counting, how).statistics.pixels_needed);
    const auto bands = static_cast<double>(render(in_bands, how).statistics.pixels_needed);
    EXPECT_GT(bands, whole);
    EXPECT_LT(bands, 1.05 * whole);
  }
}

/// Otherwise each band would add its own note.
TEST_F(Bands, SpeakOfTheWholeWhereMemoryIsShort) {
  const auto note = [&](const VirtualCamera& whole, int first, int end, int full_height) {
    const VirtualCamera fine = supersampled(crop_rows(whole, first, end), kFactor);
    const LightFieldFrame instant;
    const MethodOptions options({}, {}, "no method");
    ResultCache kept(0);
    BufferPool buffers;
    ViewRequest request{fine, instant, kPlane, options, kept, 5'000'000, buffers};
    request.supersampling = kFactor;
    request.first_row = first;
    request.full_height = full_height;
    return memory_overrun_note("x", request);
  };
  const std::string of_whole = note(view(), 0, kHeight, 0);
  EXPECT_NE(of_whole.find("a view of 20x15 needs more working memory"), std::string::npos)
      << of_whole;
  EXPECT_EQ(note(view(), 0, kRows, kHeight), of_whole);
  EXPECT_EQ(note(view(), kRows, kHeight, kHeight), of_whole);
}

/// Needed pixels are counted once, however many bands a method works in.
TEST_F(Bands, OfAMethodCountNothingTwice) {
  RendererOptions counting;
  counting.count_needed_pixels = true;
  const RenderStatistics whole = render(counting, by("lumigraph")).statistics;
  counting.working_bytes = whole.working_bytes / 3;
  const RenderStatistics bands = render(counting, by("lumigraph")).statistics;
  EXPECT_LE(bands.working_bytes, counting.working_bytes);
  EXPECT_EQ(bands.pixels_needed, whole.pixels_needed);
  EXPECT_GT(bands.pixels_needed, 0);
  EXPECT_EQ(bands.cameras_used, whole.cameras_used);
}

}  // namespace
}  // namespace raystage::render::row_bands_test
