// SPDX-License-Identifier: Apache-2.0
#include "store/fixity/salvage.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <set>

#include "base/error.h"
#include "store/fixity/repair.h"
#include "store/fixity/verify.h"
#include "store/matroska.h"
#include "testing/store/fixity_test_data.h"

namespace raystage::store {
namespace {

using ::testing::IsEmpty;
using testing::make_pair;
using testing::PairBytes;

using Random = std::mt19937_64;

constexpr unsigned kFrames = 20;

PairBytes repaired(const PairBytes& damaged, const SalvageResult& saved) {
  const testing::TestFolder folder;
  const auto archive = folder.path() / "a.mkv", journal = folder.path() / "a.journal";
  write_salvaged_archive(damaged.pair(), saved, archive, journal);
  return {testing::bytes_of(archive), testing::bytes_of(journal), true};
}

// A randomly damaged archive and journal, with the bytes of the originals that the damage touched.
// Where bytes were removed or inserted, the others have moved but are still contiguous.
struct Damaged {
  PairBytes bytes;
  std::vector<bool> archive_touched, journal_touched;
  bool moved = false;  // bytes of the archive have moved

  Damaged(const PairBytes& whole, Random& random)
      : bytes(whole), archive_touched(whole.archive.size()), journal_touched(whole.journal.size()) {
    for (auto kinds = 1 + random() % 3; kinds > 0; --kinds) hurt(random);
  }

  void hurt(Random& random) {
    const auto kind = random() % 9;
    auto& file = kind % 2 == 0 ? bytes.archive : bytes.journal;
    auto& touched = kind % 2 == 0 ? archive_touched : journal_touched;
    if (file.empty()) return;
    const std::size_t at = random() % file.size();
    const std::size_t length = std::min<std::size_t>(1 + random() % 150, file.size() - at);
    const auto first = file.begin() + static_cast<std::ptrdiff_t>(at);
    const auto touch = [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < std::min(end, touched.size()); ++i) touched[i] = true;
    };
    if (kind <= 3 || (moved && kind % 2 == 0)) {
      if (moved && kind % 2 == 0) return;  // original offsets are unknown
      testing::flip(file, 8 * at + random() % 8);
      touch(at, at + 1);
    } else if (kind == 4 || kind == 5) {
      std::fill_n(first, length, std::byte{0});
      touch(at, at + length);
    } else if (kind == 6) {
      file.erase(first, first + static_cast<std::ptrdiff_t>(length));
      touch(at, at + length);
      moved = true;
    } else if (kind == 7) {
      file.resize(at);
      touch(at, touched.size());
    } else {
      const std::vector<std::byte> garbage(length, std::byte{0x55});
      file.insert(first, garbage.begin(), garbage.end());
      if (at > 0) touch(at - 1, at + 1);  // splits a frame around it
      moved = true;
    }
  }

  static bool any(const std::vector<bool>& touched, std::size_t begin, std::size_t end) {
    return std::find(touched.begin() + static_cast<std::ptrdiff_t>(begin),
                     touched.begin() + static_cast<std::ptrdiff_t>(end),
                     true) != touched.begin() + static_cast<std::ptrdiff_t>(end);
  }
};

TEST(SalvageResult, SavesEveryUndamagedFrameByteForByte) {
  Random random(20051);
  long saved_frames = 0, whole_frames = 0, mended = 0, relisted = 0;
  for (int round = 0; round < 3000; ++round) {
    const PairBytes whole = make_pair(kFrames, round % 2 == 0);
    const auto original = journal::decode(whole.journal, "journal").records;
    const Damaged damaged(whole, random);
    const SalvageResult saved = salvage_archive(damaged.bytes.pair());
    const PairBytes now = repaired(damaged.bytes, saved);
    const ArchiveFixityReport report = verify_archive(now.pair(), {});
    ASSERT_TRUE(report.is_intact()) << round << ": " << report.problems[0].what;
    ASSERT_EQ(report.frames, saved.frames);

    std::map<Nanoseconds, FrameRecord> stored, missing;
    for (const FrameRecord& record : journal::decode(now.journal, "journal").records) {
      (record.status == FrameStatus::kStored ? stored : missing)[record.time_ns] = record;
    }
    const auto same_bytes = [&](const FrameRecord& a, const FrameRecord& b) {
      return a.size == b.size &&
             std::equal(now.archive.begin() + static_cast<long>(a.offset),
                        now.archive.begin() + static_cast<long>(a.offset + a.size),
                        whole.archive.begin() + static_cast<long>(b.offset));
    };
    std::int64_t changed = 0;
    std::set<Nanoseconds> known;
    for (std::size_t i = 0; i < original.size(); ++i) {
      const FrameRecord& record = original[i];
      const std::size_t line = journal::kHeaderBytes + i * journal::kRecordBytes;
      const bool record_good =
          !Damaged::any(damaged.journal_touched, line, line + journal::kRecordBytes);
      if (record.status != FrameStatus::kStored) {
        if (!record_good) continue;
        ASSERT_TRUE(missing.contains(record.time_ns)) << round << " " << i;
        EXPECT_EQ(missing[record.time_ns], record);
        continue;
      }
      known.insert(record.time_ns);
      const bool jpeg_good =
          !Damaged::any(damaged.archive_touched, record.offset, record.offset + record.size);
      const bool cluster_good =
          !Damaged::any(damaged.archive_touched, record.offset - 35, record.offset);
      const bool there = stored.contains(record.time_ns);
      if (there && !same_bytes(stored[record.time_ns], record)) ++changed;
      if (!jpeg_good || !(cluster_good || (record_good && !damaged.moved))) continue;
      ++whole_frames;
      ASSERT_TRUE(there) << round << ": frame " << i << " is lost";
      ASSERT_TRUE(same_bytes(stored[record.time_ns], record)) << round << ": frame " << i;
      ++saved_frames;
      if (!record_good) continue;
      EXPECT_EQ(stored[record.time_ns].arrival_ns, record.arrival_ns);
      EXPECT_EQ(stored[record.time_ns].sequence, record.sequence);
    }
    // Frames that differ from the recorded ones count as unverified, except one at the end of an
    // unclosed archive, which looks like an interrupted write.
    for (const auto& [time, record] : stored) changed += known.contains(time) ? 0 : 1;
    ASSERT_LE(changed, std::max<std::int64_t>(saved.unverified_frames, round % 2)) << round;
    mended += saved.corrected_records;
    relisted += saved.reindexed_frames;
  }
  EXPECT_EQ(saved_frames, whole_frames);
  EXPECT_GT(saved_frames, 20'000);
  EXPECT_GT(mended, 500);
  EXPECT_GT(relisted, 500);
}

TEST(SalvageResult, OneFlippedBitInTheJournalCostsNothing) {
  const PairBytes whole = make_pair(4, true);
  const auto records = journal::decode(whole.journal, "journal").records;
  PairBytes damaged = whole;
  for (std::size_t bit = 0; bit < 8 * whole.journal.size(); ++bit) {
    testing::flip(damaged.journal, bit);
    const SalvageResult saved = salvage_archive(damaged.pair());
    ASSERT_THAT(saved.losses, IsEmpty()) << bit << " " << saved.losses[0].what;
    ASSERT_EQ(saved.records, records) << bit;
    testing::flip(damaged.journal, bit);
  }
}

TEST(SalvageResult, OneFlippedBitInTheArchiveCostsOneFrameAtMost) {
  const PairBytes whole = make_pair(4, true);
  const auto records = journal::decode(whole.journal, "journal").records;
  PairBytes damaged = whole;
  for (std::size_t bit = 0; bit < 8 * whole.archive.size(); ++bit) {
    testing::flip(damaged.archive, bit);
    const SalvageResult saved = salvage_archive(damaged.pair());
    const bool in_a_frame = std::ranges::any_of(records, [&](const FrameRecord& record) {
      return bit / 8 >= record.offset && bit / 8 < record.offset + record.size;
    });
    if (in_a_frame) {
      ASSERT_EQ(saved.corrupt_frames, 1) << bit;
      ASSERT_EQ(saved.frames, 3);
    } else {
      // Damage of the headers and the Cues: they are written again.
      ASSERT_EQ(saved.records, records) << bit;
    }
    testing::flip(damaged.archive, bit);
  }
  const PairBytes now = repaired(damaged, salvage_archive(damaged.pair()));
  EXPECT_EQ(now.archive, whole.archive);
  EXPECT_EQ(now.journal, whole.journal);
}

TEST(SalvageResult, AJournalOfVersionOneBecomesVersionTwo) {
  const PairBytes old = testing::with_journal_v1(make_pair(5, true));
  PairBytes damaged = old;
  testing::flip(damaged.archive, 8 * (damaged.archive.size() - 5));
  const SalvageResult saved = salvage_archive(damaged.pair());
  EXPECT_THAT(saved.losses, IsEmpty());
  const PairBytes now = repaired(damaged, saved);
  EXPECT_EQ(now.archive, old.archive);
  EXPECT_EQ(journal::decode_header(now.journal, "journal")->version, 2u);
}

TEST(SalvageResult, AnArchiveOfTheFirstVersionIsWrittenInTheNewForm) {
  const PairBytes whole = make_pair(kFrames, true);
  const PairBytes torn = testing::with_archive_v1(make_pair(kFrames, false), false);
  PairBytes damaged = testing::with_archive_v1(whole, true);
  for (const std::size_t bit : {99u, 1200u, 8u * 230u}) testing::flip(damaged.archive, bit);
  for (const PairBytes& first_version : {torn, damaged}) {
    const SalvageResult saved = salvage_archive(first_version.pair());
    EXPECT_TRUE(saved.losses.empty());
    const PairBytes now = repaired(first_version, saved);
    EXPECT_EQ(now.archive, whole.archive);
    EXPECT_EQ(now.journal, whole.journal);
  }
}

std::int64_t unverified_in(const PairBytes& pair) {
  return std::ranges::count_if(journal::decode(pair.journal, "journal").records,
                               [](const FrameRecord& record) { return record.is_unverified; });
}

// What a lost journal no longer shows stays unknown, whatever happens to the archive later.
TEST(SalvageResult, UnverifiedFramesStayUnverified) {
  PairBytes pair = make_pair(kFrames, true);
  pair.has_journal = false;
  SalvageResult saved = salvage_archive(pair.pair());
  EXPECT_EQ(saved.unverified_frames, kFrames);
  pair = repaired(pair, saved);
  EXPECT_EQ(unverified_in(pair), kFrames);
  const ArchiveFixityReport report = verify_archive(pair.pair(), {});
  EXPECT_TRUE(report.is_intact());
  EXPECT_EQ(report.unverified_frames, kFrames);

  // Rot after the repair is still found. The frame is lost then.
  const auto records = journal::decode(pair.journal, "journal").records;
  testing::flip(pair.archive, 8 * (records[3].offset + 2));
  EXPECT_FALSE(verify_archive(pair.pair(), {}).is_intact());
  saved = salvage_archive(pair.pair());
  EXPECT_EQ(saved.unverified_frames, 0);  // none in addition
  EXPECT_EQ(saved.corrupt_frames, 1);
  pair = repaired(pair, saved);
  EXPECT_EQ(unverified_in(pair), kFrames - 1);
}

TEST(SalvageResult, ADamagedRecordOfAnUnverifiedFrameProvesNothing) {
  PairBytes pair = make_pair(kFrames, true);
  pair.has_journal = false;
  pair = repaired(pair, salvage_archive(pair.pair()));
  // Two flipped bits in the time of a record: the hash is still readable.
  const std::size_t at = 8 * (journal::kHeaderBytes + 5 * journal::kRecordBytes);
  testing::flip(pair.journal, at + 3);
  testing::flip(pair.journal, at + 9);
  const SalvageResult saved = salvage_archive(pair.pair());
  EXPECT_EQ(saved.reindexed_frames, 1);
  pair = repaired(pair, saved);
  EXPECT_EQ(unverified_in(pair), kFrames);
}

// Of a frame without a record nothing shows whether it is the recorded one. A single one at the end
// of an open archive is what an interrupted write leaves.
TEST(SalvageResult, OnlyAnInterruptedWriteIsTrustedWithoutItsRecord) {
  const testing::TestFolder folder;
  const auto archive = folder.path() / "a.mkv", file = folder.path() / "a.journal";
  for (const int lacking : {1, 2, kMaxBatchFrames}) {
    std::filesystem::remove(archive);
    std::filesystem::remove(file);
    ArchiveWriter out(archive, file, testing::description());
    std::vector<std::vector<std::byte>> jpegs;
    std::vector<NewFrame> frames;
    for (unsigned i = 0; i < 40; ++i) jpegs.push_back(testing::frame_bytes(i));
    for (unsigned i = 0; i < 40; ++i)
      frames.push_back({testing::frame_time(i), jpegs[i], FrameStatus::kStored, {}, false});
    for (const auto& frame : frames) out.append(std::span(&frame, 1));
    PairBytes pair{testing::bytes_of(archive), testing::bytes_of(file), true};
    pair.journal.resize(journal::kHeaderBytes +
                        static_cast<std::size_t>(40 - lacking) * journal::kRecordBytes);
    const bool by_a_crash = lacking == 1;
    const SalvageResult saved = salvage_archive(pair.pair());
    EXPECT_EQ(saved.unverified_frames, by_a_crash ? 0 : lacking);
    EXPECT_EQ(unverified_in(repaired(pair, saved)), by_a_crash ? 0 : lacking);
    const auto problems = verify_archive(pair.pair(), {}).problems;
    EXPECT_TRUE(std::ranges::all_of(problems, &FixityProblem::not_closed)) << lacking;
  }
}

// Hashing the bytes for each record would take hours.
TEST(SalvageResult, EachFrameIsHashedOnceHoweverManyRecordsStateIt) {
  constexpr std::size_t kCount = 400'000;
  const std::vector<std::byte> frame(400, std::byte{0x55});
  PairBytes pair;
  pair.archive = matroska::make_header(testing::description()).bytes;
  const std::uint64_t first = pair.archive.size() + matroska::kClusterHeaderBytes;
  const auto cluster = matroska::make_cluster_header(1000, frame.size());
  for (std::size_t i = 0; i < kCount; ++i) {
    pair.archive.insert(pair.archive.end(), cluster.begin(), cluster.end());
    pair.archive.insert(pair.archive.end(), frame.begin(), frame.end());
  }
  const auto header = journal::encode_header(testing::description());
  const auto saved_with = [&](std::uint64_t offset, std::size_t size) {
    FrameRecord record{1000, offset, static_cast<std::uint32_t>(size)};
    pair.journal.assign(header.begin(), header.end());
    for (std::size_t i = 0; i < kCount; ++i) {
      record.xxh3 = i;  // wrong
      const auto bytes = journal::encode_record(record);
      pair.journal.insert(pair.journal.end(), bytes.begin(), bytes.end());
    }
    return salvage_archive(pair.pair());
  };
  const auto count = static_cast<std::int64_t>(kCount);
  EXPECT_EQ(saved_with(pair.archive.size(), frame.size()).truncated_frames, count);
  EXPECT_EQ(saved_with(first, pair.archive.size() - first).corrupt_frames, count);
}

// Clusters within clusters: each states the rest of the archive as its frame.
TEST(SalvageResult, NestedClustersAreHashedUpToALimit) {
  constexpr std::size_t kCount = 300'000;
  PairBytes pair;
  pair.archive = matroska::make_header(testing::description()).bytes;
  const std::size_t begin = pair.archive.size();
  for (std::size_t i = 0; i < kCount; ++i) {
    const std::size_t rest = (kCount - i - 1) * matroska::kClusterHeaderBytes + 50;
    const auto cluster = matroska::make_cluster_header(1000, rest);
    pair.archive.insert(pair.archive.end(), cluster.begin(), cluster.end());
  }
  pair.archive.resize(begin + kCount * matroska::kClusterHeaderBytes + 50);
  const auto header = journal::encode_header(testing::description());
  pair.journal.assign(header.begin(), header.end());
  for (const bool has_record : {false, true}) {
    if (has_record) {
      FrameRecord record{1000, begin + matroska::kClusterHeaderBytes, 50};
      record.xxh3 = 7;  // wrong: all clusters of its time are looked at
      const auto bytes = journal::encode_record(record);
      pair.journal.insert(pair.journal.end(), bytes.begin(), bytes.end());
    }
    const SalvageResult saved = salvage_archive(pair.pair());
    std::uint64_t bytes = 0;
    for (const FrameRecord& record : saved.records) bytes += record.size;
    EXPECT_LE(bytes, 16 * pair.archive.size());
  }
}

TEST(SalvageResult, AMovedFrameIsFoundAmongOthersOfItsTimeAndSize) {
  const testing::TestFolder folder;
  const auto pair_of = [&](int value) {  // one frame of 50 equal bytes
    const std::string name = (folder.path() / std::to_string(value)).string();
    const std::vector<std::byte> frame(50, static_cast<std::byte>(value));
    ArchiveWriter out(name + ".mkv", name + ".journal", testing::description());
    out.append(frame, 1000);
    return PairBytes{testing::bytes_of(name + ".mkv"), testing::bytes_of(name + ".journal"), true};
  };
  PairBytes pair = pair_of(2);  // its record remains
  const auto header =
      static_cast<std::ptrdiff_t>(matroska::make_header(testing::description()).bytes.size());
  const std::vector<std::byte> cluster(pair.archive.begin() + header, pair.archive.end());
  const std::vector<std::byte> other = pair_of(1).archive;
  pair.archive = other;
  for (int i = 0; i < 2; ++i) {
    pair.archive.insert(pair.archive.end(), cluster.begin(), cluster.end());
  }
  const SalvageResult saved = salvage_archive(pair.pair());
  ASSERT_EQ(saved.records.size(), 1u);
  EXPECT_EQ(saved.records[0].offset, other.size() + matroska::kClusterHeaderBytes);
}

TEST(SalvageResult, RefusesTheFilesOfAnotherCamera) {
  PairBytes pair = make_pair(3, true);
  ArchivePair foreign = pair.pair();
  foreign.description.camera_id = "r9c9";
  EXPECT_THROW(salvage_archive(foreign), Error);
  foreign.journal.reset();
  EXPECT_THROW(salvage_archive(foreign), Error);
}

}  // namespace
}  // namespace raystage::store
