// SPDX-License-Identifier: Apache-2.0
// Exported models as COLMAP and our own import read them.
#include "exports/export_model.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>

#include "base/error.h"
#include "exports/resample_lens.h"
#include "store/jpeg/decode.h"
#include "testing/exports/export_test_data.h"
#include "testing/render/synthetic_take.h"

namespace raystage::exports::export_model_test {
namespace {

using ::testing::ElementsAre;
using testing::ExportTake;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::output_of_program;

ModelExportOptions both(const std::filesystem::path& output) {
  ModelExportOptions options;
  options.output = output;
  for (const ModelFormat& format : model_formats()) options.formats.push_back(format.format);
  return options;
}

std::vector<ingest::ForeignRig::Camera> read_model(const ingest::RigFormat& format,
                                                   const std::filesystem::path& folder) {
  std::vector<ingest::NamedText> files;
  for (const std::string& name : format.files()) {
    files.push_back({name, read_file(folder / name)});
  }
  files.resize(format.needed_files());
  return format.parse(files, nullptr).cameras;
}

TEST(ExportModel, HasTheRigAndTheFramesOfOneInstant) {
  schemas::RigDocument rig = ExportTake::default_rig();
  rig.cameras[0].geometry.intrinsics.distortion = {-0.1, 0.02, 1e-3, -2e-3, 0.005};
  rig.cameras[2].geometry.world_from_camera = {0.8,  0, 0.6, 0.5, 0, 1, 0, -1,
                                               -0.6, 0, 0.8, 2,   0, 0, 0, 1};
  const ExportTake data(true, rig);
  const ExportReport report = export_model(data.take(), both(data.out("model")), {});
  EXPECT_EQ(report.frames(), 3);  // the first tick has all cameras
  for (const ModelFormat& format : model_formats()) {
    const auto cameras = read_model(*format.format, data.out("model") / format.folder);
    ASSERT_EQ(cameras.size(), 3);
    for (std::size_t i = 0; i < 3; ++i) {
      const schemas::CameraGeometry& read = cameras[i].geometry;
      const schemas::CameraGeometry& own = rig.cameras[i].geometry;
      EXPECT_EQ(read.id, own.id);
      EXPECT_EQ(read.intrinsics, own.intrinsics);
      for (std::size_t k = 0; k < 16; ++k) {
        EXPECT_NEAR(read.world_from_camera[k], own.world_from_camera[k], 1e-12);
      }
      const std::string jpeg = read_file(data.out("model") / "images" / (own.id + ".jpg"));
      const auto expected = ExportTake::jpeg(static_cast<int>(i), 0);
      EXPECT_TRUE(std::equal(jpeg.begin(), jpeg.end(), expected.begin(), expected.end(),
                             [](char a, std::byte b) { return std::byte(a) == b; }));
    }
  }
}

TEST(ExportModel, AbsentCamerasAreLeftOut) {
  const ExportTake data;
  ModelExportOptions options = both(data.out("model"));
  options.frame = 4;  // tick 3, which c1 lacks
  const ExportReport report = export_model(data.take(), options, {});
  EXPECT_EQ(report.frames(), 2);
  const auto cameras = read_model(*options.formats[1], data.out("model"));
  ASSERT_EQ(cameras.size(), 2);
  EXPECT_EQ(cameras[1].geometry.id, "c2");
  EXPECT_FALSE(std::filesystem::exists(data.out("model") / "images" / "c1.jpg"));
  data.rot(0, 0);
  options.frame = 1;
  options.output = data.out("rotten");
  EXPECT_EQ(export_model(data.take(), options, {}).exit_code(), ExitCode::kFellShort);
  options.frame = 99;
  options.output = data.out("none");
  EXPECT_THROW(export_model(data.take(), options, {}), Error);
  EXPECT_FALSE(std::filesystem::exists(options.output));
}

TEST(ExportModel, LensesThatNoFormatHoldsAreResampled) {
  schemas::RigDocument rig = ExportTake::default_rig();
  for (int i = 0; i < 3; ++i) {
    schemas::Intrinsics& lens = rig.cameras[i].geometry.intrinsics;
    lens = {20, 20, 24.25, 15.75, {}};
    lens.projection = i == 0 ? schemas::Projection::kFtheta : schemas::Projection::kEquisolid;
    lens.radial_distortion = {0.01, 0, 0, 0};
  }
  const ExportTake data(true, rig);
  const ExportReport report = export_model(data.take(), both(data.out("model")), {});
  EXPECT_THAT(
      report.notes,
      ::testing::Contains("the images of 2 cameras were resampled to fisheyes without distortion"));
  const auto cameras = read_model(*model_formats()[0].format, data.out("model") / "sparse" / "0");
  EXPECT_EQ(cameras[0].geometry.intrinsics.radial_distortion[0], 0.01);  // as it is
  EXPECT_EQ(cameras[1].geometry.intrinsics.radial_distortion[0], 0);
  EXPECT_EQ(cameras[1].geometry.intrinsics.projection, schemas::Projection::kFisheye);

  ModelExportOptions options = both(data.out("pinholes"));
  options.undistorts = true;
  export_model(data.take(), options, {});
  EXPECT_THAT(read_file(data.out("pinholes") / "sparse" / "0" / "cameras.txt"),
              Not(HasSubstr("FISHEYE")));
  const auto pinholes = read_model(*model_formats()[1].format, data.out("pinholes"));
  const store::RgbImage picture = store::JpegDecoder().decode(
      testing::bytes_of(data.out("pinholes") / "images" / "c1.jpg"), "c1");
  EXPECT_EQ(picture.width, pinholes[1].geometry.width);
  EXPECT_EQ(picture.height, pinholes[1].geometry.height);
}

/// A picture whose codes say where the ray of each pixel points.
store::RgbImage direction_picture(const rig::CameraModel& model) {
  store::RgbImage picture(model.width(), model.height());
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x) {
      const auto ray = model.unproject({x + 0.5, y + 0.5});
      if (!ray) continue;
      const Eigen::Vector3d unit = ray->normalized();
      for (int c = 0; c < 3; ++c) {
        picture.at(x, y, c) = static_cast<std::uint8_t>(std::lround(127.5 + 100 * unit[c]));
      }
    }
  }
  return picture;
}

TEST(ResampleLens, RaysKeepTheirColours) {
  schemas::CameraGeometry geometry;
  geometry.id = "c";
  geometry.width = 160;
  geometry.height = 120;
  geometry.intrinsics = {60, 61, 82, 58, {}};
  geometry.intrinsics.projection = schemas::Projection::kOrthographic;
  const rig::CameraModel from(geometry);
  schemas::CameraGeometry other = geometry;
  other.intrinsics = {70, 70, 80, 60, {}};
  for (const auto projection : {schemas::Projection::kPinhole, schemas::Projection::kFisheye}) {
    other.intrinsics.projection = projection;
    const rig::CameraModel to(other);
    const store::RgbImage resampled = resample_lens(direction_picture(from), from, to);
    const store::RgbImage expected = direction_picture(to);
    int compared = 0;
    for (int y = 0; y < expected.height; ++y) {
      for (int x = 0; x < expected.width; ++x) {
        const auto pixel = from.project(*to.unproject({x + 0.5, y + 0.5}));
        const bool is_inside = pixel && pixel->x() > 1 && pixel->y() > 1 &&
                               pixel->x() < from.width() - 1 && pixel->y() < from.height() - 1 &&
                               (*pixel - Eigen::Vector2d(82, 58)).norm() < 55;
        if (!is_inside) continue;
        ++compared;
        for (int c = 0; c < 3; ++c) {
          ASSERT_NEAR(resampled.at(x, y, c), expected.at(x, y, c), 2) << x << ' ' << y;
        }
      }
    }
    EXPECT_GT(compared, 4000);
  }
  // What the camera did not see is black.
  const store::RgbImage wide =
      resample_lens(store::RgbImage(160, 120, 200), from, rig::CameraModel([&] {
                      schemas::CameraGeometry g = other;
                      g.intrinsics.fx = g.intrinsics.fy = 20;
                      return g;
                    }()));
  EXPECT_EQ(wide.at(0, 0, 0), 0);
  EXPECT_EQ(wide.at(80, 60, 0), 200);
}

TEST(ExportModel, ColmapTriangulatesWithThePoses) {
  testing::SyntheticTake scene;
  scene.cameras = testing::camera_grid(2, 3, 0.3, 400, 300);
  // A textured plane that SIFT finds features on: random blots of 4 cm.
  scene.scene = [](const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) {
    const double t = (-4 - origin.z()) / direction.z();
    const Eigen::Vector3d at = origin + t * direction;
    const auto i = static_cast<std::int64_t>(std::floor(at.x() / 0.08)),
               j = static_cast<std::int64_t>(std::floor(at.y() / 0.08));
    std::uint64_t hash =
        static_cast<std::uint64_t>(i * 73856093) ^ static_cast<std::uint64_t>(j * 19349663);
    hash = (hash ^ (hash >> 13)) * 0x9E3779B97F4A7C15ULL;
    const double value = 0.05 + 0.9 * static_cast<double>(hash >> 40) / (1 << 24);
    return std::array<double, 3>{value, value, value};
  };
  scene.samples = 3;
  const testing::TestFolder folder;
  write_synthetic_take(scene, folder.path() / "take");
  ModelExportOptions options = both(folder.path() / "model");
  export_model(store::Take(folder.path() / "take"), options, {});
  const std::filesystem::path model = options.output;
  const std::string database = (folder.path() / "database.db").string();
  ::setenv("QT_QPA_PLATFORM", "offscreen", 1);
  EXPECT_THAT(
      output_of_program({"colmap", "model_analyzer", "--path", (model / "sparse/0").string()}),
      HasSubstr("Registered images: 6"));
  output_of_program({"colmap", "feature_extractor", "--database_path", database, "--image_path",
                     (model / "images").string(), "--SiftExtraction.use_gpu", "0",
                     "--SiftExtraction.num_threads", "1", "--SiftExtraction.max_num_features",
                     "800"});
  output_of_program(
      {"colmap", "exhaustive_matcher", "--database_path", database, "--SiftMatching.use_gpu", "0"});
  std::filesystem::create_directory(folder.path() / "points");
  output_of_program({"colmap", "point_triangulator", "--database_path", database, "--image_path",
                     (model / "images").string(), "--input_path", (model / "sparse/0").string(),
                     "--output_path", (folder.path() / "points").string()});
  output_of_program({"colmap", "model_converter", "--input_path",
                     (folder.path() / "points").string(), "--output_path",
                     (folder.path() / "points").string(), "--output_type", "TXT"});
  // The points are on the plane, in our world and its unit.
  std::vector<double> errors;  // metres
  for (const std::string& line :
       testing::lines_of(read_file(folder.path() / "points" / "points3D.txt"))) {
    if (line.starts_with('#')) continue;
    std::istringstream stream(line);
    double id = 0, x = 0, y = 0, z = 0;
    stream >> id >> x >> y >> z;
    errors.push_back(std::abs(z + 4));
  }
  ASSERT_GT(errors.size(), 200);
  std::ranges::sort(errors);
  EXPECT_LT(errors[errors.size() / 2], 0.01);
  EXPECT_LT(errors[errors.size() * 9 / 10], 0.04);
}

}  // namespace
}  // namespace raystage::exports::export_model_test
