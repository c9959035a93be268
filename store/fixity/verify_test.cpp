// SPDX-License-Identifier: Apache-2.0
#include "store/fixity/verify.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <random>
#include <stop_token>
#include <thread>

#include "base/atomic_file.h"
#include "base/error.h"
#include "base/mapped_file.h"
#include "schemas/recording_document.h"
#include "store/jpeg/encode.h"
#include "store/matroska.h"
#include "store/timeline.h"
#include "testing/store/fixity_test_data.h"
#include "testing/store/take_test_data.h"

namespace raystage::store {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::make_pair;
using testing::PairBytes;

ArchiveFixityReport verify(const PairBytes& bytes, VerifyDepth depth = VerifyDepth::kHashes) {
  VerifyOptions options;
  options.depth = depth;
  return verify_archive(bytes.pair(), options);
}

bool is_damaged(const ArchiveFixityReport& report) {
  return std::ranges::count(report.problems, false, &FixityProblem::not_closed) > 0;
}

constexpr VerifyDepth kDepths[] = {VerifyDepth::kSizes, VerifyDepth::kJournal,
                                   VerifyDepth::kHashes};

TEST(VerifyArchive, NothingIsWrongWithWholeOnes) {
  for (const unsigned frames : {0u, 1u, 2u, 7u, 30u}) {
    for (const VerifyDepth depth : kDepths) {
      const PairBytes pair = make_pair(frames, true);
      const ArchiveFixityReport report = verify(pair, depth);
      EXPECT_TRUE(report.is_intact()) << frames << ": " << report.problems[0].what;
      EXPECT_EQ(report.frames, depth == VerifyDepth::kSizes ? 0 : frames);
      EXPECT_TRUE(verify(testing::with_journal_v1(pair), depth).is_intact());
      EXPECT_TRUE(verify(testing::with_archive_v1(pair, true), depth).is_intact());
    }
  }
}

// Files of holes can be of any size: nothing waits for their end.
TEST(VerifyArchive, AStopDoesNotWaitForTheEndOfAHugeFile) {
  PairBytes pair = make_pair(2, true);
  const testing::TestFolder folder;
  const auto grown = [&](const char* name, const std::vector<std::byte>& bytes,
                         std::uintmax_t size) {
    const std::filesystem::path file = folder.path() / name;
    std::ofstream(file, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()),
               static_cast<std::streamsize>(bytes.size()));
    std::filesystem::resize_file(file, size);
    return file;
  };
  const MappedFile archive(grown("a.mkv", pair.archive, std::uintmax_t{1} << 40));
  const MappedFile journal(grown("a.journal", pair.journal, journal::kMaxBytes));
  for (const VerifyDepth depth : kDepths) {
    for (const bool has_large_journal : {false, true}) {
      ArchivePair large = pair.pair();
      large.archive = archive.bytes();
      if (has_large_journal) large.journal = journal.bytes();
      std::stop_source stop;
      std::jthread asks([&] {
        std::this_thread::sleep_for(std::chrono::milliseconds(100));
        stop.request_stop();
      });
      VerifyOptions options;
      options.depth = depth;
      options.can_read = [&](std::span<const std::byte> part) { return archive.can_read(part); };
      options.stop = stop.get_token();
      const ArchiveFixityReport report = verify_archive(large, options);
      if (depth != VerifyDepth::kSizes) {
        EXPECT_EQ(report.status, RunStatus::kStopped);
      }
    }
  }
}

TEST(VerifyArchive, AfterACrashItIsNotClosedAndNothingElse) {
  for (const unsigned frames : {0u, 1u, 7u}) {
    const PairBytes whole = make_pair(frames, false);
    // Crashes while a frame was written, while its record was written, and between the two.
    PairBytes torn_frame = whole, torn_record = whole, no_record = whole;
    const auto cluster = matroska::make_cluster_header(900'000, 100);
    for (PairBytes* pair : {&torn_frame, &torn_record, &no_record}) {
      pair->archive.insert(pair->archive.end(), cluster.begin(), cluster.end());
    }
    torn_frame.archive.resize(torn_frame.archive.size() + 60);
    torn_record.archive.resize(torn_record.archive.size() + 100);
    torn_record.journal.resize(torn_record.journal.size() + 20);
    no_record.archive.resize(no_record.archive.size() + 100);
    for (const PairBytes& pair : {whole, torn_frame, torn_record, no_record}) {
      for (const VerifyDepth depth : kDepths) {
        const ArchiveFixityReport report = verify(pair, depth);
        ASSERT_EQ(report.problems.size(), 1u) << report.problems[0].what;
        EXPECT_TRUE(report.problems[0].not_closed);
        EXPECT_THAT(report.problems[0].what, HasSubstr("not closed"));
      }
    }
    EXPECT_THAT(verify(torn_frame).problems[0].what, HasSubstr("95 bytes follow"));
    EXPECT_THAT(verify(torn_record).problems[0].what, HasSubstr("last record is torn"));
    EXPECT_THAT(verify(no_record).problems[0].what, HasSubstr("journal lacks: 1"));
    // Truncated during close().
    const PairBytes closed = make_pair(frames, true);
    for (std::size_t size = whole.archive.size(); size < closed.archive.size(); ++size) {
      PairBytes pair = whole;
      pair.archive.insert(pair.archive.end(),
                          closed.archive.begin() + static_cast<std::ptrdiff_t>(pair.archive.size()),
                          closed.archive.begin() + static_cast<std::ptrdiff_t>(size));
      ASSERT_EQ(verify(pair).problems.size(), 1u);
      ASSERT_FALSE(is_damaged(verify(pair)));
    }
  }
}

// Flips every bit of every byte: header, padding, cluster headers, frames, Cues, records.
TEST(VerifyArchive, FindsAnyFlippedBit) {
  for (const PairBytes& whole :
       {make_pair(7, true), make_pair(7, false), make_pair(0, true), make_pair(0, false),
        make_pair(1, true), testing::with_journal_v1(make_pair(7, true)),
        testing::with_archive_v1(make_pair(7, true), true),
        testing::with_archive_v1(make_pair(7, false), false)}) {
    PairBytes pair = whole;
    for (auto* file : {&pair.archive, &pair.journal}) {
      for (std::size_t bit = 0; bit < 8 * file->size(); ++bit) {
        testing::flip(*file, bit);
        bool found = false;
        try {
          found = is_damaged(verify(pair));
        } catch (const Error&) {
          found = true;
        }
        ASSERT_TRUE(found) << (file == &pair.archive ? "archive" : "journal") << " bit " << bit;
        testing::flip(*file, bit);
      }
    }
    ASSERT_FALSE(is_damaged(verify(pair)));
  }
}

TEST(VerifyArchive, SaysWhereAndWhichFrame) {
  const PairBytes whole = make_pair(7, true);
  const auto contents = journal::decode(whole.journal, "journal");
  const FrameRecord fourth = contents.records[4];  // follows the record of a missing frame
  ASSERT_EQ(fourth.time_ns, testing::frame_time(3));
  const AffectedFrame affected{3, fourth.time_ns};
  const auto only_problem = [](const PairBytes& pair,
                               VerifyDepth depth = VerifyDepth::kHashes) -> FixityProblem {
    const ArchiveFixityReport report = verify(pair, depth);
    EXPECT_EQ(report.problems.size(), 1u);
    return report.problems.empty() ? FixityProblem{} : report.problems[0];
  };
  {
    PairBytes pair = whole;
    pair.archive[fourth.offset + 11] ^= std::byte{4};
    EXPECT_TRUE(verify(pair, VerifyDepth::kJournal).is_intact());
    const FixityProblem problem = only_problem(pair);
    EXPECT_EQ(problem.file, "r0c0.mkv");
    EXPECT_EQ(problem.offset, fourth.offset);
    EXPECT_THAT(problem.what, HasSubstr("XXH3"));
    EXPECT_THAT(problem.frames, ElementsAre(affected));
  }
  {
    PairBytes pair = whole;
    pair.archive[fourth.offset - 20] ^= std::byte{4};
    EXPECT_TRUE(verify(pair, VerifyDepth::kSizes).is_intact());
    const FixityProblem problem = only_problem(pair, VerifyDepth::kJournal);
    EXPECT_EQ(problem.offset, fourth.offset - 20);
    EXPECT_THAT(problem.what, HasSubstr("Matroska header of a frame"));
    EXPECT_THAT(problem.frames, ElementsAre(affected));
  }
  {
    PairBytes pair = whole;
    const std::size_t at = journal::kHeaderBytes + 4 * journal::kRecordBytes;
    pair.journal[at + 40] ^= std::byte{4};
    const FixityProblem problem = only_problem(pair, VerifyDepth::kJournal);
    EXPECT_EQ(problem.file, "r0c0.journal");
    EXPECT_EQ(problem.offset, at);
    EXPECT_THAT(problem.frames, ElementsAre(affected));
  }
  {
    PairBytes pair = whole;  // the record of a missing frame
    pair.journal[journal::kHeaderBytes + 3 * journal::kRecordBytes + 40] ^= std::byte{4};
    EXPECT_THAT(only_problem(pair).frames, ::testing::IsEmpty());
  }
  {
    PairBytes pair = whole;
    pair.archive[pair.archive.size() - 3] ^= std::byte{4};
    const FixityProblem problem = only_problem(pair, VerifyDepth::kJournal);
    EXPECT_EQ(problem.offset, pair.archive.size() - 3);
    EXPECT_THAT(problem.what, HasSubstr("Cues"));
  }
  {
    PairBytes pair = whole;
    pair.archive.resize(fourth.offset + 10);
    EXPECT_EQ(only_problem(pair, VerifyDepth::kSizes).offset, pair.archive.size());
    const FixityProblem problem = only_problem(pair);
    EXPECT_EQ(problem.offset, pair.archive.size());
    EXPECT_THAT(problem.what, HasSubstr("are lost: 4"));
    ASSERT_EQ(problem.frames.size(), 4u);
    EXPECT_EQ(problem.frames[0], affected);
  }
  {
    PairBytes pair = whole;
    pair.archive.push_back(std::byte{0});
    EXPECT_FALSE(verify(pair, VerifyDepth::kSizes).is_intact());
    EXPECT_FALSE(verify(pair, VerifyDepth::kJournal).is_intact());
  }
  {
    PairBytes pair = whole;
    pair.has_journal = false;
    EXPECT_THAT(verify(pair).problems[0].what, HasSubstr("journal is missing"));
  }
  {
    PairBytes pair = whole;
    auto other = testing::description();
    other.camera_id = "r0c1";
    std::ranges::copy(journal::encode_header(other), pair.journal.begin());
    EXPECT_THAT(only_problem(pair).what, HasSubstr("journal is of another camera"));
  }
}

TEST(VerifyArchive, KeepsTheListShort) {
  const PairBytes whole = make_pair(1500, true);
  PairBytes pair = whole;
  for (const FrameRecord& record : journal::decode(whole.journal, "journal").records) {
    if (record.status == FrameStatus::kStored) pair.archive[record.offset] ^= std::byte{1};
  }
  const ArchiveFixityReport report = verify(pair);
  EXPECT_EQ(report.problems.size(), kMaxProblems);
  EXPECT_EQ(report.omitted_problems, 500u);
}

struct VerifyTake : ::testing::Test {
  VerifyTake() {
    std::vector<std::vector<Nanoseconds>> times(3);
    for (auto& column : times) {
      for (int i = 0; i < 10; ++i) column.push_back(i * 50'000'000);
    }
    testing::write_take(take, times, 20);
    write_timeline(build_timeline(Take(take), 0, 0), take);
  }
  TakeFixityReport verify(VerifyDepth depth = VerifyDepth::kHashes) const {
    TakeVerifyOptions options;
    options.depth = depth;
    return verify_take(take, options);
  }
  void damage(const std::string& file, std::size_t bit) const {
    auto bytes = testing::bytes_of(take / file);
    testing::flip(bytes, bit % (8 * bytes.size()));
    testing::overwrite(take / file, bytes);
  }

  testing::TestFolder folder;
  std::filesystem::path take = folder.path() / "take";
};

TEST_F(VerifyTake, NothingIsWrongWithAWholeOne) {
  for (const VerifyDepth depth : kDepths) {
    double done = 0;
    TakeVerifyOptions options;
    options.depth = depth;
    std::mutex mutex;
    options.progress = [&](double share) {
      const std::scoped_lock lock(mutex);
      done = std::max(done, share);
    };
    const TakeFixityReport report = verify_take(take, options);
    EXPECT_TRUE(report.is_intact());
    EXPECT_EQ(report.cameras.size(), 3u);
    EXPECT_EQ(done, 1);
  }
}

TEST_F(VerifyTake, FindsAThousandRandomFlips) {
  std::mt19937_64 random(20051);
  const std::vector<std::string> files{"archive/c0.mkv",     "archive/c1.mkv",
                                       "archive/c2.mkv",     "archive/c0.journal",
                                       "archive/c1.journal", "archive/c2.journal"};
  for (int i = 0; i < 1000; ++i) {
    const std::string& file = files[random() % files.size()];
    const std::size_t bit = random();
    damage(file, bit);
    const TakeFixityReport report = verify();
    ASSERT_FALSE(report.is_intact()) << file << " bit " << bit;
    ASSERT_TRUE(report.is_readable());
    for (const auto& camera : report.cameras) {
      const bool hit = file.find(camera.id) != std::string::npos;
      ASSERT_EQ(camera.report.is_intact(), !hit) << file << " bit " << bit;
    }
    damage(file, bit);  // restores the bit
  }
  EXPECT_TRUE(verify().is_intact());
}

TEST_F(VerifyTake, MissingFilesAndATimelineThatDoesNotFit) {
  auto bytes = testing::bytes_of(take / "timeline.zst");
  bytes.pop_back();
  testing::overwrite(take / "timeline.zst", bytes);
  EXPECT_TRUE(verify(VerifyDepth::kSizes).is_intact());
  TakeFixityReport report = verify(VerifyDepth::kJournal);
  ASSERT_EQ(report.problems.size(), 1u);
  EXPECT_EQ(report.problems[0].file, "timeline.zst");
  std::filesystem::remove(take / "timeline.zst");
  EXPECT_TRUE(verify().is_intact());
  std::filesystem::remove(take / "archive/c1.mkv");
  for (const VerifyDepth depth : kDepths) {
    report = verify(depth);
    ASSERT_EQ(report.cameras[1].report.problems.size(), 1u);
    EXPECT_THAT(report.cameras[1].report.problems[0].what, HasSubstr("archive is missing"));
  }
  std::filesystem::remove(take / "rig.json");
  EXPECT_THROW(verify(), Error);
}

TEST_F(VerifyTake, EveryNodesAccountMustBeReadable) {
  schemas::RecordingDocument account;
  account.node = "one";
  std::filesystem::create_directory(take / "recording");
  const std::string whole = schemas::format_recording(account);
  write_file_atomically(take / "recording/one.json", whole);
  write_file_atomically(take / "recording/two.json", whole);
  EXPECT_TRUE(verify().is_intact());
  std::string future = whole;
  const auto version = future.find("recording/1");
  ASSERT_NE(version, std::string::npos);
  future.replace(version, 11, "recording/9");
  for (const std::string& damaged : {whole.substr(0, whole.size() / 2), future, std::string()}) {
    write_file_atomically(take / "recording/two.json", damaged);
    for (const VerifyDepth depth : kDepths) {
      const TakeFixityReport report = verify(depth);
      EXPECT_FALSE(report.is_intact()) << damaged;
      ASSERT_EQ(report.problems.size(), 1u);
      EXPECT_EQ(report.problems[0].file, "recording/two.json");
    }
  }
}

TEST_F(VerifyTake, AFutureJournalCannotBeJudged) {
  const schemas::TakeDocument document = testing::take_document(3);
  testing::overwrite(take / "archive/c1.journal",
                     journal::encode_header({"c1", 320, 240, document.epoch_utc}, 9));
  const TakeFixityReport report = verify();
  EXPECT_FALSE(report.is_readable());
  EXPECT_THAT(report.cameras[1].error, HasSubstr("version 9"));
}

TEST(VerifyDecode, LooksAtThePictures) {
  const testing::TestFolder folder;
  const auto take = folder.path() / "take";
  RgbImage image{320, 240, std::vector<std::uint8_t>(320 * 240 * 3, 100)};
  RgbImage other{160, 240, std::vector<std::uint8_t>(160 * 240 * 3, 100)};
  {
    TakeWriter writer(take, testing::take_document(1), testing::rig_document(1));
    writer.archive(0).append(encode_jpeg(image, {}), 0);
    writer.archive(0).append(encode_jpeg(other, {}), 1);
    writer.archive(0).append(testing::fake_jpeg(1), 2);
    writer.commit();
  }
  TakeVerifyOptions options;
  EXPECT_TRUE(verify_take(take, options).is_intact());
  options.decode = true;
  const TakeFixityReport report = verify_take(take, options);
  const auto& problems = report.cameras[0].report.problems;
  ASSERT_EQ(problems.size(), 2u);
  for (const VerifyDepth depth : kDepths) {  // decoding overrides the depth
    options.depth = depth;
    EXPECT_EQ(verify_take(take, options).cameras[0].report.problems.size(), 2u);
  }
  EXPECT_THAT(problems[0].what, HasSubstr("160 x 240"));
  EXPECT_THAT(problems[0].frames, ElementsAre(AffectedFrame{1, 1}));
  EXPECT_THAT(problems[1].what, HasSubstr("cannot be decoded"));
}

}  // namespace
}  // namespace raystage::store
