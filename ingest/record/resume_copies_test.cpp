// SPDX-License-Identifier: Apache-2.0
// Tests that resuming one of two copies of a take takes the records that a crash prevented from the
// other, and never costs a frame.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>

#include "base/error.h"
#include "ingest/record/recording_take.h"
#include "ingest/sources/frame_source.h"
#include "store/jpeg/encode.h"
#include "store/jpegxl/frame_packer.h"
#include "testing/store/take_test_data.h"
#include "testing/test_folder.h"

namespace raystage::ingest {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

class ResumeCopies : public ::testing::Test {
 protected:
  ResumeCopies() {
    document.epoch_utc = host_utc_now();
    record(take, 12);
  }

  /// Records frames of 50 bytes, with a missing one after each third if `with_missing`.
  void record(const fs::path& copy, unsigned frames, bool with_missing = false) const {
    fs::remove_all(copy);
    RecordingTake out = RecordingTake::create(copy, document, testing::rig_document(1), "node");
    for (unsigned i = 0; i < frames; ++i) {
      out.archive(0).append(testing::fake_jpeg(i, 50), time(i), {time(i) + 5, i});
      if (with_missing && i % 3 == 2) {
        out.archive(0).append_missing(store::FrameStatus::kDroppedRamFull, time(i), {time(i), i});
      }
    }
    out.write_session({}, true);
    // Not closed, as after a crash.
    std::vector<std::string> problems;
    const auto archive = testing::bytes_of(copy / "archive/c0.mkv");
    out.close(problems);
    testing::overwrite(copy / "archive/c0.mkv", archive);
  }
  static Nanoseconds time(unsigned i) { return 1000 * (Nanoseconds{i} + 1); }
  /// Removes records from the end of a journal.
  static void forget(const fs::path& copy, std::size_t records) {
    constexpr std::size_t kRecordBytes = 48;
    const fs::path journal = copy / "archive/c0.journal";
    fs::resize_file(journal, fs::file_size(journal) - records * kRecordBytes);
  }
  static std::map<std::string, std::vector<std::byte>> archives_of(const fs::path& copy) {
    std::map<std::string, std::vector<std::byte>> files;
    for (const auto& entry : fs::directory_iterator(copy / "archive")) {
      files.emplace(entry.path().filename().string(), testing::bytes_of(entry.path()));
    }
    return files;
  }
  static RecordingTake resume(const fs::path& copy, const fs::path& other) {
    return RecordingTake::resume(copy, {"c0"}, "node", other);
  }
  /// Resumes both as `raystage record` does.
  void resume_both() const {
    RecordingTake first = resume(take, mirror);
    RecordingTake second = resume(mirror, take);
    second.complete_from(first);
    first.complete_from(second);
    std::vector<std::string> problems;
    first.close(problems);
    second.close(problems);
    EXPECT_TRUE(problems.empty());
  }
  /// Expects that both refuse to resume and change no archive.
  void expect_refused(const std::string& text) const {
    const auto in_take = archives_of(take), in_mirror = archives_of(mirror);
    for (const auto& [copy, other] : {std::pair(take, mirror), std::pair(mirror, take)}) {
      try {
        resume(copy, other);
        ADD_FAILURE() << copy << " was resumed";
      } catch (const Error& error) {
        EXPECT_THAT(error.what(), HasSubstr(text));
        EXPECT_THAT(error.what(), HasSubstr("raystage repair"));
      }
      EXPECT_EQ(archives_of(take), in_take);
      EXPECT_EQ(archives_of(mirror), in_mirror);
    }
  }
  static std::size_t frames_in(const fs::path& copy) {
    return store::ArchiveReader(copy / "archive/c0.mkv", copy / "archive/c0.journal")
        .frames()
        .size();
  }

  testing::TestFolder folder;
  fs::path take = folder.path() / "take", mirror = folder.path() / "mirror";
  schemas::TakeDocument document = testing::take_document(1);
};

TEST_F(ResumeCopies, AClosedCopyThatHasLostItsEndIsRefused) {
  record(take, 12, false);
  record(mirror, 12, false);
  resume_both();
  const fs::path cut = mirror / "archive/c0.mkv";
  fs::resize_file(cut, fs::file_size(cut) / 2);
  expect_refused("the records of camera \"c0\"");
}

TEST_F(ResumeCopies, RecordsThatACrashPreventedAreThoseOfTheOtherCopy) {
  for (const bool with_missing : {false, true}) {
    for (const unsigned ahead : {0U, 2U}) {
      SCOPED_TRACE(ahead);
      record(take, 12, with_missing);
      record(mirror, 12 + ahead, with_missing);
      forget(take, 3);
      resume_both();
      EXPECT_EQ(frames_in(take), 12U + ahead);
      EXPECT_EQ(archives_of(take), archives_of(mirror));
    }
  }
}

// A crash left more frames without a record here than the mirror is ahead by.
TEST_F(ResumeCopies, FramesThatTheOtherCopyLacksAreKept) {
  for (const bool with_missing : {false, true}) {
    SCOPED_TRACE(with_missing);
    record(take, 12, with_missing);
    record(mirror, 9, with_missing);
    forget(take, 6);
    resume_both();
    EXPECT_EQ(frames_in(take), 12U);
    EXPECT_EQ(frames_in(mirror), 12U);
  }
}

TEST_F(ResumeCopies, AMissingOrDamagedJournalIsRefused) {
  for (const unsigned in_mirror : {1U, 5U, 12U, 20U}) {
    SCOPED_TRACE(in_mirror);
    record(take, 12);
    record(mirror, in_mirror);
    const fs::path journal = take / "archive/c0.journal";
    auto bytes = testing::bytes_of(journal);
    fs::remove(journal);
    expect_refused("the journal is missing");
    bytes[2] ^= std::byte{0xff};
    testing::overwrite(journal, bytes);
    expect_refused("its header is damaged");
  }
}

TEST_F(ResumeCopies, TheMirrorOfAnotherTakeIsRefused) {
  forget(take, 4);
  document.epoch_utc += kNanosecondsPerSecond;
  record(mirror, 20);
  expect_refused("name, epoch or cameras");
  document.epoch_utc -= kNanosecondsPerSecond;
  document.name = "another";
  record(mirror, 20);
  expect_refused("name, epoch or cameras");
}

/// Writes a take with a camera that has two packed frames and one that stayed JPEG.
void write_packed_take(const fs::path& folder, const schemas::TakeDocument& document) {
  const store::FramePacker packer;
  store::TakeWriter writer(folder, document, testing::rig_document(1), store::FrameCodec::kPacked);
  for (int i = 0; i < 3; ++i) {
    store::RgbImage image(320, 240);
    for (std::size_t at = 0; at < image.values.size(); ++at) {
      image.values[at] = static_cast<std::uint8_t>(at / 960 + at / 3 % 320 + 40U * i);
    }
    const std::vector<std::byte> jpeg = store::encode_jpeg(image, {});
    const auto packed = packer.pack(jpeg, {320, 240}, 7, "c0");
    ASSERT_EQ(packed.refusal, "");
    writer.archive(0).append(i == 1 ? jpeg : packed.bytes, 1000 * (i + 1), {1000 * (i + 1), 0});
  }
  writer.commit();
}

TEST_F(ResumeCopies, ANewMirrorOfAPackedTakeHasTheSameForm) {
  fs::remove_all(take);
  write_packed_take(take, document);
  const std::vector<std::byte> jpeg = testing::fake_jpeg(1, 500);
  {
    RecordingTake first = resume(take, {});
    RecordingTake second = RecordingTake::create_copy(mirror, first);
    EXPECT_EQ(second.complete_from(first), 3U);
    EXPECT_EQ(first.complete_from(second), 0U);
    for (RecordingTake* const copy : {&first, &second}) {
      copy->archive(0).append(jpeg, 9000, {9000, 1});
      copy->write_session({}, true);
      std::vector<std::string> problems;
      copy->close(problems);
      EXPECT_TRUE(problems.empty());
    }
  }
  EXPECT_EQ(archives_of(take), archives_of(mirror));
  const store::ArchiveReader copied(mirror / "archive/c0.mkv", mirror / "archive/c0.journal");
  EXPECT_TRUE(copied.is_packed(0));
  EXPECT_FALSE(copied.is_packed(1));
  EXPECT_NO_THROW(store::parse_jpeg_layout(copied.jpeg(0), "c0"));
  // Records that a crash prevented have the XXH3 of the stored bytes.
  forget(take, 2);
  resume_both();
  EXPECT_EQ(archives_of(take), archives_of(mirror));
  EXPECT_EQ(frames_in(take), 4U);
}

// The documents agree, but the frames do not.
TEST_F(ResumeCopies, AMirrorWithOtherFramesIsRefused) {
  forget(take, 4);
  fs::remove_all(mirror);
  {
    RecordingTake out = RecordingTake::create(mirror, document, testing::rig_document(1), "node");
    for (unsigned i = 0; i < 20; ++i) {
      const unsigned picture = i < 9 ? i : 100 + i;
      out.archive(0).append(testing::fake_jpeg(picture, 50), time(i), {time(i) + 5, i});
    }
    out.write_session({}, true);
  }
  expect_refused("the records of camera");
}

}  // namespace
}  // namespace raystage::ingest
