// SPDX-License-Identifier: Apache-2.0
// Truncates archives and journals at every byte: each complete frame remains readable.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "store/archive_index.h"
#include "store/journal.h"
#include "store/matroska.h"
#include "testing/store/archive_test_data.h"
#include "testing/test_folder.h"

namespace raystage::store {
namespace {

using Bytes = std::span<const std::byte>;
using testing::bytes_of;
using testing::description;
using testing::fake_jpeg;

constexpr unsigned kFrames = 12;

struct Cut : ::testing::TestWithParam<bool> {
  Cut() {
    const auto mkv = folder.path() / "a.mkv";
    const auto journal_file = folder.path() / "a.journal";
    ArchiveWriter writer(mkv, journal_file, description());
    for (unsigned i = 0; i < kFrames; ++i) {
      if (i == 5) writer.append_missing(FrameStatus::kDroppedBySource, 95);
      writer.append(fake_jpeg(i, 40 + i), time(i));
    }
    if (GetParam()) writer.close();
    archive = bytes_of(mkv);
    journal = bytes_of(journal_file);
    whole = index_archive(archive, journal, "a.mkv", "a.journal");
  }
  static Nanoseconds time(unsigned i) { return 20 * i; }

  std::size_t frames_within(std::size_t bytes) const {
    return static_cast<std::size_t>(std::ranges::count_if(
        whole.frames, [&](const FrameRecord& f) { return f.offset + f.size <= bytes; }));
  }
  void expect_frames(const ArchiveIndex& index, std::size_t count, Bytes file) const {
    ASSERT_EQ(index.frames.size(), count);
    for (std::size_t i = 0; i < count; ++i) {
      const FrameRecord& frame = index.frames[i];
      ASSERT_EQ(frame.time_ns, time(static_cast<unsigned>(i)));
      ASSERT_TRUE(std::ranges::equal(file.subspan(frame.offset, frame.size),
                                     fake_jpeg(static_cast<unsigned>(i), 40 + i)));
    }
  }

  testing::TestFolder folder;
  std::vector<std::byte> archive, journal;
  ArchiveIndex whole;
};

TEST_P(Cut, WholeFileHasEverything) {
  ASSERT_NO_FATAL_FAILURE(expect_frames(whole, kFrames, archive));
  EXPECT_EQ(whole.records.size(), kFrames + 1);
  EXPECT_EQ(whole.closed, GetParam());
  EXPECT_EQ(whole.damaged_records, 0);
}

TEST_P(Cut, ArchiveWithoutJournal) {
  for (std::size_t size = 0; size <= archive.size(); ++size) {
    const Bytes file = Bytes(archive).first(size);
    const auto index = index_archive(file, std::nullopt, "a.mkv", "a.journal");
    ASSERT_NO_FATAL_FAILURE(expect_frames(index, frames_within(size), file)) << size;
    EXPECT_EQ(index.closed, GetParam() && size == archive.size());
  }
}

TEST_P(Cut, ArchiveWithItsJournal) {
  for (std::size_t size = 0; size <= archive.size(); ++size) {
    const Bytes file = Bytes(archive).first(size);
    const auto index = index_archive(file, journal, "a.mkv", "a.journal");
    ASSERT_NO_FATAL_FAILURE(expect_frames(index, frames_within(size), file)) << size;
    // The records of truncated frames remain, with a status of missing.
    ASSERT_EQ(index.records.size(), kFrames + 1) << size;
    EXPECT_EQ(index.records[5].status, FrameStatus::kDroppedBySource);
    for (std::size_t i = frames_within(size) + (frames_within(size) >= 5 ? 1 : 0); i < kFrames + 1;
         ++i) {
      if (i != 5) {
        EXPECT_EQ(index.records[i].status, FrameStatus::kTorn) << size << " " << i;
      }
    }
  }
}

TEST_P(Cut, Journal) {
  for (std::size_t size = 0; size <= journal.size(); ++size) {
    const auto index = index_archive(archive, Bytes(journal).first(size), "a.mkv", "a.journal");
    ASSERT_NO_FATAL_FAILURE(expect_frames(index, kFrames, archive)) << size;
    const std::size_t records =
        size < journal::kHeaderBytes ? 0 : (size - journal::kHeaderBytes) / journal::kRecordBytes;
    EXPECT_EQ(index.records.size(), kFrames + (records > 5 ? 1u : 0u)) << size;
    const std::size_t listed = records - (records > 5 ? 1 : 0);
    EXPECT_EQ(static_cast<std::size_t>(index.recovered), kFrames - listed) << size;
  }
}

TEST_P(Cut, BothAtOnce) {
  for (std::size_t size = 0; size <= archive.size(); size += 13) {
    for (std::size_t lines = 0; lines <= journal.size(); lines += 29) {
      const Bytes file = Bytes(archive).first(size);
      const auto index = index_archive(file, Bytes(journal).first(lines), "a.mkv", "a.journal");
      ASSERT_NO_FATAL_FAILURE(expect_frames(index, frames_within(size), file)) << size;
    }
  }
}

// A flipped bit costs at most one frame. With the journal it costs none, although pixels may be
// wrong.
TEST_P(Cut, RottenByteWithoutJournal) {
  const auto begin = whole.frames.front().offset - matroska::kClusterHeaderBytes;
  const auto end = whole.frames.back().offset + whole.frames.back().size;
  for (auto at = begin; at < end; ++at) {
    for (const unsigned bit : {0u, 3u, 7u}) {
      auto bytes = archive;
      bytes[at] ^= static_cast<std::byte>(1u << bit);
      const auto index = index_archive(bytes, std::nullopt, "a.mkv", "");
      EXPECT_GE(index.frames.size(), kFrames - 1) << at << " " << bit;
      const auto with_journal = index_archive(bytes, journal, "a.mkv", "a.journal");
      // The last frame of an unclosed file is torn if its hash fails.
      EXPECT_GE(with_journal.frames.size(), kFrames - (GetParam() ? 0 : 1)) << at << " " << bit;
    }
  }
}

// A walk over all records of that time for each truncated frame would take hours.
TEST(ArchiveIndex, AMillionTruncatedFramesOfOneTime) {
  constexpr std::size_t kRecords = 1'000'000;
  const auto header = journal::encode_header(description());
  FrameRecord missing, truncated;
  missing.time_ns = truncated.time_ns = 7;
  missing.status = FrameStatus::kDroppedLate;
  truncated.offset = std::uint64_t{1} << 40;
  truncated.size = 1;
  std::vector<std::byte> journal(header.begin(), header.end());
  journal.reserve(journal.size() + 2 * kRecords * journal::kRecordBytes);
  for (const FrameRecord& record : {missing, truncated}) {
    const auto bytes = journal::encode_record(record);
    for (std::size_t i = 0; i < kRecords; ++i) {
      journal.insert(journal.end(), bytes.begin(), bytes.end());
    }
  }
  const auto archive = matroska::make_header(description()).bytes;
  const ArchiveIndex index = index_archive(archive, journal, "a.mkv", "a.journal");
  EXPECT_EQ(index.records.size(), 2 * kRecords);
  EXPECT_EQ(index.records.back().status, FrameStatus::kTorn);
  EXPECT_TRUE(index.frames.empty());
}

INSTANTIATE_TEST_SUITE_P(Archive, Cut, ::testing::Values(false, true), [](const auto& parameter) {
  return parameter.param ? "Closed" : "Unclosed";
});

}  // namespace
}  // namespace raystage::store
