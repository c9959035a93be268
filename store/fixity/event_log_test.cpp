// SPDX-License-Identifier: Apache-2.0
#include "store/fixity/event_log.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <random>
#include <thread>

#include "base/atomic_file.h"
#include "base/error.h"
#include "store/fixity/manifest.h"
#include "testing/store/take_test_data.h"
#include "testing/test_folder.h"
#include "testing/test_permissions.h"

namespace raystage::store {
namespace event_log_test {

namespace fs = std::filesystem;
using schemas::TakeEvent;

TakeEvent check_event(const std::string& note = "intact") {
  TakeEvent event;
  event.type = "fixity check";
  event.detail = "verify, depth: hashes";
  event.note = note;
  event.program = "raystage";
  event.version = "1.2.3";
  return event;
}

class EventLogTest : public ::testing::Test {
 protected:
  EventLogTest() { testing::write_take(take(), {{1'000'000, 2'000'000}, {1'500'000}}); }
  fs::path take() const { return folder_.path() / "take"; }
  fs::path log() const { return take() / kEventLogFile; }

 private:
  testing::TestFolder folder_;
};

TEST_F(EventLogTest, EventsComeBackInTheirOrder) {
  std::vector<TakeEvent> events;
  for (int i = 0; i < 3; ++i) {
    TakeEvent event = make_event(take(), check_event("run " + std::to_string(i)));
    event.outcome = static_cast<TakeEvent::Outcome>(i);
    EXPECT_TRUE(append_event(take(), event));
    events.push_back(event);
  }
  const EventLog log = read_event_log(take());
  EXPECT_EQ(log.events, events);
  EXPECT_EQ(log.damaged_lines, 0);
  EXPECT_EQ(log.events[0].take, "test");
  EXPECT_NE(log.events[0].id, log.events[1].id);
  EXPECT_EQ(log.events[0].sha256.size(), 64);
}

TEST_F(EventLogTest, TheDigestIsThatOfSha256sum) {
  const std::string command =
      "cd '" + take().string() +
      "' && sha256sum archive/*.journal rig.json take.json | sha256sum > sum";
  ASSERT_EQ(std::system(command.c_str()), 0);
  EXPECT_EQ(read_file(take() / "sum").substr(0, 64), take_digest(take()));
}

TEST_F(EventLogTest, WithoutALogThereAreNoEvents) {
  EXPECT_TRUE(read_event_log(take()).events.empty());
  EXPECT_FALSE(fs::exists(log()));
}

TEST_F(EventLogTest, ManifestsDoNotListIt) {
  ASSERT_TRUE(append_event(take(), make_event(take(), check_event())));
  EXPECT_THAT(files_of_take(take()), ::testing::Not(::testing::Contains(kEventLogFile)));
}

TEST_F(EventLogTest, AnIncompleteLineStaysOnItsOwn) {
  ASSERT_TRUE(append_event(take(), make_event(take(), check_event("first"))));
  const std::string whole = read_file(log());
  for (const std::size_t size : {whole.size() - 1, whole.size() / 2, std::size_t{1}}) {
    write_file_atomically(log(), whole + whole.substr(0, size));
    ASSERT_TRUE(append_event(take(), make_event(take(), check_event("last"))));
    const EventLog found = read_event_log(take());
    // Without its line feed alone, the line is an event nevertheless.
    EXPECT_EQ(found.damaged_lines, size == whole.size() - 1 ? 0 : 1);
    EXPECT_EQ(found.events.front().note, "first");
    EXPECT_EQ(found.events.back().note, "last");
  }
}

TEST_F(EventLogTest, ThreadsThatAppendAtOnceLoseNothing) {
  constexpr int kThreads = 8, kEvents = 20;
  {
    std::vector<std::jthread> threads;
    for (int i = 0; i < kThreads; ++i) {
      threads.emplace_back([&] {
        for (int k = 0; k < kEvents; ++k) append_event(take(), make_event(take(), check_event()));
      });
    }
  }
  const EventLog found = read_event_log(take());
  EXPECT_EQ(found.events.size(), kThreads * kEvents);
  EXPECT_EQ(found.damaged_lines, 0);
}

TEST_F(EventLogTest, TakesInBagsGetNoEvents) {
  const fs::path bag = take().parent_path() / "bag";
  fs::create_directory(bag);
  fs::rename(take(), bag / "data");
  write_file_atomically(bag / "bagit.txt", "a bag\n");
  const TakeEvent event = make_event(bag / "data", check_event());
  for (const char* name : {"data", "data/", "data/.", "data/../data"}) {
    EXPECT_FALSE(append_event(bag / name, event));
  }
  EXPECT_FALSE(fs::exists(bag / "data" / kEventLogFile));
  fs::remove(bag / "bagit.txt");
  EXPECT_TRUE(append_event(bag / "data", event));
}

TEST_F(EventLogTest, ReadOnlyTakesAreNoError) {
  const TakeEvent event = make_event(take(), check_event());
  const fs::perms writable = fs::status(take()).permissions();
  for (const auto& entry : {take().parent_path(), take()}) {
    fs::permissions(entry, fs::perms::others_read | fs::perms::others_exec, fs::perm_options::add);
  }
  EXPECT_EQ(testing::run_unprivileged([&]() -> std::string {
              return append_event(take(), event) ? "written" : "read only";
            }),
            geteuid() == 0 ? "read only" : "written");
  fs::permissions(take(), writable);
}

TEST_F(EventLogTest, LinksAndOtherFilesAreRefused) {
  write_file_atomically(take().parent_path() / "elsewhere", "mine\n");
  fs::create_symlink(take().parent_path() / "elsewhere", log());
  EXPECT_THROW(append_event(take(), make_event(take(), check_event())), Error);
  EXPECT_THROW(read_event_log(take()), Error);
  EXPECT_EQ(read_file(take().parent_path() / "elsewhere"), "mine\n");
  fs::remove(log());
  fs::create_directory(log());
  EXPECT_THROW(append_event(take(), make_event(take(), check_event())), Error);
}

TEST_F(EventLogTest, TextsAreMadeValidAndShort) {
  TakeEvent event = make_event(
      take(), check_event(std::string(990, 'a') + "\xff" + std::string(40, '\n') + "\xc3\xa9"));
  ASSERT_TRUE(append_event(take(), event));
  const EventLog found = read_event_log(take());
  ASSERT_EQ(found.events.size(), 1);
  EXPECT_LE(found.events[0].note.size(), 1000);
}

TEST_F(EventLogTest, DamagedLogsAreReadWithoutTheDamagedLines) {
  for (int i = 0; i < 5; ++i) append_event(take(), make_event(take(), check_event()));
  const std::string whole = read_file(log());
  std::mt19937 random(7);
  for (int i = 0; i < 300; ++i) {
    std::string bytes = whole;
    bytes[random() % bytes.size()] ^= static_cast<char>(1u << (random() % 8));
    const EventLog found = parse_event_log(bytes, "log");
    EXPECT_GE(found.events.size(), 3);
  }
}

}  // namespace event_log_test
}  // namespace raystage::store
