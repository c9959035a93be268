// SPDX-License-Identifier: Apache-2.0
#include "render/hull/visual_hull.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <Eigen/Geometry>
#include <cmath>
#include <fstream>
#include <iterator>
#include <numbers>
#include <optional>

#include "base/error.h"
#include "base/transfer_function.h"
#include "render/common/ray_cells.h"
#include "render/hull/hull_surface.h"
#include "render/renderer.h"
#include "store/jpeg/encode.h"
#include "testing/render/synthetic_take.h"
#include "testing/render/test_matte.h"
#include "testing/test_folder.h"

namespace raystage::render {
namespace {

using Eigen::Vector3d;
using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr double kDegree = std::numbers::pi / 180, kRadius = 0.5;
const Vector3d kMiddle(0, 0.1, -3);

/// Returns the metres along a ray (unit direction) to the sphere at the centre of the cameras.
std::optional<double> sphere_hit(const Vector3d& eye, const Vector3d& direction) {
  const Vector3d to_middle = kMiddle - eye;
  const double along = to_middle.dot(direction);
  const double squared = kRadius * kRadius - (to_middle - along * direction).squaredNorm();
  if (squared < 0) return std::nullopt;
  return along - std::sqrt(squared);
}

rig::Pose around(double turn_degrees, double rise_degrees, double distance) {
  rig::Pose pose;
  pose.world_from_camera_rotation = (Eigen::AngleAxisd(turn_degrees * kDegree, Vector3d::UnitY()) *
                                     Eigen::AngleAxisd(-rise_degrees * kDegree, Vector3d::UnitX()))
                                        .toRotationMatrix();
  pose.position = kMiddle + distance * pose.world_from_camera_rotation.col(2);
  return pose;
}

std::vector<schemas::CameraGeometry> cameras_around(int width, int height,
                                                    const schemas::Distortion& distortion = {
                                                        -0.15, 0.02, 0, 0, 0}) {
  std::vector<schemas::CameraGeometry> cameras;
  const auto add = [&](double turn, double rise) {
    schemas::CameraGeometry camera =
        testing::camera_grid(1, 1, 1, width, height, distortion).front();
    camera.id = "c" + std::to_string(cameras.size());
    camera.world_from_camera = rig::matrix_from_pose(around(turn, rise, 2.5));
    camera.row.reset();
    camera.column.reset();
    cameras.push_back(camera);
  };
  for (int i = 0; i < 16; ++i) add(22.5 * i, 3.0 * (i % 2));
  for (int i = 0; i < 6; ++i) add(60.0 * i, 45);
  for (int i = 0; i < 6; ++i) add(60.0 * i + 30, -45);
  return cameras;
}

class VisualHull : public ::testing::Test {
 protected:
  /// Writes a take of the sphere in `cameras`, with a matte for each.
  void write(const std::vector<schemas::CameraGeometry>& cameras) {
    schemas::TakeDocument take;
    take.name = "sphere";
    take.created_by = "test";
    take.nominal_fps = 15;
    take.color_space = "srgb_texture";
    schemas::RigDocument rig;
    rig.name = "around";
    for (const schemas::CameraGeometry& camera : cameras) {
      take.cameras.push_back({camera.id, "", "", ""});
      rig.cameras.push_back({camera, {}});
    }
    store::TakeWriter writer(folder(), take, rig);
    for (std::size_t i = 0; i < cameras.size(); ++i) {
      const schemas::CameraGeometry& camera = cameras[i];
      const rig::CameraModel model(camera);
      const rig::Pose pose = rig::pose_from_matrix(camera.world_from_camera);
      store::RgbImage picture{camera.width, camera.height, std::vector<std::uint8_t>()};
      std::vector<std::uint8_t> matte;
      for (int y = 0; y < camera.height; ++y) {
        for (int x = 0; x < camera.width; ++x) {
          std::optional<double> hit;
          Vector3d direction = Vector3d::Zero();
          if (const auto ray = model.unproject({x + 0.5, y + 0.5})) {
            direction = (pose.world_from_camera_rotation * *ray).normalized();
            hit = sphere_hit(pose.position, direction);
          }
          matte.push_back(hit ? 255 : 0);
          for (const double linear : colour(pose.position, direction, hit)) {
            picture.values.push_back(
                static_cast<std::uint8_t>(srgb_from_linear(linear) * 255 + 0.5));
          }
        }
      }
      writer.archive(static_cast<int>(i)).append(store::encode_jpeg(picture, {}), 0);
      mattes_.push_back(std::move(matte));
    }
    writer.commit();
    for (std::size_t i = 0; i < cameras.size(); ++i) {
      write_matte(cameras[i].id, cameras[i].width, cameras[i].height, mattes_[i]);
    }
  }
  void write_matte(const std::string& camera, int width, int height,
                   const std::vector<std::uint8_t>& codes) const {
    testing::write_matte(folder(), camera, 0, width, height, codes);
  }
  static std::array<double, 3> colour(const Vector3d& eye, const Vector3d& direction,
                                      const std::optional<double>& hit) {
    if (!hit) return {0.1, 0.8, 0.1};  // a green screen
    const Vector3d point = eye + *hit * direction;
    return testing::painted_plane(point.x() + point.z(), point.y());
  }
  RenderedView render(const VirtualCamera& view, bool reference = false,
                      const schemas::OptionValues& options = {{"nearest", 1.0}},
                      schemas::HoleFill fill = schemas::HoleFill::kNone) const {
    const store::Take take(folder());
    RendererOptions settings;
    settings.reference = reference;
    return LightFieldRenderer(take, settings)
        .render(view, store::select_frames(take, 0, 1),
                {"visual_hull", {0, 0, 0, 1}, options, fill});
  }
  std::filesystem::path folder() const { return folder_.path() / "take"; }

  testing::TestFolder folder_;
  std::vector<std::vector<std::uint8_t>> mattes_;
};

struct Agreement {
  double overlap = 0;  ///< of the silhouettes: intersection over union
  double depth = 0;    ///< mean distance of the surfaces where both are, metres
  double colour = 0;   ///< mean difference there, linear light
};

TEST_F(VisualHull, IsTheSphereThatAllCamerasSee) {
  write(cameras_around(320, 240));
  for (const auto& [turn, rise, distance] :
       {std::tuple{11.0, 10.0, 2.2}, {100.0, -20.0, 3.5}, {215.0, 30.0, 1.8}}) {
    const VirtualCamera view =
        virtual_camera_with_fov(240, 200, 40 * kDegree, around(turn, rise, distance));
    const RenderedView image = render(view);
    int both = 0, either = 0;
    Agreement found;
    for (int y = 0; y < view.height; ++y) {
      for (int x = 0; x < view.width; ++x) {
        const Vector3d direction =
            (world_ray_from_pixel(view) * Vector3d(x + 0.5, y + 0.5, 1)).normalized();
        const auto hit = sphere_hit(view.pose.position, direction);
        const std::size_t at = static_cast<std::size_t>(y * view.width + x);
        const bool shown = image.rgba[at * 4 + 3] > 0.5F;
        both += hit && shown ? 1 : 0;
        either += hit || shown ? 1 : 0;
        EXPECT_EQ(std::isfinite(image.z[at]), image.rgba[at * 4 + 3] > 0);
        if (!hit || !shown) continue;
        const double cosine = direction.dot(view.pose.viewing_direction());
        found.depth += std::abs(double{image.z[at]} / cosine - *hit);
        const auto truth = colour(view.pose.position, direction, hit);
        for (std::size_t c = 0; c < 3; ++c) {
          found.colour += std::abs(double{image.rgba[at * 4 + c]} - truth[c]) / 3;
        }
      }
    }
    EXPECT_GT(static_cast<double>(both) / either, 0.97) << turn;
    EXPECT_LT(found.depth / both, 0.02) << turn;
    EXPECT_LT(found.colour / both, 0.03) << turn;
  }
}

TEST_F(VisualHull, AgreesWithTheReference) {
  // With a lens the tolerance is half a pixel larger: the fast implementation removes its
  // distortion beforehand, the reference at every point.
  for (const auto& [distortion, tolerance] : {std::pair{schemas::Distortion{}, 0.03F},
                                              {schemas::Distortion{-0.15, 0.02, 0, 0, 0}, 0.08F}}) {
    std::filesystem::remove_all(folder());
    mattes_.clear();
    write(cameras_around(160, 120, distortion));  // a matte's pixel is 19 mm wide at the sphere
    const VirtualCamera view = virtual_camera_with_fov(60, 50, 40 * kDegree, around(33, 15, 2));
    const RenderedView fast = render(view), reference = render(view, true);
    int both = 0, one = 0, apart = 0;
    for (std::size_t i = 0; i < fast.coverage.size(); ++i) {
      const bool in_fast = std::isfinite(fast.z[i]), in_reference = std::isfinite(reference.z[i]);
      one += in_fast != in_reference ? 1 : 0;
      if (!in_fast || !in_reference) continue;
      ++both;
      apart += std::abs(fast.z[i] - reference.z[i]) > tolerance ? 1 : 0;
    }
    EXPECT_GT(both, 500);
    EXPECT_LT(one, both / 30);
    EXPECT_LT(apart, both / 30);
  }
}

TEST_F(VisualHull, AFillPaintsNothingBesideTheHull) {
  write(cameras_around(160, 120));
  // As fine as the cameras, and coarser, where each pixel is the mean of many rays.
  for (const int width : {240, 30}) {
    const VirtualCamera view =
        virtual_camera_with_fov(width, width / 3, 40 * kDegree, around(33, 15, 2));
    for (const bool reference : {false, true}) {
      if (reference && width > 30) continue;  // slow
      const RenderedView plain = render(view, reference, {{"nearest", 1.0}});
      const RenderedView filled =
          render(view, reference, {{"nearest", 1.0}}, schemas::HoleFill::kPushPull);
      int outside = 0, inside = 0;
      for (std::size_t i = 0; i < plain.coverage.size(); ++i) {
        outside += plain.rgba[i * 4 + 3] == 0 ? 1 : 0;
        inside += plain.rgba[i * 4 + 3] > 0 ? 1 : 0;
        ASSERT_NEAR(filled.rgba[i * 4 + 3], 1 - plain.empty_space[i], 1e-6) << i;
        if (plain.empty_space[i] == 1) {
          ASSERT_EQ(filled.rgba[i * 4 + 3], 0) << i;
        }
        if (plain.rgba[i * 4 + 3] == 0) {
          ASSERT_EQ(plain.empty_space[i], 1) << i;  // all of the sphere is seen
        }
      }
      EXPECT_GT(outside, 50) << width;
      EXPECT_GT(inside, 50) << width;
    }
  }
}

TEST_F(VisualHull, RaysOfAViewAreAnsweredAsTheViewShowsThem) {
  write(cameras_around(160, 120));
  const VirtualCamera view = virtual_camera_with_fov(60, 50, 40 * kDegree, around(33, 15, 2));
  std::vector<WorldRay> rays;
  for (int y = 0; y < view.height; ++y) {
    for (int x = 0; x < view.width; ++x) {
      rays.push_back({view.pose.position,
                      (world_ray_from_pixel(view) * Vector3d(x + 0.5, y + 0.5, 1)).normalized()});
    }
  }
  const store::Take take(folder());
  for (const bool reference : {false, true}) {
    RendererOptions settings;
    settings.reference = reference;
    settings.max_supersampling = 1;  // one ray per pixel
    const LightFieldRenderer renderer(take, settings);
    const store::FrameSelection frames = store::select_frames(take, 0, 1);
    // The focal plane through the sphere's centre must have no effect.
    const ReconstructionOptions by_hull{"visual_hull", {0, 0, 1, 3}, {{"nearest", 1.0}}};
    const RenderedView image = renderer.render(view, frames, by_hull);
    std::vector<RaySample> samples(rays.size());
    renderer.query(rays, frames, by_hull, samples);
    int hits = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      for (std::size_t c = 0; c < 4; ++c) {
        ASSERT_NEAR(samples[i].rgba[c], image.rgba[i * 4 + c], 2e-3) << i;
      }
      ASSERT_NEAR(samples[i].coverage, image.coverage[i], 2e-3) << i;
      ASSERT_EQ(std::isfinite(samples[i].depth), std::isfinite(image.z[i])) << i;
      if (!std::isfinite(image.z[i])) continue;
      ++hits;
      const double cosine = rays[i].direction.dot(view.pose.viewing_direction());
      ASSERT_NEAR(double{samples[i].depth} * cosine, double{image.z[i]}, 1e-3) << i;
    }
    EXPECT_GT(hits, 500);
    EXPECT_LT(hits, 2500);  // of 3000: the others miss it
  }
}

TEST_F(VisualHull, ACameraWithoutMatteDoesNotCarveAndABlackOneCarvesAllItSees) {
  const auto cameras = cameras_around(160, 120);
  write(cameras);
  const VirtualCamera view = virtual_camera_with_fov(60, 50, 40 * kDegree, around(11, 5, 2));
  const auto shown = [](const RenderedView& image) {
    int count = 0;
    for (std::size_t i = 3; i < image.rgba.size(); i += 4) count += image.rgba[i] > 0 ? 1 : 0;
    return count;
  };
  const int all = shown(render(view));
  std::filesystem::remove(folder() / "mattes" / "c4" / "000000.png");
  EXPECT_GE(shown(render(view)), all);
  write_matte("c4", 160, 120, std::vector<std::uint8_t>(160 * 120, 0));
  EXPECT_EQ(shown(render(view)), 0);
  std::filesystem::remove_all(folder() / "mattes");
  EXPECT_THROW(render(view), Error);
}

TEST_F(VisualHull, MattesAreCountedAsPicturesAreNotAsInstants) {
  testing::SyntheticTake settings;
  settings.cameras = testing::camera_grid(1, 2, 0.1, 32, 24);
  settings.frames = 3;
  settings.absent = {{0, 1}};
  testing::write_synthetic_take(settings, folder());
  const store::Take take(folder());
  for (const schemas::CameraGeometry& camera : settings.cameras) {
    for (int frame = 0; frame < 3; ++frame) {
      testing::write_matte(folder(), camera.id, frame, 32, 24,
                           std::vector<std::uint8_t>(32 * 24, 255));
    }
  }
  const Method& method = visual_hull_method();
  const store::FrameSelection third =
      store::select_frames(take, 2 * kNanosecondsPerSecond / 15, 10'000'000);
  const auto matte = [&](std::size_t camera, const char* file) {
    return folder() / "mattes" / settings.cameras[camera].id / file;
  };
  EXPECT_THAT(method.input_files(MethodOptions(method.options(), {}, "visual_hull"), take, third),
              ::testing::ElementsAre(matte(0, "000001.png"), matte(1, "000002.png")));
}

TEST_F(VisualHull, CamerasWithoutMattesAreCounted) {
  write(cameras_around(160, 120));
  const VirtualCamera view = virtual_camera_with_fov(9, 9, 1, around(11, 5, 2));
  using ::testing::Contains;
  using ::testing::HasSubstr;
  EXPECT_THAT(render(view).notes, ::testing::Not(Contains(HasSubstr("have no matte"))));
  std::filesystem::remove_all(folder() / "mattes" / "c3");
  EXPECT_THAT(render(view).notes, Contains(HasSubstr("visual_hull: 1 of 28 cameras have no")));
}

TEST_F(VisualHull, MattesThatAreNoneAreRefused) {
  write(cameras_around(160, 120));
  const auto file = folder() / "mattes" / "c3" / "000000.png";
  const auto refusal = [&] {
    try {
      render(virtual_camera_with_fov(9, 9, 1, around(11, 5, 2)));
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
      return std::string(error.what());
    }
    return std::string("rendered");
  };
  // Errors name what failed, where, and what to do.
  const auto names = [&](const std::string& what) {
    return AllOf(HasSubstr(what), HasSubstr(file.string()),
                 HasSubstr("Write an 8-bit grey PNG of 160x120 pixels"));
  };
  write_matte("c3", 80, 60, std::vector<std::uint8_t>(80 * 60, 255));
  EXPECT_THAT(refusal(), names("the matte has 80x60 pixels, its camera 160x120"));
  write_matte("c3", 160, 120, mattes_[3]);
  EXPECT_EQ(refusal(), "rendered");
  std::string whole;
  {
    std::ifstream in(file, std::ios::binary);
    whole.assign(std::istreambuf_iterator<char>(in), {});
  }
  std::string turned = whole;  // a changed byte: the checksum does not match
  turned[whole.size() / 2] = static_cast<char>(~turned[whole.size() / 2]);
  for (const std::string& content :
       {std::string(), std::string("no picture at all"), whole.substr(0, 20),
        whole.substr(0, whole.size() / 2), turned, whole.substr(1)}) {
    SCOPED_TRACE(content.size());
    std::ofstream(file, std::ios::binary | std::ios::trunc) << content;
    EXPECT_THAT(refusal(), names("the matte cannot be read: "));
  }
  std::filesystem::remove(file);
  std::filesystem::create_directory(file);
  EXPECT_THAT(refusal(), names("the matte cannot be read: "));
  std::filesystem::remove_all(folder() / "mattes");
  EXPECT_THAT(refusal(), AllOf(HasSubstr("no camera has a matte at this instant"),
                               HasSubstr((folder() / "mattes").string()),
                               HasSubstr("docs/formats/mattes.md")));
}

TEST_F(VisualHull, SameBytesForAnyNumberOfThreads) {
  write(cameras_around(160, 120));
  const VirtualCamera view = virtual_camera_with_fov(150, 100, 40 * kDegree, around(33, 15, 2));
  std::vector<RenderedView> images;
  for (const std::size_t threads : {1, 2, 5}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    images.push_back(render(view));
  }
  EXPECT_EQ(images[0].rgba, images[1].rgba);
  EXPECT_EQ(images[0].rgba, images[2].rgba);
  EXPECT_EQ(images[0].z, images[2].z);
}

TEST(Carving, KeepsWhatNoCameraSeesOfARayButShowsOnlyWhatOneDoes) {
  schemas::RigDocument document;
  for (const schemas::CameraGeometry& camera : testing::camera_grid(1, 2, 0.5, 100, 100)) {
    document.cameras.push_back({camera, {}});
  }
  const rig::Rig rig = rig::rig_from_document(document);
  // The left matte is all foreground. Of the right one only the left half is, so what is left of x
  // = 0.25.
  std::vector<std::uint8_t> all(100 * 100, 255), left_half = all;
  for (std::size_t i = 0; i < left_half.size(); ++i) left_half[i] = i % 100 < 50 ? 255 : 0;
  const std::vector<Silhouette> silhouettes{
      {0, std::make_shared<const Matte>(rig.cameras[0].model, all, 0.5)},
      {1, std::make_shared<const Matte>(rig.cameras[1].model, left_half, 0.5)}};
  const double tangent = std::tan(31 * kDegree);
  const std::vector<WorldRay> rays{
      {{-0.25, 0, 0}, -Vector3d::UnitZ()},  // the left camera's axis: seen from the start
      {{0.3, 0, 0}, -Vector3d::UnitZ()},   // enters the image of the right camera in its background
      {{-2, 0, -0.5}, Vector3d::UnitX()},  // across: enters at the left camera's border
      {{0, 0, 1}, Vector3d::UnitZ()},      // behind the cameras
      {{0, 0, 2}, -Vector3d::UnitZ()}};    // from behind: starts at the plane of the cameras
  for (const RaySurface& surface : {hull_surface(rig, silhouettes, 1, 0.01),
                                    hull_surface_reference(rig, silhouettes, 1, 0.01, 40000)}) {
    std::vector<double> inverse(rays.size());
    surface(rays, inverse);
    EXPECT_NEAR(1 / inverse[0], 0.01, 1e-6);
    // Before the right camera sees the ray at z = -0.05 / tangent the left one does not either.
    EXPECT_TRUE(std::isnan(inverse[1])) << 1 / inverse[1];
    EXPECT_NEAR(1 / inverse[2], 1.75 - 0.5 * tangent, 0.02);
    EXPECT_TRUE(std::isnan(inverse[3]));
    EXPECT_NEAR(1 / inverse[4], 2 + 0.25 / tangent, 0.03);
  }
  // Seen from afar, everything that the cameras see is within a ten millionth of the inverse
  // distances.
  const std::vector<WorldRay> from_afar{{{0, 0, 1e6}, -Vector3d::UnitZ()}};
  double inverse = 0;
  hull_surface(rig, silhouettes, 1, 0.1)(from_afar, {&inverse, 1});
  EXPECT_NEAR(1 / inverse, 1e6 + 0.25 / tangent, 0.03);
}

}  // namespace
}  // namespace raystage::render
