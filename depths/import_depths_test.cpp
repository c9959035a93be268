// SPDX-License-Identifier: Apache-2.0
#include "depths/import_depths.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/atomic_file.h"
#include "base/error.h"
#include "depths/depth_image.h"
#include "images/image_file.h"
#include "render/common/image_quality.h"
#include "render/depth/depth_file.h"
#include "render/depth/imported_maps.h"
#include "store/fixity/repair.h"
#include "store/fixity/verify.h"
#include "store/imported_depths.h"
#include "store/packing/pack_temporal.h"
#include "testing/render/test_depth.h"

namespace raystage::depths {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using Document = schemas::ImportedDepthsDocument;

/// Returns the distance to the scene of DepthTest::step_edge().
double step_distance(const Eigen::Vector3d& from, const Eigen::Vector3d& direction) {
  const testing::Plane& plane =
      testing::hits_wall(from, direction) ? testing::kFront : testing::kBack;
  return plane.distance(from, direction);
}

double slanted_distance(const Eigen::Vector3d& from, const Eigen::Vector3d& direction) {
  return testing::kSlanted.distance(from, direction);
}

using Distance = double (*)(const Eigen::Vector3d&, const Eigen::Vector3d&);

/// Returns the true planar depths of a camera at a resolution, in its recorded pixels.
std::vector<float> true_depths(const rig::Rig::Camera& camera, int width, int height,
                               Distance distance = step_distance) {
  std::vector<float> z;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const auto ray = camera.model.unproject(
          {(x + 0.5) * camera.model.width() / width, (y + 0.5) * camera.model.height() / height});
      if (!ray) {
        z.push_back(0);
        continue;
      }
      const Eigen::Vector3d direction = camera.pose.world_from_camera_rotation * *ray;
      z.push_back(static_cast<float>(distance(camera.pose.position, direction) * -ray->z()));
    }
  }
  return z;
}

class ImportDepths : public testing::DepthTest {
 protected:
  fs::path maps() const { return folder_.path() / "maps"; }
  /// Writes the true depths of all cameras.
  void write_maps(const store::Take& take, bool as_png = false, int divisor = 1) const {
    for (std::size_t i = 0; i < take.rig().cameras.size(); ++i) {
      const rig::Rig::Camera& camera = take.rig().cameras[i];
      const int width = camera.model.width() / divisor, height = camera.model.height() / divisor;
      const std::vector<float> z = true_depths(camera, width, height, distance_);
      const fs::path folder = maps() / take.document().cameras[i].id;
      create_folder(folder);
      if (!as_png) {
        images::write_depth_image(width, height, z, folder / "000001.exr");
        continue;
      }
      render::InverseDepthMap map(width, height);
      std::ranges::transform(z, map.values.begin(), [](float depth) { return 1 / depth; });
      write_file_atomically(folder / "000001.png", encode_depth_png(map, kRange, "a map"));
    }
  }
  static store::Take reopened(const store::Take& take) { return store::Take(take.folder()); }
  static const schemas::Distortion& barrel() {
    static const schemas::Distortion kBarrel{-0.2, 0.05, 0.001, -0.001, 0};
    return kBarrel;
  }
  store::Take write_step(int rows, int columns, const schemas::Distortion& distortion = {}) {
    settings_ = step_edge(rows, columns);
    settings_.cameras = testing::camera_grid(rows, columns, 0.1, 96, 72, distortion);
    settings_.samples = 3;
    return write(settings_);
  }
  /// Returns the PSNR of a view by a method against the scene, dB.
  double quality(const store::Take& take, const render::ReconstructionOptions& how) const {
    schemas::CameraGeometry geometry = settings_.cameras[0];
    geometry.intrinsics.distortion = {};
    geometry.world_from_camera = settings_.cameras[0].world_from_camera;
    render::VirtualCamera view = render::virtual_camera_from_geometry(geometry);
    view.pose.position = Eigen::Vector3d(0.04, 0.03, 0);
    view.pose.world_from_camera_rotation.setIdentity();
    schemas::CameraGeometry at_view = geometry;
    at_view.world_from_camera = {1, 0, 0, 0.04, 0, 1, 0, 0.03, 0, 0, 1, 0, 0, 0, 0, 1};
    const render::RenderedView image = render_reconstruction(take, view, how, {}, 0);
    return render::compare_images(render::srgb_image(image),
                                  testing::render_camera_image(at_view, settings_),
                                  render::coverage_mask(image))
        .psnr_db;
  }
  std::string refusal(const store::Take& take, const DepthImportOptions& options = {}) const {
    try {
      import_depths(take, maps(), options, {});
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kBadInput) << error.what();
      return error.what();
    }
    return "accepted";
  }
  static std::size_t stored_maps(const store::Take& take) {
    std::size_t count = 0;
    std::error_code none;
    for (const auto& entry :
         fs::recursive_directory_iterator(take.folder() / Document::kFolder, none)) {
      if (entry.path().extension() == ".zst") ++count;
    }
    return count;
  }
  static DepthImportOptions png_options() {
    DepthImportOptions options;
    options.encoding.inverse_range = kRange;
    return options;
  }

  static constexpr schemas::DepthRange kRange{1.5, 9};
  testing::SyntheticTake settings_;
  Distance distance_ = step_distance;  ///< to the scene
};

TEST_F(ImportDepths, TrueDepthsOfASurfaceRenderAtLeastAsWellAsEstimatedOnes) {
  settings_ = slanted(3, 3, barrel());
  settings_.samples = 3;
  distance_ = slanted_distance;
  const store::Take take = write(settings_);
  const render::ReconstructionOptions depth{"depth", {0, 0, 0, 1}, {}};
  const render::ReconstructionOptions lumigraph{
      "lumigraph", {0, 0, 0, 1}, {{"proxy", std::string("depth")}}};
  const double estimated = quality(take, depth), estimated_surface = quality(take, lumigraph);
  const auto before = stored_depth_files();
  for (const bool as_png : {false, true}) {
    fs::remove_all(maps());
    write_maps(take, as_png);
    DepthImportOptions options = as_png ? png_options() : DepthImportOptions{};
    options.overwrites = as_png;
    const DepthImportReport report = import_depths(take, maps(), options, {});
    EXPECT_EQ(report.maps, 9U);
    EXPECT_EQ(report.replaced, as_png ? 9U : 0U);
    EXPECT_TRUE(report.notes.empty());
    EXPECT_EQ(stored_maps(take), 9U);
    EXPECT_GE(quality(take, depth), estimated);
    EXPECT_GE(quality(take, lumigraph), estimated_surface);
  }
  // Neither are depths estimated, nor are those that were stored touched.
  EXPECT_EQ(stored_depth_files(), before);
  EXPECT_THAT(render(take, testing::default_view()).notes,
              Contains(HasSubstr("imported depth maps")));
}

// Depths at pixel centres cut pixels at edges, of which estimation takes the surface that the
// colours agree with.
TEST_F(ImportDepths, TrueDepthsAtEdgesRenderAlmostAsWellAsEstimatedOnes) {
  const store::Take take = write_step(3, 3, barrel());
  const render::ReconstructionOptions depth{"depth", {0, 0, 0, 1}, {}};
  const double estimated = quality(take, depth);
  write_maps(take);
  import_depths(take, maps(), {}, {});
  EXPECT_GT(quality(take, depth), estimated - 1);
}

TEST_F(ImportDepths, AMapComesBackAndUnknownDepthsStayUnknown) {
  const store::Take take = write_step(1, 2);
  write_maps(take);
  std::vector<float> z = true_depths(take.rig().cameras[0], 96, 72);
  for (const std::size_t hole : {0U, 100U, 5000U}) z[hole] = std::nanf("");
  const std::string& id = take.document().cameras[0].id;
  images::write_depth_image(96, 72, z, maps() / id / "000001.exr");
  EXPECT_GT(import_depths(take, maps(), {}, {}).unknown_share, 0);
  const Document document = store::read_imported_depths(take);
  const Document::Map* entry = document.find(id, 0);
  ASSERT_NE(entry, nullptr);
  EXPECT_EQ(entry->quantity, Document::Quantity::kInverseDepth);
  EXPECT_EQ(entry->source, id + "/000001.exr");
  EXPECT_NEAR(entry->unknown_share, 3 / (96.0 * 72), 1e-9);
  EXPECT_EQ(document.imports.at(0).encoding, "EXR, channel Z, planar depth, 1 m a unit");
  const render::InverseDepthMap map = render::read_imported_map(take, 0, 0, *entry);
  for (std::size_t i = 0; i < z.size(); ++i) {
    if (std::isnan(z[i])) {
      EXPECT_EQ(map.values[i], render::kUnknownDepth);
    } else {
      ASSERT_NEAR(map.values[i], 1 / z[i], 1e-5);
    }
  }
  EXPECT_EQ(document.find(id, 1), nullptr);
  EXPECT_EQ(document.find("other", 0), nullptr);
}

TEST_F(ImportDepths, MapsOfOtherSizesAreNotBlendedAcrossEdges) {
  const store::Take take = write_step(3, 3, barrel());
  const double estimated = quality(take, {"depth", {0, 0, 0, 1}, {}});
  write_maps(take, false, 2);
  EXPECT_EQ(import_depths(take, maps(), {}, {}).maps, 9U);
  EXPECT_GT(quality(take, {"depth", {0, 0, 0, 1}, {}}), estimated - 1.5);
  const rig::CameraModel& model = take.rig().cameras[0].model;
  const render::VirtualCamera pinhole = render::undistorted(model, take.rig().cameras[0].pose);
  render::InverseDepthMap step(48, 36);
  for (int y = 0; y < 36; ++y) {
    for (int x = 0; x < 48; ++x) step.at(x, y) = x < 24 ? 0.4F : 0.2F;
  }
  const render::InverseDepthMap whole =
      render::undistorted_depths(step, render::DepthQuantity::kPlanar, model, pinhole, 0.1F);
  std::set<float> found(whole.values.begin(), whole.values.end());
  found.erase(render::kUnknownDepth);
  EXPECT_EQ(found, (std::set<float>{0.2F, 0.4F}));
}

TEST_F(ImportDepths, NamesWhatIsWrong) {
  const store::Take take = write_step(1, 2);
  const std::string id = take.document().cameras[0].id;
  create_folder(maps());
  EXPECT_THAT(refusal(take), HasSubstr("no depth maps of the take's frames"));
  write_maps(take);
  fs::rename(maps() / id, maps() / "cam7");
  EXPECT_THAT(refusal(take), AllOf(HasSubstr("no camera \"cam7\""), HasSubstr(id)));
  fs::rename(maps() / "cam7", maps() / id);
  fs::copy_file(maps() / id / "000001.exr", maps() / id / "000002.exr");
  EXPECT_THAT(refusal(take), HasSubstr("there is no frame 2"));
  fs::rename(maps() / id / "000002.exr", maps() / id / "1.exr");
  EXPECT_THAT(refusal(take), HasSubstr("are of the same frame"));
  fs::rename(maps() / id / "1.exr", maps() / id / "first.exr");
  EXPECT_THAT(refusal(take), HasSubstr("is no number from 1"));
  fs::remove(maps() / id / "first.exr");
  images::write_depth_image(96, 96, std::vector<float>(96UL * 96, 2), maps() / id / "000001.exr");
  EXPECT_THAT(refusal(take), AllOf(HasSubstr("96x96"), HasSubstr("the shapes differ")));
  for (const auto& [width, height] : {std::pair{1, 1}, std::pair{8, 6}, std::pair{95, 1}}) {
    const std::vector<float> z(static_cast<std::size_t>(width * height), 2);
    images::write_depth_image(width, height, z, maps() / id / "000001.exr");
    EXPECT_THAT(refusal(take), HasSubstr("allowed: at least 8 and a 16th"));
  }
  EXPECT_EQ(stored_maps(take), 0U);
  fs::remove_all(maps());
  fs::create_directory_symlink("/etc", (create_folder(maps()), maps() / id));
  EXPECT_THAT(refusal(take), HasSubstr("no depth maps"));
}

TEST_F(ImportDepths, ExistingMapsAreReplacedOnRequestOnly) {
  const store::Take take = write_step(1, 2);
  write_maps(take);
  import_depths(take, maps(), {}, {});
  const std::string list = read_file(take.file(Document::kFile));
  EXPECT_THAT(refusal(take), HasSubstr("has an imported depth map of frame 0 of camera"));
  EXPECT_EQ(read_file(take.file(Document::kFile)), list);
  DepthImportOptions options;
  options.overwrites = true;
  options.encoding.unit_m = 1.5;
  EXPECT_EQ(import_depths(take, maps(), options, {}).replaced, 2U);
  EXPECT_EQ(stored_maps(take), 2U);  // the old files are gone
  const Document document = store::read_imported_depths(take);
  EXPECT_EQ(document.imports.size(), 1U);
  EXPECT_THAT(document.imports[0].encoding, HasSubstr("1.5 m a unit"));
}

TEST_F(ImportDepths, OneImportAtATime) {
  const store::Take take = write_step(1, 2);
  write_maps(take);
  DepthImportOptions options;
  options.overwrites = true;
  options.progress = [&](double) {  // as if another process began now
    try {
      import_depths(take, maps(), {}, {});
      ADD_FAILURE() << "two imports at a time";
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kFailed);
      EXPECT_THAT(error.what(), AllOf(HasSubstr("another import of depth maps into this take"),
                                      HasSubstr("imported_depth"), HasSubstr("when it has ended")));
    }
  };
  EXPECT_EQ(import_depths(take, maps(), options, {}).maps, 2U);
  options.progress = [](double) {};
  EXPECT_EQ(import_depths(take, maps(), options, {}).replaced, 2U);  // the lock has ended
}

TEST_F(ImportDepths, MapsOfKilledImportsAreRemoved) {
  const store::Take take = write_step(1, 2);
  write_maps(take);
  const fs::path folder = take.folder() / Document::kFolder / take.document().cameras[0].id;
  const fs::path outside = folder_.path() / "outside.zst";
  create_folder(folder);
  schemas::write_imported_depths({}, take.folder() / Document::kFile);  // an import begins with it
  for (const char* const name : {"000000.0123456789abcdef.zst", "000007.0123456789abcdef.zst",
                                 ".000000.0123456789abcdef.zst.host.1.01.tmp.zst", "notes.txt"}) {
    write_file_atomically(folder / name, "killed");
  }
  write_file_atomically(outside, "of others");
  fs::create_symlink(outside, folder / "link.zst");
  import_depths(take, maps(), {}, {});
  const std::string kept = store::read_imported_depths(take).cameras[0].maps[0].file;
  std::set<std::string> found;
  for (const auto& entry : fs::directory_iterator(folder)) {
    found.insert(entry.path().filename().string());
  }
  EXPECT_EQ(found,
            (std::set<std::string>{fs::path(kept).filename().string(), "link.zst", "notes.txt"}));
  EXPECT_TRUE(fs::exists(outside));
}

TEST_F(ImportDepths, AListBeginsEveryImportAndIsGoneIfItFails) {
  const store::Take take = write_step(1, 2);
  write_maps(take);
  bool began = false;
  DepthImportOptions options;
  options.progress = [&](double) {  // the first map is written
    began = fs::exists(take.folder() / Document::kFile);
    throw Error::failed("the import ends", "", "");
  };
  EXPECT_THROW(import_depths(take, maps(), options, {}), Error);
  EXPECT_TRUE(began);
  EXPECT_FALSE(fs::exists(take.folder() / Document::kFile));
  EXPECT_EQ(stored_maps(take), 0U);
}

TEST_F(ImportDepths, MapsWithoutTheirListAreNeitherForgottenNorRemoved) {
  const store::Take take = write_step(1, 2);
  write_maps(take);
  import_depths(take, maps(), {}, {});
  fs::remove(take.folder() / Document::kFile);
  EXPECT_THAT(refusal(take), AllOf(HasSubstr("list of the imported depth maps is missing"),
                                   HasSubstr("repair TAKE --from COPY")));
  EXPECT_EQ(stored_maps(take), 2U);
  EXPECT_THROW(render(take, testing::default_view()), Error) << "estimated the depths";
  const auto problems = store::verify_take(take.folder(), {}).problems;
  ASSERT_EQ(problems.size(), 1U);
  EXPECT_EQ(problems[0].file, Document::kFile);
  EXPECT_THAT(problems[0].what, HasSubstr("is missing"));
}

/// Gives the frames of the first camera, which show the same, a comment each.
void make_frames_differ(const store::Take& take) {
  const auto& entry = take.document().cameras[0];
  const store::ArchiveReader& archive = take.archive(0);
  const fs::path archive_file = take.folder() / "new.mkv", journal = take.folder() / "new.journal";
  store::ArchiveWriter out(archive_file, journal, archive.description());
  for (int i = 0; i < static_cast<int>(archive.frames().size()); ++i) {
    const auto jpeg = archive.jpeg(i);
    std::vector<std::byte> bytes(jpeg.begin(), jpeg.end());
    const std::array comment{std::byte{0xff}, std::byte{0xfe}, std::byte{0}, std::byte{3},
                             static_cast<std::byte>(i)};
    bytes.insert(bytes.begin() + 2, comment.begin(), comment.end());
    out.append(bytes, archive.frames()[i].time_ns);
  }
  out.close();
  fs::rename(archive_file, take.folder() / entry.archive);
  fs::rename(journal, take.folder() / entry.journal);
}

TEST_F(ImportDepths, MapsStayWithTheirFramesWhenARepairLosesOthers) {
  settings_ = slanted(1, 2);
  settings_.frames = 4;
  make_frames_differ(write(settings_));
  const store::Take whole(folder_.path() / "take");
  const std::string id = whole.document().cameras[0].id;
  create_folder(maps() / id);
  for (int i = 1; i <= 4; ++i) {
    images::write_depth_image(96, 72, std::vector<float>(96UL * 72, static_cast<float>(1 + i)),
                              maps() / id / ("00000" + std::to_string(i) + ".exr"));
  }
  store::write_timeline(store::build_timeline(whole, 15, 0), whole);
  import_depths(whole, maps(), {}, {});
  const Document list = store::read_imported_depths(whole);
  const fs::path archive = whole.folder() / whole.document().cameras[0].archive;
  std::string bytes = read_file(archive);
  bytes[static_cast<std::size_t>(whole.archive(0).frames()[1].offset) + 40] ^= 1;
  write_file_atomically(archive, bytes);
  ASSERT_TRUE(store::repair_take(whole.folder(), {}).has_losses());

  const store::Take take(whole.folder());
  ASSERT_EQ(take.archive(0).frames().size(), 3U);
  for (const auto& [frame, before] : {std::pair{0, 0}, std::pair{1, 2}, std::pair{2, 3}}) {
    EXPECT_EQ(render::find_imported_map(list, take, 0, frame), list.find(id, before));
    EXPECT_EQ(
        render::read_imported_map(take, 0, frame, *list.find(id, before)).values[0],
        render::read_imported_map(take, 0, frame, *render::find_imported_map(list, take, 0, frame))
            .values[0]);
  }
  // The next import numbers them anew.
  fs::remove_all(maps());
  create_folder(maps() / id);
  images::write_depth_image(96, 72, std::vector<float>(96UL * 72, 9), maps() / id / "000001.exr");
  DepthImportOptions options;
  options.overwrites = true;
  options.numbers = MapNumbers::kRecorded;
  const DepthImportReport report = import_depths(take, maps(), options, {});
  EXPECT_THAT(report.notes, Contains(HasSubstr("no longer has were removed: 1")));
  const Document now = store::read_imported_depths(take);
  ASSERT_EQ(now.cameras[0].maps.size(), 3U);
  EXPECT_EQ(now.find(id, 2)->file, list.find(id, 3)->file);
}

TEST_F(ImportDepths, ImplausibleUnitsAreNoted) {
  const store::Take take = write_step(1, 2);
  write_maps(take);
  DepthImportOptions options;
  options.encoding.unit_m = 0.001;
  EXPECT_THAT(import_depths(take, maps(), options, {}).notes,
              Contains(HasSubstr("far outside of the take's depth range")));
}

// A depth of 1 mm needs steps in which 10 m become 10.7 m.
TEST_F(ImportDepths, APixelThatIsMuchTooNearLeavesTheOthersPrecise) {
  const store::Take take = write_step(1, 2);
  const std::vector<std::string> ids{take.document().cameras[0].id, take.document().cameras[1].id};
  for (const std::string& id : ids) create_folder(maps() / id);
  std::vector<float> z(96UL * 72, 10);
  std::ranges::fill_n(z.begin(), 100, 5.0F);
  z[7] = 200;
  z[8] = 0.1F;  // a near object, which is kept
  images::write_depth_image(96, 72, z, maps() / ids[1] / "000001.exr");
  z[5000] = z[5001] = 0.001F;
  images::write_depth_image(96, 72, z, maps() / ids[0] / "000001.exr");
  const DepthImportReport report = import_depths(take, maps(), {}, {});
  EXPECT_EQ(report.too_near, 2U);
  EXPECT_NEAR(report.unknown_share, 1 / (96.0 * 72), 1e-9);
  EXPECT_THAT(report.notes, ElementsAre(AllOf(HasSubstr("2 pixels of 1 of 2 maps are so near"),
                                              HasSubstr(": " + ids[0] + "/000001.exr"))));
  const Document document = store::read_imported_depths(take);
  const auto map_of = [&](int camera) {
    return render::read_imported_map(take, camera, 0,
                                     *document.find(ids[static_cast<std::size_t>(camera)], 0));
  };
  render::InverseDepthMap spoiled = map_of(0);
  for (std::size_t i = 0; i < z.size(); ++i) {
    if (i == 5000 || i == 5001) {
      EXPECT_EQ(spoiled.values[i], render::kUnknownDepth);
    } else {
      ASSERT_NEAR(spoiled.values[i], 1 / z[i], 1.25e-4) << i;  // half a step
    }
  }
  // The map without outliers has the step and the bytes that it always had.
  const render::InverseDepthMap plain = map_of(1);
  EXPECT_EQ(render::depth_step(plain), std::ldexp(1.0F, -12));
  spoiled.values[5000] = spoiled.values[5001] = plain.values[5000];
  EXPECT_EQ(spoiled.values, plain.values);
}

TEST_F(ImportDepths, CoarseStepsAreNoted) {
  const store::Take take = write_step(1, 2);
  write_maps(take);
  std::vector<float> z(96UL * 72, 5);
  std::ranges::fill_n(z.begin(), 200, 1e-4F);  // 3 %
  const std::string file = take.document().cameras[1].id + "/000001.exr";
  images::write_depth_image(96, 72, z, maps() / file);
  const DepthImportReport report = import_depths(take, maps(), {}, {});
  EXPECT_EQ(report.too_near, 0U);
  EXPECT_EQ(report.unknown_share, 0);
  EXPECT_THAT(report.notes, ElementsAre(AllOf(HasSubstr("of 1 of 2 maps are rounded by up to 1 "),
                                              HasSubstr(": " + file))));
}

TEST_F(ImportDepths, EveryInstantOfAMovingTakeHasItsOwnMaps) {
  settings_ = slanted(2, 3);
  settings_.frames = 3;
  settings_.absent = {{1, 2}};  // camera 1 has no frame at the third tick
  const store::Take take = write(settings_);
  store::write_timeline(store::build_timeline(take, 15, 0), take);
  const std::vector<double> metres{3, 4, 5};
  for (std::size_t i = 0; i < take.rig().cameras.size(); ++i) {
    const fs::path folder = maps() / take.document().cameras[i].id;
    create_folder(folder);
    for (std::size_t tick = 0; tick < metres.size(); ++tick) {
      images::write_depth_image(96, 72,
                                std::vector<float>(96UL * 72, static_cast<float>(metres[tick])),
                                folder / ("00000" + std::to_string(tick + 1) + ".exr"));
    }
  }
  const DepthImportReport report = import_depths(take, maps(), {}, {});
  EXPECT_EQ(report.maps, 17U);
  EXPECT_THAT(report.notes, Contains(HasSubstr("no frame at their time: ")));
  for (const char* const method : {"depth", "lumigraph"}) {
    render::ReconstructionOptions how{method, {0, 0, 0, 1}, {}};
    if (std::string_view(method) == "lumigraph") how.options = {{"proxy", std::string("depth")}};
    for (std::size_t tick = 0; tick < metres.size(); ++tick) {
      const render::RenderedView view =
          render_reconstruction(take, testing::default_view(), how, {}, static_cast<int>(tick));
      std::vector<float> z(view.z.begin(), view.z.end());
      std::ranges::nth_element(z, z.begin() + static_cast<std::ptrdiff_t>(z.size() / 2));
      EXPECT_NEAR(z[z.size() / 2], metres[tick] + 0.03, 0.1) << method << " " << tick;
    }
  }
  EXPECT_TRUE(stored_depth_files().empty());
}

// The pictures and the maps of the frames before and after are those of the same surface, so that
// estimated depths would be averaged.
TEST_F(ImportDepths, MapsAreNotAveragedOverTime) {
  settings_ = slanted(2, 3);
  settings_.frames = 3;  // all equal
  distance_ = slanted_distance;
  const store::Take take = write(settings_);
  write_maps(take);
  for (const auto& camera : fs::directory_iterator(maps())) {
    fs::rename(camera.path() / "000001.exr", camera.path() / "000002.exr");
  }
  DepthImportOptions options;
  options.numbers = MapNumbers::kRecorded;
  import_depths(take, maps(), options, {});
  for (const auto& camera : fs::directory_iterator(maps())) {
    fs::copy(camera.path() / "000002.exr", camera.path() / "000001.exr");
    fs::rename(camera.path() / "000002.exr", camera.path() / "000003.exr");
  }
  options.encoding.unit_m = 1.01;
  import_depths(take, maps(), options, {});
  const store::Timeline timeline = store::build_timeline(take, 15, 0);
  render::RendererOptions on_ticks;
  on_ticks.ticks = timeline.ticks;
  const auto depths = [&](bool temporal) {
    return render(take, testing::default_view(), {{"temporal", temporal}}, on_ticks, 1).z;
  };
  EXPECT_EQ(depths(true), depths(false));
}

TEST_F(ImportDepths, ADamagedMapIsAnErrorAndNotAnEstimation) {
  const store::Take take = write_step(2, 2);
  write_maps(take);
  import_depths(take, maps(), {}, {});
  const std::string& id = take.document().cameras[1].id;
  Document document = store::read_imported_depths(take);
  const fs::path file = take.folder() / Document::kFolder / document.find(id, 0)->file;
  const std::string whole = read_file(file);
  const auto failure = [&] {
    try {
      render(take, testing::default_view());
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
      return std::string(error.what());
    }
    return std::string("rendered");
  };
  EXPECT_EQ(failure(), "rendered");
  const auto problems = [&](store::VerifyDepth depth = store::VerifyDepth::kHashes) {
    store::TakeVerifyOptions options;
    options.depth = depth;
    return store::verify_take(take.folder(), options).problems;
  };
  EXPECT_TRUE(problems().empty());
  std::string flipped = whole;
  flipped[flipped.size() / 2] ^= 1;
  write_file_atomically(file, flipped);
  ASSERT_EQ(problems().size(), 1U);
  EXPECT_THAT(problems()[0].what, HasSubstr("not as it was imported"));
  EXPECT_EQ(take.folder() / problems()[0].file, file);
  write_file_atomically(file, whole.substr(0, whole.size() / 2));
  EXPECT_THAT(failure(), AllOf(HasSubstr("damaged"), HasSubstr("import the depth maps again")));
  fs::remove(file);
  EXPECT_THAT(failure(), HasSubstr(file.filename().string()));
  EXPECT_EQ(problems().size(), 1U);
  EXPECT_EQ(problems(store::VerifyDepth::kSizes).size(), 1U);
  write_file_atomically(file, whole);
  for (Document::Camera& camera : document.cameras) {
    if (camera.id == id) camera.maps[0].frame_xxh3 = std::string(16, 'a');
  }
  schemas::write_imported_depths(document, take.folder() / Document::kFile);
  EXPECT_THAT(failure(), HasSubstr("belongs to another picture than frame 0"));
  write_file_atomically(take.folder() / Document::kFile, "{}");
  ASSERT_EQ(problems().size(), 1U);
  EXPECT_EQ(problems()[0].file, Document::kFile);
}

// Encoding as video changes the pictures a little, and not what they show.
TEST_F(ImportDepths, MapsStayWithFramesThatAreEncodedAsVideo) {
  const store::Take take = write_step(2, 2);
  write_maps(take);
  import_depths(take, maps(), {}, {});
  for (const store::References references :
       {store::References::kTime, store::References::kCameras}) {
    store::TemporalOptions how;
    how.video.codec = store::VideoCodec::kHevc;
    how.references = references;
    const fs::path folder =
        take.folder().parent_path() / (references == store::References::kTime ? "time" : "cameras");
    store::pack_temporal(take, folder, how);
    const store::Take video(folder);
    EXPECT_NE(video.archive(1).jpeg_xxh3(0), take.archive(1).jpeg_xxh3(0));
    EXPECT_EQ(video.archive(1).recorded_xxh3(0), take.archive(1).jpeg_xxh3(0));
    EXPECT_THAT(render(video, testing::default_view()).notes,
                Contains(HasSubstr("imported depth maps")));
  }
}

TEST(RecordedDepths, GoToTheCameraWithoutDistortionAndBack) {
  for (const bool is_fisheye : {false, true}) {
    schemas::CameraGeometry geometry{"a", 128, 96, {}, {}, {}, {}};
    geometry.intrinsics = {60, 60, 64, 48, {-0.2, 0.05, 0, 0, 0}};
    if (is_fisheye) {
      geometry.intrinsics.distortion = {};
      geometry.intrinsics.projection = schemas::Projection::kFisheye;
    }
    const rig::CameraModel model(geometry);
    const render::DepthQuantity quantity = render::stored_quantity(model);
    EXPECT_EQ(quantity,
              is_fisheye ? render::DepthQuantity::kDistance : render::DepthQuantity::kPlanar);
    // A fronto-parallel plane at 2 m. The outer half of border pixels has the value of their
    // centres: beside a fisheye's axis, distances change by 1 % there.
    render::InverseDepthMap map(128, 96, 0.5F);
    render::convert_recorded_depths(map, model, render::DepthQuantity::kPlanar, quantity);
    const render::VirtualCamera pinhole = render::undistorted(model, {});
    const render::InverseDepthMap whole =
        render::undistorted_depths(map, quantity, model, pinhole, 0.05F);
    const auto known = std::ranges::count_if(whole.values, [](float value) { return value >= 0; });
    EXPECT_GT(known, static_cast<std::ptrdiff_t>(whole.values.size() / 3));
    for (const float value : whole.values) {
      if (value < 0) continue;
      ASSERT_NEAR(value, 0.5, is_fisheye ? 1e-2 : 2e-3);
    }
    render::InverseDepthMap back(128, 96, render::kUnknownDepth);
    render::add_recorded_depths(whole, pinhole, model, quantity, 0.05F, back);
    for (int y = 8; y < 88; ++y) {
      for (int x = 8; x < 120; ++x)
        ASSERT_NEAR(back.at(x, y), map.at(x, y), is_fisheye ? 1e-2 : 2e-3);
    }
  }
}

}  // namespace
}  // namespace raystage::depths
