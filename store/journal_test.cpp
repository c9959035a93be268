// SPDX-License-Identifier: Apache-2.0
#include "store/journal.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <xxhash.h>

#include <array>
#include <filesystem>
#include <fstream>

#include "base/error.h"
#include "base/little_endian.h"
#include "base/mapped_file.h"
#include "store/matroska.h"
#include "store/timeline_file.h"
#include "testing/store/archive_test_data.h"
#include "testing/store/take_test_data.h"

namespace raystage::store {
namespace {

using testing::bytes_of;
using testing::description;
using testing::fake_jpeg;
using ::testing::HasSubstr;

struct Journal : ::testing::Test, testing::ArchiveFiles {};

TEST_F(Journal, KeepsWhereFramesCameFrom) {
  {
    ArchiveWriter out = writer();
    out.append(fake_jpeg(1), 10, {17, 41});
    out.append_missing(FrameStatus::kDroppedDiskFull, 20, {-3, 0xFFFF'FFFF'FFFF'FFFF});
    out.append(fake_jpeg(2), 30);
  }
  const ArchiveReader in = reader();
  ASSERT_EQ(in.records().size(), 3u);
  EXPECT_EQ(in.records()[0].arrival_ns, 17);
  EXPECT_EQ(in.records()[0].sequence, 41u);
  EXPECT_EQ(in.records()[1].arrival_ns, -3);
  EXPECT_EQ(in.records()[1].sequence, 0xFFFF'FFFF'FFFF'FFFF);
  EXPECT_EQ(in.records()[2].arrival_ns, kUnknownTime);
  EXPECT_EQ(in.records()[2].sequence, 0u);
  EXPECT_EQ(in.frames()[0], in.records()[0]);
}

TEST_F(Journal, EveryStatusComesBackAndHasAName) {
  {
    ArchiveWriter out = writer();
    for (std::size_t i = 1; i < kFrameStatusCount; ++i) {
      out.append_missing(static_cast<FrameStatus>(i), static_cast<Nanoseconds>(i));
    }
  }
  const ArchiveReader in = reader();
  ASSERT_EQ(in.records().size(), kFrameStatusCount - 1);
  for (std::size_t i = 1; i < kFrameStatusCount; ++i) {
    EXPECT_EQ(in.records()[i - 1].status, static_cast<FrameStatus>(i));
    EXPECT_STRNE(name_of(static_cast<FrameStatus>(i)), "unknown");
  }
  EXPECT_STREQ(name_of(FrameStatus::kDroppedDiskFull), "dropped, could not be written");
  EXPECT_STREQ(name_of(FrameStatus::kDroppedLate), "dropped, arrived out of order");
  EXPECT_STREQ(name_of(FrameStatus::kUnreadable), "no JPEG or of another size");
}

TEST_F(Journal, KeepsThatAFrameIsUnverified) {
  {
    ArchiveWriter out = writer();
    FrameRecord record{.time_ns = 5, .arrival_ns = 7, .sequence = 9, .is_unverified = true};
    out.append_again(record, fake_jpeg(1));
    record.time_ns = 6;
    record.is_unverified = false;
    out.append_again(record, fake_jpeg(2));
    out.append_again({.time_ns = 7, .status = FrameStatus::kTorn, .is_unverified = true}, {});
  }
  const ArchiveReader in = reader();
  ASSERT_EQ(in.records().size(), 3u);
  EXPECT_EQ(in.damaged_records(), 0);
  EXPECT_TRUE(in.records()[0].is_unverified);
  EXPECT_EQ(in.records()[0].status, FrameStatus::kStored);
  EXPECT_EQ(in.records()[0].arrival_ns, 7);
  EXPECT_EQ(in.records()[0].sequence, 9u);
  EXPECT_TRUE(std::ranges::equal(in.jpeg(0), fake_jpeg(1)));
  EXPECT_FALSE(in.records()[1].is_unverified);
  // A missing frame has nothing to verify.
  EXPECT_EQ(in.records()[2].status, FrameStatus::kTorn);
  EXPECT_FALSE(in.records()[2].is_unverified);
}

// Version 1 never had the mark, so that there it is damage.
TEST_F(Journal, VersionOneHasNoUnverifiedFrames) {
  const FrameRecord record{.time_ns = 5, .offset = 99, .size = 3, .xxh3 = 7, .is_unverified = true};
  EXPECT_TRUE(journal::decode_record(journal::encode_record(record), 2));
  EXPECT_FALSE(journal::decode_record(journal::encode_record_v1(record), 1));
}

TEST_F(Journal, MissingFramesMayShareATime) {
  {
    ArchiveWriter out = writer();
    EXPECT_EQ(out.last_time(), -1);
    out.append_missing(FrameStatus::kDroppedRamFull, 0, {1, 1});
    out.append_missing(FrameStatus::kDroppedEncoder, 0, {2, 2});
    out.append(fake_jpeg(1), 0, {3, 3});
    out.append_missing(FrameStatus::kDroppedLate, 0, {4, 4});
    EXPECT_THROW(out.append(fake_jpeg(2), 0), Error);
    out.append(fake_jpeg(2), 5, {5, 5});
    out.append_missing(FrameStatus::kDroppedLate, out.last_time(), {6, 6});
    EXPECT_THROW(out.append_missing(FrameStatus::kDroppedLate, 4), Error);
    EXPECT_EQ(out.last_time(), 5);
  }
  const ArchiveReader in = reader();
  EXPECT_EQ(in.damaged_records(), 0);
  ASSERT_EQ(in.records().size(), 6u);
  for (std::size_t i = 0; i < 6; ++i) EXPECT_EQ(in.records()[i].sequence, i + 1);
  ASSERT_EQ(in.frames().size(), 2u);
  EXPECT_EQ(in.frames()[1].time_ns, 5);
}

// Builds a journal of version 1 by its specification, not with our encoder.
TEST_F(Journal, VersionOneIsRead) {
  writer().close();  // for the archive's header
  std::vector<std::byte> archive = bytes_of(mkv);
  const auto plain = matroska::make_header(description());
  archive = plain.bytes;
  std::vector<std::byte> bytes(64);
  const char magic[] = "RAYSJRNL";
  for (std::size_t i = 0; i < 8; ++i) bytes[i] = static_cast<std::byte>(magic[i]);
  store_little_endian(bytes, 8, std::uint32_t{1});
  store_little_endian(bytes, 12, std::uint32_t{32});
  store_little_endian(bytes, 16, description().epoch_utc);
  store_little_endian(bytes, 24, std::uint64_t{XXH3_64bits("r0c0", 4)});
  store_little_endian(bytes, 56, std::uint64_t{XXH3_64bits(bytes.data(), 56)});
  const auto add = [&](std::int64_t time, std::uint64_t offset, std::uint32_t size,
                       std::uint32_t status, std::uint64_t hash) {
    std::array<std::byte, 32> line{};
    store_little_endian(line, 0, time);
    store_little_endian(line, 8, offset);
    store_little_endian(line, 16, size);
    store_little_endian(line, 20, status);
    store_little_endian(line, 24, hash);
    const std::uint64_t check = XXH3_64bits(line.data(), line.size());
    store_little_endian(line, 20, status | (static_cast<std::uint32_t>(check) & 0xFFFFFF00u));
    bytes.insert(bytes.end(), line.begin(), line.end());
  };
  for (unsigned i = 0; i < 3; ++i) {
    const auto jpeg = fake_jpeg(i, 50);
    const auto cluster = matroska::make_cluster_header(10 * (i + 1), jpeg.size());
    archive.insert(archive.end(), cluster.begin(), cluster.end());
    add(10 * (i + 1), archive.size(), 50, 0, XXH3_64bits(jpeg.data(), jpeg.size()));
    archive.insert(archive.end(), jpeg.begin(), jpeg.end());
    if (i == 1) add(25, 0, 0, 2, 0);
  }
  testing::overwrite(mkv, archive);
  testing::overwrite(journal, bytes);

  const auto check = [&](const ArchiveReader& in, std::size_t frames) {
    EXPECT_EQ(in.damaged_records(), 0);
    EXPECT_EQ(in.recovered_frames(), 0);
    ASSERT_EQ(in.records().size(), frames + 1);
    ASSERT_EQ(in.frames().size(), frames);
    EXPECT_EQ(in.records()[2].status, FrameStatus::kDroppedRamFull);
    EXPECT_EQ(in.records()[2].time_ns, 25);
    for (unsigned i = 0; i < 3; ++i) {
      EXPECT_EQ(in.frames()[i].time_ns, 10 * (i + 1));
      EXPECT_EQ(in.frames()[i].arrival_ns, kUnknownTime);
      EXPECT_EQ(in.frames()[i].sequence, 0u);
      EXPECT_TRUE(in.verify_frame(static_cast<int>(i)));
    }
  };
  check(reader(), 3);
  // Resuming upgrades it to version 2.
  ArchiveWriter::resume(mkv, journal, description()).append(fake_jpeg(3), 40, {5, 6});
  check(reader(), 4);
  EXPECT_EQ(reader().frames()[3].sequence, 6u);
  EXPECT_EQ(journal::decode_header(bytes_of(journal), "journal")->version, 2u);
}

// Includes the fields that no other check covers: arrival, sequence number, time of a missing
// frame.
TEST_F(Journal, NoOneOrTwoFlippedBitsPassTheCheck) {
  const FrameRecord record{123'456'789, 0, 0, FrameStatus::kDroppedLate, 0, 987'654'321, 42};
  auto bytes = journal::encode_record(record);
  ASSERT_EQ(journal::decode_record(bytes, 2), record);
  constexpr std::size_t kBits = 8 * journal::kRecordBytes;
  const auto flip = [&](std::size_t bit) {
    bytes[bit / 8] ^= static_cast<std::byte>(1u << (bit % 8));
  };
  for (std::size_t first = 0; first < kBits; ++first) {
    flip(first);
    ASSERT_FALSE(journal::decode_record(bytes, 2).has_value()) << first;
    for (std::size_t second = first + 1; second < kBits; ++second) {
      flip(second);
      ASSERT_FALSE(journal::decode_record(bytes, 2).has_value()) << first << " " << second;
      flip(second);
    }
    flip(first);
  }
  EXPECT_EQ(journal::decode_record(bytes, 2), record);
}

// A timeline remains valid if it was made with a journal of version 1, or before a repair.
TEST_F(Journal, ArrivalsAreNoPartOfWhatATimelineStandsOn) {
  const auto fingerprint = [&](const std::string& name, FrameOrigin origin, unsigned seed) {
    TakeWriter out(folder.path() / name, testing::take_document(1), testing::rig_document(1));
    out.archive(0).append(fake_jpeg(seed), 10, origin);
    out.commit();
    return take_fingerprint(Take(folder.path() / name));
  };
  EXPECT_EQ(fingerprint("a", {}, 1), fingerprint("b", {5, 6}, 1));
  EXPECT_NE(fingerprint("c", {}, 1), fingerprint("d", {}, 2));
}

// A file of holes can be of any size.
TEST_F(Journal, IsRefusedWhereItIsLargerThanAnyRecording) {
  const std::filesystem::path file = folder.path() / "holes.journal";
  std::ofstream(file).put('x');
  std::filesystem::resize_file(file, journal::kMaxBytes + 1);
  const MappedFile mapped(file);
  try {
    journal::decode(mapped.bytes(), "holes.journal");
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
    EXPECT_THAT(error.what(), HasSubstr("holes.journal: the journal has 4294967297 bytes"));
  }
}

TEST_F(Journal, IsRefusedFromTheFuture) {
  for (const std::uint32_t version : {0u, 3u, 1000u}) {
    const auto header = journal::encode_header(description(), version);
    try {
      journal::decode(header, "a.journal");
      FAIL() << version;
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
      EXPECT_THAT(error.what(), HasSubstr("version " + std::to_string(version) + " "));
      EXPECT_THAT(error.what(), HasSubstr("reads versions 1 to 2"));
      EXPECT_THAT(error.what(), HasSubstr("newer Raystage"));
    }
  }
}

}  // namespace
}  // namespace raystage::store
