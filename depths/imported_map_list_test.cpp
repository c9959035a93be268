// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <filesystem>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "base/atomic_file.h"
#include "base/error.h"
#include "depths/import_depths.h"
#include "images/image_file.h"
#include "render/depth/imported_maps.h"
#include "store/fixity/repair.h"
#include "store/fixity/verify.h"
#include "store/imported_depths.h"
#include "store/packing/pack_temporal.h"
#include "testing/depths/import_depths_test_data.h"

namespace raystage::depths {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using Document = schemas::ImportedDepthsDocument;
using ImportedMapList = testing::ImportDepths;

TEST_F(ImportedMapList, ExistingMapsAreReplacedOnRequestOnly) {
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

TEST_F(ImportedMapList, OneImportAtATime) {
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

TEST_F(ImportedMapList, MapsOfKilledImportsAreRemoved) {
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

TEST_F(ImportedMapList, AListBeginsEveryImportAndIsGoneIfItFails) {
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

TEST_F(ImportedMapList, MapsWithoutTheirListAreNeitherForgottenNorRemoved) {
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

TEST_F(ImportedMapList, MapsStayWithTheirFramesWhenARepairLosesOthers) {
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

TEST_F(ImportedMapList, ADamagedMapIsAnErrorAndNotAnEstimation) {
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
TEST_F(ImportedMapList, MapsStayWithFramesThatAreEncodedAsVideo) {
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

}  // namespace
}  // namespace raystage::depths
