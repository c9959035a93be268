// SPDX-License-Identifier: Apache-2.0
#include "store/catalogue/check_takes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <array>
#include <barrier>
#include <cstdlib>
#include <functional>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "base/atomic_file.h"
#include "base/error.h"
#include "base/posix_file.h"
#include "store/catalogue/catalogue_lock.h"
#include "store/catalogue/find_takes.h"
#include "store/take.h"
#include "testing/store/sparse_take.h"
#include "testing/test_folder.h"
#include "testing/test_permissions.h"

namespace raystage::store {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using Result = schemas::FixityCatalogue::Result;

constexpr Nanoseconds kDay = 86'400 * kNanosecondsPerSecond;
constexpr Nanoseconds kStart = 1'800'000'000 * kNanosecondsPerSecond;

class CheckTakes : public ::testing::Test {
 protected:
  CheckTakes() {
    for (const char* name : {"a", "group/b", "group/c"}) write(name);
    options.now_utc = kStart;
    options.save_seconds = 0;
    options.on_checked = [this](const schemas::FixityCatalogue::Take& take) {
      checked.push_back(take.path);
    };
  }
  void write(const std::string& name, int frames = 5, std::size_t cameras = 2) const {
    std::vector<std::vector<Nanoseconds>> times(cameras);
    for (auto& column : times) {
      for (int i = 0; i < frames; ++i) column.push_back(i * 50'000'000);
    }
    testing::write_take(folder.path() / name, times);
  }
  CatalogueReport run(Nanoseconds now = kStart) {
    checked.clear();
    options.now_utc = now;
    return check_takes_below(folder.path(), options);
  }
  /// Flips a bit of a frame; with `secretly`, size and time of the file stay, as when a disk rots.
  void flip(const std::string& name, int frame, bool secretly) const {
    const fs::path file = folder.path() / name / "archive" / "c0.mkv";
    const auto offset = Take(folder.path() / name).archive(0).frames()[frame].offset;
    const auto time = fs::last_write_time(file);
    auto bytes = testing::bytes_of(file);
    bytes[offset + 4] ^= std::byte{1};
    testing::overwrite(file, bytes);
    fs::last_write_time(file, secretly ? time : time + std::chrono::seconds(1));
  }
  /// Leaves a take of 400 frames, whose check is stopped after a third.
  CatalogueReport stop_within_a_take() {
    for (const char* name : {"a", "group"}) fs::remove_all(folder.path() / name);
    write("long", 400, 1);
    std::stop_source stop;
    options.stop = stop.get_token();
    options.progress = [&](double share) {
      if (share > 0.3) stop.request_stop();
    };
    CatalogueReport report = run();
    options.stop = {};
    options.progress = {};
    return report;
  }
  fs::path lock_file() const {
    return folder.path() / (std::string(".") + kCatalogueFile + ".lock");
  }
  /// Returns a line for each take after a run without root's permissions, and the problems. The
  /// catalogue has to be new enough that nothing is checked: threads do not survive fork().
  std::string run_as_nobody() {
    return testing::run_unprivileged([&] {
      const CatalogueReport report = run(kStart + kDay);
      std::string text;
      for (const CatalogueEntry& found : report.takes) {
        const char* const state = found.is_missing()     ? "missing"
                                  : found.is_unreachable ? "unreachable"
                                  : found.is_good()      ? "good"
                                                         : "bad";
        text += found.take.path + " " + state + "\n";
      }
      for (const std::string& problem : report.problems) text += problem + "\n";
      return text;
    });
  }
  static const CatalogueEntry& entry(const CatalogueReport& report, const std::string& path) {
    for (const CatalogueEntry& found : report.takes) {
      if (found.take.path == path) return found;
    }
    throw std::runtime_error("no take " + path);
  }

  testing::TestFolder folder;
  CatalogueOptions options;
  std::vector<std::string> checked;
};

TEST_F(CheckTakes, ChecksWhatIsDueAndKeepsIt) {
  const CatalogueReport first = run();
  EXPECT_THAT(checked, ElementsAre("a", "group/b", "group/c"));
  EXPECT_TRUE(first.is_good());
  EXPECT_TRUE(entry(first, "a").is_new);
  EXPECT_EQ(entry(first, "a").take.name, "test");
  EXPECT_FALSE(entry(first, "a").is_due);
  EXPECT_GT(first.bytes, 0U);

  const CatalogueReport second = run(kStart + kDay);
  EXPECT_THAT(checked, IsEmpty());
  EXPECT_TRUE(second.is_good());
  EXPECT_FALSE(entry(second, "a").is_new);
  EXPECT_NEAR(static_cast<double>(entry(second, "a").due_utc - kStart), 90. * kDay, 1e11);

  options.only_reports = true;
  EXPECT_TRUE(entry(run(kStart + 91 * kDay), "a").is_due);
  EXPECT_THAT(checked, IsEmpty());
  options.only_reports = false;
  run(kStart + 91 * kDay);
  EXPECT_EQ(checked.size(), 3U);
}

TEST_F(CheckTakes, ReportsDamagedChangedMissingAndNewTakes) {
  run();
  flip("group/b", 1, false);
  fs::rename(folder.path() / "a", folder.path() / "d");
  const CatalogueReport report = run(kStart + kDay);
  EXPECT_THAT(checked, ::testing::UnorderedElementsAre("d", "group/b"));
  EXPECT_FALSE(report.is_good());
  EXPECT_EQ(entry(report, "a").take.missing_since_utc, kStart + kDay);
  EXPECT_TRUE(entry(report, "a").take.last_intact_utc);
  EXPECT_TRUE(entry(report, "d").is_new);
  const auto& damaged = entry(report, "group/b").take;
  EXPECT_EQ(damaged.last_check->result, Result::kDamaged);
  EXPECT_EQ(damaged.last_check->problem_count, 1);
  EXPECT_THAT(damaged.last_check->problems.at(0), HasSubstr("wrong XXH3"));
  EXPECT_TRUE(damaged.last_intact_utc);

  EXPECT_FALSE(run(kStart + 2 * kDay).is_good()) << "the damage is still there";
  EXPECT_THAT(checked, IsEmpty());
  flip("group/b", 1, false);  // repaired
  options.forgets_missing = true;
  const CatalogueReport repaired = run(kStart + 3 * kDay);
  EXPECT_THAT(checked, ElementsAre("group/b"));
  EXPECT_TRUE(repaired.is_good());
  EXPECT_EQ(repaired.takes.size(), 3U);
}

TEST_F(CheckTakes, RotThatLeavesNoTraceIsFoundWhenTheTakeIsDue) {
  run();
  flip("group/c", 2, true);
  EXPECT_TRUE(run(kStart + 89 * kDay).is_good());
  EXPECT_THAT(checked, IsEmpty());
  const CatalogueReport due = run(kStart + 91 * kDay);
  EXPECT_FALSE(due.is_good());
  EXPECT_EQ(entry(due, "group/c").take.last_check->result, Result::kDamaged);
}

TEST_F(CheckTakes, AStoppedRunIsContinuedWhereItWas) {
  const CatalogueReport stopped = stop_within_a_take();
  EXPECT_EQ(stopped.status, RunStatus::kStopped);
  const auto& progress = entry(stopped, "long").take.progress;
  ASSERT_TRUE(progress);
  const std::int64_t frames = progress->cameras[0].frames;
  EXPECT_GT(frames, 10);

  // A frame that was checked is not read again: what happens to it meanwhile is not found. The
  // others are read.
  flip("long", 0, true);
  EXPECT_TRUE(run(kStart + kDay).is_good());
  EXPECT_FALSE(entry(run(kStart + kDay), "long").take.progress);
  EXPECT_FALSE(run(kStart + 100 * kDay).is_good()) << "the next check reads all";
}

TEST_F(CheckTakes, AChangedTakeIsCheckedFromItsBeginning) {
  stop_within_a_take();
  flip("long", 0, false);
  EXPECT_FALSE(run().is_good());
}

TEST_F(CheckTakes, FramesReadLongAgoAreReadAgain) {
  stop_within_a_take();
  flip("long", 0, true);
  const CatalogueReport report = run(kStart + 91 * kDay);
  EXPECT_EQ(entry(report, "long").take.last_check->result, Result::kDamaged);
}

TEST_F(CheckTakes, ProgressOfTheFutureIsNotContinued) {
  stop_within_a_take();
  flip("long", 0, true);
  EXPECT_FALSE(run(kStart - kDay).is_good());
}

TEST_F(CheckTakes, NoTakeIsForgottenWhileAFolderCannotBeRead) {
  run();
  const std::string skip = testing::unprivileged_access_error(folder.path().parent_path());
  if (!skip.empty()) GTEST_SKIP() << skip;
  testing::make_world_writable(folder.path());
  fs::remove_all(folder.path() / "a");
  write("d");  // so that a take is left
  run();
  testing::make_world_writable(folder.path());
  fs::permissions(folder.path() / "group", fs::perms::none);
  options.forgets_missing = true;
  EXPECT_THAT(run_as_nobody(),
              ::testing::MatchesRegex("a missing\nd good\ngroup/b unreachable\ngroup/c "
                                      "unreachable\ngroup: the folder cannot be read.*\nno take "
                                      "was forgotten.*cannot be read.*\n"));
  fs::permissions(folder.path() / "group", fs::perms::all);
  EXPECT_EQ(run_as_nobody(), "d good\ngroup/b good\ngroup/c good\n");
}

TEST_F(CheckTakes, NoTakeIsForgottenIfNoneIsLeft) {
  const testing::TestFolder elsewhere;
  options.file = elsewhere.path() / "catalogue.json";
  run();
  for (const char* name : {"a", "group"}) fs::remove_all(folder.path() / name);
  create_folder(folder.path() / "lost+found" / "1");  // of another disk: the folder is not empty
  options.forgets_missing = true;
  const CatalogueReport report = run(kStart + kDay);
  EXPECT_EQ(report.takes.size(), 3U);
  EXPECT_THAT(report.problems, ElementsAre(HasSubstr("Mount the disk")));
  EXPECT_EQ(run(kStart + 2 * kDay).takes.size(), 3U) << "they are in the catalogue";
}

TEST_F(CheckTakes, NoTakeOfAnEmptyFolderIsForgotten) {
  write("disk/d");
  run();
  fs::remove_all(folder.path() / "a");
  fs::remove_all(folder.path() / "disk" / "d");  // as if it were not mounted
  options.forgets_missing = true;
  const CatalogueReport report = run(kStart + kDay);
  EXPECT_EQ(report.takes.size(), 3U) << "a is forgotten";
  EXPECT_EQ(entry(report, "disk/d").take.missing_since_utc, kStart + kDay);
  EXPECT_THAT(report.problems, ElementsAre(HasSubstr("disk: the folder is empty")));
  fs::remove(folder.path() / "disk");
  const CatalogueReport removed = run(kStart + kDay);
  EXPECT_EQ(removed.takes.size(), 2U);
  EXPECT_TRUE(removed.is_good());
}

TEST_F(CheckTakes, ATakeWithAnUnreadableFolderKeepsWhatIsKnown) {
  const CatalogueReport before = run();
  const std::string skip = testing::unprivileged_access_error(folder.path().parent_path());
  if (!skip.empty()) GTEST_SKIP() << skip;
  testing::make_world_writable(folder.path());
  fs::permissions(folder.path() / "a" / "archive", fs::perms::none);
  EXPECT_THAT(run_as_nobody(),
              ::testing::MatchesRegex("a unreachable\ngroup/b good\ngroup/c "
                                      "good\n.*/a/archive: the take cannot be checked.*\n"));
  fs::permissions(folder.path() / "a" / "archive", fs::perms::all);
  const CatalogueReport after = run(kStart + kDay);
  EXPECT_THAT(checked, IsEmpty());
  EXPECT_EQ(entry(after, "a").take.last_check->state, entry(before, "a").take.last_check->state);
  EXPECT_TRUE(after.is_good());
}

TEST_F(CheckTakes, LinksNeitherCountAsFilesNorAddToTheSize) {
  const testing::TestFolder elsewhere;
  const fs::path target = elsewhere.path() / "target";
  write_file_atomically(target, std::string_view("1"));
  const std::string state = state_of_take(folder.path() / "a");
  fs::create_symlink(target, folder.path() / "a" / "link");
  EXPECT_EQ(state_of_take(folder.path() / "a"), state);

  constexpr std::int64_t kSize = 1'000'000'000;
  fs::resize_file(target, kSize);  // sparse
  const fs::path archive = folder.path() / "a" / "archive" / "c0.mkv";
  fs::remove(archive);
  fs::create_symlink(target, archive);
  EXPECT_LT(entry(run(), "a").take.last_check->bytes, kSize);
}

TEST_F(CheckTakes, AReportChangesNothing) {
  options.only_reports = true;
  EXPECT_TRUE(entry(run(), "a").is_new);
  EXPECT_FALSE(fs::exists(folder.path() / kCatalogueFile));
  EXPECT_FALSE(fs::exists(lock_file()));
  options.only_reports = false;
  EXPECT_TRUE(entry(run(), "a").is_new) << "the report did not mark it as seen";

  const std::string catalogue = read_file(folder.path() / kCatalogueFile);
  fs::remove_all(folder.path() / "a");
  options.only_reports = true;
  const OutputFile lock(lock_file(), OutputFile::Open::kExisting);
  EXPECT_TRUE(entry(run(kStart + kDay), "a").is_missing());
  EXPECT_EQ(read_file(folder.path() / kCatalogueFile), catalogue);
}

TEST_F(CheckTakes, NoCatalogueInATake) {
  EXPECT_THROW(check_takes_below(folder.path() / "a", options), Error);
  EXPECT_FALSE(fs::exists(folder.path() / "a" / kCatalogueFile));
  options.file = folder.path() / "a" / "x.json";
  EXPECT_THROW(check_takes_below(folder.path() / "a", options), Error);
  options.file = folder.path() / "a.json";
  EXPECT_TRUE(check_takes_below(folder.path() / "a", options).is_good());
}

TEST_F(CheckTakes, ASecondRunIsRefused) {
  run();
  const OutputFile lock(lock_file(), OutputFile::Open::kExisting);
  try {
    run();
    ADD_FAILURE() << "two runs used one catalogue";
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kFailed);
    EXPECT_THAT(error.what(), HasSubstr("used by another check"));
  }
}

TEST_F(CheckTakes, OtherErrorsOfTheLockAreNoOtherRun) {
  fs::create_directory(lock_file());
  try {
    run();
    ADD_FAILURE() << "a run without a lock file";
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kFailed);
    EXPECT_THAT(error.what(), HasSubstr("cannot be opened for writing"));
    EXPECT_THAT(error.what(), ::testing::Not(HasSubstr("another check")));
  }
}

TEST_F(CheckTakes, OfTwoFirstRunsOneHasTheLock) {
  struct Run {
    std::optional<CatalogueLock> lock;
    std::string error;
  };
  for (int round = 0; round < 200; ++round) {
    const fs::path catalogue = folder.path() / std::to_string(round);
    std::array<Run, 2> runs;
    std::barrier start(2);
    const auto begin = [&](Run& mine) {
      start.arrive_and_wait();
      try {
        mine.lock.emplace(catalogue);
      } catch (const Error& error) {
        mine.error = error.what();
      }
    };
    std::jthread other([&] { begin(runs[1]); });
    begin(runs[0]);
    other.join();
    ASSERT_NE(runs[0].lock.has_value(), runs[1].lock.has_value());
    ASSERT_THAT(runs[0].error + runs[1].error, HasSubstr("another check"));
  }
}

TEST_F(CheckTakes, ADamagedCatalogueIsRefusedAndKept) {
  write_file_atomically(folder.path() / kCatalogueFile, std::string_view("{\"schema\": 1"));
  EXPECT_THROW(run(), Error);
  EXPECT_EQ(read_file(folder.path() / kCatalogueFile), "{\"schema\": 1");
  options.file = folder.path() / "none" / "catalogue.json";
  EXPECT_THROW(run(), Error);
  EXPECT_THROW(check_takes_below(folder.path() / "none", options), Error);
}

TEST_F(CheckTakes, UnreadableTakesAndLinksAreNoReasonToStop) {
  write_file_atomically(folder.path() / "a" / "take.json", std::string_view("{}"));
  fs::create_directory_symlink(folder.path() / "group", folder.path() / "link");
  const CatalogueReport report = run();
  EXPECT_EQ(checked.size(), 3U);
  EXPECT_EQ(entry(report, "a").take.last_check->result, Result::kUnreadable);
  EXPECT_EQ(entry(report, "group/b").take.last_check->result, Result::kIntact);
  EXPECT_FALSE(report.is_good());
}

/// RAYSTAGE_SPARSE_GB sets the size of the take (1 without it).
TEST_F(CheckTakes, MemoryDoesNotGrowWithTheTake) {
  for (const char* name : {"a", "group"}) fs::remove_all(folder.path() / name);
  const char* const text = std::getenv("RAYSTAGE_SPARSE_GB");
  const int gigabytes = text == nullptr ? 1 : std::atoi(text);
  constexpr std::uint32_t kFrame = 50'000'000;
  testing::write_sparse_take(folder.path() / "sparse", 20 * gigabytes, kFrame);
  const auto peak = [] {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return static_cast<double>(usage.ru_maxrss) * 1024;
  };
  options.save_seconds = 5;
  const double before = peak();
  const CatalogueReport report = run();
  EXPECT_EQ(entry(report, "sparse").take.last_check->result, Result::kIntact);
  EXPECT_LT(peak() - before, 100e6);
  std::printf("%d GB in %.1f s, peak memory %.0f MB\n", gigabytes, report.seconds, peak() / 1e6);
}

/// As strangers could send them, by accident or not.
TEST_F(CheckTakes, ABadTakeDoesNotKeepOthersFromBeingChecked) {
  const fs::path bad = folder.path() / "a";
  const auto replace_in_document = [&](const std::string& from, const std::string& to) {
    std::string text = read_file(bad / "take.json");
    const std::size_t at = text.find(from);
    ASSERT_NE(at, std::string::npos);
    write_file_atomically(bad / "take.json", text.replace(at, from.size(), to));
  };
  const auto link_to_itself = [&](const std::string& name) {
    fs::remove(bad / name);
    fs::create_symlink(fs::path(name).filename(), bad / name);
  };
  const std::vector<std::pair<std::string, std::function<void()>>> faults{
      {"journal", [&] { link_to_itself("archive/c0.journal"); }},
      {"archive", [&] { link_to_itself("archive/c0.mkv"); }},
      {"timeline", [&] { link_to_itself("timeline.zst"); }},
      {"long name",
       [&] { replace_in_document("archive/c0.mkv", "archive/" + std::string(300, 'x') + ".mkv"); }},
      {"report",
       [&] {
         fs::create_directories(bad / "recording");
         write_file_atomically(bad / "recording/\xFF.json", std::string_view("{}"));
       }},
  };
  for (const auto& [name, make] : faults) {
    SCOPED_TRACE(name);
    fs::remove_all(bad);
    fs::remove(folder.path() / kCatalogueFile);
    write("a");
    make();
    const CatalogueReport report = run();
    EXPECT_THAT(checked, ElementsAre("a", "group/b", "group/c"));
    ASSERT_TRUE(entry(report, "a").take.last_check);
    EXPECT_NE(entry(report, "a").take.last_check->result, Result::kIntact);
    EXPECT_GT(entry(report, "a").take.last_check->problem_count, 0);
    for (const char* other : {"group/b", "group/c"}) EXPECT_TRUE(entry(report, other).is_good());
    // What was written can be read again.
    EXPECT_TRUE(entry(run(kStart + 1), "group/b").is_good());
  }
}

/// JSON cannot hold the name.
TEST_F(CheckTakes, ATakeWhosePathIsNotUtf8IsAProblem) {
  fs::rename(folder.path() / "group/b", folder.path() / "group/\xFF");
  for (int i = 0; i < 2; ++i) {
    const CatalogueReport report = run(kStart + i);
    EXPECT_FALSE(report.is_good());
    EXPECT_THAT(report.problems, ElementsAre(HasSubstr("its path is not UTF-8")));
    EXPECT_EQ(report.takes.size(), 2U);
    EXPECT_TRUE(entry(report, "a").is_good());
    EXPECT_TRUE(entry(report, "group/c").is_good());
  }
}

}  // namespace
}  // namespace raystage::store
