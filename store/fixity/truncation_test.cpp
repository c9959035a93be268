// SPDX-License-Identifier: Apache-2.0
// Another program truncates a file of a take while it is mapped: whatever reads it ends with an
// error that names the file, or with its result, and not by a signal.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

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

  /// Calls `work` while the file is truncated at random moments and lengths. `work` returns the
  /// text of its error, or nothing if it did not notice.
  void while_truncated(const std::function<std::optional<std::string>()>& work) {
    constexpr int kRounds = 12;
    std::mt19937 random(7);
    restore();
    const Stopwatch watch;
    EXPECT_EQ(work().value_or(""), "");
    const double seconds = watch.seconds();
    int noticed = 0;
    for (int i = 0; i < kRounds; ++i) {
      restore();
      const double delay = seconds * std::uniform_real_distribution<double>(0, 1)(random);
      const auto size = static_cast<off_t>(random() % std::filesystem::file_size(file_));
      std::thread other([&] {
        std::this_thread::sleep_for(std::chrono::duration<double>(delay));
        EXPECT_EQ(truncate(file_.c_str(), size), 0);
      });
      const auto error = work();
      other.join();
      if (!error) continue;
      ++noticed;
      EXPECT_THAT(*error, HasSubstr("c0."));
    }
    RecordProperty("noticed", noticed);
  }

  void restore() const {
    testing::overwrite(take_ / "archive" / "c0.mkv", whole_[0]);
    testing::overwrite(take_ / "archive" / "c0.journal", whole_[1]);
  }

  testing::TestFolder folder_;
  std::filesystem::path take_ = folder_.path() / "take";
  std::filesystem::path file_ = take_ / "archive" / GetParam();
  std::vector<std::vector<std::byte>> whole_;
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
  while_truncated([&]() -> std::optional<std::string> {
    const RepairReport report = repair_take(take_, {});
    const RepairReport::Camera& camera = report.cameras.front();
    if (camera.error.empty()) return std::nullopt;
    EXPECT_TRUE(camera.kept.empty());
    EXPECT_FALSE(camera.repaired);
    return camera.error;
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
