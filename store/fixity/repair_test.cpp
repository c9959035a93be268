// SPDX-License-Identifier: Apache-2.0
#include "store/fixity/repair.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <tbb/task_arena.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <fstream>
#include <map>
#include <random>
#include <set>

#include "base/error.h"
#include "base/resources.h"
#include "store/fixity/verify.h"
#include "store/matroska.h"
#include "store/timeline.h"
#include "testing/store/fixity_test_data.h"
#include "testing/store/take_test_data.h"

namespace raystage::store {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

struct RepairTake : ::testing::Test {
  RepairTake() {
    TakeWriter writer(take, testing::take_document(3, 20), testing::rig_document(3));
    for (unsigned camera = 0; camera < 3; ++camera) {
      for (unsigned i = 0; i < 10; ++i) {
        writer.archive(static_cast<int>(camera))
            .append(testing::fake_jpeg(100 * camera + i, 30), i * Nanoseconds{50'000'000});
      }
    }
    writer.commit();
    write_timeline(build_timeline(Take(take), 0, 0), take);
  }
  std::filesystem::path archive(int camera) const {
    return take / ("archive/c" + std::to_string(camera) + ".mkv");
  }
  std::filesystem::path journal(int camera) const {
    return take / ("archive/c" + std::to_string(camera) + ".journal");
  }
  // Makes the archive as a crash leaves it: without Cues and sizes.
  void leave_open(int camera) const {
    const Take whole(take);
    const FrameRecord last = whole.archive(camera).frames().back();
    auto bytes = testing::bytes_of(archive(camera));
    const auto header =
        matroska::make_header({"c" + std::to_string(camera), 320, 240, whole.document().epoch_utc});
    std::ranges::copy(header.bytes, bytes.begin());
    bytes.resize(static_cast<std::size_t>(last.offset) + last.size);
    testing::overwrite(archive(camera), bytes);
  }
  // Flips a bit of a frame and returns the record of the frame.
  FrameRecord rot_a_frame(int camera) const {
    const FrameRecord frame = Take(take).archive(camera).frames()[5];
    auto bytes = testing::bytes_of(archive(camera));
    bytes[static_cast<std::size_t>(frame.offset) + 4] ^= std::byte{8};
    testing::overwrite(archive(camera), bytes);
    return frame;
  }
  std::set<std::string> names() const {
    std::set<std::string> found;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(take)) {
      if (entry.is_regular_file()) found.insert(entry.path().filename().string());
    }
    return found;
  }
  bool is_intact() const { return verify_take(take, {}).is_intact(); }

  testing::TestFolder folder;
  std::filesystem::path take = folder.path() / "take";
};

TEST_F(RepairTake, AWholeTakeIsNotTouched) {
  const auto before = std::filesystem::last_write_time(archive(0));
  const RepairReport report = repair_take(take, {});
  for (const auto& camera : report.cameras) {
    EXPECT_TRUE(camera.was_intact);
    EXPECT_FALSE(camera.repaired);
  }
  EXPECT_EQ(std::filesystem::last_write_time(archive(0)), before);
}

TEST_F(RepairTake, FilesBehindLinksAreNotRepaired) {
  const auto other = folder.path() / "other.mkv";
  leave_open(1);
  std::filesystem::rename(archive(1), other);
  std::filesystem::create_symlink(other, archive(1));
  const auto before = testing::bytes_of(other);
  const RepairReport report = repair_take(take, {});
  EXPECT_FALSE(report.cameras[1].repaired);
  EXPECT_THAT(report.cameras[1].error, ::testing::HasSubstr("is a link"));
  EXPECT_EQ(testing::bytes_of(other), before);
  EXPECT_TRUE(std::filesystem::is_symlink(archive(1)));
}

TEST_F(RepairTake, ACrashedTakeIsClosedAndLeavesNothingBehind) {
  const auto before = names();
  const auto original = testing::bytes_of(archive(1));
  leave_open(1);
  ASSERT_FALSE(is_intact());
  const pid_t ended = fork();
  ASSERT_GE(ended, 0);
  if (ended == 0) _exit(0);
  waitpid(ended, nullptr, 0);
  for (const int camera : {0, 1}) {
    for (const char* extension : {".mkv", ".journal"}) {
      const std::string name = archive(camera).stem().string() + extension;
      std::ofstream(
          archive(camera).parent_path() /
          ("." + name + "." + host_name() + "." + std::to_string(ended) + ".0123.tmp" + extension))
          << "left by a repair that was killed";
      // A process of this ID lives, but it does not hold the archive's lock.
      std::ofstream(archive(camera).parent_path() /
                    ("." + name + "." + host_name() + "." + std::to_string(getpid()) +
                     ".0123456789abcdef.tmp" + extension))
          << "left by a repair whose process ID was used again";
    }
  }
  const RepairReport report = repair_take(take, {});
  EXPECT_TRUE(report.cameras[0].was_intact);
  EXPECT_TRUE(report.cameras[1].repaired);
  EXPECT_FALSE(report.has_losses());
  EXPECT_EQ(testing::bytes_of(archive(1)), original);
  EXPECT_EQ(names(), before);
  EXPECT_TRUE(is_intact());
}

/// Expects the ticks of `before`, with their frames by time, but without a frame of a camera.
void expect_same_ticks(const std::filesystem::path& take, const Timeline& before,
                       std::size_t camera, std::int32_t lost) {
  const Timeline now = read_timeline(Take(take));
  ASSERT_EQ(now.ticks.size(), before.ticks.size());
  EXPECT_EQ(now.clocks, before.clocks);
  for (std::size_t i = 0; i < now.ticks.size(); ++i) {
    EXPECT_EQ(now.ticks[i].time_ns, before.ticks[i].time_ns);
    for (std::size_t c = 0; c < now.ticks[i].frame.size(); ++c) {
      const std::int32_t was = before.ticks[i].frame[c];
      const bool is_later = c == camera && was > lost;
      const bool is_lost = c == camera && was == lost;
      EXPECT_EQ(now.ticks[i].frame[c], is_lost ? -1 : is_later ? was - 1 : was) << i << " " << c;
      EXPECT_EQ(now.ticks[i].difference[c], is_lost ? 0 : before.ticks[i].difference[c]);
    }
  }
}

TEST_F(RepairTake, TheOriginalsOfALossStay) {
  const Timeline timeline = read_timeline(Take(take));
  const FrameRecord frame = rot_a_frame(2);
  const auto bytes = testing::bytes_of(archive(2));
  const auto lines = testing::bytes_of(journal(2));
  const auto before = names();

  RepairOptions dry;
  dry.dry_run = true;
  RepairReport report = repair_take(take, dry);
  EXPECT_EQ(names(), before);
  EXPECT_EQ(testing::bytes_of(archive(2)), bytes);
  EXPECT_EQ(report.cameras[2].salvage.corrupt_frames, 1);

  report = repair_take(take, {});
  EXPECT_TRUE(report.has_losses());
  EXPECT_THAT(report.cameras[2].kept, ElementsAre("c2.mkv.damaged", "c2.journal.damaged"));
  ASSERT_EQ(report.cameras[2].salvage.losses.size(), 1u);
  EXPECT_EQ(report.cameras[2].salvage.losses[0].time_ns, frame.time_ns);
  EXPECT_EQ(testing::bytes_of(take / "archive/c2.mkv.damaged"), bytes);
  EXPECT_EQ(testing::bytes_of(take / "archive/c2.journal.damaged"), lines);
  // The timeline refers to frames by index, but its ticks stay.
  EXPECT_TRUE(report.is_timeline_renumbered);
  EXPECT_EQ(report.renamed_timeline, "");
  EXPECT_TRUE(is_intact());
  expect_same_ticks(take, timeline, 2, 5);
  const Take now(take);
  ASSERT_EQ(now.archive(2).frames().size(), 9u);
  EXPECT_EQ(now.archive(2).records()[5].status, FrameStatus::kTorn);
  EXPECT_EQ(now.archive(2).records()[5].time_ns, frame.time_ns);

  // A second repair does not overwrite the files kept by the first.
  auto again = testing::bytes_of(archive(2));
  again[now.archive(2).frames()[0].offset] ^= std::byte{1};
  testing::overwrite(archive(2), again);
  report = repair_take(take, {});
  EXPECT_THAT(report.cameras[2].kept, ElementsAre("c2.mkv.damaged-2", "c2.journal.damaged-2"));
  EXPECT_TRUE(is_intact());
}

// The process stopped after the rename of the archive, before that of the journal.
TEST_F(RepairTake, CanBeInterruptedBetweenTheTwoRenames) {
  rot_a_frame(2);
  const auto old_journal = testing::bytes_of(journal(2));
  repair_take(take, {});
  const auto new_archive = testing::bytes_of(archive(2)),
             new_journal = testing::bytes_of(journal(2));
  testing::overwrite(journal(2), old_journal);
  ASSERT_FALSE(is_intact());
  repair_take(take, {});
  EXPECT_EQ(testing::bytes_of(archive(2)), new_archive);
  EXPECT_EQ(testing::bytes_of(journal(2)), new_journal);
}

TEST_F(RepairTake, ALostJournalIsMadeAgain) {
  const auto original = testing::bytes_of(archive(0));
  const auto header = journal::encode_header(describe_pair(Take(take), 0).description);
  std::vector<std::byte> lines(header.begin(), header.end());
  for (FrameRecord record : journal::decode(testing::bytes_of(journal(0)), "journal").records) {
    record.is_unverified = true;
    const auto line = journal::encode_record(record);
    lines.insert(lines.end(), line.begin(), line.end());
  }
  std::filesystem::remove(journal(0));
  const RepairReport report = repair_take(take, {});
  EXPECT_EQ(report.cameras[0].salvage.reindexed_frames, 10);
  EXPECT_TRUE(report.has_losses());
  EXPECT_EQ(testing::bytes_of(archive(0)), original);
  EXPECT_EQ(testing::bytes_of(journal(0)), lines);
  EXPECT_TRUE(is_intact());
}

TEST_F(RepairTake, WhatCannotBeRepairedIsSaidAndTheRestGoesOn) {
  leave_open(0);
  std::filesystem::remove(archive(1));
  leave_open(2);
  ArchiveWriter recording = ArchiveWriter::resume(
      archive(2), journal(2), {"c2", 320, 240, Take(take).document().epoch_utc});
  const RepairReport report = repair_take(take, {});
  EXPECT_TRUE(report.failed());
  EXPECT_TRUE(report.cameras[0].repaired);
  EXPECT_THAT(report.cameras[1].error, HasSubstr("archive is missing"));
  EXPECT_THAT(report.cameras[2].error, HasSubstr("another program is writing"));
  recording.append(testing::fake_jpeg(1), 900'000'000);
}

TEST_F(RepairTake, IsTheSameForAnyNumberOfThreads) {
  for (int camera = 0; camera < 3; ++camera) rot_a_frame(camera);
  const auto repaired_by = [&](int threads) {
    const testing::TestFolder elsewhere;
    const auto copy = elsewhere.path() / "take";
    std::filesystem::copy(take, copy, std::filesystem::copy_options::recursive);
    std::atomic<int> done = 0;
    RepairOptions options;
    options.progress = [&](double) { ++done; };
    tbb::task_arena(threads).execute([&] {
      const RepairReport report = repair_take(copy, options);
      EXPECT_FALSE(report.failed() || report.status != RunStatus::kFinished);
    });
    EXPECT_EQ(done, 3);
    std::map<std::string, std::vector<std::byte>> files;
    for (const auto& entry : std::filesystem::directory_iterator(copy / "archive")) {
      files[entry.path().filename().string()] = testing::bytes_of(entry.path());
    }
    return files;
  };
  const auto by_one = repaired_by(1);
  EXPECT_EQ(by_one.size(), 12U);  // the new and the damaged pair of each camera
  EXPECT_EQ(repaired_by(2), by_one);
}

TEST_F(RepairTake, RandomDamageThenRepairThenVerify) {
  std::mt19937_64 random(7);
  for (int round = 0; round < 25; ++round) {
    for (auto hits = 1 + random() % 4; hits > 0; --hits) {
      const int camera = static_cast<int>(random() % 3);
      const auto file = random() % 2 == 0 ? archive(camera) : journal(camera);
      auto bytes = testing::bytes_of(file);
      if (random() % 4 == 0) bytes.resize(bytes.size() - random() % (bytes.size() / 4));
      testing::flip(bytes, random() % (8 * bytes.size()));
      testing::overwrite(file, bytes);
    }
    ASSERT_FALSE(is_intact());
    const RepairReport report = repair_take(take, {});
    ASSERT_FALSE(report.failed());
    ASSERT_TRUE(is_intact()) << round;
  }
}

}  // namespace
}  // namespace raystage::store
