// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/error.h"
#include "base/posix_file.h"
#include "schemas/imported_depths_document.h"
#include "store/fixity/repair_from_copy.h"
#include "testing/store/copied_take_test_data.h"

namespace raystage::store {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

using Bytes = std::vector<std::byte>;

class RepairFromStrangeCopy : public testing::CopiedTake {};

TEST_F(RepairFromStrangeCopy, ADocumentThatCannotBeOpenedIsNotReplaced) {
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
  EXPECT_EQ(testing::contents_of(take), whole);
}

TEST_F(RepairFromStrangeCopy, ATakeThatIsRecordedIsNotChanged) {
  fs::resize_file(take / "archive" / "c0.mkv", 700);
  const Bytes before = testing::bytes_of(take / "archive" / "c0.mkv");
  const OutputFile recorder(take / "archive" / "c0.mkv", OutputFile::Open::kExisting);
  const RepairReport report = repair();
  EXPECT_THAT(report.cameras[0].error, HasSubstr("another program is writing"));
  EXPECT_EQ(testing::bytes_of(take / "archive" / "c0.mkv"), before);
}

TEST_F(RepairFromStrangeCopy, AHoleStaysAHoleAndMustFitTheDisk) {
  testing::write_bytes_to(copy / "sparse.bin", Bytes(10, std::byte{1}));
  fs::resize_file(copy / "sparse.bin", 50'000'000);
  EXPECT_FALSE(repair().failed());
  EXPECT_EQ(testing::bytes_of(take / "sparse.bin"), testing::bytes_of(copy / "sparse.bin"));
  struct stat status {};
  ASSERT_EQ(stat((take / "sparse.bin").c_str(), &status), 0);
  EXPECT_LT(status.st_blocks * 512, 5'000'000);
  const auto most = std::uintmax_t{1} << 42;
  std::error_code unsupported;
  testing::write_bytes_to(copy / "huge.bin", Bytes{});
  fs::resize_file(copy / "huge.bin", most, unsupported);
  if (unsupported || fs::space(take).available >= most) GTEST_SKIP() << "the disk is too large";
  const RepairReport report = repair();
  ASSERT_EQ(report.files.size(), 1U);
  EXPECT_THAT(report.files[0].error, HasSubstr("MB free"));
  EXPECT_FALSE(fs::exists(take / "huge.bin"));
  EXPECT_THAT(repair(true).files.at(0).error, HasSubstr("MB free"));  // nor is it read
}

TEST_F(RepairFromStrangeCopy, DocumentsOfAnySizeAreNotLoaded) {
  const char* const maps = schemas::ImportedDepthsDocument::kFile;
  create_folder((copy / maps).parent_path());
  testing::write_bytes_to(copy / maps, Bytes{});
  fs::resize_file(copy / maps, std::uintmax_t{3} << 30);  // a hole
  const RepairReport report = repair();
  ASSERT_EQ(report.files.size(), 1U);
  EXPECT_THAT(report.files[0].error, HasSubstr("too large for a document"));
  EXPECT_FALSE(fs::exists(take / maps));
  for (const auto& camera : report.cameras) EXPECT_TRUE(camera.was_intact);
}

TEST_F(RepairFromStrangeCopy, StopsInTheMiddleOfAFile) {
  testing::write_bytes_to(copy / "matte.bin", Bytes(100));
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
TEST_F(RepairFromStrangeCopy, StrangeFilesOfTheCopyAreLeftOut) {
  fs::create_symlink("loop", copy / "loop");
  fs::create_symlink("/etc/passwd", copy / "recording" / "link.json");
  ASSERT_EQ(mkfifo((copy / "pipe").c_str(), 0600), 0);
  testing::write_bytes_to(copy / "two\nlines", Bytes(3));
  fs::remove(take / "archive" / "c0.mkv");
  fs::remove(take / "recording" / "one.json");
  const RepairReport report = repair();
  EXPECT_FALSE(report.failed() || report.has_losses());
  EXPECT_EQ(testing::contents_of(take), whole);
  std::vector<std::string> left_out;
  for (const Error& error : report.left_out) {
    left_out.push_back(fs::path(error.where()).filename().string());
  }
  EXPECT_THAT(left_out, ::testing::UnorderedElementsAre("loop", "link.json", "pipe", "two\nlines"));
}

TEST_F(RepairFromStrangeCopy, AnotherTakeIsRefused) {
  fs::remove_all(copy);
  schemas::TakeDocument other = testing::take_document(testing::kCopiedCameras);
  other.name = "another";
  {
    TakeWriter writer(copy, other, testing::rig_document(testing::kCopiedCameras));
    writer.commit();
  }
  EXPECT_THAT(refusal(), HasSubstr("another take: its name is \"another\""));
  other = testing::take_document(testing::kCopiedCameras);
  other.epoch_utc += kNanosecondsPerSecond;
  fs::remove_all(copy);
  {
    TakeWriter writer(copy, other, testing::rig_document(testing::kCopiedCameras));
    writer.commit();
  }
  EXPECT_THAT(refusal(), HasSubstr("another take: its epoch is"));
  fs::remove_all(copy);
  {
    TakeWriter writer(copy, testing::take_document(testing::kCopiedCameras + 1),
                      testing::rig_document(testing::kCopiedCameras + 1));
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
  EXPECT_EQ(testing::contents_of(take), whole);
}

// The documents agree, as after a reset of the clock, but the frames do not.
TEST_F(RepairFromStrangeCopy, OtherFramesOfTheSameTimesAreRefused) {
  fs::remove_all(copy);
  {
    TakeWriter writer(copy, testing::take_document(testing::kCopiedCameras),
                      testing::rig_document(testing::kCopiedCameras));
    for (int camera = 0; camera < testing::kCopiedCameras; ++camera) {
      writer.archive(camera).append(testing::fake_jpeg(999, 50), testing::frame_time(3),
                                    testing::frame_origin(3));
    }
    writer.commit();
  }
  const RepairReport report = repair();
  EXPECT_TRUE(report.failed());
  for (const auto& camera : report.cameras) EXPECT_THAT(camera.error, HasSubstr("another take"));
  EXPECT_EQ(testing::contents_of(take), whole);
}

TEST_F(RepairFromStrangeCopy, NoLinkIsFollowedInEitherFolder) {
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

TEST_F(RepairFromStrangeCopy, AFolderThatIsNoTakeIsRefused) {
  fs::remove_all(take);
  fs::create_directory(take);
  EXPECT_THAT(refusal(), HasSubstr("this is no take"));
  EXPECT_TRUE(fs::is_empty(take));
}

}  // namespace
}  // namespace raystage::store
