// SPDX-License-Identifier: Apache-2.0
#include "render/depth/depth.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <Eigen/Geometry>
#include <cmath>
#include <filesystem>
#include <numbers>

#include "render/depth/solve_kernels.h"
#include "render/quality/image_quality.h"
#include "render/renderer.h"
#include "render/view/synthetic_take.h"
#include "schemas/atomic_file.h"
#include "schemas/error.h"
#include "schemas/test_targets.h"

namespace raystage {
namespace {

namespace fs = std::filesystem;
using testing::SyntheticTake;

constexpr double kDegree = std::numbers::pi / 180;

/// More texture than the painted plane has, so that depth shows.
std::array<double, 3> texture(double x, double y) {
  const auto rgb = testing::painted_plane(1.5 * x, 1.5 * y);
  const auto fine = testing::painted_plane(4 * x + 1, 4 * y);
  return {(rgb[0] + fine[1]) / 2, (rgb[1] + fine[2]) / 2, (rgb[2] + fine[0]) / 2};
}

/// The plane n.X = c.
struct Plane {
  Eigen::Vector3d normal;
  double c;
  double distance(const Eigen::Vector3d& from, const Eigen::Vector3d& direction) const {
    return (c - normal.dot(from)) / normal.dot(direction);
  }
};
const Plane kSlanted{{0.35, 0.1, 1}, -4};
const Plane kBack{{0, 0, 1}, -5}, kFront{{0, 0, 1}, -2.5};

/// Everything left of x = 0.1 on the front plane is a wall; behind it the back plane.
bool hits_wall(const Eigen::Vector3d& from, const Eigen::Vector3d& direction) {
  return (from + kFront.distance(from, direction) * direction).x() < 0.1;
}
std::array<double, 3> step_scene(const Eigen::Vector3d& from, const Eigen::Vector3d& direction) {
  const Plane& plane = hits_wall(from, direction) ? kFront : kBack;
  const Eigen::Vector3d hit = from + plane.distance(from, direction) * direction;
  return texture(hit.x(), hit.y() + plane.c);
}
std::array<double, 3> slanted_scene(const Eigen::Vector3d& from, const Eigen::Vector3d& direction) {
  const Eigen::Vector3d hit = from + kSlanted.distance(from, direction) * direction;
  return texture(hit.x(), hit.y());
}

Pose looking(const Eigen::Vector3d& position, double yaw_degrees) {
  Pose pose;
  pose.position = position;
  pose.world_from_camera_rotation =
      Eigen::AngleAxisd(yaw_degrees * kDegree, Eigen::Vector3d::UnitY()).toRotationMatrix();
  return pose;
}

class Depth : public ::testing::Test {
 protected:
  static SyntheticTake slanted(int rows, int columns, const Distortion& distortion = {}) {
    SyntheticTake take;
    take.cameras = testing::camera_grid(rows, columns, 0.1, 96, 72, distortion);
    take.depth_range = DepthRange{2.5, 7};
    take.painting = slanted_scene;
    return take;
  }
  static SyntheticTake step_edge(int rows, int columns) {
    SyntheticTake take = slanted(rows, columns);
    take.painting = step_scene;
    return take;
  }
  fs::path take_folder() const { return folder_.path() / "take"; }
  Take write(const SyntheticTake& settings) {
    write_synthetic_take(settings, take_folder());
    return Take(take_folder());
  }
  static RenderedView render(const Take& take, const VirtualCamera& view, OptionValues options = {},
                             const RendererSettings& settings = {}, int frame = 0) {
    const FrameSelection frames =
        select_frames(take, frame * kNanosecondsPerSecond / 15, 30'000'000);
    return LightFieldRenderer(take, settings)
        .render(view, frames, {"depth", {0, 0, 0, 1}, std::move(options)});
  }
  std::vector<fs::path> kept_files() const {
    std::vector<fs::path> files;
    std::error_code none;
    for (const auto& entry : fs::recursive_directory_iterator(take_folder() / "depth", none)) {
      if (entry.is_regular_file()) files.push_back(entry.path());
    }
    return files;
  }
  TestFolder folder_;
};

VirtualCamera a_view() {
  return virtual_camera_with_fov(90, 64, 40 * kDegree, looking({0.02, 0.013, 0.03}, 2));
}

double mean_alpha(const RenderedView& view) {
  double sum = 0;
  for (std::size_t i = 3; i < view.rgba.size(); i += 4) sum += static_cast<double>(view.rgba[i]);
  return sum / static_cast<double>(view.coverage.size());
}

/// Both blend on the same depths, so nothing may differ by more than floats do.
void expect_equal(const RenderedView& fast, const RenderedView& slow) {
  for (std::size_t i = 0; i < fast.coverage.size(); ++i) {
    ASSERT_NEAR(fast.coverage[i], slow.coverage[i], 2e-3) << "pixel " << i;
    for (std::size_t c = 0; c < 4; ++c) {
      ASSERT_NEAR(fast.rgba[4 * i + c], slow.rgba[4 * i + c], 3e-3) << "pixel " << i;
    }
    if (std::isfinite(slow.z[i])) {
      ASSERT_NEAR(fast.z[i], slow.z[i], 1e-4 * static_cast<double>(slow.z[i]));
    }
  }
}

TEST_F(Depth, AgreesWithTheReference) {
  const Take take = write(slanted(3, 3, {-0.15, 0.04, 0.001, -0.002, 0}));
  RendererSettings slow;
  slow.reference = true;
  for (const OptionValues& options :
       {OptionValues{}, OptionValues{{"cameras", 5.0}, {"agreement", 40.0}}}) {
    expect_equal(render(take, a_view(), options), render(take, a_view(), options, slow));
  }
  for (const VirtualCamera& view :
       {virtual_camera_with_fov(70, 50, 1.2, looking({0.3, 0.1, 0.4}, 15)),     // from the side
        virtual_camera_with_fov(70, 50, 0.5, looking({0, 0.05, -1.5}, -5))}) {  // in front
    expect_equal(render(take, view), render(take, view, {}, slow));
  }
  RendererSettings linear;
  linear.blend_space = BlendSpace::kLinear;
  slow.blend_space = BlendSpace::kLinear;
  expect_equal(render(take, a_view(), {}, linear), render(take, a_view(), {}, slow));
}

TEST_F(Depth, EveryInstructionSetSeesTheSame) {
  const Take take = write(step_edge(3, 3));
  const OptionValues anew{{"keep", false}};
  const RenderedView expected = render(take, a_view(), anew);
  testing::for_each_target(depth_solve_target, [&] {
    const RenderedView image = render(take, a_view(), anew);
    // Rounded differently, a choice between equals may fall differently; hardly anywhere.
    std::size_t differ = 0;
    for (std::size_t i = 0; i < image.rgba.size(); ++i) {
      differ += std::abs(image.rgba[i] - expected.rgba[i]) > 5e-3F ? 1 : 0;
    }
    EXPECT_LT(differ, image.rgba.size() / 100);
  });
}

TEST_F(Depth, FindsASlantedPlane) {
  const Take take = write(slanted(3, 3));
  const VirtualCamera view = a_view();
  const RenderedView image = render(take, view);
  const ViewRays rays(view);
  const double pixel_metres = 80 * 0.1;  // focal length times the cameras' spacing
  double disparity_error = 0, colour_error = 0;
  int count = 0;
  for (int y = 8; y < view.height - 8; ++y) {
    for (int x = 8; x < view.width - 8; ++x) {
      const auto at = static_cast<std::size_t>(y * view.width + x);
      const Eigen::Vector3d ray = *rays.through(x + 0.5, y + 0.5);
      const double depth = kSlanted.distance(view.pose.position, ray);
      const auto truth = slanted_scene(view.pose.position, ray);
      disparity_error += std::abs(1 / static_cast<double>(image.z[at]) - 1 / depth) * pixel_metres;
      for (std::size_t c = 0; c < 3; ++c) {
        colour_error += std::abs(static_cast<double>(image.rgba[4 * at + c]) - truth[c]) / 3;
      }
      ++count;
      EXPECT_NEAR(image.rgba[4 * at + 3], 1, 1e-3);
      EXPECT_EQ(image.coverage[at], image.rgba[4 * at + 3]);
    }
  }
  EXPECT_LT(disparity_error / count, 0.05);  // pixels
  EXPECT_LT(colour_error / count, 0.012);
}

/// A wall with round holes, before the back plane: edges at every angle and of every phase.
std::array<double, 3> holes_scene(const Eigen::Vector3d& from, const Eigen::Vector3d& direction) {
  const Eigen::Vector3d on_wall = from + kFront.distance(from, direction) * direction;
  const bool wall = std::cos(5 * on_wall.x() + 1) + std::cos(5 * on_wall.y()) > 0.6;
  const Plane& plane = wall ? kFront : kBack;
  const Eigen::Vector3d hit = from + plane.distance(from, direction) * direction;
  const auto coarse = texture(hit.x(), hit.y() + plane.c);
  const auto fine = testing::painted_plane(9 * hit.x() + 2, 7 * hit.y() + hit.x());
  return {(2 * coarse[0] + fine[2]) / 3, (2 * coarse[1] + fine[0]) / 3,
          (2 * coarse[2] + fine[1]) / 3};
}

TEST_F(Depth, TheErrorDoesNotFlickerWhenTheCameraMoves) {
  SyntheticTake settings = slanted(3, 4);
  settings.painting = holes_scene;
  settings.samples = 3;
  settings.jpeg = {75, JpegEncodeSettings::Chroma::k444, 0};
  const Take take = write(settings);
  const LightFieldRenderer renderer(take, {});
  const FrameSelection frames = select_frames(take, 0, 30'000'000);
  const auto largest_step = [&](const OptionValues& options) {
    double before = 0, largest = 0;
    for (int i = 0; i < 28; ++i) {
      const double way = 0.008 * i;  // two camera spacings in all
      CameraGeometry geometry = settings.cameras[0];
      geometry.intrinsics.fx = geometry.intrinsics.fy = 130;
      geometry.world_from_camera[3] = way - 0.13;
      geometry.world_from_camera[7] = 0.02;
      geometry.world_from_camera[11] = way / 3;
      const RenderedView image = renderer.render(virtual_camera_from_geometry(geometry), frames,
                                                 {"depth", {0, 0, 0, 1}, options});
      const double psnr =
          compare_images(srgb_image(image), photograph(geometry, settings), covered_pixels(image))
              .psnr_db;
      if (i > 0) largest = std::max(largest, std::abs(psnr - before));
      before = psnr;
    }
    EXPECT_GT(before, 26);
    return largest;
  };
  EXPECT_LT(largest_step({}), 0.3);                  // dB
  EXPECT_GT(largest_step({{"cameras", 2.0}}), 0.3);  // too few to hide the change
}

TEST_F(Depth, KeepsTheTwoSidesOfAStepApart) {
  const Take take = write(step_edge(3, 3));
  const VirtualCamera view = a_view();
  const RenderedView image = render(take, view);
  const ViewRays rays(view);
  int wrong = 0, count = 0;
  for (int y = 4; y < view.height - 4; ++y) {
    for (int x = 4; x < view.width - 4; ++x) {
      const auto side = [&](double at) {
        return hits_wall(view.pose.position, *rays.through(at, y + 0.5));
      };
      if (side(x - 2) != side(x + 3)) continue;
      const Plane& plane = side(x + 0.5) ? kFront : kBack;
      const double depth = plane.distance(view.pose.position, *rays.through(x + 0.5, y + 0.5));
      const auto found = static_cast<double>(image.z[static_cast<std::size_t>(y * view.width + x)]);
      wrong += std::abs(found / depth - 1) > 0.05;
      ++count;
    }
  }
  EXPECT_LT(wrong, count / 50);
}

TEST_F(Depth, SameBytesForAnyNumberOfThreadsAndAnyMemory) {
  const Take take = write(slanted(3, 3));
  std::vector<RenderedView> images;
  for (const std::size_t threads : {1, 2, 5}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    RendererSettings settings;
    if (threads == 5) settings.working_bytes = 2'000'000;  // camera by camera
    images.push_back(render(take, a_view(), {{"keep", false}}, settings));
  }
  EXPECT_EQ(images[0].rgba, images[1].rgba);
  EXPECT_EQ(images[0].rgba, images[2].rgba);
  EXPECT_EQ(images[0].z, images[2].z);
  EXPECT_TRUE(kept_files().empty());
}

TEST_F(Depth, SaysHowMuchMemoryItTakesAndWhereThatIsMoreThanItsShare) {
  const Take take = write(slanted(3, 3));
  constexpr std::size_t kPixels = 90 * 64;
  const std::size_t solved = render(take, a_view()).statistics.working_bytes;
  const RenderedView kept = render(take, a_view());
  EXPECT_GT(solved, 9U * 8 * 96 * 72);  // images and second maps of all cameras, at the least
  EXPECT_GE(kept.statistics.working_bytes, 16 * kPixels);
  EXPECT_LT(kept.statistics.working_bytes, solved);
  const auto beyond = ::testing::Contains(
      ::testing::HasSubstr("a view of 90x64 takes more memory to work with than its share, 0 MB"));
  EXPECT_THAT(kept.notes, ::testing::Not(beyond));
  RendererSettings little;
  little.working_bytes = kept.statistics.working_bytes - 1;
  const RenderedView in_bands = render(take, a_view(), {}, little);
  EXPECT_LE(in_bands.statistics.working_bytes, little.working_bytes);
  EXPECT_THAT(in_bands.notes, ::testing::Not(beyond));
  EXPECT_EQ(in_bands.rgba, kept.rgba);
  little.working_bytes = 0;
  const RenderedView least = render(take, a_view(), {}, little);
  EXPECT_EQ(least.rgba, kept.rgba);
  EXPECT_THAT(least.notes, beyond);
}

TEST_F(Depth, KeepsDepthsInTheTakeAndUsesThem) {
  const Take take = write(slanted(2, 3));
  const RenderedView first = render(take, a_view());
  ASSERT_EQ(kept_files().size(), 1U);
  const fs::path file = kept_files()[0];
  const auto written = fs::last_write_time(file);
  EXPECT_EQ(render(take, a_view()).rgba, first.rgba);
  EXPECT_EQ(fs::last_write_time(file), written);
  EXPECT_EQ(render(take, a_view(), {{"keep", false}}).rgba, first.rgba);  // found or read: the same
  // Other settings have another file; damage is mended.
  render(take, a_view(), {{"far", 9.0}});
  EXPECT_EQ(kept_files().size(), 2U);
  const std::string whole = read_file(file);
  write_file_atomically(file, std::string_view(whole).substr(0, whole.size() / 2));
  EXPECT_EQ(render(take, a_view()).rgba, first.rgba);
  EXPECT_EQ(read_file(file), whole);
}

TEST_F(Depth, RaysMeetWhatViewsWithTheSameOptionsShow) {
  SyntheticTake painted = slanted(2, 3);
  painted.frames = 3;
  const Take take = write(painted);
  const FrameSelection frames = select_frames(take, kNanosecondsPerSecond / 15, 30'000'000);
  const auto answered = [&](OptionValues options, std::shared_ptr<KeptResults> kept) {
    RendererSettings settings;
    settings.kept = std::move(kept);
    const WorldRay ahead{{0.02, 0.013, 0}, {0, 0, -1}};
    RaySample sample;
    LightFieldRenderer(take, settings)
        .query({&ahead, 1}, frames, {"depth", {0, 0, 0, 1}, std::move(options)}, {&sample, 1});
    return sample.depth;
  };
  for (const OptionValues::value_type& option : {OptionValues::value_type{"near", 2.0},
                                                 {"far", 9.0},
                                                 {"plane_px", 1.0},
                                                 {"neighbours", 2.0},
                                                 {"witnesses", 3.0},
                                                 {"temporal", true}}) {
    const OptionValues options{{"keep", false}, option};
    RendererSettings settings;
    settings.kept = std::make_shared<KeptResults>(std::size_t{1} << 28);
    EXPECT_NEAR(answered(options, settings.kept), 4, 0.1) << option.first;
    const std::size_t held = settings.kept->bytes_held();
    render(take, a_view(), options, settings, 1);
    EXPECT_EQ(settings.kept->bytes_held(), held) << option.first << " had no say";
  }
  EXPECT_TRUE(kept_files().empty());
  answered({}, nullptr);
  ASSERT_EQ(kept_files().size(), 1U);
  render(take, a_view(), {}, {}, 1);
  EXPECT_EQ(kept_files().size(), 1U);
}

TEST_F(Depth, RaysOfAPlaneSweepEndBetweenItsDepths) {
  SyntheticTake painted = slanted(2, 3);
  painted.knows_depth_range = false;
  const Take take = write(painted);
  RendererSettings settings;
  settings.use_take_folder = false;
  const LightFieldRenderer renderer(take, settings);
  const WorldRay ahead{{0.02, 0.013, 0}, {0, 0, -1}};
  RaySample sample;
  const auto ask = [&](OptionValues options) {
    renderer.query({&ahead, 1}, select_frames(take, 0, 1),
                   {"plane_sweep", {0, 0, 1, 1}, std::move(options)}, {&sample, 1});
  };
  ask({{"near", 2.5}, {"far", 7.0}});
  EXPECT_NEAR(sample.depth, 4, 0.1);
  ask({{"near", 5.0}, {"far", 7.0}});
  EXPECT_GE(sample.depth, 4.999F);
  EXPECT_THROW(ask({}), Error);
  EXPECT_TRUE(kept_files().empty());
}

TEST_F(Depth, TheViewThatDepthsAreFoundForSaysWhatTheyTook) {
  SyntheticTake settings = slanted(2, 3);
  settings.frames = 3;
  const Take take = write(settings);
  constexpr std::int64_t kFrames = 6 * 96 * 72;  // pixels of an instant
  RendererSettings counting;
  counting.count_needed_pixels = true;
  const auto decoded = [&](OptionValues options, bool by_reference = false) {
    counting.reference = by_reference;
    const FrameSelection frames = select_frames(take, kNanosecondsPerSecond / 15, 30'000'000);
    const RenderStatistics found = LightFieldRenderer(take, counting)
                                       .render(a_view(), frames, {"depth", {0, 0, 0, 1}, options})
                                       .statistics;
    EXPECT_GE(found.pixels_decoded, found.pixels_needed);
    return found.pixels_decoded;
  };
  EXPECT_EQ(decoded({}), kFrames);
  EXPECT_LT(decoded({{"cameras", 2.0}}), kFrames);  // depths are there
  EXPECT_EQ(decoded({{"keep", false}}), kFrames);
  EXPECT_EQ(decoded({{"keep", false}}, true), kFrames);
  const auto timeline = build_timeline(take, 15, 0);
  counting.ticks = timeline.ticks;
  EXPECT_EQ(decoded({{"keep", false}, {"temporal", true}}), 3 * kFrames);
}

TEST_F(Depth, TemporalLooksAtTheFramesBeforeAndAfter) {
  SyntheticTake settings = slanted(2, 3);
  settings.frames = 4;  // all alike
  const Take take = write(settings);
  const OptionValues steady{{"temporal", true}};
  const Timeline timeline = build_timeline(take, 15, 0);
  RendererSettings on_ticks;
  on_ticks.ticks = timeline.ticks;
  EXPECT_GT(mean_alpha(render(take, a_view(), steady, on_ticks, 0)), 0.9);  // it has none before
  const RenderedView second = render(take, a_view(), steady, on_ticks, 1);
  const RenderedView alone = render(take, a_view(), {}, {}, 1);
  for (std::size_t i = 0; i < alone.rgba.size(); ++i) {
    ASSERT_NEAR(second.rgba[i], alone.rgba[i], 1e-3) << i;
  }
  RendererSettings slow = on_ticks;
  slow.reference = true;
  expect_equal(second, render(take, a_view(), steady, slow, 1));
  EXPECT_EQ(render(take, a_view(), steady, on_ticks, 1).rgba,
            second.rgba);  // found or read: the same
}

TEST_F(Depth, RendersATakeThatItMayNotWriteTo) {
  const Take take = write(slanted(2, 2));
  write_file_atomically(take_folder() / "depth", std::string_view("in the way"));
  const RenderedView image = render(take, a_view());
  EXPECT_GT(mean_alpha(image), 0.9);
  EXPECT_THAT(image.notes, ::testing::Contains(::testing::HasSubstr("cannot be kept")));
}

TEST_F(Depth, AnAbsentCamerasNeighboursStandInAndCoverageSaysSo) {
  SyntheticTake settings = slanted(3, 3);
  settings.frames = 2;
  settings.absent = {{4, 1}};  // the middle camera, second frame
  const Take take = write(settings);
  const OptionValues four{{"cameras", 4.0}};
  const VirtualCamera view = virtual_camera_with_fov(60, 40, 0.5, looking({0, 0, 0.01}, 0));
  const std::size_t middle = 20 * 60 + 30;
  EXPECT_NEAR(render(take, view, four).coverage[middle], 1, 1e-3);
  const RenderedView lacking = render(take, view, four, {}, 1);
  EXPECT_NEAR(lacking.rgba[middle * 4 + 3], 1, 1e-3);  // still a picture
  EXPECT_LT(lacking.coverage[middle], 0.1);            // that owns up
  EXPECT_EQ(kept_files().size(), 2U);
  RendererSettings slow;
  slow.reference = true;
  expect_equal(lacking, render(take, view, four, slow, 1));
}

TEST_F(Depth, OneCameraIsAllThatItNeeds) {
  const Take take = write(slanted(1, 1));
  const RenderedView image = render(take, a_view());
  EXPECT_GT(mean_alpha(image), 0.9);
  const float z = image.z[32 * 90 + 45];  // mid-way in disparity: there is nothing to compare
  EXPECT_GT(z, 2.5F);
  EXPECT_LT(z, 7.0F);
}

TEST_F(Depth, StaysFiniteWhereDepthsEnd) {
  const Take take = write(slanted(2, 2));
  for (const OptionValues& options :
       {OptionValues{{"near", 4.0}, {"far", 4.0}}, OptionValues{{"far", 1e12}},
        OptionValues{{"near", 0.01}, {"plane_px", 4.0}},
        OptionValues{{"near", 1e9}, {"far", 1e9}}}) {
    for (const VirtualCamera& view :
         {virtual_camera_with_fov(40, 30, 1, looking({0, 0, 0}, 0)),
          virtual_camera_with_fov(40, 30, 1, looking({0, 0, -4.5}, 0)),      // inside the scene
          virtual_camera_with_fov(40, 30, 1, looking({0.3, 0, -4}, 170)),    // looking back
          virtual_camera_with_fov(40, 30, 3, looking({0, 0, 0}, 90)),        // along the array
          virtual_camera_with_fov(1, 1, 0.001, looking({0, 0, 1e6}, 0))}) {  // far behind
      const RenderedView image = render(take, view, options);
      for (std::size_t i = 0; i < image.coverage.size(); ++i) {
        for (std::size_t c = 0; c < 4; ++c) ASSERT_TRUE(std::isfinite(image.rgba[4 * i + c]));
        ASSERT_GE(image.coverage[i], 0);
        ASSERT_LE(image.coverage[i], 1 + 1e-6F);
        ASSERT_GT(image.z[i], 0);
      }
    }
  }
}

TEST_F(Depth, RendersDistortedViews) {
  const Take take = write(slanted(2, 2));
  VirtualCamera bent = a_view();
  bent.intrinsics.distortion.k1 = -0.1;
  const RenderedView image = render(take, bent);
  EXPECT_GT(mean_alpha(image), 0.9);
  const ViewRays rays(bent);
  double error = 0;
  for (int y = 8; y < 56; ++y) {
    for (int x = 8; x < 82; ++x) {
      const auto truth = slanted_scene(bent.pose.position, *rays.through(x + 0.5, y + 0.5));
      error += std::abs(static_cast<double>(image.rgba[4 * static_cast<std::size_t>(y * 90 + x)]) -
                        truth[0]);
    }
  }
  EXPECT_LT(error / (48 * 74), 0.03);
}

TEST_F(Depth, SaysWhereItTriesFewerPlanesThanDisparityAsksFor) {
  const Take take = write(slanted(2, 2));
  const auto notes = [&](double near, double plane_px) {
    return render(take, a_view(), {{"near", near}, {"far", 7.0}, {"plane_px", plane_px}}).notes;
  };
  EXPECT_THAT(notes(3, 0.5), ::testing::Not(::testing::Contains(::testing::HasSubstr("planes"))));
  EXPECT_THAT(notes(0.13, 0.1), ::testing::Contains(::testing::ContainsRegex(
                                    "depth: 0.1 pixels .* up to [0-9]+ planes .*; 256 are tried")));
}

TEST_F(Depth, SaysWhatItLacks) {
  SyntheticTake settings = slanted(2, 2);
  settings.depth_range = DepthRange{};
  const Take take = write(settings);
  EXPECT_THROW(render(take, a_view()), Error);
  EXPECT_THROW(render(take, a_view(), {{"near", 7.0}, {"far", 3.0}}), Error);
  EXPECT_GT(mean_alpha(render(take, a_view(), {{"near", 3.0}, {"far", 7.0}})), 0.9);
}

}  // namespace
}  // namespace raystage
