// SPDX-License-Identifier: Apache-2.0
// Tests the import of arrays of other programs with pictures and movies that are found by the
// cameras' ids.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "base/contained_path.h"
#include "base/error.h"
#include "ingest/import_source.h"
#include "ingest/import_take.h"
#include "store/take.h"
#include "testing/ingest/import_test_data.h"
#include "testing/ingest/test_movie.h"
#include "testing/test_folder.h"

namespace raystage::ingest::array_import_test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr int kWidth = 48, kHeight = 40;

class ArrayImport : public ::testing::Test {
 protected:
  void write(const fs::path& file, std::string_view text) const {
    create_folder((folder_.path() / file).parent_path());
    write_file_atomically(folder_.path() / file, text);
  }
  void write_jpeg(const fs::path& file, int seed = 1) const {
    write(file, testing::jpeg_as_string(testing::picture(kWidth, kHeight, seed)));
  }
  void write_test_movie(const fs::path& file, int frames) const {
    create_folder((folder_.path() / file).parent_path());
    testing::write_movie(folder_.path() / file,
                         {.width = kWidth, .height = kHeight, .frames = frames});
  }
  /// Writes a rig of facebook360_dep whose cameras look outwards.
  void write_rig(const fs::path& file, int cameras) const {
    json document;
    for (int i = 0; i < cameras; ++i) {
      const double side = i % 2 == 0 ? -1 : 1;
      document["cameras"].push_back({{"version", 1},
                                     {"type", "FTHETA"},
                                     {"id", fmt::format("cam{}", i)},
                                     {"origin", {0.1 * i, 0, 0.3 * side}},
                                     {"right", {-side, 0, 0}},
                                     {"up", {0, 1, 0}},
                                     {"forward", {0, 0, side}},
                                     {"resolution", {kWidth, kHeight}},
                                     {"focal", {15, -15}},
                                     {"fov", 1.5}});
    }
    write(file, document.dump());
  }
  void write_google_models(int cameras) const {
    json document = json::array();
    for (int i = 1; i <= cameras; ++i) {
      document.push_back({{"name", fmt::format("camera_{:04}", i)},
                          {"width", double{kWidth}},
                          {"height", double{kHeight}},
                          {"focal_length", 20.5},
                          {"principal_point", {24, 20}},
                          {"radial_distortion", {0.01, -0.002, 0.0}},
                          {"orientation", {0.3, -1.2, 0.4}},
                          {"position", {0.1 * i, 0, 0}},
                          {"projection_type", "fisheye"}});
    }
    write("models.json", document.dump());
  }
  ImportSource open(const fs::path& path, const ModelImportOptions& options = {}) const {
    return open_import_source(folder_.path() / path, options);
  }
  std::string refusal(const fs::path& path, const ModelImportOptions& options = {}) const {
    try {
      const ImportSource source = open(path, options);
      import_take(source.manifest, source.base, folder_.path() / "refused", {});
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
      EXPECT_FALSE(error.what_to_do().empty());
      return error.what();
    }
    return "accepted";
  }
  /// Imports and returns the times of the frames of each camera.
  std::vector<std::vector<Nanoseconds>> imported_times(const ImportSource& source) const {
    const fs::path folder = folder_.path() / "take";
    fs::remove_all(folder);
    import_take(source.manifest, source.base, folder, {});
    const store::Take take(folder);
    std::vector<std::vector<Nanoseconds>> times;
    for (int camera = 0; camera < take.camera_count(); ++camera) {
      times.emplace_back();
      for (const auto& frame : take.archive(camera).frames()) times.back().push_back(frame.time_ns);
    }
    return times;
  }
  testing::TestFolder folder_;
};

TEST_F(ArrayImport, PicturesAreFoundInTheUsualFolders) {
  for (const char* place : {"", "color", "video/color"}) {
    fs::remove_all(folder_.path() / "p");
    write_rig("p/rig.json", 2);
    for (const char* file : {"cam0/000000.jpg", "cam0/000001.jpg", "cam1/000001.jpg"}) {
      write_jpeg(fs::path("p") / place / file);
    }
    write("p/color/cam0/notes.txt", "no picture");
    const ImportSource source =
        open(*place == '\0' ? "p" : "p/rig.json", {.images = {}, .nominal_fps = 10.0});
    EXPECT_FALSE(source.manifest.arbitrary_scale);
    // The second camera lacks the first frame.
    EXPECT_THAT(imported_times(source),
                ElementsAre(ElementsAre(0, 100'000'000), ElementsAre(100'000'000)));
  }
  const store::Take take(folder_.path() / "take");
  EXPECT_EQ(take.rig().cameras[1].model.intrinsics().projection, schemas::Projection::kFtheta);
  EXPECT_EQ(take.rig().cameras[1].model.intrinsics().half_angle, 1.5);
}

TEST_F(ArrayImport, ProjectsKeepTheirRigsInAFolderOfTheirOwn) {
  write_rig("project/rigs/rig_calibrated.json", 1);
  write_jpeg("project/video/color/cam0/000007.jpg");
  EXPECT_THAT(imported_times(open("project/rigs/rig_calibrated.json")),
              ElementsAre(ElementsAre(0)));
}

TEST_F(ArrayImport, PicturesMayBeNamedOtherwiseOrElsewhere) {
  write_rig("rig.json", 1);
  write_jpeg("elsewhere/cam0/frame_10.jpg");
  write_jpeg("elsewhere/cam0/frame_2.JPG");
  EXPECT_THAT(imported_times(open("rig.json",
                                  {.images = folder_.path() / "elsewhere", .nominal_fps = 1000.0})),
              ElementsAre(ElementsAre(0, 1'000'000)));
  write_jpeg("stills/cam0.jpg");
  EXPECT_THAT(imported_times(open("rig.json", {.images = folder_.path() / "stills"})),
              ElementsAre(ElementsAre(0)));
}

TEST_F(ArrayImport, MoviesHaveTheirOwnRate) {
  write_google_models(2);
  write_test_movie("camera_0001.mkv", 3);
  write_test_movie("camera_0002.mkv", 4);
  const ImportSource source = open("");
  EXPECT_GT(source.manifest.nominal_fps, 0);
  const auto frame = [&](int i) {
    return static_cast<Nanoseconds>(std::llround(i * 1e9 / source.manifest.nominal_fps));
  };
  EXPECT_THAT(imported_times(source), ElementsAre(ElementsAre(0, frame(1), frame(2)),
                                                  ElementsAre(0, frame(1), frame(2), frame(3))));
  EXPECT_THAT(imported_times(open("models.json", {.images = {}, .nominal_fps = 50.0})),
              ElementsAre(ElementsAre(0, 20'000'000, 40'000'000),
                          ElementsAre(0, 20'000'000, 40'000'000, 60'000'000)));
  // A manifest can say the same.
  const auto again = schemas::parse_import_manifest(
      schemas::format_import_manifest(source.manifest), "import.json");
  EXPECT_EQ(again.cameras[1].movie, source.manifest.cameras[1].movie);
  EXPECT_TRUE(again.cameras[1].times_ns.empty());
}

TEST_F(ArrayImport, ARigNeedsNoPictures) {
  write_rig("rig.json", 3);
  const ImportSource source = open("rig.json", {.images = {}, .has_pictures = false});
  const schemas::RigDocument rig = rig_of(source.manifest);
  ASSERT_EQ(rig.cameras.size(), 3u);
  EXPECT_EQ(schemas::parse_rig(schemas::format_rig(rig), "rig.json").cameras[2].geometry,
            rig.cameras[2].geometry);
}

TEST_F(ArrayImport, OtherModelsAreFoundNextToARigOfOurs) {
  write_google_models(1);
  write_jpeg("camera_0001.jpg");
  schemas::write_rig(rig_of(open("models.json").manifest), folder_.path() / "rig.json");
  EXPECT_EQ(open("").manifest.cameras.at(0).geometry.id, "camera_0001");
  EXPECT_THAT(refusal("rig.json"), HasSubstr("rig.json#/schema"));
}

TEST_F(ArrayImport, MissingPicturesAreRefusedAtTheCamera) {
  write_rig("rig.json", 2);
  EXPECT_THAT(refusal("rig.json"),
              AllOf(HasSubstr("rig.json#/cameras/0"), HasSubstr("camera \"cam0\" has no pictures"),
                    HasSubstr("folder of the pictures")));
  write_jpeg("color/cam0/0.jpg");
  EXPECT_THAT(refusal("rig.json"), AllOf(HasSubstr("rig.json#/cameras/1"),
                                         HasSubstr("camera \"cam1\" has no pictures")));
  create_folder(folder_.path() / "color" / "cam1");
  EXPECT_THAT(refusal("rig.json"), HasSubstr("rig.json#/cameras/1"));
  write_google_models(2);
  write_test_movie("camera_0001.mkv", 1);
  EXPECT_THAT(refusal("models.json"),
              AllOf(HasSubstr("models.json#/1"), HasSubstr("camera_0002.mp4")));
}

TEST_F(ArrayImport, HostileFoldersAreRefused) {
  write_rig("rig.json", 1);
  write_jpeg("secret.jpg");
  create_folder(folder_.path() / "cam0");
  fs::create_symlink("../secret.jpg", folder_.path() / "cam0" / "0.jpg");
  EXPECT_THAT(refusal("rig.json"), HasSubstr("cam0/0.jpg"));
  fs::remove_all(folder_.path() / "cam0");
  write_jpeg("other/0.jpg");
  fs::create_directory_symlink("other", folder_.path() / "cam0");
  EXPECT_THAT(refusal("rig.json"), HasSubstr("cam0/0.jpg"));
  fs::remove(folder_.path() / "cam0");
  fs::create_symlink("secret.jpg", folder_.path() / "cam0.jpg");
  EXPECT_THAT(refusal("rig.json"), HasSubstr("cam0.jpg"));
}

TEST_F(ArrayImport, FramesThatContradictAreRefused) {
  write_rig("rig.json", 1);
  write_jpeg("cam0/0.jpg");
  write_jpeg("cam0/000.jpeg");
  EXPECT_THAT(refusal("rig.json"), HasSubstr("it is frame 0, as"));
  fs::remove(folder_.path() / "cam0" / "000.jpeg");
  write_jpeg("cam0/999999999999999.jpg");
  EXPECT_THAT(refusal("rig.json"), HasSubstr("104 days"));
  fs::remove(folder_.path() / "cam0" / "999999999999999.jpg");
  write("cam0/1.jpg", testing::jpeg_as_string(testing::picture(40, 40, 1)));
  EXPECT_THAT(refusal("rig.json"), AllOf(HasSubstr("cam0/1.jpg"), HasSubstr("40")));
  EXPECT_FALSE(fs::exists(folder_.path() / "refused"));
}

}  // namespace
}  // namespace raystage::ingest::array_import_test
