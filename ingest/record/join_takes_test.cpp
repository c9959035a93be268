// SPDX-License-Identifier: Apache-2.0
#include "ingest/record/join_takes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "base/error.h"
#include "schemas/recording_document.h"
#include "store/journal_archives.h"
#include "store/take.h"
#include "store/timeline_file.h"
#include "testing/test_folder.h"

namespace raystage::ingest {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

std::vector<std::byte> picture(const std::string& text) {
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

void write_part(const std::filesystem::path& folder, const std::string& id, Nanoseconds epoch,
                const std::string& node, const std::string& rig_name = "row", double x = 0) {
  schemas::TakeDocument take;
  take.name = "part";
  take.epoch_utc = epoch;
  take.nominal_fps = 15;
  take.color_space = "srgb_texture";
  take.cameras.push_back({id, {}, {}, {}});
  schemas::RigDocument rig;
  rig.name = rig_name;
  schemas::CameraGeometry camera;
  camera.id = id;
  camera.width = 64;
  camera.height = 48;
  camera.intrinsics.fx = camera.intrinsics.fy = 64;
  camera.intrinsics.cx = 32;
  camera.intrinsics.cy = 24;
  camera.world_from_camera = {1, 0, 0, x, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  rig.cameras.push_back({camera, {}});
  store::TakeWriter writer(folder, take, rig);
  writer.archive(0).append(picture(id + "0"), 100, {105, 7});
  writer.archive(0).append_missing(store::FrameStatus::kDroppedRamFull, 150, {155, 8});
  writer.archive(0).append(picture(id + "1"), 200);
  schemas::RecordingDocument account;
  account.node = node;
  std::filesystem::create_directory(writer.working_folder() / "recording");
  schemas::write_recording(account, writer.working_folder() / "recording" / (node + ".json"));
  writer.commit();
}

class Join : public ::testing::Test {
 protected:
  std::filesystem::path part(const std::string& name) const { return folder_.path() / name; }
  JoinReport join(const std::vector<std::filesystem::path>& parts) const {
    return join_takes(parts, part("joined"), "test", false, {}, {});
  }

 private:
  testing::TestFolder folder_;
};

TEST_F(Join, MakesTheDocumentsAloneWhereArchivesStay) {
  constexpr Nanoseconds kEpoch = 1'767'225'600'000'000'000;
  write_part(part("a"), "left", kEpoch + 5000, "one");
  write_part(part("b"), "right", kEpoch, "two");
  const std::vector<std::filesystem::path> parts{part("a"), part("b")};
  join(parts);
  // Joining with archives left in place does not read them.
  for (const char* file : {"a/archive/left.mkv", "b/archive/right.mkv"}) {
    std::filesystem::rename(part(file), part(file).string() + ".elsewhere");
  }
  const JoinReport report = join_takes(parts, part("shared"), "test", true, {}, {});
  EXPECT_EQ(report.cameras, 2);
  EXPECT_EQ(report.frames, 4U);
  EXPECT_EQ(report.missing, 2U);
  EXPECT_FALSE(std::filesystem::exists(part("shared") / "archive" / "left.mkv"));
  EXPECT_THROW(store::Take(part("shared")).archive(0), Error);
  // The records from journals alone, and from the archives, equal those of the joined take.
  const store::Take joined(part("joined"));
  const store::Take journals(part("shared"), store::make_journal_archives(part("shared")));
  EXPECT_THROW(journals.archive(0).jpeg(0), Error);
  EXPECT_THROW(journals.archive(1).jpeg(0), Error);
  for (const char* file : {"a/archive/left.mkv", "b/archive/right.mkv"}) {
    std::filesystem::copy_file(part(file).string() + ".elsewhere",
                               part("shared") / "archive" / std::filesystem::path(file).filename());
  }
  const store::Take whole(part("shared"));
  for (int camera = 0; camera < 2; ++camera) {
    const auto expected = joined.archive(camera).records();
    for (const store::Take* take : {&journals, &whole}) {
      const auto records = take->archive(camera).records();
      ASSERT_EQ(records.size(), expected.size());
      for (std::size_t i = 0; i < records.size(); ++i) {
        EXPECT_EQ(records[i].time_ns, expected[i].time_ns);
        EXPECT_EQ(records[i].arrival_ns, expected[i].arrival_ns);
        EXPECT_EQ(records[i].status, expected[i].status);
        EXPECT_EQ(records[i].xxh3, expected[i].xxh3);
      }
    }
    EXPECT_TRUE(std::ranges::equal(whole.archive(camera).jpeg(1), joined.archive(camera).jpeg(1)));
  }
  EXPECT_EQ(store::take_fingerprint(journals), store::take_fingerprint(whole))
      << "one timeline fits both";
}

TEST_F(Join, KeepsEveryRecordAtItsInstant) {
  constexpr Nanoseconds kEpoch = 1'767'225'600'000'000'000;
  write_part(part("a"), "left", kEpoch + 5000, "one");
  write_part(part("b"), "right", kEpoch, "two");
  const JoinReport report = join({part("a"), part("b")});
  EXPECT_EQ(report.cameras, 2);
  EXPECT_EQ(report.frames, 4U);
  EXPECT_EQ(report.missing, 2U);
  EXPECT_THAT(report.warnings, IsEmpty());
  const store::Take take(part("joined"));
  EXPECT_EQ(take.document().epoch_utc, kEpoch);
  EXPECT_EQ(take.document().cameras[0].node, "one");
  EXPECT_EQ(take.document().cameras[1].node, "two");
  const auto left = take.archive(0).records(), right = take.archive(1).records();
  ASSERT_EQ(left.size(), 3U);
  EXPECT_EQ(left[0].time_ns, 5100);
  EXPECT_EQ(left[0].arrival_ns, 5105);
  EXPECT_EQ(left[0].sequence, 7U);
  EXPECT_EQ(left[1].status, store::FrameStatus::kDroppedRamFull);
  EXPECT_EQ(left[1].arrival_ns, 5155);
  EXPECT_EQ(left[2].arrival_ns, store::kUnknownTime);
  EXPECT_EQ(right[0].time_ns, 100);
  EXPECT_TRUE(std::ranges::equal(take.archive(1).jpeg(1), picture("right1")));
  EXPECT_EQ(schemas::read_recording(part("joined") / "recording" / "one.json").node, "one");
  EXPECT_EQ(schemas::read_recording(part("joined") / "recording" / "two.json").node, "two");
}

TEST_F(Join, FramesWhoseRecordsAreLostAreUnverified) {
  write_part(part("a"), "left", 0, "one");
  write_part(part("b"), "right", 0, "two");
  std::filesystem::remove(part("a") / store::Take(part("a")).document().cameras[0].journal);
  join({part("a"), part("b")});
  const store::Take joined(part("joined"));
  for (int camera = 0; camera < 2; ++camera) {
    ASSERT_EQ(joined.archive(camera).frames().size(), 2U);
    for (const store::FrameRecord& frame : joined.archive(camera).frames()) {
      EXPECT_EQ(frame.is_unverified, camera == 0);
      EXPECT_NE(frame.xxh3, 0U);
    }
  }
}

TEST_F(Join, SaysThatPartsDoNotOverlap) {
  write_part(part("a"), "left", 10 * kNanosecondsPerSecond, "one");
  write_part(part("b"), "right", 0, "two");
  EXPECT_THAT(
      join({part("a"), part("b")}).warnings,
      ElementsAre("the parts do not overlap in time: " + part("b").string() +
                  " from 0.000 s to 0.000 s, " + part("a").string() +
                  " from 10.000 s to 10.000 s, a gap of 10.000 s; check the nodes' clocks"));
  EXPECT_EQ(store::Take(part("joined")).camera_count(), 2);
}

TEST_F(Join, RefusesPartsThatNoTakeHolds) {
  constexpr Nanoseconds kDay = 86400 * kNanosecondsPerSecond;
  write_part(part("a"), "left", 0, "one");
  write_part(part("b"), "right", 200 * kDay, "two");
  try {
    join({part("a"), part("b")});
    FAIL() << "joined";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("ends 200 days after the epoch of the first part"));
    EXPECT_EQ(error.where(), part("b").string());
  }
}

TEST_F(Join, GuessedPlacesAreKeptApart) {
  write_part(part("a"), "left", 0, "one", "not calibrated");
  write_part(part("b"), "right", 0, "two", "not calibrated");
  write_part(part("c"), "measured", 0, "three", "row", 0.7);
  EXPECT_THAT(join({part("a"), part("b")}).warnings, IsEmpty());
  const schemas::RigDocument guessed = schemas::read_rig(part("joined") / "rig.json");
  EXPECT_FALSE(schemas::is_calibrated(guessed));
  EXPECT_EQ(guessed.cameras[0].geometry.world_from_camera[3], 0);
  EXPECT_EQ(guessed.cameras[1].geometry.world_from_camera[3], schemas::kDefaultCameraSpacing);

  std::filesystem::remove_all(part("joined"));
  EXPECT_THAT(join({part("c"), part("a")}).warnings, ElementsAre(HasSubstr("is not calibrated")));
  const schemas::RigDocument mixed = schemas::read_rig(part("joined") / "rig.json");
  EXPECT_FALSE(schemas::is_calibrated(mixed));
  EXPECT_EQ(mixed.cameras[0].geometry.world_from_camera[3], 0.7);
  EXPECT_NEAR(mixed.cameras[1].geometry.world_from_camera[3], 0.7 + schemas::kDefaultCameraSpacing,
              1e-12);
}

TEST_F(Join, RefusesAPlaceWithinAPart) {
  write_part(part("a"), "left", 0, "one");
  write_part(part("b"), "right", 0, "two");
  EXPECT_THROW(
      join_takes({part("a"), part("b")}, part("b") / "new" / "joined", "test", false, {}, {}),
      Error);
  EXPECT_FALSE(std::filesystem::exists(part("b") / "new"));
}

TEST_F(Join, RefusesCamerasOfOneNameAndDamage) {
  write_part(part("a"), "left", 0, "one");
  write_part(part("b"), "left", 0, "two");
  EXPECT_THROW(join({part("a"), part("b")}), Error);
  write_part(part("c"), "right", 0, "two");
  const auto file = part("c") / "archive" / "right.mkv";
  std::string bytes;
  {
    std::ifstream in(file, std::ios::binary);
    bytes.assign(std::istreambuf_iterator<char>(in), {});
  }
  bytes[bytes.find("right1") + 2] ^= 1;
  std::ofstream(file, std::ios::binary) << bytes;
  try {
    join({part("a"), part("c")});
    FAIL() << "joined";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(),
                HasSubstr("right.mkv: frame 1 of camera \"right\" is not as it was recorded"));
  }
  EXPECT_FALSE(std::filesystem::exists(part("joined")));
}

}  // namespace
}  // namespace raystage::ingest
