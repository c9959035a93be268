// SPDX-License-Identifier: Apache-2.0
#include "store/journal_tail.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <limits>

#include "base/atomic_file.h"
#include "store/journal.h"
#include "testing/test_folder.h"

namespace raystage::store {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

class JournalTailTest : public ::testing::Test {
 protected:
  std::filesystem::path file() const { return folder_.path() / "a.journal"; }

  void append(std::span<const std::byte> bytes) const {
    std::ofstream out(file(), std::ios::binary | std::ios::app);
    out.write(reinterpret_cast<const char*>(bytes.data()),
              static_cast<std::streamsize>(bytes.size()));
  }
  void append_header() const { append(journal::encode_header({"a", 8, 8, 0})); }
  void append_record(Nanoseconds time) const {
    FrameRecord record;
    record.time_ns = time;
    record.offset = 100;
    record.size = 10;
    append(journal::encode_record(record));
  }

  static std::vector<Nanoseconds> times(const std::vector<FrameRecord>& records) {
    std::vector<Nanoseconds> result;
    for (const FrameRecord& record : records) result.push_back(record.time_ns);
    return result;
  }

  testing::TestFolder folder_;
};

TEST_F(JournalTailTest, ReturnsEachRecordOnceAsItIsAppended) {
  JournalTail tail({folder_.path(), "a.journal"}, 100);
  EXPECT_THAT(tail.read(), IsEmpty());
  append_header();
  EXPECT_THAT(tail.read(), IsEmpty());
  append_record(1);
  append_record(2);
  EXPECT_THAT(times(tail.read()), ElementsAre(1, 2));
  EXPECT_THAT(tail.read(), IsEmpty());
  append_record(3);
  EXPECT_THAT(times(tail.read()), ElementsAre(3));
}

TEST_F(JournalTailTest, WaitsForTheRestOfARecord) {
  append_header();
  JournalTail tail({folder_.path(), "a.journal"}, 100);
  FrameRecord record;
  record.time_ns = 7;
  const auto bytes = journal::encode_record(record);
  append(std::span(bytes).first(20));
  EXPECT_THAT(tail.read(), IsEmpty());
  append(std::span(bytes).subspan(20));
  EXPECT_THAT(times(tail.read()), ElementsAre(7));
}

TEST_F(JournalTailTest, BeginsNearTheEnd) {
  append_header();
  for (int i = 0; i < 50; ++i) append_record(i);
  JournalTail tail({folder_.path(), "a.journal"}, 3);
  EXPECT_THAT(times(tail.read()), ElementsAre(47, 48, 49));
}

TEST_F(JournalTailTest, SkipsDamagedRecords) {
  append_header();
  append_record(1);
  append(std::vector<std::byte>(journal::kRecordBytes, std::byte{0x55}));
  append_record(2);
  JournalTail tail({folder_.path(), "a.journal"}, 100);
  EXPECT_THAT(times(tail.read()), ElementsAre(1, 2));
}

TEST_F(JournalTailTest, RefusesNothingButReturnsNothingWithoutAHeader) {
  append(std::vector<std::byte>(500, std::byte{0x55}));
  JournalTail tail({folder_.path(), "a.journal"}, 100);
  EXPECT_THAT(tail.read(), IsEmpty());
  EXPECT_FALSE(journal_time_range({folder_.path(), "a.journal"}));
}

TEST_F(JournalTailTest, TheTimeRangeIsThatOfTheFirstAndTheLastRecord) {
  EXPECT_FALSE(journal_time_range({folder_.path(), "a.journal"}));
  append_header();
  EXPECT_FALSE(journal_time_range({folder_.path(), "a.journal"}));
  append_record(5);
  append_record(6);
  append_record(90);
  const auto range = journal_time_range({folder_.path(), "a.journal"});
  ASSERT_TRUE(range);
  EXPECT_EQ(range->begin, 5);
  EXPECT_EQ(range->end, 90);
}

TEST_F(JournalTailTest, TimesThatNoArchiveHasAreDamage) {
  append_header();
  append_record(std::numeric_limits<Nanoseconds>::min());
  append_record(-1);
  append_record(0);
  append_record(kMaxArchiveTime);
  append_record(kMaxArchiveTime + 1);
  append_record(std::numeric_limits<Nanoseconds>::max());
  JournalTail tail({folder_.path(), "a.journal"}, 100);
  EXPECT_THAT(times(tail.read()), ElementsAre(0, kMaxArchiveTime));
  EXPECT_FALSE(journal_time_range({folder_.path(), "a.journal"})) << "end - begin would overflow";
}

}  // namespace
}  // namespace raystage::store
