// SPDX-License-Identifier: Apache-2.0
#include "store/fixity/repair_from_copy.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>

#include "store/fixity/verify.h"
#include "store/matroska.h"
#include "testing/store/copied_take_test_data.h"

namespace raystage::store {
namespace {

namespace fs = std::filesystem;
using ::testing::IsEmpty;

using Bytes = std::vector<std::byte>;

class RepairFromCopy : public testing::CopiedTake {};

TEST_F(RepairFromCopy, AnyDamageOfOneCopyIsRepairedToTheSameBytes) {
  std::mt19937_64 random(20051);
  for (int round = 0; round < 120; ++round) {
    SCOPED_TRACE(round);
    damage(take, random);
    // A take of which nothing is left is refused, because any folder looks like that.
    if (!fs::exists(take / "take.json") && !fs::exists(take / "rig.json")) {
      testing::write_bytes_to(take / "rig.json", whole["rig.json"]);
    }
    const testing::FolderContents damaged = testing::contents_of(take);
    const RepairReport planned = repair(true);
    EXPECT_EQ(testing::contents_of(take), damaged) << "a dry run changed something";
    EXPECT_FALSE(planned.failed());
    const RepairReport report = repair();
    EXPECT_FALSE(report.failed());
    EXPECT_FALSE(report.has_losses());
    for (std::size_t i = 0; i < report.cameras.size(); ++i) {
      EXPECT_EQ(report.cameras[i].frames_from_copy, planned.cameras[i].frames_from_copy);
    }
    ASSERT_EQ(testing::contents_of(take), whole);
    ASSERT_EQ(testing::contents_of(copy), whole) << "the copy was changed";
  }
}

// Neither copy is whole, but no frame is damaged in both.
TEST_F(RepairFromCopy, TwoDamagedCopiesCompleteEachOther) {
  const auto flip_frame = [&](const fs::path& where, int camera, std::size_t frame) {
    const std::string name = "archive/c" + std::to_string(camera) + ".mkv";
    const auto offset = Take(where).archive(camera).frames()[frame].offset;
    Bytes bytes = testing::bytes_of(where / name);
    bytes[offset + 3] ^= std::byte{4};
    testing::write_bytes_to(where / name, bytes);
  };
  for (int camera = 0; camera < testing::kCopiedCameras; ++camera) {
    flip_frame(take, camera, 2);
    flip_frame(take, camera, 3);
    flip_frame(copy, camera, 7);
  }
  const RepairReport report = repair();
  EXPECT_FALSE(report.failed() || report.has_losses());
  for (const auto& camera : report.cameras) EXPECT_EQ(camera.frames_from_copy, 2);
  EXPECT_EQ(testing::contents_of(take), whole);
  const RepairReport back = repair_take(copy, {.copy = take});
  EXPECT_FALSE(back.failed() || back.has_losses());
  EXPECT_EQ(testing::contents_of(copy), whole);
}

TEST_F(RepairFromCopy, RandomDamageOfBothNeverMakesOneWorse) {
  std::mt19937_64 random(7);
  for (int round = 0; round < 100; ++round) {
    SCOPED_TRACE(round);
    const auto hurt = [&](const fs::path& where) {
      for (int faults = 0; faults < 2; ++faults) {
        const std::string name = "archive/c" + std::to_string(random() % testing::kCopiedCameras) +
                                 (random() % 2 == 0 ? ".mkv" : ".journal");
        Bytes bytes = testing::bytes_of(where / name);
        testing::flip(bytes, random() % (8 * bytes.size()));
        testing::write_bytes_to(where / name, bytes);
      }
    };
    hurt(take);
    hurt(copy);
    const auto intact_frames = [&](const fs::path& where) {
      std::map<std::pair<int, Nanoseconds>, std::uint64_t> frames;
      const Take opened(where);
      for (int camera = 0; camera < testing::kCopiedCameras; ++camera) {
        ArchivePair pair = describe_pair(opened, camera);
        const Bytes archive = testing::bytes_of(where / pair.archive_name);
        const Bytes journal = testing::bytes_of(where / pair.journal_name);
        pair.archive = archive;
        pair.journal = journal;
        const SalvageResult saved = salvage_archive(pair);
        for (const FrameRecord& record : saved.records) {
          if (record.status != FrameStatus::kStored) continue;
          if (saved.unverified_times.contains(record.time_ns)) continue;
          frames[{camera, record.time_ns}] = record.xxh3;
        }
      }
      return frames;
    };
    auto expected = intact_frames(take);
    expected.merge(intact_frames(copy));
    const RepairReport report = repair();
    EXPECT_FALSE(report.failed());
    const auto now = intact_frames(take);
    for (const auto& [key, hash] : expected) {
      const auto found = now.find(key);
      ASSERT_NE(found, now.end()) << key.first << " " << key.second;
      EXPECT_EQ(found->second, hash);
    }
    fs::remove_all(take);
    fs::remove_all(copy);
    for (const auto& [name, bytes] : whole) {
      testing::write_bytes_to(take / name, bytes);
      testing::write_bytes_to(copy / name, bytes);
    }
  }
}

// A copy with the journals shows which unverified frames are the recorded ones.
TEST_F(RepairFromCopy, UnverifiedFramesAreVerifiedOrReplaced) {
  const fs::path journal = take / "archive" / "c1.journal", archive = take / "archive" / "c1.mkv";
  const auto rotten = static_cast<std::size_t>(Take(take).archive(1).frames()[4].offset) + 3;
  fs::remove(journal);
  Bytes bytes = testing::bytes_of(archive);
  bytes[rotten] ^= std::byte{1};  // nothing notices this without the journal
  testing::write_bytes_to(archive, bytes);
  EXPECT_TRUE(repair_take(take, {}).has_losses());
  const auto unverified = [&] {
    const Take repaired(take);
    return std::ranges::count_if(repaired.archive(1).frames(), &FrameRecord::is_unverified);
  };
  EXPECT_EQ(unverified(), testing::kCopiedFrames);
  EXPECT_TRUE(verify_take(take, {}).is_intact());

  const RepairReport report = repair();
  EXPECT_FALSE(report.failed());
  EXPECT_EQ(unverified(), 0);
  EXPECT_EQ(testing::bytes_of(archive), whole.at("archive/c1.mkv"));
  EXPECT_EQ(testing::bytes_of(journal), whole.at("archive/c1.journal"));
}

// Both copies lost their first journals. What one of them has is still better than nothing.
TEST_F(RepairFromCopy, UnverifiedFramesOfTheCopyAreTakenButStayUnverified) {
  const fs::path archive = take / "archive" / "c1.mkv", journal = take / "archive" / "c1.journal";
  fs::remove(journal);
  repair_take(take, {});
  const Bytes repaired = testing::bytes_of(archive), records = testing::bytes_of(journal);
  make_copy();
  EXPECT_EQ(repair().cameras[1].was_intact, true);
  EXPECT_EQ(testing::bytes_of(archive), repaired);

  const auto rotten = static_cast<std::size_t>(Take(take).archive(1).frames()[4].offset) + 3;
  for (const int fault : {0, 1, 2, 3}) {
    Bytes bytes = repaired;
    bytes[rotten] ^= std::byte{1};
    testing::write_bytes_to(archive, bytes);  // since the repair, so that its hash shows it
    if (fault == 1) fs::remove(archive);
    if (fault == 2) fs::remove(journal);
    if (fault == 3) fs::remove_all(take / "archive");
    const RepairReport report = repair();
    EXPECT_FALSE(report.failed()) << fault;
    EXPECT_EQ(testing::bytes_of(archive), repaired) << fault;
    EXPECT_EQ(testing::bytes_of(journal), records) << fault;
    EXPECT_TRUE(verify_take(take, {}).is_intact());
  }
}

// The record of the recording shows that the copy's frame, which has a later one, is another.
TEST_F(RepairFromCopy, AnUnverifiedFrameThatIsNotTheRecordedOneIsNotTaken) {
  const auto offset = static_cast<std::size_t>(Take(take).archive(1).frames()[4].offset) + 3;
  Bytes bytes = testing::bytes_of(copy / "archive" / "c1.mkv");
  bytes[offset] ^= std::byte{1};
  testing::write_bytes_to(copy / "archive" / "c1.mkv", bytes);
  fs::remove(copy / "archive" / "c1.journal");
  repair_take(copy, {});
  bytes = testing::bytes_of(take / "archive" / "c1.mkv");
  bytes[offset + 1] ^= std::byte{1};
  testing::write_bytes_to(take / "archive" / "c1.mkv", bytes);
  const RepairReport report = repair();
  EXPECT_TRUE(report.has_losses());
  const Take repaired(take);
  EXPECT_EQ(repaired.archive(1).frames().size(), testing::kCopiedFrames - 1U);
  EXPECT_EQ(std::ranges::count_if(repaired.archive(1).frames(), &FrameRecord::is_unverified), 0);
}

// The copy's record shows that the own frame is another, but its bytes are rotten, too.
TEST_F(RepairFromCopy, AnUnverifiedFrameIsKeptWhereTheCopyHasNoBetterOne) {
  const auto offset = static_cast<std::size_t>(Take(take).archive(1).frames()[4].offset) + 3;
  const auto flip_in = [&](const fs::path& side, std::size_t byte) {
    Bytes bytes = testing::bytes_of(side / "archive" / "c1.mkv");
    bytes[byte] ^= std::byte{1};
    testing::write_bytes_to(side / "archive" / "c1.mkv", bytes);
  };
  flip_in(take, offset);
  fs::remove(take / "archive" / "c1.journal");
  repair_take(take, {});
  flip_in(copy, offset + 1);
  EXPECT_FALSE(repair().failed());
  const Take repaired(take);
  ASSERT_EQ(repaired.archive(1).frames().size(), testing::kCopiedFrames);
  for (int i = 0; i < testing::kCopiedFrames; ++i) {
    EXPECT_EQ(repaired.archive(1).frames()[i].is_unverified, i == 4) << i;
  }
}

// As a mirror that stopped: every file is valid, but frames are missing at the end.
TEST_F(RepairFromCopy, AnIntactCopyThatEndsEarlyIsCompleted) {
  {
    fs::remove_all(take / "archive");
    fs::create_directory(take / "archive");
    const Take other(copy);
    for (int camera = 0; camera < testing::kCopiedCameras; ++camera) {
      const std::string name = "archive/c" + std::to_string(camera);
      ArchiveWriter writer(take / (name + ".mkv"), take / (name + ".journal"),
                           describe_pair(other, camera).description);
      for (int i = 0; i < 5; ++i) {
        const FrameRecord& record = other.archive(camera).frames()[i];
        const auto jpeg = other.archive(camera).jpeg(i);
        writer.append(jpeg.bytes(), record.time_ns, {record.arrival_ns, record.sequence});
        if (i % 3 == 2) {
          writer.append_missing(FrameStatus::kDroppedLate, record.time_ns,
                                {1, 100U + static_cast<unsigned>(i)});
        }
      }
      writer.close();
    }
  }
  testing::write_bytes_to(take / "recording" / "one.json", account(false));
  fs::remove(take / "timeline.zst");
  ASSERT_TRUE(verify_take(take, {}).is_intact());
  const RepairReport report = repair();
  EXPECT_FALSE(report.failed() || report.has_losses());
  for (const auto& camera : report.cameras) {
    EXPECT_EQ(camera.frames_from_copy, testing::kCopiedFrames - 5);
    EXPECT_THAT(camera.kept, IsEmpty());
  }
  EXPECT_EQ(testing::contents_of(take), whole);
}

// The take has more frames than the copy, but its end and the records of it are damaged: the
// original may hold what only an expert can save.
TEST_F(RepairFromCopy, ADamagedEndThatTheCopyLacksIsLostAndKept) {
  const std::string name = "archive/c0";
  {
    fs::remove(copy / (name + ".mkv"));
    fs::remove(copy / (name + ".journal"));
    const Take other(take);
    ArchiveWriter writer(copy / (name + ".mkv"), copy / (name + ".journal"),
                         describe_pair(other, 0).description);
    for (int i = 0; i < 2; ++i) {
      const FrameRecord& record = other.archive(0).frames()[i];
      writer.append(other.archive(0).jpeg(i).bytes(), record.time_ns,
                    {record.arrival_ns, record.sequence});
    }
    writer.close();
  }
  // The third frame and all after it.
  const auto begin = static_cast<std::ptrdiff_t>(Take(take).archive(0).frames()[2].offset -
                                                 matroska::kClusterHeaderBytes);
  Bytes archive = testing::bytes_of(take / (name + ".mkv"));
  std::fill(archive.begin() + begin, archive.end(), std::byte{0x55});
  testing::write_bytes_to(take / (name + ".mkv"), archive);
  Bytes journal = testing::bytes_of(take / (name + ".journal"));
  constexpr std::size_t kHeaderAndTwoRecords = 64 + 2 * 48;
  ASSERT_GT(journal.size(), kHeaderAndTwoRecords);
  std::fill(journal.begin() + kHeaderAndTwoRecords, journal.end(), std::byte{0x55});
  testing::write_bytes_to(take / (name + ".journal"), journal);
  const RepairReport report = repair();
  EXPECT_FALSE(report.failed());
  EXPECT_TRUE(report.has_losses());
  EXPECT_EQ(report.cameras[0].salvage.frames, 2);
  ASSERT_EQ(report.cameras[0].kept.size(), 2U);
  EXPECT_EQ(testing::bytes_of(take / "archive" / report.cameras[0].kept[0]), archive);
  EXPECT_EQ(testing::bytes_of(take / "archive" / report.cameras[0].kept[1]), journal);
}

TEST_F(RepairFromCopy, AnInvalidDocumentIsKeptBesideTheRestoredOne) {
  for (const char* file : {"take.json", "rig.json", "recording/one.json", "timeline.zst"}) {
    SCOPED_TRACE(file);
    const Bytes invalid(30, std::byte{'{'});
    testing::write_bytes_to(take / file, invalid);
    EXPECT_FALSE(repair().failed());
    EXPECT_EQ(testing::bytes_of(take / (std::string(file) + ".damaged")), invalid);
    EXPECT_EQ(testing::contents_of(take), whole);
  }
}

// Larger than the parts in which files are copied.
TEST_F(RepairFromCopy, ALargeFileIsRestored) {
  Bytes large(3'500'000);
  for (std::size_t i = 0; i < large.size(); ++i) large[i] = static_cast<std::byte>(i * 7 / 5);
  testing::write_bytes_to(copy / "matte.bin", large);
  EXPECT_FALSE(repair().failed());
  EXPECT_EQ(testing::bytes_of(take / "matte.bin"), large);
}

TEST_F(RepairFromCopy, AnIntactTakeTakesNothingFromADamagedCopy) {
  fs::resize_file(copy / "archive" / "c1.mkv", 700);
  fs::remove(copy / "archive" / "c2.mkv");
  fs::remove(copy / "notes.txt");
  const RepairReport report = repair();
  EXPECT_FALSE(report.failed() || report.has_losses());
  for (const auto& camera : report.cameras) EXPECT_TRUE(camera.was_intact);
  EXPECT_THAT(report.files, IsEmpty());
  EXPECT_EQ(testing::contents_of(take), whole);
}

}  // namespace
}  // namespace raystage::store
