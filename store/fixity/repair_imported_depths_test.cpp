// SPDX-License-Identifier: Apache-2.0
// Tests that repairs leave imported depth maps as they are, or restore them from a copy.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "base/error.h"
#include "store/fixity/repair.h"
#include "store/fixity/verify.h"
#include "store/imported_depths.h"
#include "store/temporal/temporal_frame.h"
#include "testing/store/fixity_test_data.h"
#include "testing/store/take_test_data.h"

namespace raystage::store {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using Document = schemas::ImportedDepthsDocument;

constexpr int kMappedFrames = 6;

class RepairImportedDepths : public ::testing::Test {
 protected:
  void SetUp() override {
    TakeWriter writer(take, testing::take_document(2), testing::rig_document(2));
    for (unsigned camera = 0; camera < 2; ++camera) {
      for (unsigned i = 0; i < kMappedFrames; ++i) {
        writer.archive(static_cast<int>(camera))
            .append(testing::fake_jpeg(100 * camera + i, 30), testing::frame_time(i));
      }
    }
    writer.commit();
    // What is in the maps makes no difference here.
    Document document;
    document.imports.push_back({0, "test", "maps", "z"});
    Document::Camera maps{"c0", {}};
    fs::create_directories(take / Document::kFolder / "c0");
    for (int i = 0; i < kMappedFrames; ++i) {
      const auto bytes = testing::fake_jpeg(static_cast<unsigned>(900 + i), 50);
      const std::string file = fmt::format("c0/{:06}.{:016x}.zst", i, hash_of_stored(bytes));
      testing::overwrite(take / Document::kFolder / file, bytes);
      maps.maps.push_back(
          {i, std::string(16, '0'), file, {}, 8, 8, 0, 0, "s", std::string(64, '0')});
    }
    document.cameras.push_back(maps);
    schemas::write_imported_depths(document, take / Document::kFile);
    fs::copy(take, copy, fs::copy_options::recursive);
    ASSERT_TRUE(is_intact());
  }
  bool is_intact() const { return verify_take(take, {}).is_intact(); }
  fs::path map_of(int frame) const {
    return take / Document::kFolder / read_imported_depths(Take(copy)).find("c0", frame)->file;
  }
  static void flip_in(const fs::path& file, std::size_t at) {
    auto bytes = testing::bytes_of(file);
    bytes[at] ^= std::byte{8};
    testing::overwrite(file, bytes);
  }
  std::vector<std::string> restored(bool dry_run = false) const {
    std::vector<std::string> files;
    const RepairReport report = repair_take(take, {.dry_run = dry_run, .copy = copy});
    for (const auto& file : report.files) {
      EXPECT_EQ(file.error, "");
      files.push_back(file.path);
    }
    return files;
  }

  testing::TestFolder folder;
  fs::path take = folder.path() / "take", copy = folder.path() / "copy";
};

// Maps are found by the hash of their frame, so that those of a lost frame come back with it.
TEST_F(RepairImportedDepths, TheListStaysAsItIs) {
  const auto list = testing::bytes_of(take / Document::kFile);
  flip_in(take / "archive/c0.mkv", Take(take).archive(0).frames()[3].offset + 4);
  EXPECT_TRUE(repair_take(take, {}).has_losses());
  EXPECT_EQ(testing::bytes_of(take / Document::kFile), list);
  EXPECT_TRUE(is_intact());
  repair_take(take, {.copy = copy});
  EXPECT_EQ(Take(take).archive(0).frames().size(), static_cast<std::size_t>(kMappedFrames));
  EXPECT_EQ(testing::bytes_of(take / Document::kFile), list);
}

TEST_F(RepairImportedDepths, DamagedMapsAndListsAreTakenFromTheCopy) {
  const auto whole = testing::bytes_of(map_of(2));
  flip_in(map_of(2), 20);
  const auto damaged = testing::bytes_of(map_of(2));
  EXPECT_FALSE(is_intact());
  const std::string name = map_of(2).lexically_relative(take).string();
  EXPECT_THAT(restored(true), ElementsAre(name));
  EXPECT_EQ(testing::bytes_of(map_of(2)), damaged);
  EXPECT_THAT(restored(), ElementsAre(name));
  EXPECT_EQ(testing::bytes_of(map_of(2)), whole);
  EXPECT_EQ(testing::bytes_of(map_of(2).string() + ".damaged"), damaged);
  EXPECT_TRUE(is_intact());

  const auto list = testing::bytes_of(take / Document::kFile);
  testing::overwrite(take / Document::kFile, {list.begin(), list.begin() + 40});
  EXPECT_FALSE(is_intact());
  EXPECT_THAT(restored(), ElementsAre(Document::kFile));
  EXPECT_EQ(testing::bytes_of(take / Document::kFile), list);
  fs::remove(take / Document::kFile);
  EXPECT_FALSE(is_intact());
  EXPECT_THAT(restored(), ElementsAre(Document::kFile));
  EXPECT_TRUE(is_intact());
  EXPECT_THAT(restored(), IsEmpty());
}

// A map of the copy that is damaged does not replace anything.
TEST_F(RepairImportedDepths, MapsThatTheCopyHasDamagedTooStay) {
  flip_in(map_of(2), 20);
  flip_in(copy / map_of(2).lexically_relative(take), 21);
  const auto damaged = testing::bytes_of(map_of(2));
  EXPECT_THAT(restored(), IsEmpty());
  EXPECT_EQ(testing::bytes_of(map_of(2)), damaged);
  EXPECT_FALSE(is_intact());
}

// With the list of a copy that has fewer maps, the next import would remove the others.
TEST_F(RepairImportedDepths, AListThatLacksMapsIsNotTaken) {
  fs::remove(take / Document::kFile);
  schemas::write_imported_depths({}, copy / Document::kFile);
  for (const bool dry_run : {true, false}) {
    const RepairReport report = repair_take(take, {.dry_run = dry_run, .copy = copy});
    EXPECT_TRUE(report.failed());
    ASSERT_EQ(report.files.size(), 1U);
    EXPECT_THAT(report.files[0].error, HasSubstr("lacks depth maps that are here, such as c0/"));
  }
  EXPECT_FALSE(fs::exists(take / Document::kFile));
}

TEST_F(RepairImportedDepths, AFolderBehindALinkIsLeftAlone) {
  fs::rename(take / Document::kFolder, folder.path() / "elsewhere");
  fs::create_directory_symlink(folder.path() / "elsewhere", take / Document::kFolder);
  const RepairReport report = repair_take(take, {.copy = copy});
  EXPECT_FALSE(report.failed());
  EXPECT_THAT(report.files, IsEmpty());
}

}  // namespace
}  // namespace raystage::store
