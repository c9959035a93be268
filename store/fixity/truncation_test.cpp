// SPDX-License-Identifier: Apache-2.0
// Another program truncates a file of a take while it is mapped: whatever reads it ends with an
// error that names the file, or with its result, and not by a signal.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <functional>
#include <optional>
#include <random>
#include <thread>

#include "base/error.h"
#include "base/stopwatch.h"
#include "store/fixity/repair.h"
#include "store/fixity/verify.h"
#include "store/journal_archives.h"
#include "testing/store/take_test_data.h"
#include "testing/test_folder.h"

namespace raystage::store {
namespace {

using ::testing::HasSubstr;

constexpr int kFileFrames = 8'000;

class Truncation : public ::testing::TestWithParam<const char*> {
 protected:
  Truncation() {
    std::vector<Nanoseconds> times;
    for (int i = 0; i < kFileFrames; ++i) times.push_back(Nanoseconds{i} * 50'000'000);
    testing::write_take(take_, {times}, 20);
    for (const char* name : {"c0.mkv", "c0.journal"}) {
      whole_.push_back(testing::bytes_of(take_ / "archive" / name));
    }
  }

  using Result = std::optional<std::string>;

  /// Calls `work` while the file is truncated at random moments and lengths. `work` returns the
  /// text of its error, or nothing if it did not notice. `check` is called with that after the
  /// truncation. Continues until an error was seen; skips the test if that takes too many rounds.
  void while_truncated(const std::function<Result()>& work,
                       const std::function<void(const Result&)>& check = {}) {
    constexpr int kRounds = 12, kMostRounds = 100;
    std::mt19937 random(7);
    restore();
    const Stopwatch watch;
    EXPECT_EQ(work().value_or(""), "");
    const double seconds = watch.seconds();
    int noticed = 0;
    for (int i = 0; i < kRounds || (noticed == 0 && i < kMostRounds); ++i) {
      restore();
      const double delay = seconds * std::uniform_real_distribution<double>(0, 1)(random);
      const auto size = static_cast<off_t>(random() % std::filesystem::file_size(file_));
      std::thread other([&] {
        std::this_thread::sleep_for(std::chrono::duration<double>(delay));
        EXPECT_EQ(truncate(file_.c_str(), size), 0);
      });
      const auto error = work();
      other.join();
      if (check) check(error);
      if (!error) continue;
      ++noticed;
      EXPECT_THAT(*error, HasSubstr("c0."));
    }
    RecordProperty("noticed", noticed);
    if (noticed == 0) GTEST_SKIP() << "no truncation came while the files were read";
  }

  void restore() const {
    for (const std::filesystem::path& folder : {take_, copy_}) {
      const std::filesystem::path archives = folder / "archive";
      if (!std::filesystem::exists(archives)) continue;
      std::filesystem::remove_all(archives);
      std::filesystem::create_directory(archives);
      testing::overwrite(archives / "c0.mkv", whole_[0]);
      testing::overwrite(archives / "c0.journal", whole_[1]);
    }
  }

  /// Expects that a file has the first bytes of what it had.
  static void expect_beginning(const std::filesystem::path& file,
                               const std::vector<std::byte>& whole) {
    const std::vector<std::byte> now = testing::bytes_of(file);
    ASSERT_LE(now.size(), whole.size()) << file;
    EXPECT_TRUE(std::equal(now.begin(), now.end(), whole.begin())) << file;
  }

  /// Repairs the take. Returns the text of its error.
  Result repair(const RepairOptions& options) {
    report_ = {};
    report_.cameras.resize(1);
    try {
      report_ = repair_take(take_, options);
    } catch (const Error& error) {
      return error.what();
    }
    const RepairReport::Camera& camera = report_.cameras.front();
    if (camera.error.empty()) return std::nullopt;
    EXPECT_TRUE(camera.kept.empty());
    EXPECT_FALSE(camera.repaired);
    return camera.error;
  }

  /// Expects that all frames that are there have their bytes, none zeros instead.
  void expect_right_frames() const {
    const std::vector<std::byte> expected = testing::fake_jpeg(0, 30);
    int wrong = 0;
    try {
      const ArchiveReader reader(take_ / "archive" / "c0.mkv", take_ / "archive" / "c0.journal");
      for (std::size_t i = 0; i < reader.frames().size(); ++i) {
        const auto jpeg = reader.intact_jpeg(static_cast<int>(i));
        if (!jpeg || !std::ranges::equal(jpeg->bytes(), expected)) ++wrong;
      }
    } catch (const Error& error) {  // truncated within the header, after the repair
      EXPECT_THAT(error.what(), HasSubstr("c0."));
    }
    EXPECT_EQ(wrong, 0);
  }

  /// Expects what must hold after repair().
  void expect_nothing_destroyed() const {
    const RepairReport::Camera& camera = report_.cameras.front();
    if (!camera.repaired) {
      expect_beginning(take_ / "archive" / "c0.mkv", whole_[0]);
      expect_beginning(take_ / "archive" / "c0.journal", whole_[1]);
      return;
    }
    expect_right_frames();
    EXPECT_TRUE(!report_.has_losses() || !camera.kept.empty());
    for (const std::string& name : camera.kept) {
      expect_beginning(take_ / "archive" / name, whole_[name.starts_with("c0.mkv") ? 0 : 1]);
    }
  }

  testing::TestFolder folder_;
  std::filesystem::path take_ = folder_.path() / "take", copy_ = folder_.path() / "copy";
  std::filesystem::path file_ = take_ / "archive" / GetParam();
  std::vector<std::vector<std::byte>> whole_;
  RepairReport report_;
};

TEST_P(Truncation, IsAnErrorOfVerify) {
  for (const VerifyDepth depth :
       {VerifyDepth::kSizes, VerifyDepth::kJournal, VerifyDepth::kHashes}) {
    while_truncated([&]() -> std::optional<std::string> {
      TakeVerifyOptions options;
      options.depth = depth;
      const TakeFixityReport report = verify_take(take_, options);
      const TakeFixityReport::Camera& camera = report.cameras.front();
      if (!camera.error.empty()) return camera.error;
      if (report.is_intact()) return std::nullopt;
      return camera.report.problems.front().file;
    });
  }
}

TEST_P(Truncation, IsAnErrorOfRepairWhichKeepsTheOriginals) {
  while_truncated([&] { return repair({}); },
                  [&](const Result&) {
                    expect_nothing_destroyed();
                    const RepairReport::Camera& camera = report_.cameras.front();
                    EXPECT_TRUE(!camera.repaired || !camera.kept.empty());
                  });
}

TEST_P(Truncation, IsAnErrorOfRepairFromACopyWhichKeepsTheOriginals) {
  std::filesystem::copy(take_, copy_, std::filesystem::copy_options::recursive);
  while_truncated([&] { return repair({.copy = copy_}); },
                  [&](const Result&) { expect_nothing_destroyed(); });
}

// The take has half of the frames; the copy, of which it takes the others, is truncated.
TEST_P(Truncation, OfTheCopyIsAnErrorOfRepair) {
  std::filesystem::copy(take_, copy_, std::filesystem::copy_options::recursive);
  file_ = copy_ / "archive" / GetParam();
  const std::filesystem::path archive = take_ / "archive" / "c0.mkv";
  const auto half = whole_[0].size() / 2;
  while_truncated(
      [&] {
        std::filesystem::resize_file(archive, half);
        return repair({.copy = copy_});
      },
      [&](const Result&) {
        expect_nothing_destroyed();
        if (!report_.cameras.front().repaired) {
          EXPECT_EQ(std::filesystem::file_size(archive), half);
        }
      });
}

TEST_P(Truncation, IsAnErrorOfResume) {
  const ArchiveWriter::Description description = describe_pair(Take(take_), 0).description;
  while_truncated([&]() -> std::optional<std::string> {
    try {
      ArchiveWriter::resume(take_ / "archive" / "c0.mkv", take_ / "archive" / "c0.journal",
                            description);
      return std::nullopt;
    } catch (const Error& error) {
      return error.what();
    }
  });
}

TEST_P(Truncation, IsAnErrorOfReading) {
  while_truncated([&]() -> std::optional<std::string> {
    try {
      const Take take(take_);
      return std::nullopt;
    } catch (const Error& error) {
      return error.what();
    }
  });
}

TEST_P(Truncation, IsAnErrorOfReadingTheJournalAlone) {
  if (file_.extension() != ".journal") GTEST_SKIP() << "the archive is on another host";
  while_truncated([&]() -> std::optional<std::string> {
    try {
      std::filesystem::remove(take_ / "archive" / "c0.mkv");
      const Take take(take_, make_journal_archives(take_));
      return std::nullopt;
    } catch (const Error& error) {
      return error.what();
    }
  });
}

std::string name_of_file(const ::testing::TestParamInfo<const char*>& info) {
  return info.index == 0 ? "Archive" : "Journal";
}

INSTANTIATE_TEST_SUITE_P(Files, Truncation, ::testing::Values("c0.mkv", "c0.journal"),
                         name_of_file);

}  // namespace
}  // namespace raystage::store
