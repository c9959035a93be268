// SPDX-License-Identifier: Apache-2.0
#include "store/fixity/repair_from_copy.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <map>
#include <random>

#include "base/error.h"
#include "base/posix_file.h"
#include "schemas/imported_depths_document.h"
#include "store/fixity/verify.h"
#include "store/matroska.h"
#include "store/timeline.h"
#include "testing/store/fixity_test_data.h"
#include "testing/store/take_test_data.h"

namespace raystage::store {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

using Bytes = std::vector<std::byte>;
/// The files of a folder by relative path, without hidden and set-aside ones.
using Contents = std::map<std::string, Bytes>;

constexpr int kCopiedCameras = 3, kCopiedFrames = 12;

void write_bytes_to(const fs::path& file, const Bytes& bytes) {
  fs::create_directories(file.parent_path());
  std::ofstream out(file, std::ios::binary | std::ios::trunc);
  out.write(reinterpret_cast<const char*>(bytes.data()),
            static_cast<std::streamsize>(bytes.size()));
}

Contents contents_of(const fs::path& folder) {
  Contents contents;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (!entry.is_regular_file() || name.find(".damaged") != std::string::npos) continue;
    contents.emplace(entry.path().lexically_relative(folder).string(),
                     testing::bytes_of(entry.path()));
  }
  return contents;
}

class RepairFromCopy : public ::testing::Test {
 protected:
  RepairFromCopy() {
    TakeWriter writer(take, testing::take_document(kCopiedCameras),
                      testing::rig_document(kCopiedCameras));
    for (int camera = 0; camera < kCopiedCameras; ++camera) {
      for (unsigned i = 0; i < kCopiedFrames; ++i) {
        const auto jpeg = testing::fake_jpeg(100U * static_cast<unsigned>(camera) + i, 40 + i);
        writer.archive(camera).append(jpeg, testing::frame_time(i), testing::frame_origin(i));
        if (i % 3 == 2) {
          writer.archive(camera).append_missing(FrameStatus::kDroppedLate, testing::frame_time(i),
                                                {1, 100 + i});
        }
      }
    }
    fs::create_directory(writer.working_folder() / "recording");
    write_bytes_to(writer.working_folder() / "recording" / "one.json", account(true));
    write_bytes_to(writer.working_folder() / "notes.txt", Bytes(20, std::byte{'x'}));
    writer.commit();
    write_timeline(read_timeline(Take(take)), Take(take));
    whole = contents_of(take);
    make_copy();
  }

  static Bytes account(bool finished) {
    std::string text = R"({"schema": "raystage/recording/1", "node": "one", "sessions": [{
      "program": "test", "started_utc": "2026-01-01T00:00:00Z", "memory_bytes": 1,
      "buffered_in_memory": false, "clock": {"source": "unknown"}, "cameras": [])";
    text += finished ? R"(, "stopped_utc": "2026-01-01T00:00:01Z"}]})" : "}]}";
    Bytes bytes(text.size());
    std::ranges::transform(text, bytes.begin(), [](char c) { return static_cast<std::byte>(c); });
    return bytes;
  }
  void make_copy() const {
    fs::remove_all(copy);
    fs::copy(take, copy, fs::copy_options::recursive);
  }
  void restore_take() const {
    fs::remove_all(take);
    fs::copy(copy, take, fs::copy_options::recursive);
  }
  RepairReport repair(bool dry_run = false) const {
    return repair_take(take, {.dry_run = dry_run, .copy = copy});
  }
  std::string refusal() const {
    try {
      repair();
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
      return error.what();
    }
    return "nothing was thrown";
  }
  /// Damages random files of a take: bits, cut ends, zeroed parts, missing files.
  static void damage(const fs::path& folder, std::mt19937_64& random) {
    std::vector<std::string> files;
    for (const auto& [name, bytes] : contents_of(folder)) files.push_back(name);
    for (auto faults = 1 + random() % 4; faults > 0; --faults) {
      const std::string& file = files[random() % files.size()];
      const fs::path path = folder / file;
      if (!fs::exists(path)) continue;
      Bytes bytes = testing::bytes_of(path);
      const bool is_archive = file.starts_with("archive/");
      const auto kind = random() % 4;
      if (kind == 0 || bytes.empty() || (!is_archive && kind > 1)) {
        fs::remove(path);
        continue;
      }
      if (kind == 1) {
        // A document without its last bytes cannot be parsed.
        bytes.resize(is_archive ? random() % bytes.size() : bytes.size() - 4);
        if (file == "notes.txt") continue;
      } else if (kind == 2) {
        testing::flip(bytes, random() % (8 * bytes.size()));
      } else {
        const std::size_t at = random() % bytes.size();
        std::fill_n(bytes.begin() + static_cast<std::ptrdiff_t>(at),
                    std::min<std::size_t>(bytes.size() - at, 1 + random() % 200), std::byte{0});
      }
      write_bytes_to(path, bytes);
    }
  }

  testing::TestFolder folder;
  fs::path take = folder.path() / "take", copy = folder.path() / "copy";
  Contents whole;
};

TEST_F(RepairFromCopy, AnyDamageOfOneCopyIsRepairedToTheSameBytes) {
  std::mt19937_64 random(20051);
  for (int round = 0; round < 120; ++round) {
    SCOPED_TRACE(round);
    damage(take, random);
    // A take of which nothing is left is refused, because any folder looks like that.
    if (!fs::exists(take / "take.json") && !fs::exists(take / "rig.json")) {
      write_bytes_to(take / "rig.json", whole["rig.json"]);
    }
    const Contents damaged = contents_of(take);
    const RepairReport planned = repair(true);
    EXPECT_EQ(contents_of(take), damaged) << "a dry run changed something";
    EXPECT_FALSE(planned.failed());
    const RepairReport report = repair();
    EXPECT_FALSE(report.failed());
    EXPECT_FALSE(report.has_losses());
    for (std::size_t i = 0; i < report.cameras.size(); ++i) {
      EXPECT_EQ(report.cameras[i].frames_from_copy, planned.cameras[i].frames_from_copy);
    }
    ASSERT_EQ(contents_of(take), whole);
    ASSERT_EQ(contents_of(copy), whole) << "the copy was changed";
  }
}

// Neither copy is whole, but no frame is damaged in both.
TEST_F(RepairFromCopy, TwoDamagedCopiesCompleteEachOther) {
  const auto flip_frame = [&](const fs::path& where, int camera, std::size_t frame) {
    const std::string name = "archive/c" + std::to_string(camera) + ".mkv";
    const auto offset = Take(where).archive(camera).frames()[frame].offset;
    Bytes bytes = testing::bytes_of(where / name);
    bytes[offset + 3] ^= std::byte{4};
    write_bytes_to(where / name, bytes);
  };
  for (int camera = 0; camera < kCopiedCameras; ++camera) {
    flip_frame(take, camera, 2);
    flip_frame(take, camera, 3);
    flip_frame(copy, camera, 7);
  }
  const RepairReport report = repair();
  EXPECT_FALSE(report.failed() || report.has_losses());
  for (const auto& camera : report.cameras) EXPECT_EQ(camera.frames_from_copy, 2);
  EXPECT_EQ(contents_of(take), whole);
  const RepairReport back = repair_take(copy, {.copy = take});
  EXPECT_FALSE(back.failed() || back.has_losses());
  EXPECT_EQ(contents_of(copy), whole);
}

TEST_F(RepairFromCopy, RandomDamageOfBothNeverMakesOneWorse) {
  std::mt19937_64 random(7);
  for (int round = 0; round < 100; ++round) {
    SCOPED_TRACE(round);
    const auto hurt = [&](const fs::path& where) {
      for (int faults = 0; faults < 2; ++faults) {
        const std::string name = "archive/c" + std::to_string(random() % kCopiedCameras) +
                                 (random() % 2 == 0 ? ".mkv" : ".journal");
        Bytes bytes = testing::bytes_of(where / name);
        testing::flip(bytes, random() % (8 * bytes.size()));
        write_bytes_to(where / name, bytes);
      }
    };
    hurt(take);
    hurt(copy);
    const auto intact_frames = [&](const fs::path& where) {
      std::map<std::pair<int, Nanoseconds>, std::uint64_t> frames;
      const Take opened(where);
      for (int camera = 0; camera < kCopiedCameras; ++camera) {
        ArchivePair pair = describe_pair(opened, camera);
        const Bytes archive = testing::bytes_of(where / pair.archive_name);
        const Bytes journal = testing::bytes_of(where / pair.journal_name);
        pair.archive = archive;
        pair.journal = journal;
        const SalvageResult saved = salvage_archive(pair);
        for (const FrameRecord& record : saved.records) {
          if (record.status != FrameStatus::kStored) continue;
          if (saved.unverified_times.contains(record.time_ns)) continue;
          frames[{camera, record.time_ns}] = record.xxh3;
        }
      }
      return frames;
    };
    auto expected = intact_frames(take);
    expected.merge(intact_frames(copy));
    const RepairReport report = repair();
    EXPECT_FALSE(report.failed());
    const auto now = intact_frames(take);
    for (const auto& [key, hash] : expected) {
      const auto found = now.find(key);
      ASSERT_NE(found, now.end()) << key.first << " " << key.second;
      EXPECT_EQ(found->second, hash);
    }
    fs::remove_all(take);
    fs::remove_all(copy);
    for (const auto& [name, bytes] : whole) {
      write_bytes_to(take / name, bytes);
      write_bytes_to(copy / name, bytes);
    }
  }
}

// A copy with the journals shows which unverified frames are the recorded ones.
TEST_F(RepairFromCopy, UnverifiedFramesAreVerifiedOrReplaced) {
  const fs::path journal = take / "archive" / "c1.journal", archive = take / "archive" / "c1.mkv";
  const auto rotten = static_cast<std::size_t>(Take(take).archive(1).frames()[4].offset) + 3;
  fs::remove(journal);
  Bytes bytes = testing::bytes_of(archive);
  bytes[rotten] ^= std::byte{1};  // nothing notices this without the journal
  write_bytes_to(archive, bytes);
  EXPECT_TRUE(repair_take(take, {}).has_losses());
  const auto unverified = [&] {
    const Take repaired(take);
    return std::ranges::count_if(repaired.archive(1).frames(), &FrameRecord::is_unverified);
  };
  EXPECT_EQ(unverified(), kCopiedFrames);
  EXPECT_TRUE(verify_take(take, {}).is_intact());

  const RepairReport report = repair();
  EXPECT_FALSE(report.failed());
  EXPECT_EQ(unverified(), 0);
  EXPECT_EQ(testing::bytes_of(archive), whole.at("archive/c1.mkv"));
  EXPECT_EQ(testing::bytes_of(journal), whole.at("archive/c1.journal"));
}

// Both copies lost their first journals. What one of them has is still better than nothing.
TEST_F(RepairFromCopy, UnverifiedFramesOfTheCopyAreTakenButStayUnverified) {
  const fs::path archive = take / "archive" / "c1.mkv", journal = take / "archive" / "c1.journal";
  fs::remove(journal);
  repair_take(take, {});
  const Bytes repaired = testing::bytes_of(archive), records = testing::bytes_of(journal);
  make_copy();
  EXPECT_EQ(repair().cameras[1].was_intact, true);
  EXPECT_EQ(testing::bytes_of(archive), repaired);

  const auto rotten = static_cast<std::size_t>(Take(take).archive(1).frames()[4].offset) + 3;
  for (const int fault : {0, 1, 2, 3}) {
    Bytes bytes = repaired;
    bytes[rotten] ^= std::byte{1};
    write_bytes_to(archive, bytes);  // since the repair, so that its hash shows it
    if (fault == 1) fs::remove(archive);
    if (fault == 2) fs::remove(journal);
    if (fault == 3) fs::remove_all(take / "archive");
    const RepairReport report = repair();
    EXPECT_FALSE(report.failed()) << fault;
    EXPECT_EQ(testing::bytes_of(archive), repaired) << fault;
    EXPECT_EQ(testing::bytes_of(journal), records) << fault;
    EXPECT_TRUE(verify_take(take, {}).is_intact());
  }
}

// The record of the recording shows that the copy's frame, which has a later one, is another.
TEST_F(RepairFromCopy, AnUnverifiedFrameThatIsNotTheRecordedOneIsNotTaken) {
  const auto offset = static_cast<std::size_t>(Take(take).archive(1).frames()[4].offset) + 3;
  Bytes bytes = testing::bytes_of(copy / "archive" / "c1.mkv");
  bytes[offset] ^= std::byte{1};
  write_bytes_to(copy / "archive" / "c1.mkv", bytes);
  fs::remove(copy / "archive" / "c1.journal");
  repair_take(copy, {});
  bytes = testing::bytes_of(take / "archive" / "c1.mkv");
  bytes[offset + 1] ^= std::byte{1};
  write_bytes_to(take / "archive" / "c1.mkv", bytes);
  const RepairReport report = repair();
  EXPECT_TRUE(report.has_losses());
  const Take repaired(take);
  EXPECT_EQ(repaired.archive(1).frames().size(), kCopiedFrames - 1U);
  EXPECT_EQ(std::ranges::count_if(repaired.archive(1).frames(), &FrameRecord::is_unverified), 0);
}

// The copy's record shows that the own frame is another, but its bytes are rotten, too.
TEST_F(RepairFromCopy, AnUnverifiedFrameIsKeptWhereTheCopyHasNoBetterOne) {
  const auto offset = static_cast<std::size_t>(Take(take).archive(1).frames()[4].offset) + 3;
  const auto flip_in = [&](const fs::path& side, std::size_t byte) {
    Bytes bytes = testing::bytes_of(side / "archive" / "c1.mkv");
    bytes[byte] ^= std::byte{1};
    write_bytes_to(side / "archive" / "c1.mkv", bytes);
  };
  flip_in(take, offset);
  fs::remove(take / "archive" / "c1.journal");
  repair_take(take, {});
  flip_in(copy, offset + 1);
  EXPECT_FALSE(repair().failed());
  const Take repaired(take);
  ASSERT_EQ(repaired.archive(1).frames().size(), kCopiedFrames);
  for (int i = 0; i < kCopiedFrames; ++i) {
    EXPECT_EQ(repaired.archive(1).frames()[i].is_unverified, i == 4) << i;
  }
}

// As a mirror that stopped: every file is valid, but frames are missing at the end.
TEST_F(RepairFromCopy, AnIntactCopyThatEndsEarlyIsCompleted) {
  {
    fs::remove_all(take / "archive");
    fs::create_directory(take / "archive");
    const Take other(copy);
    for (int camera = 0; camera < kCopiedCameras; ++camera) {
      const std::string name = "archive/c" + std::to_string(camera);
      ArchiveWriter writer(take / (name + ".mkv"), take / (name + ".journal"),
                           describe_pair(other, camera).description);
      for (int i = 0; i < 5; ++i) {
        const FrameRecord& record = other.archive(camera).frames()[i];
        const auto jpeg = other.archive(camera).jpeg(i);
        writer.append(jpeg.bytes(), record.time_ns, {record.arrival_ns, record.sequence});
        if (i % 3 == 2) {
          writer.append_missing(FrameStatus::kDroppedLate, record.time_ns,
                                {1, 100U + static_cast<unsigned>(i)});
        }
      }
      writer.close();
    }
  }
  write_bytes_to(take / "recording" / "one.json", account(false));
  fs::remove(take / "timeline.zst");
  ASSERT_TRUE(verify_take(take, {}).is_intact());
  const RepairReport report = repair();
  EXPECT_FALSE(report.failed() || report.has_losses());
  for (const auto& camera : report.cameras) {
    EXPECT_EQ(camera.frames_from_copy, kCopiedFrames - 5);
    EXPECT_THAT(camera.kept, IsEmpty());
  }
  EXPECT_EQ(contents_of(take), whole);
}

// The take has more frames than the copy, but its end and the records of it are damaged: the
// original may hold what only an expert can save.
TEST_F(RepairFromCopy, ADamagedEndThatTheCopyLacksIsLostAndKept) {
  const std::string name = "archive/c0";
  {
    fs::remove(copy / (name + ".mkv"));
    fs::remove(copy / (name + ".journal"));
    const Take other(take);
    ArchiveWriter writer(copy / (name + ".mkv"), copy / (name + ".journal"),
                         describe_pair(other, 0).description);
    for (int i = 0; i < 2; ++i) {
      const FrameRecord& record = other.archive(0).frames()[i];
      writer.append(other.archive(0).jpeg(i).bytes(), record.time_ns,
                    {record.arrival_ns, record.sequence});
    }
    writer.close();
  }
  // The third frame and all after it.
  const auto begin = static_cast<std::ptrdiff_t>(Take(take).archive(0).frames()[2].offset -
                                                 matroska::kClusterHeaderBytes);
  Bytes archive = testing::bytes_of(take / (name + ".mkv"));
  std::fill(archive.begin() + begin, archive.end(), std::byte{0x55});
  write_bytes_to(take / (name + ".mkv"), archive);
  Bytes journal = testing::bytes_of(take / (name + ".journal"));
  constexpr std::size_t kHeaderAndTwoRecords = 64 + 2 * 48;
  ASSERT_GT(journal.size(), kHeaderAndTwoRecords);
  std::fill(journal.begin() + kHeaderAndTwoRecords, journal.end(), std::byte{0x55});
  write_bytes_to(take / (name + ".journal"), journal);
  const RepairReport report = repair();
  EXPECT_FALSE(report.failed());
  EXPECT_TRUE(report.has_losses());
  EXPECT_EQ(report.cameras[0].salvage.frames, 2);
  ASSERT_EQ(report.cameras[0].kept.size(), 2U);
  EXPECT_EQ(testing::bytes_of(take / "archive" / report.cameras[0].kept[0]), archive);
  EXPECT_EQ(testing::bytes_of(take / "archive" / report.cameras[0].kept[1]), journal);
}

TEST_F(RepairFromCopy, AnInvalidDocumentIsKeptBesideTheRestoredOne) {
  for (const char* file : {"take.json", "rig.json", "recording/one.json", "timeline.zst"}) {
    SCOPED_TRACE(file);
    const Bytes invalid(30, std::byte{'{'});
    write_bytes_to(take / file, invalid);
    EXPECT_FALSE(repair().failed());
    EXPECT_EQ(testing::bytes_of(take / (std::string(file) + ".damaged")), invalid);
    EXPECT_EQ(contents_of(take), whole);
  }
}

TEST_F(RepairFromCopy, ADocumentThatCannotBeOpenedIsNotReplaced) {
  if (geteuid() == 0) GTEST_SKIP() << "root may open every file";
  const fs::path account_file = take / "recording" / "one.json";
  fs::permissions(account_file, fs::perms::none);
  const RepairReport report = repair();
  EXPECT_TRUE(report.failed());
  ASSERT_EQ(report.files.size(), 1U);
  EXPECT_THAT(report.files[0].error, HasSubstr("cannot be read"));
  fs::permissions(account_file, fs::perms::owner_read | fs::perms::owner_write);
  fs::permissions(take / "take.json", fs::perms::none);
  EXPECT_THAT(refusal(), HasSubstr("take.json"));
  fs::permissions(take / "take.json", fs::perms::owner_read | fs::perms::owner_write);
  EXPECT_EQ(contents_of(take), whole);
}

TEST_F(RepairFromCopy, ATakeThatIsRecordedIsNotChanged) {
  fs::resize_file(take / "archive" / "c0.mkv", 700);
  const Bytes before = testing::bytes_of(take / "archive" / "c0.mkv");
  const OutputFile recorder(take / "archive" / "c0.mkv", OutputFile::Open::kExisting);
  const RepairReport report = repair();
  EXPECT_THAT(report.cameras[0].error, HasSubstr("another program is writing"));
  EXPECT_EQ(testing::bytes_of(take / "archive" / "c0.mkv"), before);
}

// Larger than the parts in which files are copied.
TEST_F(RepairFromCopy, ALargeFileIsRestored) {
  Bytes large(3'500'000);
  for (std::size_t i = 0; i < large.size(); ++i) large[i] = static_cast<std::byte>(i * 7 / 5);
  write_bytes_to(copy / "matte.bin", large);
  EXPECT_FALSE(repair().failed());
  EXPECT_EQ(testing::bytes_of(take / "matte.bin"), large);
}

TEST_F(RepairFromCopy, AHoleStaysAHoleAndMustFitTheDisk) {
  write_bytes_to(copy / "sparse.bin", Bytes(10, std::byte{1}));
  fs::resize_file(copy / "sparse.bin", 50'000'000);
  EXPECT_FALSE(repair().failed());
  EXPECT_EQ(testing::bytes_of(take / "sparse.bin"), testing::bytes_of(copy / "sparse.bin"));
  struct stat status {};
  ASSERT_EQ(stat((take / "sparse.bin").c_str(), &status), 0);
  EXPECT_LT(status.st_blocks * 512, 5'000'000);
  const auto most = std::uintmax_t{1} << 42;
  std::error_code unsupported;
  write_bytes_to(copy / "huge.bin", Bytes{});
  fs::resize_file(copy / "huge.bin", most, unsupported);
  if (unsupported || fs::space(take).available >= most) GTEST_SKIP() << "the disk is too large";
  const RepairReport report = repair();
  ASSERT_EQ(report.files.size(), 1U);
  EXPECT_THAT(report.files[0].error, HasSubstr("MB free"));
  EXPECT_FALSE(fs::exists(take / "huge.bin"));
  EXPECT_THAT(repair(true).files.at(0).error, HasSubstr("MB free"));  // nor is it read
}

TEST_F(RepairFromCopy, DocumentsOfAnySizeAreNotLoaded) {
  const char* const maps = schemas::ImportedDepthsDocument::kFile;
  create_folder((copy / maps).parent_path());
  write_bytes_to(copy / maps, Bytes{});
  fs::resize_file(copy / maps, std::uintmax_t{3} << 30);  // a hole
  const RepairReport report = repair();
  ASSERT_EQ(report.files.size(), 1U);
  EXPECT_THAT(report.files[0].error, HasSubstr("too large for a document"));
  EXPECT_FALSE(fs::exists(take / maps));
  for (const auto& camera : report.cameras) EXPECT_TRUE(camera.was_intact);
}

TEST_F(RepairFromCopy, StopsInTheMiddleOfAFile) {
  write_bytes_to(copy / "matte.bin", Bytes(100));
  std::stop_source stop;
  RepairOptions options;
  options.copy = copy;
  options.stop = stop.get_token();
  options.progress = [&](double share) {
    if (share >= 1) stop.request_stop();
  };
  const RepairReport report = repair_take(take, options);
  EXPECT_FALSE(fs::exists(take / "matte.bin"));
  EXPECT_TRUE(report.failed() || report.status != RunStatus::kFinished);
}

// What is no file of a take does not keep the take from being repaired.
TEST_F(RepairFromCopy, StrangeFilesOfTheCopyAreLeftOut) {
  fs::create_symlink("loop", copy / "loop");
  fs::create_symlink("/etc/passwd", copy / "recording" / "link.json");
  ASSERT_EQ(mkfifo((copy / "pipe").c_str(), 0600), 0);
  write_bytes_to(copy / "two\nlines", Bytes(3));
  fs::remove(take / "archive" / "c0.mkv");
  fs::remove(take / "recording" / "one.json");
  const RepairReport report = repair();
  EXPECT_FALSE(report.failed() || report.has_losses());
  EXPECT_EQ(contents_of(take), whole);
  std::vector<std::string> left_out;
  for (const Error& error : report.left_out) {
    left_out.push_back(fs::path(error.where()).filename().string());
  }
  EXPECT_THAT(left_out, ::testing::UnorderedElementsAre("loop", "link.json", "pipe", "two\nlines"));
}

TEST_F(RepairFromCopy, AnIntactTakeTakesNothingFromADamagedCopy) {
  fs::resize_file(copy / "archive" / "c1.mkv", 700);
  fs::remove(copy / "archive" / "c2.mkv");
  fs::remove(copy / "notes.txt");
  const RepairReport report = repair();
  EXPECT_FALSE(report.failed() || report.has_losses());
  for (const auto& camera : report.cameras) EXPECT_TRUE(camera.was_intact);
  EXPECT_THAT(report.files, IsEmpty());
  EXPECT_EQ(contents_of(take), whole);
}

TEST_F(RepairFromCopy, AnotherTakeIsRefused) {
  fs::remove_all(copy);
  schemas::TakeDocument other = testing::take_document(kCopiedCameras);
  other.name = "another";
  {
    TakeWriter writer(copy, other, testing::rig_document(kCopiedCameras));
    writer.commit();
  }
  EXPECT_THAT(refusal(), HasSubstr("another take: its name is \"another\""));
  other = testing::take_document(kCopiedCameras);
  other.epoch_utc += kNanosecondsPerSecond;
  fs::remove_all(copy);
  {
    TakeWriter writer(copy, other, testing::rig_document(kCopiedCameras));
    writer.commit();
  }
  EXPECT_THAT(refusal(), HasSubstr("another take: its epoch is"));
  fs::remove_all(copy);
  {
    TakeWriter writer(copy, testing::take_document(kCopiedCameras + 1),
                      testing::rig_document(kCopiedCameras + 1));
    writer.commit();
  }
  EXPECT_THAT(refusal(), HasSubstr("another take: its cameras differ"));
  EXPECT_THAT(([&] {
                try {
                  repair_take(take, {.copy = take});
                } catch (const Error& error) {
                  return std::string(error.what());
                }
                return std::string();
              }()),
              HasSubstr("the take itself"));
  EXPECT_EQ(contents_of(take), whole);
}

// The documents agree, as after a reset of the clock, but the frames do not.
TEST_F(RepairFromCopy, OtherFramesOfTheSameTimesAreRefused) {
  fs::remove_all(copy);
  {
    TakeWriter writer(copy, testing::take_document(kCopiedCameras),
                      testing::rig_document(kCopiedCameras));
    for (int camera = 0; camera < kCopiedCameras; ++camera) {
      writer.archive(camera).append(testing::fake_jpeg(999, 50), testing::frame_time(3),
                                    testing::frame_origin(3));
    }
    writer.commit();
  }
  const RepairReport report = repair();
  EXPECT_TRUE(report.failed());
  for (const auto& camera : report.cameras) EXPECT_THAT(camera.error, HasSubstr("another take"));
  EXPECT_EQ(contents_of(take), whole);
}

TEST_F(RepairFromCopy, NoLinkIsFollowedInEitherFolder) {
  const fs::path outside = folder.path() / "outside.mkv";
  fs::copy(copy / "archive" / "c0.mkv", outside);
  for (const fs::path& where : {copy, take}) {
    restore_take();
    fs::remove(where / "archive" / "c0.mkv");
    fs::create_symlink(outside, where / "archive" / "c0.mkv");
    const Bytes before = testing::bytes_of(outside);
    std::string said;
    try {
      said = repair().cameras[0].error;
    } catch (const Error& error) {
      said = error.what();
    }
    EXPECT_THAT(said, HasSubstr("link")) << where;
    EXPECT_EQ(testing::bytes_of(outside), before);
    EXPECT_TRUE(fs::is_symlink(where / "archive" / "c0.mkv"));
    fs::remove(where / "archive" / "c0.mkv");
    fs::copy(outside, where / "archive" / "c0.mkv");
  }
}

TEST_F(RepairFromCopy, AFolderThatIsNoTakeIsRefused) {
  fs::remove_all(take);
  fs::create_directory(take);
  EXPECT_THAT(refusal(), HasSubstr("this is no take"));
  EXPECT_TRUE(fs::is_empty(take));
}

}  // namespace
}  // namespace raystage::store
