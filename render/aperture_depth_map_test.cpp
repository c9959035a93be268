// SPDX-License-Identifier: Apache-2.0
// Tests of the method `aperture` with its focus on a depth map.
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfOutputFile.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hwy/highway.h>

#include <Eigen/Geometry>
#include <cmath>
#include <fstream>
#include <limits>
#include <numbers>

#include "base/error.h"
#include "render/common/plane_projection.h"
#include "render/methods.h"
#include "render/renderer.h"
#include "render/sampling/source_view.h"
#include "testing/render/synthetic_take.h"
#include "testing/test_simd_targets.h"

namespace raystage::render {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr int kWidth = 117, kHeight = 83;
constexpr float kInfinity = std::numeric_limits<float>::infinity();

VirtualCamera default_view(int width = kWidth, int height = kHeight) {
  rig::Pose pose;
  pose.position = {0.01, -0.02, 0.07};
  pose.world_from_camera_rotation =
      Eigen::AngleAxisd(0.03, Eigen::Vector3d(0.3, 1, 0.1).normalized()).toRotationMatrix();
  return virtual_camera_with_fov(width, height, 40 * std::numbers::pi / 180, pose);
}

/// Writes one channel of an EXR file. `window`: the data window within a display window of width x
/// height.
void write_channel(const std::filesystem::path& file, const char* channel,
                   const std::vector<float>& values, int width, int height,
                   const Imath::Box2i& window) {
  Imf::Header header(Imath::Box2i({0, 0}, {width - 1, height - 1}), window);
  header.channels().insert(channel, Imf::Channel(Imf::FLOAT));
  Imf::OutputFile output(file.c_str(), header, 0);
  Imf::FrameBuffer buffer;
  buffer.insert(channel,
                Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(const_cast<float*>(values.data())),
                           sizeof(float), sizeof(float) * static_cast<std::size_t>(width)));
  output.setFrameBuffer(buffer);
  output.writePixels(window.max.y + 1 - window.min.y);
}

class ApertureDepthMap : public ::testing::Test {
 protected:
  ApertureDepthMap() {
    testing::SyntheticTake settings;
    settings.cameras =
        testing::camera_grid(4, 4, 0.06, 160, 120, {-0.2, 0.05, 0.001, -0.002, 0.003});
    write_synthetic_take(settings, folder_.path() / "take");
    take_ = std::make_unique<store::Take>(folder_.path() / "take");
  }

  void write_map(const std::vector<float>& z, int width = kWidth, int height = kHeight) {
    write_channel(file(), "Z", z, width, height, {{0, 0}, {width - 1, height - 1}});
  }
  std::filesystem::path file() const { return folder_.path() / "take/z.exr"; }

  RenderedView render(const VirtualCamera& view, const RendererOptions& settings,
                      const Eigen::Vector4d& plane = {0, 0, 1, 4}, bool on_map = true) {
    schemas::OptionValues options{{"radius", 0.09}};
    if (on_map) options["depth_map"] = std::string("z.exr");
    return LightFieldRenderer(*take_, settings)
        .render(view, store::select_frames(*take_, 0, kNanosecondsPerSecond),
                {"aperture", plane, options});
  }

  /// Renders with the fast and the reference implementation, which must agree.
  RenderedView render_both(const VirtualCamera& view) {
    RendererOptions settings;
    settings.count_needed_pixels = true;
    RenderedView fast = render(view, settings);
    settings.reference = true;
    const RenderedView reference = render(view, settings);
    for (std::size_t i = 0; i < fast.coverage.size(); ++i) {
      for (std::size_t c = 0; c < 4; ++c) {
        EXPECT_NEAR(fast.rgba[4 * i + c], reference.rgba[4 * i + c], 1e-3) << "pixel " << i;
        if (std::abs(fast.rgba[4 * i + c] - reference.rgba[4 * i + c]) > 1e-3F) return fast;
      }
      EXPECT_NEAR(fast.coverage[i], reference.coverage[i], 1e-3);
      EXPECT_EQ(std::isfinite(fast.z[i]), std::isfinite(reference.z[i])) << "pixel " << i;
      if (std::isfinite(fast.z[i])) {
        EXPECT_NEAR(fast.z[i] / reference.z[i], 1, 1e-5);
      }
    }
    EXPECT_GE(fast.statistics.pixels_decoded, fast.statistics.pixels_needed);
    EXPECT_GT(fast.statistics.pixels_needed, 0);
    return fast;
  }

  testing::TestFolder folder_;
  std::unique_ptr<store::Take> take_;
};

/// Returns depths in steps between 0.8 and 6 m, with pixels at infinity and without depth.
std::vector<float> stepped_depths() {
  std::vector<float> z;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const int step = (x / 13 + 3 * (y / 11)) % 7;
      z.push_back(step == 0 ? kInfinity : 0.8F * static_cast<float>(step) + 0.01F * (x % 5));
    }
  }
  for (std::size_t i = 40; i < z.size(); i += 97) z[i] = 0;
  for (std::size_t i = 41; i < z.size(); i += 97) z[i] = std::numeric_limits<float>::quiet_NaN();
  for (std::size_t i = 42; i < z.size(); i += 97) z[i] = -2;
  return z;
}

TEST_F(ApertureDepthMap, OfAPlaneIsThePlane) {
  const VirtualCamera view = default_view();
  const Eigen::Vector4d plane(0.2, 0.3, 1, 3);
  const PlaneProjection projection(view, plane);
  std::vector<float> z;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      z.push_back(static_cast<float>(projection.depth(x + 0.5, y + 0.5)));
    }
  }
  write_map(z);
  const RenderedView on_map = render(view, {}), on_plane = render(view, {}, plane, false);
  double seen = 0;
  for (std::size_t i = 0; i < on_map.coverage.size(); ++i) {
    for (std::size_t c = 0; c < 4; ++c) {
      ASSERT_NEAR(on_map.rgba[4 * i + c], on_plane.rgba[4 * i + c], 1e-4) << "pixel " << i;
    }
    seen += static_cast<double>(on_map.coverage[i]);
    if (!(on_map.rgba[4 * i + 3] > 0)) continue;
    ASSERT_NEAR(on_map.z[i] / on_plane.z[i], 1, 1e-5) << "pixel " << i;
  }
  EXPECT_GT(seen, 0.5 * kWidth * kHeight);
}

TEST_F(ApertureDepthMap, AgreesWithTheReferenceOnEveryInstructionSet) {
  write_map(stepped_depths());
  testing::for_each_simd_target(kernel_target, [&] {
    const RenderedView image = render_both(default_view());
    for (const std::size_t i : {40U, 41U, 42U}) {
      EXPECT_EQ(image.rgba[4 * (i + 97 * 50) + 3], 0);
      EXPECT_EQ(image.z[i + 97 * 50], kInfinity);
    }
  });
}

TEST_F(ApertureDepthMap, HasTheFinalSizeWhereAViewIsRenderedFiner) {
  write_map(std::vector<float>(40 * 30, 4.0F), 40, 30);
  const RenderedView image = render_both(default_view(40, 30));
  EXPECT_GT(image.statistics.supersampling, 1);
  EXPECT_EQ(image.width, 40);
}

/// Every row of the depth map differs, so that a row in the wrong place is detected.
TEST_F(ApertureDepthMap, IsFollowedByViewsInBandsAndNeverHeldAnew) {
  constexpr int kCoarseWidth = 40, kCoarseHeight = 30;
  std::vector<float> z;
  for (int i = 0; i < kCoarseWidth * kCoarseHeight; ++i) {
    const int row = i / kCoarseWidth;
    z.push_back(1 + 0.15F * static_cast<float>(row) + 0.01F * static_cast<float>(i % 7));
  }
  write_map(z, kCoarseWidth, kCoarseHeight);
  const VirtualCamera view = default_view(kCoarseWidth, kCoarseHeight);
  RendererOptions in_bands;
  for (const bool reference : {false, true}) {
    in_bands.reference = reference;
    in_bands.supersampling_bytes = RendererOptions{}.supersampling_bytes;
    const RenderedView whole = render(view, in_bands);
    const int factor = whole.statistics.supersampling;
    ASSERT_GT(factor, 1);
    in_bands.supersampling_bytes = std::size_t{24} * kCoarseWidth * 7 * factor * factor;
    const RenderedView image = render(view, in_bands);
    EXPECT_EQ(image.statistics.supersampling, factor);
    EXPECT_EQ(image.statistics.working_bytes, 0);
    for (std::size_t i = 0; i < whole.coverage.size(); ++i) {
      for (std::size_t c = 4 * i; c < 4 * i + 4; ++c) {
        ASSERT_NEAR(image.rgba[c], whole.rgba[c], 1e-4) << "pixel " << i;
      }
      if (image.coverage[i] > 0) {
        ASSERT_NEAR(image.z[i] / whole.z[i], 1, 1e-5) << "pixel " << i;
      }
    }
  }
}

TEST_F(ApertureDepthMap, OutsideItsDataWindowThereIsNoDepth) {
  write_channel(file(), "Z", std::vector<float>(kWidth * kHeight, 4.0F), kWidth, kHeight,
                {{20, 10}, {kWidth - 1, kHeight - 1}});
  const RenderedView image = render_both(default_view());
  EXPECT_EQ(image.rgba[4 * (40 * kWidth + 10) + 3], 0);
  EXPECT_GT(image.rgba[4 * (40 * kWidth + 60) + 3], 0.9F);
}

TEST_F(ApertureDepthMap, IsRefusedWhereItDoesNotFit) {
  const auto complaint = [&] {
    try {
      render(default_view(), {});
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_THAT(complaint(), AllOf(HasSubstr("cannot be read"),
                                 HasSubstr("Use a flat EXR file with planar depths")));
  std::ofstream(file()) << "no EXR";
  EXPECT_THAT(complaint(), AllOf(HasSubstr("cannot be read"),
                                 HasSubstr("Use a flat EXR file with planar depths")));
  write_map(std::vector<float>(50 * 50, 4.0F), 50, 50);
  EXPECT_THAT(complaint(), HasSubstr("50 x 50 pixels, but the view has 117 x 83"));
  write_channel(file(), "depth", std::vector<float>(kWidth * kHeight, 4.0F), kWidth, kHeight,
                {{0, 0}, {kWidth - 1, kHeight - 1}});
  EXPECT_THAT(complaint(), HasSubstr("no channel Z"));
}

TEST_F(ApertureDepthMap, CountsAmongTheFilesThatDetermineThePixels) {
  const Method& method = method_named("aperture");
  const store::FrameSelection frames = store::select_frames(*take_, 0, kNanosecondsPerSecond);
  const MethodOptions with(method.options(), {{"depth_map", std::string("z.exr")}}, "aperture");
  const MethodOptions without(method.options(), {}, "aperture");
  EXPECT_THAT(method.input_files(with, *take_, frames), ::testing::ElementsAre(file()));
  EXPECT_TRUE(method.input_files(without, *take_, frames).empty());
}

}  // namespace
}  // namespace raystage::render
