// SPDX-License-Identifier: Apache-2.0
#include "store/take.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <thread>

#include "base/error.h"
#include "store/journal.h"
#include "store/journal_archives.h"
#include "store/recordings.h"
#include "testing/store/take_test_data.h"
#include "testing/test_folder.h"
#include "testing/test_permissions.h"

namespace raystage::store::take_test {
namespace {

using ::testing::HasSubstr;

struct TakeFolder : ::testing::Test {
  testing::TestFolder folder;
  std::filesystem::path path = folder.path() / "take";

  std::size_t entries() const {
    return static_cast<std::size_t>(
        std::distance(std::filesystem::directory_iterator(folder.path()), {}));
  }
};

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

TEST_F(TakeFolder, GivesBackWhatWentIn) {
  {
    TakeWriter writer(path, testing::take_document(3), testing::rig_document(3));
    writer.archive(2).append(testing::fake_jpeg(2), 7);
    writer.archive(0).append(testing::fake_jpeg(0), 5);
    write_file_atomically(writer.working_folder() / "views.json", "{}");
    EXPECT_FALSE(std::filesystem::exists(path));
    writer.commit();
  }
  EXPECT_EQ(entries(), 1u) << "something beside the take was left";
  EXPECT_TRUE(std::filesystem::exists(path / "views.json"));
  const Take take(path);
  EXPECT_EQ(take.camera_count(), 3);
  EXPECT_EQ(take.rig().cameras.size(), 3u);
  EXPECT_EQ(take.camera_index("c2"), 2);
  EXPECT_EQ(take.camera_index("c3"), -1);
  EXPECT_EQ(take.document().cameras[1].archive, "archive/c1.mkv");
  EXPECT_TRUE(std::ranges::equal(take.archive(2).jpeg(0), testing::fake_jpeg(2)));
  EXPECT_TRUE(take.archive(1).frames().empty());
  EXPECT_TRUE(take.archive(1).was_closed());
  EXPECT_EQ(take.archive(0).description().epoch_utc, take.document().epoch_utc);
}

TEST_F(TakeFolder, NothingStaysWithoutCommit) {
  {
    TakeWriter writer(path, testing::take_document(2), testing::rig_document(2));
    writer.archive(0).append(testing::fake_jpeg(0), 5);
    EXPECT_EQ(entries(), 1u);
  }
  EXPECT_EQ(entries(), 0u);
}

TEST_F(TakeFolder, NameWithASlashAtItsEnd) {
  TakeWriter writer(path.string() + "/", testing::take_document(1), testing::rig_document(1));
  writer.commit();
  EXPECT_EQ(Take(path).camera_count(), 1);
}

TEST_F(TakeFolder, NeverReplacesAnything) {
  std::filesystem::create_directory(path);
  EXPECT_EQ(error_of([&] {
              TakeWriter(path, testing::take_document(1), testing::rig_document(1));
            }).exit_code(),
            ExitCode::kBadInput);
  std::filesystem::remove(path);
  TakeWriter writer(path, testing::take_document(1), testing::rig_document(1));
  std::filesystem::create_directory(path);  // created by another process
  EXPECT_EQ(error_of([&] { writer.commit(); }).exit_code(), ExitCode::kFailed);
  EXPECT_TRUE(std::filesystem::is_empty(path));
}

TEST_F(TakeFolder, FolderWithoutPermission) {
  const auto outcome = [&]() -> std::string {
    try {
      const TakeWriter writer(path, testing::take_document(1), testing::rig_document(1));
    } catch (const Error& error) {
      return "exit code " + std::to_string(static_cast<int>(error.exit_code())) + ", " +
             error.what();
    }
    return "accepted";
  };
  testing::make_world_writable(folder.path());
  const std::string closed = testing::unprivileged_access_error(folder.path());
  if (!closed.empty()) GTEST_SKIP() << closed;
  EXPECT_EQ(testing::run_unprivileged(outcome), "accepted");  // the next refusal is due to the lock
  const testing::ReadOnlyFolder locked(folder.path());
  const std::string refused = testing::run_unprivileged(outcome);
  EXPECT_THAT(refused, HasSubstr("exit code 1, "));
  EXPECT_THAT(refused, HasSubstr("ermission denied"));
  EXPECT_EQ(entries(), 0u);
}

TEST_F(TakeFolder, ParentThatIsAFile) {
  write_file_atomically(folder.path() / "file", "x");
  EXPECT_EQ(error_of([&] {
              TakeWriter(folder.path() / "file" / "take", testing::take_document(1),
                         testing::rig_document(1));
            }).exit_code(),
            ExitCode::kFailed);
}

TEST_F(TakeFolder, RefusesBadDocumentsBeforeTheFirstFrame) {
  const auto refused = [&](const schemas::TakeDocument& take, const schemas::RigDocument& rig) {
    const Error error = error_of([&] { TakeWriter(path, take, rig); });
    EXPECT_EQ(error.exit_code(), ExitCode::kBadInput) << error.what();
    EXPECT_EQ(entries(), 0u);
  };
  refused(testing::take_document(0), testing::rig_document(0));
  refused(testing::take_document(2), testing::rig_document(3));
  for (const char* id : {"", "../c0", ".c0", "a/b", "a b", "a\n"}) {
    auto take = testing::take_document(1);
    auto rig = testing::rig_document(1);
    take.cameras[0].id = rig.cameras[0].geometry.id = id;
    refused(take, rig);
  }
  auto twice = testing::take_document(2);
  auto twice_rig = testing::rig_document(2);
  twice.cameras[1].id = twice_rig.cameras[1].geometry.id = "c0";
  refused(twice, twice_rig);
  auto color = testing::take_document(1);
  color.color_space = "my favourite";
  refused(color, testing::rig_document(1));
}

TEST_F(TakeFolder, RefusesDocumentsThatDisagree) {
  testing::write_take(path, {{1}, {2}});
  schemas::write_rig(testing::rig_document(3), path / "rig.json");
  EXPECT_THAT(error_of([&] { Take take(path); }).what(),
              HasSubstr("2 cameras, but rig.json has 3"));
  auto renamed = testing::rig_document(2);
  renamed.cameras[1].geometry.id = "other";
  schemas::write_rig(renamed, path / "rig.json");
  const Error error = error_of([&] { Take take(path); });
  EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
  EXPECT_THAT(error.where(), HasSubstr("take.json#/cameras/1/id"));
}

TEST_F(TakeFolder, RefusesArchivesOfOtherCameras) {
  testing::write_take(path, {{1}, {2}});
  const auto archive = [&](const char* name) { return path / "archive" / name; };
  std::filesystem::rename(archive("c0.mkv"), archive("x.mkv"));
  std::filesystem::rename(archive("c0.journal"), archive("x.journal"));
  std::filesystem::copy(archive("c1.mkv"), archive("c0.mkv"));
  std::filesystem::copy(archive("c1.journal"), archive("c0.journal"));
  const Take take(path);
  EXPECT_THAT(error_of([&] { take.archive(0); }).what(), HasSubstr("archive is of camera \"c1\""));
  EXPECT_NO_THROW(take.archive(1));
  // With the right archive it opens: a failure is not cached.
  std::filesystem::rename(archive("x.mkv"), archive("c0.mkv"));
  std::filesystem::rename(archive("x.journal"), archive("c0.journal"));
  EXPECT_EQ(take.archive(0).frames().size(), 1u);

  auto rig = testing::rig_document(2);
  rig.cameras[0].geometry.width = 640;
  schemas::write_rig(rig, path / "rig.json");
  EXPECT_THAT(error_of([&] { Take(path).archive(0); }).what(), HasSubstr("320 x 240"));
}

TEST_F(TakeFolder, MissingPartsAreBadInput) {
  EXPECT_EQ(error_of([&] { Take take(path); }).exit_code(), ExitCode::kBadInput);
  testing::write_take(path, {{1}});
  std::filesystem::remove(path / "archive" / "c0.mkv");
  const Take take(path);
  EXPECT_EQ(error_of([&] { take.archive(0); }).exit_code(), ExitCode::kBadInput);
}

TEST_F(TakeFolder, TimesOfHostileFilesDoNotOverflow) {
  testing::write_take(path, {{1, 2}});
  schemas::TakeDocument document = schemas::read_take(path / "take.json");
  const Nanoseconds epoch = document.epoch_utc;
  // Recorders that started in 1678 and 2261.
  schemas::RecordingDocument recording;
  recording.sessions.resize(3);
  for (auto& session : recording.sessions) session.cameras.emplace_back().id = "c0";
  recording.sessions[0].started_utc = std::numeric_limits<Nanoseconds>::min();
  recording.sessions[1].started_utc = epoch + 5;
  recording.sessions[2].started_utc = std::numeric_limits<Nanoseconds>::max();
  std::filesystem::create_directory(path / "recording");
  write_file_atomically(path / "recording/a.json", schemas::format_recording(recording));
  const auto restarts = recorder_restarts(Take(path));
  ASSERT_EQ(restarts[0].size(), 2u);
  EXPECT_EQ(restarts[0][0], 5);
  EXPECT_GT(restarts[0][1], kMaxArchiveTime);

  // A journal without an archive, whose epoch is the latest before the take's.
  document.epoch_utc = epoch + kMaxArchiveTime;
  document.cameras[0].archive_epoch_utc = epoch;
  schemas::write_take(document, path / "take.json");
  std::filesystem::remove(path / "archive/c0.mkv");
  const auto header = journal::encode_header({"c0", 0, 0, epoch});
  std::vector<std::byte> bytes(header.begin(), header.end());
  const auto append = [&](Nanoseconds time, Nanoseconds arrival) {
    FrameRecord record;
    record.time_ns = time;
    record.arrival_ns = arrival;
    const auto encoded = journal::encode_record(record);
    bytes.insert(bytes.end(), encoded.begin(), encoded.end());
  };
  append(-1, 0);
  append(5, std::numeric_limits<Nanoseconds>::min() + 1);
  append(5, 0);
  append(3, 0);
  append(kMaxArchiveTime, 9);
  append(std::numeric_limits<Nanoseconds>::max(), 0);
  testing::overwrite(path / "archive/c0.journal", bytes);
  const Take take(path, make_journal_archives(path));
  const auto frames = take.archive(0).frames();
  ASSERT_EQ(frames.size(), 2u);
  EXPECT_EQ(frames[0].time_ns, 5 - kMaxArchiveTime);
  EXPECT_EQ(frames[0].arrival_ns, kUnknownTime);
  EXPECT_EQ(frames[1].time_ns, 0);
  EXPECT_EQ(frames[1].arrival_ns, 9 - kMaxArchiveTime);
}

TEST_F(TakeFolder, ManyThreadsOpenArchivesAtOnce) {
  std::vector<std::vector<Nanoseconds>> times(16);
  for (auto& column : times) column = {1, 2, 3};
  testing::write_take(path, times);
  const Take take(path);
  std::vector<std::size_t> seen(4, 0);
  {
    std::vector<std::jthread> threads;
    for (std::size_t& count : seen) {
      threads.emplace_back([&take, &count] {
        for (int i = 0; i < take.camera_count(); ++i) count += take.archive(i).frames().size();
      });
    }
  }
  EXPECT_THAT(seen, ::testing::Each(48u));
}

}  // namespace
}  // namespace raystage::store::take_test
