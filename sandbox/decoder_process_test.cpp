// SPDX-License-Identifier: Apache-2.0
#include "sandbox/decoder_process.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <chrono>
#include <fstream>
#include <stop_token>
#include <string>
#include <thread>

#include "base/cancellation.h"
#include "base/error.h"
#include "base/resources.h"
#include "sandbox/machine_limits.h"
#include "testing/test_folder.h"

namespace raystage::sandbox {
namespace {

using ::testing::HasSubstr;

void write_text(const std::filesystem::path& file, const std::string& text) {
  std::ofstream(file, std::ios::binary) << text;
}

class DecoderProcessTest : public ::testing::Test {
 protected:
  DecoderProcessTest() {
    options_.program = "raystage-misbehaving-decoder";
    options_.kind = "mesh";
    options_.memory_bytes = 100'000'000;
    options_.result_bytes = 50'000'000;
    options_.time = std::chrono::seconds(1);
  }
  std::string run(const std::string& what) {
    DecoderProcess decoder(options_);
    return run_in(decoder, what);
  }
  std::string run_in(DecoderProcess& decoder, const std::string& what) {
    const auto bytes = decoder.decode(std::as_bytes(std::span(what)), "some.mesh", open_file_);
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
  }
  void expect_error(const std::string& what, const std::string& message,
                    ExitCode exit_code = ExitCode::kBadInput) {
    try {
      run(what);
      ADD_FAILURE() << what << " went well";
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), HasSubstr(message)) << what;
      EXPECT_EQ(error.where(), "some.mesh");
      EXPECT_EQ(error.exit_code(), exit_code);
    }
  }

  DecoderOptions options_;
  OpenFile open_file_ = [](const std::string&) { return FileDescriptor(-1); };
};

TEST_F(DecoderProcessTest, TheMachineLimitsWhatDocumentsOfStrangersAskFor) {
  DecoderOptions huge = options_;
  huge.memory_bytes = huge.result_bytes = std::size_t{1} << 50;
  const DecoderOptions limited = within_machine(huge);
  EXPECT_EQ(limited.memory_bytes, available_memory() / 2);
  EXPECT_EQ(limited.result_bytes, available_memory() / 2);
  EXPECT_EQ(limited.wanted_memory_bytes, huge.memory_bytes);
  const DecoderOptions small = within_machine(options_);
  EXPECT_EQ(small.memory_bytes, options_.memory_bytes);
  EXPECT_EQ(small.result_bytes, options_.result_bytes);
  EXPECT_EQ(small.wanted_memory_bytes, 0U);
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  options_.wanted_memory_bytes = 5'000'000'000'000;
  expect_error("allocate",
               "its decoder needs more than 100 MB of memory, half of this machine's; up to "
               "5000000 MB");
#endif
}

TEST_F(DecoderProcessTest, CrashesHangsAndGreedAreErrorsThatNameTheFile) {
  expect_error("crash", "its decoder crashed (Segmentation fault)");
  expect_error("loop", "its decoder took more than 1 s of processor time");
  expect_error("refuse", "no such thing");
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  expect_error("allocate", "its decoder needs more than 100 MB");
  expect_error("sleep", "closed its connection");
  // It is not known whether that is the file's fault.
  expect_error("wait", "did not answer within 12 s", ExitCode::kFailed);
#endif
  expect_error("write", "its decoder ");
  expect_error("flood", "its decoder ");
  options_.time = std::chrono::seconds(20);
  expect_error("requests", "asked for too many files");
}

TEST_F(DecoderProcessTest, AStopDoesNotWaitForIt) {
  options_.time = std::chrono::seconds(60);
  std::stop_source stop;
  std::jthread asks([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    stop.request_stop();
  });
  const CancellationScope scope(stop.get_token());
  EXPECT_THROW(run("loop"), Cancelled);
}

TEST_F(DecoderProcessTest, CanDoNothingButDecode) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "sanitizers need system calls of their own";
#endif
  EXPECT_EQ(run("escape"), "");
  options_.confinement = Confinement::kLimitsOnly;
  EXPECT_THAT(run("escape"), HasSubstr("open "));  // the test itself can fail
}

TEST_F(DecoderProcessTest, GetsTheFilesThatItsParentOpens) {
  const raystage::testing::TestFolder folder;
  const std::filesystem::path file = folder.path() / "a.bin";
  write_text(file, "contents");
  std::string asked;
  open_file_ = [&](const std::string& name) {
    asked = name;
    return FileDescriptor(name == "a.bin" ? ::open(file.c_str(), O_RDONLY | O_CLOEXEC) : -1);
  };
  EXPECT_EQ(run("a.bin"), "contents");
  EXPECT_EQ(asked, "a.bin");
  EXPECT_EQ(run("b.bin"), "none");
}

TEST_F(DecoderProcessTest, LibrariesOpenFilesByNameThroughTheParent) {
  const raystage::testing::TestFolder folder;
  const std::filesystem::path file = folder.path() / "a.bin", other = folder.path() / "b.bin";
  write_text(file, "contents");
  write_text(other, "a secret");
  open_file_ = only_file(file);
  EXPECT_EQ(run("by name: " + file.string()), "8 contents");
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  EXPECT_EQ(run("by name: " + other.string()), "none");
#endif
  std::filesystem::remove(file);
  ASSERT_EQ(::mkfifo(file.c_str(), 0600), 0);
  EXPECT_FALSE(only_file(file)(file.string()).open());
}

TEST_F(DecoderProcessTest, ItsThreadsReadFilesByName) {
  const raystage::testing::TestFolder folder;
  const std::filesystem::path file = folder.path() / "a.bin";
  write_text(file, "contents");
  open_file_ = only_file(file);
  EXPECT_EQ(run("in threads: " + file.string()), "8 contents|8 contents|8 contents|8 contents");
}

TEST_F(DecoderProcessTest, AnswersManyRequestsInOneProcessAndOneAfterACrash) {
  DecoderProcess decoder(options_);
  const std::string process = run_in(decoder, "process");
  EXPECT_THROW(run_in(decoder, "refuse"), Error);
  EXPECT_EQ(run_in(decoder, "process"), process);
  EXPECT_THROW(run_in(decoder, "crash"), Error);
  EXPECT_NE(run_in(decoder, "process"), process);
}

/// A decoder that a file has taken over may go on answering.
TEST_F(DecoderProcessTest, FalseAnswersNeitherCostMemoryNorReachTheNextRequest) {
  expect_error("false size", "returned damaged data");
  DecoderProcess decoder(options_);
  run_in(decoder, "two answers");
  std::this_thread::sleep_for(std::chrono::milliseconds(500));  // the second is there then
  EXPECT_THROW(run_in(decoder, "process"), Error);
  EXPECT_NE(run_in(decoder, "process"), "");
  try {  // it does not receive the answers to its questions
    run_in(decoder, "flood and answer");
  } catch (const Error&) {
  }
  const auto start = std::chrono::steady_clock::now();
  try {
    run_in(decoder, "process");
  } catch (const Error&) {
  }
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(5));
}

TEST_F(DecoderProcessTest, FilesOfRelativeAndCompletePathsAreTheSame) {
  const raystage::testing::TestFolder folder;
  std::filesystem::create_directories(folder.path() / "config" / "luts");
  write_text(folder.path() / "config" / "luts" / "a", "table");
  write_text(folder.path() / "config" / "config", "config");
  const auto relative =
      (folder.path() / "config" / "config").lexically_relative(std::filesystem::current_path());
  const OpenFile open = files_below_folder_of(relative, 100);
  EXPECT_TRUE(open(relative.string()).open());
  EXPECT_TRUE(open((relative.parent_path() / "luts" / "a").string()).open());
  EXPECT_TRUE(open((folder.path() / "config" / "luts" / "a").string()).open());
  EXPECT_FALSE(open((folder.path() / "elsewhere").string()).open());
  EXPECT_FALSE(files_below_folder_of(relative, 4)(relative.string()).open());
  EXPECT_FALSE(open("").open());  // a decoder that was taken over may ask for anything
}

TEST_F(DecoderProcessTest, DoesNotSeeTheEnvironment) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "sanitizers have options in the environment";
#endif
  EXPECT_EQ(run("environment"), "OMP_NUM_THREADS=1");
}

TEST_F(DecoderProcessTest, AMissingProgramIsAnError) {
  options_.program = "raystage-no-such-decoder";
  try {
    run("refuse");
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("the decoder cannot be started"));
    EXPECT_EQ(error.exit_code(), ExitCode::kFailed);
  }
}

}  // namespace
}  // namespace raystage::sandbox
