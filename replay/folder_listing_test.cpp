// SPDX-License-Identifier: Apache-2.0
#include "replay/folder_listing.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/atomic_file.h"
#include "base/error.h"
#include "replay/measurements.h"
#include "store/take.h"
#include "testing/render/synthetic_take.h"
#include "testing/test_folder.h"

namespace raystage::replay {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

class FolderListingTest : public ::testing::Test {
 protected:
  void SetUp() override {
    testing::SyntheticTake synthetic;
    synthetic.cameras = testing::camera_grid(1, 3, 0.06, 48, 32);
    synthetic.frames = 4;
    testing::write_synthetic_take(synthetic, folder_.path() / "b take");
  }
  std::vector<FolderEntry> list() const { return list_folder(folder_.path()); }
  void write(const char* name, std::string_view text) const {
    write_file_atomically(folder_.path() / name, text);
  }

  testing::TestFolder folder_;
};

TEST_F(FolderListingTest, DescribesTakes) {
  const auto entries = list();
  ASSERT_EQ(entries.size(), 1U);
  EXPECT_EQ(entries[0].kind, FolderEntry::Kind::kTake);
  EXPECT_EQ(entries[0].name, "b take");
  EXPECT_EQ(entries[0].cameras, 3);
  EXPECT_NEAR(entries[0].seconds, 4.0 / 15, 1e-6);
  EXPECT_GT(entries[0].bytes, 1000U);
  EXPECT_FALSE(entries[0].is_recording);
  EXPECT_FALSE(entries[0].verified_utc);
  EXPECT_EQ(entries[0].problem, "");
}

TEST_F(FolderListingTest, ThumbnailsShowAnIntactFrame) {
  const std::filesystem::path take_folder = folder_.path() / "b take";
  const store::RgbImage whole = take_thumbnail(take_folder, 48, 32);
  std::filesystem::path archive;
  store::FrameRecord shown;
  {
    const store::Take take(take_folder);
    archive = take_folder / take.document().cameras[1].archive;  // the one in the middle
    shown = take.archive(1).frames()[2];
  }
  std::string bytes = read_file(archive);
  bytes[static_cast<std::size_t>(shown.offset + shown.size / 2)] ^= 1;
  write_file_atomically(archive, bytes);
  EXPECT_TRUE(store::Take(take_folder).archive(1).is_rotten(2));
  const store::RgbImage other = take_thumbnail(take_folder, 48, 32);
  EXPECT_EQ(other.width, whole.width);
  EXPECT_NE(other.values, store::RgbImage(other.width, other.height).values);  // not black
}

TEST_F(FolderListingTest, ListsShotsAndFoldersButNotOtherFiles) {
  create_folder(folder_.path() / "more");
  create_folder(folder_.path() / ".hidden");
  write("a.json",
        R"({"schema": "raystage/shot/2", "name": "opening", "width": 64, "height": 48, "fps": 24,
    "first_frame": 1, "last_frame": 2, "layers": [{"name": "a", "solid": {"color": [1, 0, 0]}}],
    "camera": {"keys": [{"frame": 1, "position": [0, 0, 0], "horizontal_fov_deg": 40}]}})");
  write("broken.json", R"({"schema": "raystage/shot/2")");
  write("other.json", "{}");
  write("readme.txt", "text");
  std::filesystem::create_symlink(folder_.path() / "b take", folder_.path() / "link");
  const auto entries = list();
  std::vector<std::string> names;
  for (const FolderEntry& entry : entries) names.push_back(entry.name);
  EXPECT_THAT(names, ElementsAre("b take", "a.json", "broken.json", "more"));
  EXPECT_EQ(entries[1].title, "opening");
  EXPECT_NE(entries[2].problem, "");
}

TEST_F(FolderListingTest, ADamagedTakeIsListedWithItsProblem) {
  write_file_atomically(folder_.path() / "b take" / "take.json", std::string_view("{"));
  const auto entries = list();
  ASSERT_EQ(entries.size(), 1U);
  EXPECT_NE(entries[0].problem, "");
}

TEST_F(FolderListingTest, AReportOfVerifySaysWhen) {
  write("b take.verify.json", R"({"intact": true})");
  ASSERT_TRUE(list()[0].verified_utc);
  EXPECT_TRUE(list()[0].is_intact);
  write("b take.verify.json", R"({"intact": false})");
  EXPECT_FALSE(list()[0].is_intact);
  const std::string long_list = ", \"problems\": [" + std::string(100'000, ' ') + "1]}";
  write("b take.verify.json", R"({"bytes": 3, "intact": true)" + long_list);
  EXPECT_TRUE(list()[0].is_intact);
  for (const char* text :
       {"", "[1]", R"({"intact": 3})", "{", R"({"cameras": [{"intact": true}]})"}) {
    write("b take.verify.json", text);
    EXPECT_FALSE(list()[0].verified_utc) << text;
  }
}

TEST_F(FolderListingTest, AThumbnailFits) {
  const store::RgbImage picture = take_thumbnail(folder_.path() / "b take", 24, 100);
  EXPECT_EQ(picture.width, 24);
  EXPECT_EQ(picture.height, 16);
  EXPECT_THROW(take_thumbnail(folder_.path() / "none", 24, 24), Error);
  EXPECT_THROW(list_folder(folder_.path() / "none"), Error);
}

constexpr std::string_view kReport = R"({"schema": "raystage/trade/1", "take": "set", "rows": [
  {"label": "depth", "method": "depth", "psnr_db": 31.5, "seconds_per_frame": 0.4},
  {"label": "depth fast", "method": "depth", "psnr_db": 20, "seconds_per_frame": 0.1},
  {"label": "slabs", "method": "slabs", "psnr_db": null, "seconds_per_frame": 0.1}, 7]})";

TEST(MethodMeasurements, AreThoseOfDefaultOptions) {
  const auto found = parse_measurements(kReport, "set");
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].method, "depth");
  EXPECT_EQ(found[0].psnr_db, 31.5);
  EXPECT_EQ(found[0].seconds_per_frame, 0.4);
  EXPECT_THAT(parse_measurements(kReport, "another take"), IsEmpty());
}

TEST(MethodMeasurements, OfOtherFilesAreNone) {
  for (const std::string_view text :
       {"", "{", "[]", "null", R"({"take": "set"})", R"({"take": "set", "rows": {"a": 1}})",
        R"({"take": 3, "rows": []})", R"({"take": "set", "rows": [{"label": 1, "method": 1}]})"}) {
    EXPECT_THAT(parse_measurements(text, "set"), IsEmpty()) << text;
  }
}

TEST_F(FolderListingTest, MeasurementsAreFoundInFoldersOfReports) {
  create_folder(folder_.path() / "bench");
  write_file_atomically(folder_.path() / "bench" / "trade.json", kReport);
  EXPECT_EQ(find_measurements(folder_.path(), "set").size(), 1U);
  EXPECT_THAT(find_measurements(folder_.path() / "none", "set"), IsEmpty());
}

}  // namespace
}  // namespace raystage::replay
