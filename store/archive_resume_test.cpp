// SPDX-License-Identifier: Apache-2.0
// Tests resuming after a crash: no frame whose append returned is lost, whenever the process ended.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>
#include <xxhash.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <set>
#include <thread>

#include "base/error.h"
#include "store/journal.h"
#include "store/lost_frames.h"
#include "store/matroska.h"
#include "testing/store/archive_test_data.h"
#include "testing/test_folder.h"

namespace raystage::store::archive_resume_test {
namespace {

using testing::bytes_of;
using testing::description;
using testing::fake_jpeg;
using ::testing::HasSubstr;

using Bytes = std::vector<std::byte>;

struct Resume : ::testing::Test, testing::ArchiveFiles {
  ArchiveWriter resume() const { return ArchiveWriter::resume(mkv, journal, description()); }

  /// Return the bytes, time and origin of frame i, in all these tests.
  static Bytes jpeg(std::size_t i) { return fake_jpeg(static_cast<unsigned>(i), 100 + i % 5000); }
  static Nanoseconds time(std::size_t i) { return static_cast<Nanoseconds>(i) * 1000; }
  static FrameOrigin origin(std::size_t i) { return {time(i) + 7, i}; }

  void expect_frames(std::size_t at_least) const {
    const ArchiveReader in = reader();
    ASSERT_GE(in.frames().size(), at_least);
    for (std::size_t i = 0; i < in.frames().size(); ++i) {
      ASSERT_EQ(in.frames()[i].time_ns, time(i));
      ASSERT_TRUE(std::ranges::equal(in.jpeg(static_cast<int>(i)), jpeg(i))) << i;
      if (in.frames()[i].xxh3 == 0) continue;  // its record is not in the journal
      const FrameOrigin expected = unlisted.contains(i) ? FrameOrigin{} : origin(i);
      ASSERT_EQ(in.frames()[i].arrival_ns, expected.arrival_ns);
      ASSERT_EQ(in.frames()[i].sequence, expected.sequence);
      ASSERT_TRUE(in.verify_frame(static_cast<int>(i)));
    }
  }
  // Returns the archive and journal of the same frames without any interruption.
  std::pair<Bytes, Bytes> in_one_go(std::size_t frames) const {
    const testing::TestFolder other;
    const auto a = other.path() / "a.mkv", b = other.path() / "a.journal";
    ArchiveWriter out(a, b, description());
    for (std::size_t i = 0; i < frames; ++i) {
      out.append(jpeg(i), time(i), unlisted.contains(i) ? FrameOrigin{} : origin(i));
    }
    out.close();
    return {bytes_of(a), bytes_of(b)};
  }

  /// Frames that a crash left without a record, so their origins are unknown.
  std::set<std::size_t> unlisted;
};

// A recorder that closes and resumes at random until it is killed. It reports the number of stored
// frames through a pipe.
[[noreturn]] void record_until_killed(const Resume& test, int pipe) {
  std::mt19937 random(static_cast<unsigned>(getpid()));
  auto frames = std::filesystem::exists(test.journal)
                    ? static_cast<std::size_t>(test.reader().frames().size())
                    : std::size_t{0};
  bool begun = std::filesystem::exists(test.mkv);
  while (true) {
    ArchiveWriter out = begun ? test.resume() : test.writer();
    begun = true;
    for (std::size_t i = random() % 40; i > 0; --i) {
      out.append(Resume::jpeg(frames), Resume::time(frames), Resume::origin(frames));
      ++frames;
      if (write(pipe, &frames, sizeof frames) != sizeof frames) _exit(1);
    }
    if (random() % 2 == 0) out.close();
    // Otherwise the destructor closes it.
  }
}

TEST_F(Resume, SurvivesBeingKilledAtAnyMoment) {
  std::mt19937 random(20051);
  std::size_t acknowledged = 0, known = 0;  // frames that a recorder reported, and that were read
  int while_open = 0;
  constexpr int kKills = 60;
  // A slow disk needs more and longer rounds to store enough frames.
  for (int round = 0; round < kKills || (acknowledged <= 100 && round < 10 * kKills); ++round) {
    std::array<int, 2> ends{};
    ASSERT_EQ(pipe(ends.data()), 0);
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      close(ends[0]);
      try {
        record_until_killed(*this, ends[1]);
      } catch (const std::exception& error) {
        std::fprintf(stderr, "the recorder: %s\n", error.what());
      }
      _exit(1);
    }
    close(ends[1]);
    const auto slower = 1 + static_cast<unsigned>(round / kKills);
    std::this_thread::sleep_for(std::chrono::microseconds(1000 + random() % (slower * 30'000)));
    kill(child, SIGKILL);
    int status = 0;
    waitpid(child, &status, 0);
    ASSERT_TRUE(WIFSIGNALED(status)) << "the recorder ended by itself";
    std::size_t count = 0;
    while (read(ends[0], &count, sizeof count) == sizeof count) {
      acknowledged = std::max(acknowledged, count);
    }
    close(ends[0]);
    if (!std::filesystem::exists(mkv) || !std::filesystem::exists(journal)) continue;
    ASSERT_NO_FATAL_FAILURE(expect_frames(acknowledged)) << "round " << round;
    while_open += reader().was_closed() ? 0 : 1;
    // A frame that was stored but not acknowledged is kept. Its record may be missing until the
    // next recorder adds one without its origin.
    const std::size_t stored = reader().frames().size();
    ASSERT_GE(stored, known);
    ASSERT_LE(stored, std::max(acknowledged, known) + 1);
    if (reader().recovered_frames() > 0) {
      ASSERT_EQ(reader().recovered_frames(), 1);
      ASSERT_GT(stored, acknowledged);
      unlisted.insert(stored - 1);
    }
    known = stored;
  }
  ASSERT_GT(acknowledged, 100u);
  EXPECT_GT(while_open, 0);
  RecordProperty("frames", static_cast<int>(acknowledged));
  RecordProperty("unlisted", static_cast<int>(unlisted.size()));

  resume().close();
  const auto frames = reader().frames().size();
  ASSERT_NO_FATAL_FAILURE(expect_frames(acknowledged));
  // The files equal those of an uninterrupted recording.
  const auto [archive, lines] = in_one_go(frames);
  EXPECT_TRUE(bytes_of(mkv) == archive);
  EXPECT_TRUE(bytes_of(journal) == lines);
  if (std::system("ffprobe -version >/dev/null 2>&1") != 0) return;
  const std::string probe =
      "test \"$(ffprobe -v error -count_packets -show_entries "
      "stream=nb_read_packets -of csv=p=0 '" +
      mkv.string() + "' 2>/dev/null)\" = " + std::to_string(frames);
  EXPECT_EQ(std::system(probe.c_str()), 0);
}

TEST_F(Resume, AClosedArchiveGoesOnAsIfNeverClosed) {
  {
    ArchiveWriter out = writer();
    for (std::size_t i = 0; i < 5; ++i) out.append(jpeg(i), time(i), origin(i));
  }
  ASSERT_TRUE(reader().was_closed());
  for (std::size_t i = 5; i < 9; ++i) {
    ArchiveWriter out = resume();
    EXPECT_EQ(out.last_time(), time(i - 1));
    EXPECT_FALSE(reader().was_closed());
    EXPECT_THROW(out.append(jpeg(i), time(i - 1)), Error);
    out.append(jpeg(i), time(i), origin(i));
  }
  EXPECT_EQ(std::pair(bytes_of(mkv), bytes_of(journal)), in_one_go(9));
}

// Constructs every intermediate state of closing and resuming: each can be read and resumed.
TEST_F(Resume, EveryStepOfClosingAndOpeningAgainIsReadable) {
  {
    ArchiveWriter out = writer();
    for (std::size_t i = 0; i < 5; ++i) out.append(jpeg(i), time(i), origin(i));
  }
  const Bytes closed = bytes_of(mkv);
  const auto header = matroska::make_header(description());
  const FrameRecord last = reader().frames().back();
  const auto end = last.offset + last.size;
  const auto put_back = [&](Bytes& file, std::size_t offset, std::size_t size) {
    std::copy_n(header.bytes.begin() + static_cast<std::ptrdiff_t>(offset), size,
                file.begin() + static_cast<std::ptrdiff_t>(offset));
  };
  for (int step = 0; step < 32; ++step) {
    for (std::size_t cut = end; cut <= closed.size(); cut += cut == end ? 1 : 150) {
      Bytes file = closed;
      if (step & 1) put_back(file, header.segment_size_offset, 8);
      if (step & 2) put_back(file, header.seek_head_offset, matroska::kSeekHeadBytes);
      if (step & 4) put_back(file, header.duration_offset, matroska::kDurationBytes);
      if (step & 16) put_back(file, header.rate_offset, matroska::kRateBytes);
      if (step & 8) file.resize(cut);
      testing::overwrite(mkv, file);
      ASSERT_NO_FATAL_FAILURE(expect_frames(5)) << step << " " << cut;
      {
        ArchiveWriter out = resume();
        out.append(jpeg(5), time(5), origin(5));
      }
      ASSERT_EQ(std::pair(bytes_of(mkv), bytes_of(journal)), in_one_go(6)) << step << " " << cut;
      // Restores the journal of five frames.
      std::filesystem::resize_file(journal, journal::kHeaderBytes + 5 * journal::kRecordBytes);
    }
  }
}

TEST_F(Resume, AClosedArchiveThatHasLostItsEndIsRefused) {
  {
    ArchiveWriter out = writer();
    for (std::size_t i = 0; i < 3; ++i) out.append(jpeg(i), time(i), origin(i));
  }
  std::filesystem::resize_file(mkv, reader().frames()[2].offset);
  const auto before = std::pair(bytes_of(mkv), bytes_of(journal));
  try {
    resume();
    ADD_FAILURE() << "the records of lost frames would be gone";
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
    EXPECT_THAT(error.what(), ::testing::HasSubstr("1 frames are lost"));
    EXPECT_THAT(error.what(), ::testing::HasSubstr("raystage repair --from COPY"));
  }
  EXPECT_EQ(std::pair(bytes_of(mkv), bytes_of(journal)), before);
}

// Archives of the first version have no space for the frame rate in their header.
TEST_F(Resume, AnArchiveWithoutSpaceForItsRateStaysAsItIs) {
  const auto old_archive = [&](std::size_t frames) {
    const auto header = matroska::make_header(description(), matroska::HeaderForm::kWithoutRate);
    Bytes file = header.bytes;
    const auto journal_header = journal::encode_header(description());
    Bytes lines(journal_header.begin(), journal_header.end());
    std::vector<matroska::CuePoint> cues;
    for (std::size_t i = 0; i < frames; ++i) {
      const auto bytes = jpeg(i);
      cues.push_back({time(i), file.size()});
      const auto cluster = matroska::make_cluster_header(time(i), bytes.size());
      file.insert(file.end(), cluster.begin(), cluster.end());
      FrameRecord record{time(i), file.size(), static_cast<std::uint32_t>(bytes.size())};
      record.xxh3 = XXH3_64bits(bytes.data(), bytes.size());
      record.arrival_ns = origin(i).arrival_ns;
      record.sequence = origin(i).sequence;
      file.insert(file.end(), bytes.begin(), bytes.end());
      const auto line = journal::encode_record(record);
      lines.insert(lines.end(), line.begin(), line.end());
    }
    const auto closing = matroska::make_trailer(cues, header, file.size());
    EXPECT_TRUE(closing.rate.empty());
    file.insert(file.end(), closing.cues.begin(), closing.cues.end());
    const auto put = [&](std::size_t at, const Bytes& part) {
      std::ranges::copy(part, file.begin() + static_cast<std::ptrdiff_t>(at));
    };
    put(header.duration_offset, closing.duration);
    put(header.seek_head_offset, closing.seek_head);
    put(header.segment_size_offset, closing.segment_size);
    return std::pair(file, lines);
  };
  const auto before = old_archive(4);
  testing::overwrite(mkv, before.first);
  testing::overwrite(journal, before.second);
  ASSERT_NO_FATAL_FAILURE(expect_frames(4));
  {
    ArchiveWriter out = resume();
    for (std::size_t i = 4; i < 7; ++i) out.append(jpeg(i), time(i), origin(i));
  }
  EXPECT_EQ(std::pair(bytes_of(mkv), bytes_of(journal)), old_archive(7));
}

TEST_F(Resume, ATornTailIsCutAndUnlistedFramesAreListed) {
  {
    ArchiveWriter out = writer();
    for (std::size_t i = 0; i < 3; ++i) out.append(jpeg(i), time(i), origin(i));
    out.append_missing(FrameStatus::kDroppedBySource, time(3));
    const Bytes archive = bytes_of(mkv), lines = bytes_of(journal);
    for (std::size_t cut = 0; cut <= archive.size(); cut += 1 + cut / 8) {
      for (const std::size_t lost : {std::size_t{0}, std::size_t{1}, std::size_t{48},
                                     std::size_t{60}, std::size_t{100}, lines.size()}) {
        const auto a = folder.path() / "cut.mkv", b = folder.path() / "cut.journal";
        testing::overwrite(a, std::span(archive).first(cut));
        testing::overwrite(b, std::span(lines).first(lines.size() - lost));
        const ArchiveReader cut_archive(a, b);
        const auto before = static_cast<std::size_t>(std::ranges::count_if(
            cut_archive.frames(),
            [&](const FrameRecord& frame) { return !is_lost(cut_archive, frame); }));
        ArchiveWriter::resume(a, b, description()).append(jpeg(9), time(9), origin(9));
        const ArchiveReader in(a, b);
        EXPECT_TRUE(in.was_closed());
        EXPECT_EQ(in.damaged_records() + in.recovered_frames(), 0);
        ASSERT_EQ(in.frames().size(), before + 1) << cut << " " << lost;
        for (std::size_t i = 0; i <= before; ++i) {
          ASSERT_TRUE(in.verify_frame(static_cast<int>(i)));
          const std::size_t number = i == before ? 9 : i;
          ASSERT_EQ(in.frames()[i].time_ns, time(number));
          ASSERT_TRUE(std::ranges::equal(in.jpeg(static_cast<int>(i)), jpeg(number)));
        }
        // No bytes of the truncated part remain.
        const Bytes file = bytes_of(a);
        const auto found = matroska::scan_clusters(file, 0, file.size());
        EXPECT_EQ(found.size(), before + 1);
      }
    }
  }
}

// A write that was interrupted leaves the last frame without a record. Of others nothing shows
// whether they are as recorded.
TEST_F(Resume, FramesWhoseRecordsAreLostAreUnverified) {
  constexpr std::size_t kFrames = 30;
  constexpr std::size_t kListed[] = {kFrames, kFrames - 1, kFrames - 2, 0};
  constexpr int kUnverified[] = {0, 0, 2, kFrames};
  for (std::size_t i = 0; i < std::size(kListed); ++i) {
    for (const bool torn : {false, true}) {
      if (torn && kListed[i] == kFrames) continue;
      std::filesystem::remove(mkv);
      std::filesystem::remove(journal);
      {
        ArchiveWriter out = writer();
        for (std::size_t frame = 0; frame < kFrames; ++frame) {
          out.append(jpeg(frame), time(frame), origin(frame));
        }
        std::filesystem::copy_file(mkv, mkv.string() + ".open",
                                   std::filesystem::copy_options::overwrite_existing);
      }
      std::filesystem::rename(mkv.string() + ".open", mkv);
      std::filesystem::resize_file(journal, journal::kHeaderBytes +
                                                kListed[i] * journal::kRecordBytes +
                                                (torn ? journal::kRecordBytes / 2 : 0));
      resume().close();
      EXPECT_EQ(std::ranges::count_if(reader().frames(), &FrameRecord::is_unverified),
                kUnverified[i])
          << kListed[i] << " listed";
      EXPECT_EQ(reader().frames().size(), kFrames);
    }
  }
}

TEST_F(Resume, RefusesWhatIsNotItsOwn) {
  const auto refused = [&](const ArchiveWriter::Description& other) -> std::string {
    try {
      ArchiveWriter::resume(mkv, journal, other);
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
      return error.what();
    }
    return "went on";
  };
  EXPECT_THAT(refused(description()), HasSubstr("archive to resume does not exist"));
  {
    ArchiveWriter out = writer();
    out.append(jpeg(0), time(0));
    try {
      resume();
      ADD_FAILURE() << "two writers at once";
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kFailed);
      EXPECT_THAT(error.what(), HasSubstr("another program is writing"));
    }
  }
  const Bytes whole = bytes_of(mkv), lines = bytes_of(journal);
  auto other = description();
  other.camera_id = "r0c1";
  EXPECT_THAT(refused(other), HasSubstr("camera \"r0c0\""));
  other = description();
  other.width = 641;
  EXPECT_THAT(refused(other), HasSubstr("641 x 480"));
  other = description();
  other.epoch_utc += 1;
  EXPECT_THAT(refused(other), HasSubstr("is expected"));
  auto damaged = whole;
  damaged[20] ^= std::byte{1};
  testing::overwrite(mkv, damaged);
  EXPECT_THAT(refused(description()), HasSubstr("raystage repair"));
  EXPECT_EQ(bytes_of(mkv), damaged);
  EXPECT_EQ(bytes_of(journal), lines);
}

// A frame in a cluster with a shorter header is readable, but no record can be behind it: its
// journal would be damaged.
TEST_F(Resume, RefusesFramesInClustersOfOtherForm) {
  Bytes file, lines;
  {
    ArchiveWriter out = writer();
    for (std::size_t i = 0; i < 2; ++i) out.append(jpeg(i), time(i), origin(i));
    file = bytes_of(mkv);
    lines = bytes_of(journal);
  }
  // Cluster and time in as many bytes as ours, the block's size in one byte instead of eight.
  const Bytes bytes = jpeg(2);
  ASSERT_LT(bytes.size() + 4, 127U);
  const auto header = matroska::make_cluster_header(time(2), bytes.size() - 7);
  const auto block = std::ranges::find(header.rbegin(), header.rend(), std::byte{0xA3}).base();
  file.insert(file.end(), header.begin(), block);
  file.push_back(static_cast<std::byte>(0x80 + bytes.size() + 4));
  for (const int byte : {0x81, 0, 0, 0x80}) file.push_back(static_cast<std::byte>(byte));
  file.insert(file.end(), bytes.begin(), bytes.end());
  testing::overwrite(mkv, file);
  testing::overwrite(journal, lines);
  ASSERT_EQ(reader().frames().size(), 3U);
  EXPECT_EQ(reader().frames()[2].time_ns, time(2));
  try {
    resume();
    ADD_FAILURE() << "it went on";
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
    EXPECT_THAT(error.what(), HasSubstr("not stored as Raystage stores frames"));
    EXPECT_THAT(error.what(), HasSubstr("raystage repair"));
  }
  EXPECT_EQ(bytes_of(mkv), file);
  EXPECT_EQ(bytes_of(journal), lines);
}

TEST_F(Resume, FlushFromAnotherThread) {
  ArchiveWriter out = writer();
  std::atomic<bool> done = false;
  std::thread flusher([&] {
    while (!done) out.flush();
  });
  for (std::size_t i = 0; i < 200; ++i) out.append(jpeg(i), time(i), origin(i));
  done = true;
  flusher.join();
  out.flush();
  out.close();
  EXPECT_THROW(out.flush(), Error);
  expect_frames(200);
}

}  // namespace
}  // namespace raystage::store::archive_resume_test
