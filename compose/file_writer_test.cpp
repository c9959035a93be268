// SPDX-License-Identifier: Apache-2.0
#include "compose/file_writer.h"

#include <gtest/gtest.h>

#include <atomic>
#include <future>
#include <string>

#include "base/atomic_file.h"
#include "base/error.h"
#include "testing/test_folder.h"

namespace raystage::compose {
namespace {

std::vector<std::byte> bytes_of(const std::string& text) {
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

TEST(FileWriter, WritesAllFilesInOrderAndSaysSo) {
  testing::TestFolder folder;
  std::vector<std::size_t> written;
  {
    FileWriter writer(1);
    for (int i = 0; i < 20; ++i) {
      const std::string name = "f" + std::to_string(i);
      writer.write(
          {{folder.path() / name, bytes_of(name)}, {folder.path() / (name + "d"), {}}},
          [&, i](const FileWriter::WriteResult& done) {
            EXPECT_FALSE(done.error);
            EXPECT_EQ(read_file(folder.path() / ("f" + std::to_string(i))).size(), done.bytes);
            EXPECT_TRUE(std::filesystem::exists(folder.path() / ("f" + std::to_string(i) + "d")));
            written.push_back(static_cast<std::size_t>(i));
          });
    }
  }  // waits
  ASSERT_EQ(written.size(), 20U);
  for (std::size_t i = 0; i < 20; ++i) EXPECT_EQ(written[i], i);
}

TEST(FileWriter, AFileThatFailsLeavesTheOthers) {
  testing::TestFolder folder;
  int failed = 0, done = 0;
  FileWriter writer(2);
  for (const char* name : {"a", "nowhere/b", "c"}) {
    writer.write({{folder.path() / name, bytes_of("text")}},
                 [&](const FileWriter::WriteResult& written) {
                   ++done;
                   if (!written.error) return;
                   ++failed;
                   EXPECT_THROW(std::rethrow_exception(written.error), Error);
                 });
  }
  writer.finish();
  EXPECT_EQ(done, 3);
  EXPECT_EQ(failed, 1);
  EXPECT_EQ(read_file(folder.path() / "c"), "text");
}

TEST(FileWriter, HoldsNobodyUpUntilItsQueueIsFull) {
  testing::TestFolder folder;
  std::promise<void> disk_answers;
  const std::shared_future<void> answered = disk_answers.get_future().share();
  FileWriter writer(1);
  // The first callback blocks, as a disk that does not respond.
  std::promise<void> stuck;
  writer.write({{folder.path() / "a", bytes_of("a")}}, [&](const FileWriter::WriteResult&) {
    stuck.set_value();
    answered.wait();
  });
  stuck.get_future().wait();
  writer.write({{folder.path() / "b", bytes_of("b")}}, [](const FileWriter::WriteResult&) {});
  std::atomic<bool> third_is_in = false;
  std::thread third([&] {
    writer.write({{folder.path() / "c", bytes_of("c")}}, [](const FileWriter::WriteResult&) {});
    third_is_in = true;
  });
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  EXPECT_FALSE(third_is_in) << "there was room for one";
  disk_answers.set_value();
  third.join();
  writer.finish();
  for (const char* name : {"a", "b", "c"}) EXPECT_EQ(read_file(folder.path() / name), name);
}

}  // namespace
}  // namespace raystage::compose
