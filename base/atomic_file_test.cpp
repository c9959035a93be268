// SPDX-License-Identifier: Apache-2.0
#include "base/atomic_file.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <fstream>
#include <memory>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "base/error.h"
#include "base/posix_file.h"
#include "base/resources.h"
#include "testing/test_folder.h"
#include "testing/test_permissions.h"

namespace raystage {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

class AtomicFile : public ::testing::Test {
 protected:
  std::vector<std::string> names() const {
    std::vector<std::string> result;
    for (const auto& entry : std::filesystem::directory_iterator(folder_.path())) {
      result.push_back(entry.path().filename().string());
    }
    std::sort(result.begin(), result.end());
    return result;
  }
  testing::TestFolder folder_;
};

/// Limits the file size of this process to `bytes`, like a full disk, during its lifetime.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(rlim_t bytes) : handler_(std::signal(SIGXFSZ, SIG_IGN)) {
    getrlimit(RLIMIT_FSIZE, &old_);
    const rlimit small{bytes, old_.rlim_max};
    setrlimit(RLIMIT_FSIZE, &small);
  }
  ~FileSizeLimit() {
    setrlimit(RLIMIT_FSIZE, &old_);
    std::signal(SIGXFSZ, handler_);
  }
  FileSizeLimit(const FileSizeLimit&) = delete;
  FileSizeLimit& operator=(const FileSizeLimit&) = delete;

 private:
  rlimit old_{};
  void (*handler_)(int);
};

TEST_F(AtomicFile, SaysBeforehandWhereNothingCanBeWritten) {
  check_writable(folder_.path() / "new");
  EXPECT_TRUE(names().empty());
  EXPECT_THROW(check_writable(folder_.path() / "nowhere" / "new"), Error);
  EXPECT_THROW(check_writable(folder_.path()), Error);
}

TEST_F(AtomicFile, LeavesWhatIsNoFileAsItIs) {
  const std::filesystem::path pipe = folder_.path() / "pipe";
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_THROW(write_file_atomically(pipe, "text"), Error);
  EXPECT_TRUE(std::filesystem::is_fifo(pipe));
  EXPECT_EQ(names().size(), 1U);
}

TEST_F(AtomicFile, WritesAndReadsBackEveryByte) {
  std::string text;
  for (int i = 0; i < 100'000; ++i) text.push_back(static_cast<char>(i * 7 % 256));
  write_file_atomically(folder_.path() / "a.bin", text);
  EXPECT_EQ(read_file(folder_.path() / "a.bin"), text);
  EXPECT_THAT(names(), ::testing::ElementsAre("a.bin"));
}

TEST_F(AtomicFile, ReplacesAnOlderFile) {
  write_file_atomically(folder_.path() / "a", "old and longer");
  write_file_atomically(folder_.path() / "a", "new");
  EXPECT_EQ(read_file(folder_.path() / "a"), "new");
}

TEST_F(AtomicFile, EmptyFile) {
  write_file_atomically(folder_.path() / "a", "");
  EXPECT_EQ(read_file(folder_.path() / "a"), "");
}

TEST_F(AtomicFile, ReadsFilesThatDoNotKnowTheirSize) {
  EXPECT_THAT(read_file("/proc/self/status"), HasSubstr("Pid:"));
}

TEST_F(AtomicFile, OnlyFilesAndPipesOfSaneSizeAreRead) {
  const auto refusal = [](const std::filesystem::path& file, std::uint64_t most) -> std::string {
    try {
      read_file(file, most);
      return "";
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
      return error.what_happened();
    }
  };
  EXPECT_THAT(refusal("/dev/zero", kMaxFileBytes), HasSubstr("it is a device"));
  std::filesystem::create_symlink("/dev/zero", folder_.path() / "link");
  EXPECT_THAT(refusal(folder_.path() / "link", kMaxFileBytes), HasSubstr("it is a device"));
  EXPECT_THAT(refusal(folder_.path(), kMaxFileBytes), HasSubstr("it is a folder"));
  write_file_atomically(folder_.path() / "five", std::string_view("12345"));
  EXPECT_EQ(refusal(folder_.path() / "five", 5), "");
  EXPECT_THAT(refusal(folder_.path() / "five", 4), HasSubstr("more than"));
  EXPECT_THAT(refusal("/proc/self/status", 4), HasSubstr("more than")) << "it reports no size";
}

TEST_F(AtomicFile, PipesAreReadToTheirEndAndDoNotBlockWithoutAWriter) {
  const auto pipe = folder_.path() / "pipe";
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_EQ(read_file(pipe), "") << "there is no writer";
  FileDescriptor kept(::open(pipe.c_str(), O_RDWR | O_CLOEXEC));
  std::thread writer([&] {
    const FileDescriptor out(::open(pipe.c_str(), O_WRONLY | O_CLOEXEC));
    for (int i = 0; i < 3; ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(30));
      EXPECT_EQ(write(out.number(), "part", 4), 4);
    }
    kept.close();
  });
  EXPECT_EQ(read_file(pipe), "partpartpart");
  writer.join();
}

TEST_F(AtomicFile, TemporaryNamesAreUniqueHiddenAndKeepTheExtension) {
  const TemporaryFile a(folder_.path() / "frame.0001.exr"), b(folder_.path() / "frame.0001.exr");
  EXPECT_NE(a.path(), b.path());
  EXPECT_EQ(a.path().parent_path(), folder_.path());
  EXPECT_EQ(a.path().extension(), ".exr");
  const std::string name = a.path().filename().string();
  EXPECT_THAT(name, StartsWith(".frame.0001.exr."));
  EXPECT_THAT(name, HasSubstr("." + std::to_string(getpid()) + "."));
  EXPECT_THAT(name, ::testing::MatchesRegex(".*\\.[0-9a-f]+\\.tmp\\.exr"));
  const std::size_t end = name.size() - std::string_view(".tmp.exr").size();
  EXPECT_EQ(end - name.rfind('.', end - 1) - 1, 16U) << name;  // 64 bits, hexadecimal
}

TEST_F(AtomicFile, TemporaryFilesAreThereFromTheStartAndOnlyOnce) {
  const mode_t umask_before = umask(027);
  {
    const TemporaryFile a(folder_.path() / "a");
    struct stat status {};
    ASSERT_EQ(lstat(a.path().c_str(), &status), 0);
    EXPECT_TRUE(S_ISREG(status.st_mode));
    EXPECT_EQ(status.st_mode & 0777U, 0640U);
    EXPECT_EQ(status.st_size, 0);
    // Creating a file of the same name fails.
    EXPECT_LT(open(a.path().c_str(), O_WRONLY | O_CREAT | O_EXCL, 0666), 0);
    const TemporaryFile named(folder_.path() / "a", TemporaryFile::Creation::kByWriter);
    EXPECT_FALSE(std::filesystem::exists(named.path()));
  }
  umask(umask_before);
  EXPECT_TRUE(names().empty());
}

TEST_F(AtomicFile, NamesDifferByTheirRandomPart) {
  // In containers hosts and processes may have the same names and numbers.
  const TemporaryFile before(folder_.path() / "a");
  std::set<std::string> randoms;
  const auto random_of = [](const TemporaryFile& file) {
    const std::string name = file.path().filename().string();
    return name.substr(name.size() - 4 - 16, 16);  // RANDOM.tmp
  };
  std::vector<std::unique_ptr<TemporaryFile>> files;
  for (int i = 0; i < 100; ++i) {
    files.push_back(std::make_unique<TemporaryFile>(folder_.path() / "a"));
    randoms.insert(random_of(*files.back()));
  }
  EXPECT_EQ(randoms.size(), 100U);
  EXPECT_FALSE(randoms.contains(random_of(before)));
}

TEST_F(AtomicFile, LongNamesStillFit) {
  const std::string name = std::string(250, 'n') + ".png";
  write_file_atomically(folder_.path() / name, "x");
  EXPECT_THAT(names(), ::testing::ElementsAre(name));
}

TEST_F(AtomicFile, WithoutCommitNothingStays) {
  {
    const TemporaryFile temporary(folder_.path() / "a");
    std::ofstream(temporary.path()) << "half";
    EXPECT_EQ(names().size(), 1u);
  }
  EXPECT_TRUE(names().empty());
}

TEST_F(AtomicFile, OnlyAbandonedFilesOfTheTargetAreRemoved) {
  const std::filesystem::path folder = folder_.path() / "abandoned";
  std::filesystem::create_directory(folder);
  const std::filesystem::path target = folder / "a.mkv";
  const pid_t ended = fork();
  ASSERT_GE(ended, 0);
  if (ended == 0) _exit(0);
  waitpid(ended, nullptr, 0);
  const std::string of_ended = "." + host_name() + "." + std::to_string(ended) + ".0123";
  const std::string of_this = "." + host_name() + "." + std::to_string(getpid()) + ".0123";
  const std::vector<std::string> kept{"a.mkv",
                                      ".a.mkv.tmp",
                                      ".ab.mkv" + of_ended + ".tmp.mkv",
                                      ".a.mkv" + of_ended + ".mkv",
                                      "a.mkv" + of_ended + ".tmp.mkv",
                                      ".a.mkv" + of_this + ".tmp.mkv",
                                      ".a.mkv.other" + of_ended + ".tmp.mkv",
                                      ".a.mkv." + host_name() + ".x.0123.tmp.mkv"};
  for (const std::string& name : kept) std::ofstream(folder / name) << "kept";
  const std::filesystem::path left = folder / (".a.mkv" + of_ended + ".tmp.mkv");
  std::ofstream(left) << "left";
  remove_abandoned_temporary_files(target);
  for (const std::string& name : kept) EXPECT_TRUE(file_exists(folder / name)) << name;
  EXPECT_FALSE(file_exists(left));
  std::filesystem::create_directory(left);
  remove_abandoned_temporary_files(target);
  EXPECT_TRUE(file_exists(left)) << "a folder";
  remove_abandoned_temporary_files(folder / "missing" / "a.mkv");
}

TEST_F(AtomicFile, WhoeverHoldsTheLockOfTheTargetRemovesTheFilesOfAllProcesses) {
  const std::filesystem::path target = folder_.path() / "a.mkv";
  const std::string random = ".0123456789abcdef.tmp.mkv";
  const std::string of_this = "." + host_name() + "." + std::to_string(getpid());
  const std::vector<std::string> left{".a.mkv" + of_this + random,  // a repeated process ID
                                      ".a.mkv.other.example.7" + random};
  std::vector<std::string> kept{"a.mkv",
                                ".a.mkv" + random,
                                ".a.mkv.7" + random,
                                ".a.mkv..tmp.mkv",
                                ".a.mkv.host.x7" + random,
                                ".a.mkv.host.7.xyz.tmp.mkv",
                                ".a.mkv-b" + of_this + random,
                                ".a.mkv" + of_this + ".0123456789abcdef.tmp"};
  for (const std::string& name : left) std::ofstream(folder_.path() / name) << "left";
  for (const std::string& name : kept) std::ofstream(folder_.path() / name) << "kept";
  remove_abandoned_temporary_files(target);
  EXPECT_EQ(names().size(), left.size() + kept.size());
  remove_abandoned_temporary_files(target, Owners::kAll);
  std::sort(kept.begin(), kept.end());
  EXPECT_THAT(names(), ::testing::ElementsAreArray(kept));
}

TEST_F(AtomicFile, AKilledProcessLeavesNothingBehind) {
  if (const FileDescriptor file(::open(folder_.path().c_str(), O_TMPFILE | O_WRONLY, 0666));
      !file.open()) {
    GTEST_SKIP() << "the file system has no files without a name";
  }
  const auto file = folder_.path() / "a";
  write_file_atomically(file, "old");
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    std::signal(SIGXFSZ, SIG_DFL);
    const rlimit small{4096, 4096};
    const rlimit no_core{0, 0};
    setrlimit(RLIMIT_FSIZE, &small);
    setrlimit(RLIMIT_CORE, &no_core);
    write_file_atomically(file, std::string(100'000, 'x'));  // ends it by a signal
    _exit(0);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFSIGNALED(status));
  EXPECT_THAT(names(), ::testing::ElementsAre("a"));
  EXPECT_EQ(read_file(file), "old");
}

TEST_F(AtomicFile, CommitOfAFileThatIsNotThereFails) {
  TemporaryFile temporary(folder_.path() / "a"),
      never(folder_.path() / "a", TemporaryFile::Creation::kByWriter);
  std::filesystem::remove(temporary.path());
  EXPECT_THROW(temporary.commit(), Error);
  EXPECT_THROW(never.commit(), Error);
}

TEST_F(AtomicFile, AFolderThatIsMissingIsRefusedAtOnce) {
  try {
    const TemporaryFile temporary(folder_.path() / "none" / "a");
    FAIL() << temporary.path();
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kFailed);
    EXPECT_EQ(error.where(), (folder_.path() / "none" / "a").string());
  }
}

TEST_F(AtomicFile, FullDiskKeepsTheOldFileAndNoHalfOne) {
  const auto file = folder_.path() / "a";
  write_file_atomically(file, "old");
  {
    const FileSizeLimit limit(4096);
    try {
      write_file_atomically(file, std::string(100'000, 'x'));
      FAIL() << "a file beyond the limit was written";
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kFailed);
      EXPECT_EQ(error.where(), file.string());
    }
  }
  EXPECT_EQ(read_file(file), "old");
  EXPECT_THAT(names(), ::testing::ElementsAre("a"));
}

TEST_F(AtomicFile, ATargetThatIsAFolderIsRefused) {
  create_folder(folder_.path() / "a");
  EXPECT_THROW(write_file_atomically(folder_.path() / "a", "x"), Error);
  EXPECT_THAT(names(), ::testing::ElementsAre("a"));
}

TEST_F(AtomicFile, AParentThatIsAFileOrMissingIsRefused) {
  write_file_atomically(folder_.path() / "file", "x");
  EXPECT_THROW(write_file_atomically(folder_.path() / "file" / "a", "x"), Error);
  EXPECT_THROW(write_file_atomically(folder_.path() / "none" / "a", "x"), Error);
  EXPECT_THROW(create_folder(folder_.path() / "file"), Error);
  EXPECT_THROW(create_folder(folder_.path() / "file" / "sub"), Error);
}

TEST_F(AtomicFile, AFolderWithoutPermissionIsRefused) {
  testing::make_world_writable(folder_.path());
  const std::string closed = testing::unprivileged_access_error(folder_.path());
  if (!closed.empty()) GTEST_SKIP() << closed;
  const auto write = [&]() -> std::string {
    write_file_atomically(folder_.path() / "a", "x");
    return "written";
  };
  const auto create = [&]() -> std::string {
    create_folder(folder_.path() / "sub");
    return "created";
  };
  {
    const testing::ReadOnlyFolder locked(folder_.path());
    EXPECT_THAT(testing::run_unprivileged(write), HasSubstr("ermission denied"));
    EXPECT_THAT(testing::run_unprivileged(create), HasSubstr("ermission denied"));
    EXPECT_TRUE(names().empty());
  }
  testing::make_world_writable(folder_.path());  // so the failures came from the lock
  EXPECT_EQ(testing::run_unprivileged(write), "written");
  EXPECT_EQ(testing::run_unprivileged(create), "created");
}

TEST_F(AtomicFile, ReadingWhatIsNoFileIsBadInput) {
  for (const auto& path : {folder_.path() / "none", folder_.path()}) {
    try {
      read_file(path);
      FAIL() << path;
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
      EXPECT_EQ(error.where(), path.string());
    }
  }
}

TEST_F(AtomicFile, CreatesParentsAndAcceptsAnExistingFolder) {
  create_folder(folder_.path() / "a" / "b" / "c");
  create_folder(folder_.path() / "a" / "b" / "c");
  EXPECT_TRUE(std::filesystem::is_directory(folder_.path() / "a" / "b" / "c"));
}

TEST_F(AtomicFile, ManyWritersOfOneFileLeaveOneWholeFile) {
  const auto file = folder_.path() / "a";
  std::vector<std::thread> writers;
  for (int i = 0; i < 4; ++i) {
    writers.emplace_back([&, i] {
      for (int n = 0; n < 5; ++n) {
        write_file_atomically(file, std::string(10'000, static_cast<char>('a' + i)));
      }
    });
  }
  for (std::thread& writer : writers) writer.join();
  const std::string text = read_file(file);
  EXPECT_EQ(text, std::string(10'000, text.at(0)));
  EXPECT_THAT(names(), ::testing::ElementsAre("a"));
}

}  // namespace
}  // namespace raystage
