// SPDX-License-Identifier: Apache-2.0
#include "base/child_process.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <csignal>
#include <fstream>
#include <thread>

#include "base/atomic_file.h"
#include "base/error.h"
#include "testing/test_folder.h"

namespace raystage {
namespace {

TEST(ChildProcess, TellsItsLinesCodeAndCosts) {
  const testing::TestFolder folder;
  std::vector<std::string> lines;
  ChildOptions options;
  options.log = folder.path() / "log";
  options.line = [&](std::string_view line) { lines.emplace_back(line); };
  const ChildResult result =
      run_child({"sh", "-c", "echo one; echo two >&2; printf three; exit 7"}, options);
  EXPECT_EQ(result.exit_code, 7);
  EXPECT_EQ(result.signal, 0);
  EXPECT_THAT(lines, ::testing::ElementsAre("one", "two", "three"));
  std::string log;
  std::getline(std::ifstream(options.log), log, '\0');
  EXPECT_EQ(log, "one\ntwo\nthree");
  EXPECT_GT(result.peak_memory_bytes, 1e5);
  EXPECT_GE(result.wall_seconds, result.cpu_seconds * 0.2);
}

TEST(ChildProcess, LogsIntoRegularFilesOnly) {
  const testing::TestFolder folder;
  const auto log = [&](const char* name) { return folder.path() / name; };
  write_file_atomically(log("secret"), std::string_view("mine\n"));
  std::filesystem::create_symlink("secret", log("link"));
  ASSERT_EQ(mkfifo(log("pipe").c_str(), 0600), 0);
  for (const char* name : {"plain", "link", "pipe", "plain"}) {
    ChildOptions options;
    options.log = log(name);
    EXPECT_EQ(run_child({"echo", "said"}, options).exit_code, 0) << name << ", and not a wait";
  }
  EXPECT_EQ(read_file(log("plain")), "said\nsaid\n");
  EXPECT_EQ(read_file(log("secret")), "mine\n");
}

TEST(ChildProcess, IsStoppedOrTimedOut) {
  std::stop_source stop;
  ChildOptions options;
  options.stop = stop.get_token();
  std::thread stopper([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(150));
    stop.request_stop();
  });
  const ChildResult stopped = run_child({"sleep", "60"}, options);
  stopper.join();
  EXPECT_EQ(stopped.exit_code, 128 + SIGTERM);
  ChildOptions timed;
  timed.timeout_seconds = 0.2;
  const ChildResult late = run_child({"sleep", "60"}, timed);
  EXPECT_TRUE(late.timed_out);
  EXPECT_EQ(late.signal, SIGKILL);
}

TEST(ChildProcess, GetsItsInputAndNoGrandchildHoldsItsEnd) {
  ChildOptions options;
  options.input = std::string(300'000, 'x') + "\n";
  EXPECT_EQ(run_child({"wc", "-c"}, options).out, "300001\n");
  const ChildResult result = run_child({"sh", "-c", "sleep 30 & echo done"});
  EXPECT_EQ(result.out, "done\n");
  EXPECT_LT(result.wall_seconds, 10);
}

TEST(ChildProcess, MayEndBeforeItHasReadItsInput) {
  std::signal(SIGPIPE, SIG_DFL);  // as in programs that use the library
  ChildOptions options;
  options.input = std::string(std::size_t{1} << 20, 'x');  // more than a pipe holds
  EXPECT_EQ(run_child({"true"}, options).exit_code, 0);
}

TEST(ChildProcess, ThatIsNotThereIsAnError) {
  EXPECT_THROW(run_child({"/no/such/program"}), Error);
}

}  // namespace
}  // namespace raystage
