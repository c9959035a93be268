// SPDX-License-Identifier: Apache-2.0
#include "store/archive.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <sstream>
#include <thread>

#include "base/atomic_file.h"
#include "base/error.h"
#include "base/little_endian.h"
#include "base/mapped_file.h"
#include "base/posix_file.h"
#include "store/journal.h"
#include "store/matroska.h"
#include "testing/store/archive_test_data.h"
#include "testing/test_folder.h"

namespace raystage::store {
namespace {

using testing::bytes_of;
using testing::description;
using testing::fake_jpeg;
using ::testing::HasSubstr;

struct Archive : ::testing::Test, testing::ArchiveFiles {};

template <typename Call>
Error error_of(Call&& call) {
  try {
    call();
  } catch (const Error& error) {
    return error;
  }
  ADD_FAILURE() << "no Error was thrown";
  return Error::failed("", "", "");
}

TEST_F(Archive, SeveralAtOnceAreTheSameBytesAsOneByOne) {
  const auto a = fake_jpeg(1), b = fake_jpeg(2, 90'000), c = fake_jpeg(3);
  const std::array frames{NewFrame{10, a, FrameStatus::kStored, {11, 1}},
                          NewFrame{20, {}, FrameStatus::kDroppedBySource, {kUnknownTime, 2}},
                          NewFrame{20, b, FrameStatus::kStored, {21, 3}},
                          NewFrame{30, c, FrameStatus::kStored, {31, 4}}};
  ArchiveWriter together = writer();
  together.append(frames);
  together.append(std::span<const NewFrame>());
  EXPECT_EQ(together.last_time(), 30);
  together.close();
  const auto mkv_bytes = bytes_of(mkv), journal_bytes = bytes_of(journal);
  std::filesystem::remove(mkv);
  std::filesystem::remove(journal);
  ArchiveWriter single = writer();
  single.append(a, 10, {11, 1});
  single.append_missing(FrameStatus::kDroppedBySource, 20, {kUnknownTime, 2});
  single.append(b, 20, {21, 3});
  single.append(c, 30, {31, 4});
  single.close();
  EXPECT_EQ(bytes_of(mkv), mkv_bytes);
  EXPECT_EQ(bytes_of(journal), journal_bytes);
}

TEST_F(Archive, SeveralAtOnceAreRefusedAsAWhole) {
  const auto jpeg = fake_jpeg(1);
  ArchiveWriter out = writer();
  out.append(jpeg, 5);
  const auto before = bytes_of(mkv), journal_before = bytes_of(journal);
  const std::array same_time{NewFrame{10, jpeg, FrameStatus::kStored, {}},
                             NewFrame{10, jpeg, FrameStatus::kStored, {}}};
  const std::array empty{NewFrame{10, jpeg, FrameStatus::kStored, {}},
                         NewFrame{20, {}, FrameStatus::kStored, {}}};
  EXPECT_THAT(error_of([&] { out.append(same_time); }).what(), HasSubstr("does not follow"));
  EXPECT_THAT(error_of([&] { out.append(empty); }).what(), HasSubstr("0 bytes"));
  EXPECT_EQ(out.last_time(), 5);
  EXPECT_EQ(bytes_of(mkv), before);
  EXPECT_EQ(bytes_of(journal), journal_before);
}

TEST_F(Archive, GivesBackWhatWentIn) {
  ArchiveWriter out = writer();
  out.append_missing(FrameStatus::kStartUp, 0);
  out.append(fake_jpeg(1), 66'666'667);
  out.append_missing(FrameStatus::kDroppedRamFull, 133'333'333);
  out.append(fake_jpeg(2, 1), 200'000'001);
  out.append(fake_jpeg(3, 100'000), matroska::kMaxTime);
  out.close();

  const ArchiveReader in = reader();
  EXPECT_TRUE(in.was_closed());
  EXPECT_EQ(in.recovered_frames(), 0);
  EXPECT_EQ(in.damaged_records(), 0);
  EXPECT_EQ(in.bytes(), std::filesystem::file_size(mkv));
  EXPECT_EQ(in.description().camera_id, "r0c0");
  EXPECT_EQ(in.description().width, 640);
  EXPECT_EQ(in.description().height, 480);
  EXPECT_EQ(in.description().epoch_utc, description().epoch_utc);
  ASSERT_EQ(in.records().size(), 5u);
  EXPECT_EQ(in.records()[0].status, FrameStatus::kStartUp);
  EXPECT_EQ(in.records()[2].status, FrameStatus::kDroppedRamFull);
  EXPECT_EQ(in.records()[2].time_ns, 133'333'333);
  ASSERT_EQ(in.frames().size(), 3u);
  EXPECT_EQ(in.frames()[0].time_ns, 66'666'667);
  EXPECT_EQ(in.frames()[1].time_ns, 200'000'001);
  EXPECT_EQ(in.frames()[2].time_ns, matroska::kMaxTime);
  EXPECT_THAT(in.jpeg(0).bytes(), ::testing::ElementsAreArray(fake_jpeg(1)));
  EXPECT_THAT(in.jpeg(1).bytes(), ::testing::ElementsAreArray(fake_jpeg(2, 1)));
  EXPECT_TRUE(std::ranges::equal(in.jpeg(2).bytes(), fake_jpeg(3, 100'000)));
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(in.verify_frame(i));
}

TEST_F(Archive, IsReproducible) {
  const auto write = [&](const std::string& name) {
    ArchiveWriter out(folder.path() / (name + ".mkv"), folder.path() / (name + ".journal"),
                      description());
    out.append(fake_jpeg(1), 5);
    out.append(fake_jpeg(2), 6);
    out.close();
    return std::pair(bytes_of(folder.path() / (name + ".mkv")),
                     bytes_of(folder.path() / (name + ".journal")));
  };
  EXPECT_EQ(write("a"), write("b"));
}

TEST_F(Archive, RunningRecordingIsReadable) {
  ArchiveWriter out = writer();
  out.append(fake_jpeg(1), 1);
  out.append(fake_jpeg(2), 2);
  const ArchiveReader in = reader();
  EXPECT_FALSE(in.was_closed());
  ASSERT_EQ(in.frames().size(), 2u);
  EXPECT_TRUE(in.verify_frame(1));
  out.append(fake_jpeg(3), 3);
  EXPECT_EQ(reader().frames().size(), 3u);
}

TEST_F(Archive, WithoutAnyFrame) {
  writer().close();
  const ArchiveReader in = reader();
  EXPECT_TRUE(in.was_closed());
  EXPECT_TRUE(in.frames().empty());
  EXPECT_FALSE(in.nearest_frame(0).has_value());
}

TEST_F(Archive, RefusesWhatItCannotKeep) {
  ArchiveWriter out = writer();
  EXPECT_EQ(error_of([&] { out.append({}, 1); }).exit_code(), ExitCode::kBadInput);
  EXPECT_THROW(out.append(fake_jpeg(1), -1), Error);
  EXPECT_THROW(out.append(fake_jpeg(1), matroska::kMaxTime + 1), Error);
  EXPECT_THROW(out.append_missing(FrameStatus::kStored, 1), Error);
  out.append(fake_jpeg(1), 10);
  EXPECT_THAT(error_of([&] { out.append(fake_jpeg(2), 10); }).what(),
              HasSubstr("10 ns does not follow the one at 10 ns"));
  EXPECT_THROW(out.append_missing(FrameStatus::kTorn, 9), Error);
  out.append(fake_jpeg(2), 11);
  out.close();
  EXPECT_THROW(out.append(fake_jpeg(3), 12), Error);
  EXPECT_EQ(reader().frames().size(), 2u);
}

TEST_F(Archive, NeverTakesTheNameOfAnother) {
  writer().close();
  EXPECT_EQ(error_of([&] { writer(); }).exit_code(), ExitCode::kFailed);
  EXPECT_TRUE(reader().was_closed());
  // If only the journal exists, the new archive is removed again.
  std::filesystem::remove(mkv);
  EXPECT_THROW(writer(), Error);
  EXPECT_FALSE(std::filesystem::exists(mkv));
  EXPECT_TRUE(std::filesystem::exists(journal));
}

TEST_F(Archive, MissingOrForeignFilesAreBadInput) {
  EXPECT_EQ(error_of([&] { reader(); }).exit_code(), ExitCode::kBadInput);
  testing::overwrite(mkv, std::as_bytes(std::span("RIFF....AVI ")));
  EXPECT_THAT(error_of([&] { reader(); }).what(), HasSubstr("not a Matroska file"));
}

TEST_F(Archive, FutureJournalIsRefused) {
  {
    ArchiveWriter out = writer();
    out.append(fake_jpeg(1), 1);
  }
  auto bytes = bytes_of(journal);
  auto header = journal::encode_header(description());
  store_little_endian(header, 8, std::uint32_t{7});
  // A valid header of version 7 has a hash over its contents.
  store_little_endian(
      header, 56,
      journal::hash_camera_id(std::string_view(reinterpret_cast<const char*>(header.data()), 56)));
  std::ranges::copy(header, bytes.begin());
  testing::overwrite(journal, bytes);
  const Error error = error_of([&] { reader(); });
  EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
  EXPECT_THAT(error.what(), HasSubstr("version 7"));
  EXPECT_THAT(error.what(), HasSubstr("newer Raystage"));
}

TEST_F(Archive, JournalOfAnotherCameraIsRefused) {
  writer().close();
  auto other = description();
  other.camera_id = "r0c1";
  testing::overwrite(journal, journal::encode_header(other));
  EXPECT_THAT(error_of([&] { reader(); }).what(), HasSubstr("another archive"));
}

TEST_F(Archive, RottenRecordCostsOnlyItsHash) {
  {
    ArchiveWriter out = writer();
    out.append(fake_jpeg(1), 1);
    out.append(fake_jpeg(2), 2);
    out.append_missing(FrameStatus::kTorn, 3);
    out.append(fake_jpeg(4), 4);
  }
  const auto whole = bytes_of(journal);
  for (std::size_t bit = 0; bit < 8 * journal::kRecordBytes; ++bit) {
    auto bytes = whole;
    bytes[journal::kHeaderBytes + journal::kRecordBytes + bit / 8] ^=
        static_cast<std::byte>(1u << (bit % 8));
    testing::overwrite(journal, bytes);
    const ArchiveReader in = reader();
    ASSERT_EQ(in.records().size(), 4u) << bit;
    ASSERT_EQ(in.frames().size(), 3u) << bit;
    EXPECT_EQ(in.frames()[1].time_ns, 2);
    EXPECT_TRUE(std::ranges::equal(in.jpeg(1).bytes(), fake_jpeg(2)));
    EXPECT_EQ(in.recovered_frames(), 1);
    EXPECT_EQ(in.damaged_records(), 1);
    EXPECT_FALSE(in.verify_frame(1));
    EXPECT_TRUE(in.verify_frame(2));
  }
}

TEST_F(Archive, ChangedPictureFailsItsHash) {
  {
    ArchiveWriter out = writer();
    out.append(fake_jpeg(1), 1);
    out.append(fake_jpeg(2), 2);
  }
  auto bytes = bytes_of(mkv);
  bytes[static_cast<std::size_t>(reader().frames()[0].offset) + 7] ^= std::byte{1};
  testing::overwrite(mkv, bytes);
  const ArchiveReader in = reader();
  EXPECT_FALSE(in.verify_frame(0));
  EXPECT_TRUE(in.verify_frame(1));
  EXPECT_FALSE(in.intact_jpeg(0).has_value());
  EXPECT_TRUE(in.intact_jpeg(1).has_value());
  for (int again = 0; again < 2; ++again) {  // the second time it is remembered
    try {
      in.jpeg(0);
      FAIL() << "rot was read";
    } catch (const RottenFrame& error) {
      EXPECT_EQ(error.frame(), 0);
      EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
      EXPECT_THAT(error.what(), HasSubstr("frame 0 of camera"));
    }
    EXPECT_TRUE(std::ranges::equal(in.jpeg(1), fake_jpeg(2)));
  }
}

TEST_F(Archive, BytesOfAFrameOutliveItsReaderAndAreNotReusedMeanwhile) {
  {
    ArchiveWriter out = writer();
    for (unsigned i = 1; i <= 3; ++i) out.append(fake_jpeg(i, 5000 * i), i);
  }
  auto in = std::make_unique<ArchiveReader>(reader());
  const FrameBytes first = in->jpeg(0), second = in->jpeg(1);
  in->jpeg(2);
  in->jpeg(2);
  in.reset();
  EXPECT_TRUE(std::ranges::equal(first, fake_jpeg(1, 5000)));
  EXPECT_TRUE(std::ranges::equal(second, fake_jpeg(2, 10000)));
}

TEST_F(Archive, AFrameThatIsCutOffIsRefused) {
  {
    ArchiveWriter out = writer();
    for (int i = 0; i < 3; ++i) out.append(std::vector<std::byte>(9000, std::byte{7}), 1 + i);
  }
  const ArchiveReader in = reader();
  std::filesystem::resize_file(mkv, in.frames()[1].offset);
  EXPECT_EQ(in.jpeg(0).bytes().back(), std::byte{7});
  const Error error = error_of([&] { in.jpeg(2).bytes(); });
  EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
  EXPECT_THAT(error.what(), HasSubstr("frame 2 cannot be read"));
  EXPECT_THROW(in.verify_frame(1), Error);
}

TEST_F(Archive, FramesLostWithTheEndOfAClosedArchiveAreRotten) {
  {
    ArchiveWriter out = writer();
    out.append(fake_jpeg(1), 1);
    out.append_missing(FrameStatus::kTorn, 2);
    out.append(fake_jpeg(2), 2);
    out.append(fake_jpeg(3), 3);
    out.close();
  }
  const ArchiveReader whole = reader();
  std::filesystem::resize_file(mkv, whole.frames()[1].offset + 5);
  const ArchiveReader in = reader();
  EXPECT_FALSE(in.was_closed());
  EXPECT_TRUE(std::ranges::equal(in.records(), whole.records()));
  EXPECT_TRUE(std::ranges::equal(in.frames(), whole.frames()));
  EXPECT_FALSE(in.is_rotten(0));
  for (const int frame : {1, 2}) {
    EXPECT_TRUE(in.is_rotten(frame));
    EXPECT_FALSE(in.intact_jpeg(frame) || in.intact_stored(frame) || in.is_packed(frame));
    EXPECT_EQ(in.jpeg_xxh3(frame), whole.frames()[static_cast<std::size_t>(frame)].xxh3);
    EXPECT_THROW(in.stored(frame), RottenFrame);
    const Error error = error_of([&] { in.jpeg(frame); });
    EXPECT_THAT(error.what(), HasSubstr("the archive ends before it"));
    EXPECT_THAT(error.what(), HasSubstr("raystage verify"));
  }
}

// The hash of the JPEG in a packed frame is in the frame itself.
TEST_F(Archive, LostPackedFramesHaveNoHashOfTheirJpeg) {
  ArchiveWriter::Description packed = description();
  packed.codec = FrameCodec::kPacked;
  {
    ArchiveWriter out(mkv, journal, packed);
    for (unsigned i = 1; i <= 2; ++i) out.append(fake_jpeg(i), i);
    out.close();
  }
  std::filesystem::resize_file(mkv, reader().frames()[1].offset + 5);
  const ArchiveReader in = reader();
  ASSERT_EQ(in.frames().size(), 2U);
  EXPECT_NE(in.jpeg_xxh3(0), 0U);
  EXPECT_EQ(in.jpeg_xxh3(1), 0U);
  EXPECT_EQ(in.recorded_xxh3(1), 0U);
}

// A copy of no bytes, and others that end before the Segment's size.
TEST_F(Archive, NothingIsLeftOfAnArchive) {
  {
    ArchiveWriter out = writer();
    for (unsigned i = 1; i <= 3; ++i) out.append(fake_jpeg(i), i);
    out.close();
  }
  for (const std::uintmax_t size : {40, 10, 0}) {
    std::filesystem::resize_file(mkv, size);
    const ArchiveReader in = reader();
    ASSERT_EQ(in.frames().size(), 3U) << size;
    EXPECT_TRUE(in.is_rotten(0) && in.is_rotten(2));
  }
}

TEST_F(Archive, UnwrittenTailOfACrashIsTorn) {
  ArchiveWriter out = writer();
  for (unsigned i = 1; i <= 4; ++i) out.append(fake_jpeg(i), i);
  auto bytes = bytes_of(mkv);
  const auto third = static_cast<std::size_t>(reader().frames()[2].offset);
  std::fill(bytes.begin() + static_cast<std::ptrdiff_t>(third) + 20, bytes.end(), std::byte{0});
  const auto crashed = folder.path() / "crashed.mkv";
  testing::overwrite(crashed, bytes);
  const ArchiveReader in(crashed, journal);
  ASSERT_EQ(in.records().size(), 4u);
  EXPECT_EQ(in.frames().size(), 2u);
  EXPECT_EQ(in.records()[2].status, FrameStatus::kTorn);
  EXPECT_EQ(in.records()[3].time_ns, 4);
}

// A soft limit on file size simulates the full disk: the write stops in the middle of a frame.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(rlim_t bytes) : old_handler_(std::signal(SIGXFSZ, SIG_IGN)) {
    getrlimit(RLIMIT_FSIZE, &old_);
    rlimit limit = old_;
    limit.rlim_cur = bytes;
    setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~FileSizeLimit() {
    setrlimit(RLIMIT_FSIZE, &old_);
    std::signal(SIGXFSZ, old_handler_);
  }
  FileSizeLimit(const FileSizeLimit&) = delete;
  FileSizeLimit& operator=(const FileSizeLimit&) = delete;

 private:
  rlimit old_{};
  void (*old_handler_)(int);
};

TEST_F(Archive, FullDiskLeavesWholeFrames) {
  ArchiveWriter out = writer();
  out.append(fake_jpeg(1, 1000), 1);
  out.append(fake_jpeg(2, 1000), 2);
  const auto size = std::filesystem::file_size(mkv);
  const auto journal_size = std::filesystem::file_size(journal);
  {
    const FileSizeLimit limit(size + 500);
    const Error error = error_of([&] { out.append(fake_jpeg(3, 1000), 3); });
    EXPECT_EQ(error.exit_code(), ExitCode::kFailed);
    EXPECT_THAT(error.what(), HasSubstr("last whole frame, number 2"));
    EXPECT_THAT(error.where(), HasSubstr("r0c0.mkv"));
  }
  EXPECT_EQ(std::filesystem::file_size(mkv), size);
  EXPECT_EQ(std::filesystem::file_size(journal), journal_size);
  out.append(fake_jpeg(4, 1000), 4);  // there is space again
  {
    // There is no space for the Cues: close() fails, and the frames stay readable.
    const FileSizeLimit limit(std::filesystem::file_size(mkv));
    EXPECT_EQ(error_of([&] { out.close(); }).exit_code(), ExitCode::kFailed);
  }
  const ArchiveReader in = reader();
  EXPECT_FALSE(in.was_closed());
  ASSERT_EQ(in.frames().size(), 3u);
  EXPECT_EQ(in.frames()[2].time_ns, 4);
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(in.verify_frame(i));
}

TEST_F(Archive, FullDiskUnderTheJournalLeavesWholeRecords) {
  ArchiveWriter out = writer();
  for (unsigned i = 1; i <= 20; ++i) out.append_missing(FrameStatus::kDroppedBySource, i);
  const auto journal_size = std::filesystem::file_size(journal);
  {
    const FileSizeLimit limit(journal_size + 10);
    const Error error = error_of([&] { out.append_missing(FrameStatus::kTorn, 1000); });
    EXPECT_THAT(error.where(), HasSubstr("r0c0.journal"));
  }
  EXPECT_EQ(std::filesystem::file_size(journal), journal_size);
  EXPECT_EQ(reader().records().size(), 20u);
}

TEST_F(Archive, NearestFrameIsTheNearest) {
  rc::check([&] {
    const auto gaps =
        *rc::gen::nonEmpty(rc::gen::container<std::vector<int>>(rc::gen::inRange(1, 100)));
    const testing::TestFolder place;
    ArchiveWriter out(place.path() / "a.mkv", place.path() / "a.journal", description());
    Nanoseconds time = 0;
    for (const int gap : gaps) out.append(fake_jpeg(1, 1), time += gap);
    out.close();
    const ArchiveReader in(place.path() / "a.mkv", place.path() / "a.journal");
    for (int i = 0; i < 20; ++i) {
      const auto asked = static_cast<Nanoseconds>(*rc::gen::inRange<int>(-50, int(time) + 50));
      const auto distance = [&](const FrameRecord& frame) {
        return std::abs(frame.time_ns - asked);
      };
      const auto best = std::ranges::min_element(in.frames(), {}, distance);  // first at a tie
      RC_ASSERT(in.nearest_frame(asked) == static_cast<int>(best - in.frames().begin()));
    }
    RC_ASSERT(in.nearest_frame(std::numeric_limits<Nanoseconds>::min()) == 0);
    RC_ASSERT(in.nearest_frame(std::numeric_limits<Nanoseconds>::max()) ==
              static_cast<int>(gaps.size()) - 1);
  });
}

std::string output_of(const std::string& command) {
  std::string text;
  std::FILE* pipe = popen(command.c_str(), "r");
  if (pipe == nullptr) return text;
  std::array<char, 4096> buffer{};
  std::size_t count = 0;
  while ((count = std::fread(buffer.data(), 1, buffer.size(), pipe)) > 0) {
    text.append(buffer.data(), count);
  }
  pclose(pipe);
  return text;
}

/// Returns the number of pages of a span that are in memory.
std::size_t pages_in_memory(std::span<const std::byte> bytes) {
  const auto page = static_cast<std::uintptr_t>(sysconf(_SC_PAGESIZE));
  const auto first = reinterpret_cast<std::uintptr_t>(bytes.data()) / page * page;
  const auto last = reinterpret_cast<std::uintptr_t>(bytes.data() + bytes.size());
  std::vector<unsigned char> resident((last - first + page - 1) / page);
  EXPECT_EQ(mincore(reinterpret_cast<void*>(first), last - first, resident.data()), 0);
  return static_cast<std::size_t>(
      std::ranges::count_if(resident, [](unsigned char flags) { return (flags & 1) != 0; }));
}

TEST_F(Archive, ReadsAheadWhatItIsAskedTo) {
  constexpr std::size_t kSize = 4 << 20, kPart = 1 << 20;
  write_file_atomically(mkv, std::string(kSize, 'x'));
  const int descriptor = open(mkv.c_str(), O_RDONLY);
  fsync(descriptor);
  posix_fadvise(descriptor, 0, 0, POSIX_FADV_DONTNEED);
  close(descriptor);
  const InputFile file(mkv);
  const MappedFile mapped(file, mkv);
  const auto part = mapped.bytes().subspan(kSize - kPart);
  if (pages_in_memory(part) > 0) {
    GTEST_SKIP() << "this file system does not let go of what it has read";
  }
  file.read_ahead(kSize - kPart, kPart);
  const std::size_t pages = kPart / static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
  for (int i = 0; i < 1000 && pages_in_memory(part) < pages; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  EXPECT_EQ(pages_in_memory(part), pages);
}

TEST_F(Archive, FfprobeReadsTheSameTimesAndSizes) {
  if (std::system("ffprobe -version >/dev/null 2>&1") != 0) GTEST_SKIP() << "ffprobe is not here";
  std::vector<std::pair<Nanoseconds, std::size_t>> expected;
  std::mt19937_64 random(7);
  Nanoseconds time = 0;
  ArchiveWriter out = writer();
  const auto check = [&](const std::filesystem::path& file) {
    const std::string text =
        output_of("ffprobe -v quiet -show_packets -show_entries packet=pts,size,flags:" +
                  std::string("stream=time_base,width,height,codec_name -of csv=p=0 '") +
                  file.string() + "'");
    std::istringstream lines(text);
    std::string line;
    std::vector<std::pair<Nanoseconds, std::size_t>> found;
    while (std::getline(lines, line)) {
      if (line.starts_with("mjpeg")) {
        EXPECT_EQ(line, "mjpeg,640,480,1/1000000000");
        continue;
      }
      long long pts = 0, size = 0;
      ASSERT_EQ(std::sscanf(line.c_str(), "%lld,%lld,K", &pts, &size), 2) << line;
      EXPECT_THAT(line, HasSubstr(",K"));
      found.emplace_back(pts, size);
    }
    EXPECT_EQ(found, expected) << text;
  };
  for (unsigned i = 0; i < 40; ++i) {
    time += i == 20 ? 8'000'000'000'000'000  // 92 days
                    : 66'000'000 + static_cast<Nanoseconds>(random() % 1'333'333);
    const auto jpeg = fake_jpeg(i, 200 + i);
    out.append(jpeg, time);
    expected.emplace_back(time, jpeg.size());
  }
  check(mkv);  // still open
  out.close();
  check(mkv);
  const std::string duration = output_of(
      "ffprobe -v quiet -show_entries format=duration:format_tags=creation_time -of csv=p=0 '" +
      mkv.string() + "'");
  EXPECT_THAT(duration, HasSubstr("2026-01-01T00:00:00.123456Z"));
  EXPECT_THAT(duration, HasSubstr("800000"));  // seconds, 92 days
}

TEST_F(Archive, FfprobeShowsTheRateOfRegularFrames) {
  if (std::system("ffprobe -version >/dev/null 2>&1") != 0) GTEST_SKIP() << "ffprobe is not here";
  const auto rate_of = [&](const std::vector<Nanoseconds>& times) {
    std::filesystem::remove(mkv);
    std::filesystem::remove(journal);
    ArchiveWriter out = writer();
    for (std::size_t i = 0; i < times.size(); ++i) {
      out.append(fake_jpeg(static_cast<unsigned>(i), 300), times[i]);
    }
    out.close();
    return output_of("ffprobe -v quiet -show_entries stream=avg_frame_rate -of csv=p=0 '" +
                     mkv.string() + "'");
  };
  std::vector<Nanoseconds> times;
  for (int i = 0; i < 30; ++i) times.push_back(40'000'000LL * i + i % 3 * 100'000);
  times.erase(times.begin() + 10, times.begin() + 15);  // lost frames do not count
  int numerator = 0, denominator = 1;
  const std::string text = rate_of(times);
  ASSERT_EQ(std::sscanf(text.c_str(), "%d/%d", &numerator, &denominator), 2) << text;
  EXPECT_NEAR(static_cast<double>(numerator) / denominator, 25, 0.1);
  std::vector<Nanoseconds> irregular;
  for (int i = 0; i < 30; ++i) irregular.push_back(7'000'000LL * i * i);
  EXPECT_EQ(rate_of(irregular), "0/0\n");
}

}  // namespace
}  // namespace raystage::store
