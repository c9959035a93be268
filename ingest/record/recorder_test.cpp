// SPDX-License-Identifier: Apache-2.0
#include "ingest/record/recorder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <csignal>
#include <thread>

#include "base/error.h"
#include "base/resources.h"
#include "ingest/record/open_cameras.h"
#include "ingest/record/record_setup.h"
#include "store/jpeg/encode.h"
#include "store/take.h"
#include "testing/ingest/scripted_source.h"
#include "testing/store/test_images.h"
#include "testing/test_folder.h"

namespace raystage::ingest {
namespace {

using ::testing::HasSubstr;
using Bytes = std::vector<std::byte>;

constexpr int kWidth = 96, kHeight = 64;

SourceFrame jpeg_frame(std::uint32_t seed, int width = kWidth) {
  SourceFrame frame;
  frame.jpeg = store::encode_jpeg(testing::make(testing::Kind::kMixed, width, kHeight, seed),
                                  {80, store::JpegEncodeOptions::Chroma::k420, -1});
  return frame;
}

SourceFrame raw_frame(std::uint32_t seed) {
  const auto image = std::make_shared<store::RgbImage>(
      testing::make(testing::Kind::kMixed, kWidth, kHeight, seed));
  SourceFrame frame;
  frame.raw.format = store::PixelFormat::kRgb;
  frame.raw.width = kWidth;
  frame.raw.height = kHeight;
  frame.raw.planes[0] = {reinterpret_cast<const std::byte*>(image->values.data()),
                         std::size_t{3} * kWidth};
  frame.raw.owner = image;
  return frame;
}

testing::SourceScript script(std::vector<SourceFrame> frames, double fps, std::uint64_t count) {
  testing::SourceScript script;
  script.frames = std::move(frames);
  script.fps = fps;
  script.count = count;
  return script;
}

/// Records scripted sources and keeps the session and the take.
class Recording : public ::testing::Test {
 protected:
  schemas::RecordingDocument::Session record(const std::vector<testing::SourceScript>& scripts) {
    schemas::RecordConfig config;
    config.name = "test";
    for (std::size_t i = 0; i < scripts.size(); ++i) {
      config.cameras.push_back({"c" + std::to_string(i), schemas::RecordConfig::SimulatedSource{}});
    }
    auto cameras = open_cameras(config, [this, &scripts](const auto& camera) {
      return wrap(testing::make_scripted_source(scripts[std::stoi(camera.id.substr(1))]));
    });
    RecordingTake take =
        resume ? resume_take(path(), cameras, "node")
               : RecordingTake::create(path(),
                                       make_take_document(config, cameras, "node", epoch, "test"),
                                       make_recording_rig(config, {}, cameras), "node");
    Recorder recorder(options, std::move(cameras), take, "test");
    return recorder.run(stop.get_token(), status);
  }
  std::filesystem::path path() const { return folder_.path() / "take"; }

  std::vector<Bytes> stored(int camera) const {
    const store::Take take(path());
    const store::ArchiveReader& archive = take.archive(camera);
    std::vector<Bytes> frames;
    for (int i = 0; i < static_cast<int>(archive.frames().size()); ++i) {
      EXPECT_TRUE(archive.verify_frame(i));
      const store::FrameBytes jpeg = archive.jpeg(i);
      frames.emplace_back(jpeg.begin(), jpeg.end());
    }
    return frames;
  }
  std::vector<store::FrameRecord> records(int camera) const {
    const store::Take take(path());
    const auto all = take.archive(camera).records();
    return {all.begin(), all.end()};
  }
  static void expect_audit(const schemas::RecordingDocument::Session& session) {
    ASSERT_TRUE(session.audit);
    EXPECT_TRUE(session.audit->holds) << ::testing::PrintToString(session.audit->problems);
  }

  RecorderOptions options = every_frame_counts();
  std::function<void(const RecorderStatus&)> status;
  std::function<std::unique_ptr<FrameSource>(std::unique_ptr<FrameSource>)> wrap =
      [](std::unique_ptr<FrameSource> source) { return source; };
  std::stop_source stop;
  bool resume = false;
  Nanoseconds epoch = host_utc_now() - kNanosecondsPerSecond;

 private:
  static RecorderOptions every_frame_counts() {
    RecorderOptions all;
    all.start_utc = 0;
    return all;
  }
  testing::TestFolder folder_;
};

TEST_F(Recording, JpegIsStoredByteForByteAndRawIsEncoded) {
  options.threads = 2;
  const std::vector<SourceFrame> jpegs{jpeg_frame(1), jpeg_frame(2), jpeg_frame(3)};
  const std::vector<SourceFrame> raws{raw_frame(4), raw_frame(5)};
  const auto session = record({script(jpegs, 200, 40), script(raws, 200, 30)});
  expect_audit(session);
  EXPECT_EQ(session.stop_reason, "every source has ended");
  const auto first = stored(0), second = stored(1);
  ASSERT_EQ(first.size(), 40U);
  ASSERT_EQ(second.size(), 30U);
  for (std::size_t i = 0; i < first.size(); ++i) EXPECT_EQ(first[i], jpegs[i % 3].jpeg);
  store::RawJpegEncoder encoder(options.jpeg);
  for (std::size_t i = 0; i < second.size(); ++i) {
    Bytes expected;
    encoder.encode(raws[i % 2].raw, expected);
    EXPECT_EQ(second[i], expected);
  }
  Nanoseconds last = 0;
  std::uint64_t sequence = 0;
  for (const store::FrameRecord& record : records(0)) {
    EXPECT_GT(record.time_ns, last);
    EXPECT_NE(record.arrival_ns, store::kUnknownTime);
    EXPECT_EQ(record.sequence, sequence++);
    last = record.time_ns;
  }
  EXPECT_EQ(session.cameras[0].arrived, 40U);
  EXPECT_EQ(session.cameras[0].stored, 40U);
  const schemas::RecordingDocument kept =
      schemas::read_recording(path() / "recording" / "node.json");
  ASSERT_EQ(kept.sessions.size(), 1U);
  EXPECT_TRUE(kept.sessions[0].audit->holds);
  EXPECT_FALSE(std::filesystem::exists(path() / ".reserve"));
}

TEST_F(Recording, FullMemoryDropsAndRecordsEveryDrop) {
  options.hold = true;
  const std::vector<SourceFrame> frames{jpeg_frame(1), jpeg_frame(2)};
  options.memory_bytes = kWidth * kHeight / 2 * 5 + 30 * frames[0].jpeg.size();
  for (const bool oldest : {false, true}) {
    std::filesystem::remove_all(path());
    options.drop_oldest = oldest;
    const auto session = record({script(frames, 0, 300)});
    expect_audit(session);
    EXPECT_LE(session.memory_peak_bytes, options.memory_bytes);
    EXPECT_EQ(session.cameras[0].arrived, 300U);
    EXPECT_GT(session.cameras[0].stored, 10U);
    EXPECT_EQ(session.cameras[0].stored + session.cameras[0].dropped.at("dropped, memory full"),
              300U);
    const auto all = records(0);
    ASSERT_EQ(all.size(), 300U);
    std::vector<std::uint64_t> kept;
    for (const store::FrameRecord& record : all) {
      if (record.status == store::FrameStatus::kStored) kept.push_back(record.sequence);
    }
    // The first frame is stored in both cases: the writer holds it already.
    EXPECT_EQ(kept[0], 0U);
    if (oldest) {
      EXPECT_EQ(kept.back(), 299U);
    } else {
      EXPECT_EQ(kept[5], 5U);
    }
  }
}

TEST_F(Recording, MisbehavingSourcesAreRecordedAndOthersUntouched) {
  options.lost_after = std::chrono::milliseconds(600);  // a busy machine may pause
  testing::SourceScript gap = script({jpeg_frame(1)}, 100, 60);
  gap.events.push_back({20, testing::SourceScript::Gap{7}});
  testing::SourceScript torn = script({jpeg_frame(2)}, 100, 60);
  torn.events.push_back({10, testing::SourceScript::Tear{}});
  torn.events.push_back({11, testing::SourceScript::Tear{}});
  testing::SourceScript changed = script({jpeg_frame(3)}, 100, 60);
  changed.events.push_back({30, testing::SourceScript::Change{{jpeg_frame(3, kWidth + 16)}}});
  testing::SourceScript dies = script({jpeg_frame(4)}, 100, 60);
  dies.events.push_back({15, testing::SourceScript::Death{"cable pulled"}});
  testing::SourceScript stalls = script({jpeg_frame(5)}, 100, 250);
  stalls.events.push_back({10, testing::SourceScript::Stall{1.5}});
  const auto session = record({script({jpeg_frame(6)}, 100, 60), gap, torn, changed, dies, stalls});
  expect_audit(session);
  EXPECT_EQ(session.cameras[0].stored, 60U);
  EXPECT_TRUE(session.cameras[0].events.empty());
  EXPECT_EQ(session.cameras[1].skipped_by_source, 7U);
  EXPECT_EQ(session.cameras[2].dropped.at("torn"), 2U);
  EXPECT_EQ(session.cameras[2].stored, 58U);
  EXPECT_EQ(session.cameras[3].stored, 30U);
  EXPECT_EQ(session.cameras[3].arrived, 60U);
  ASSERT_FALSE(session.cameras[3].events.empty());
  EXPECT_THAT(session.cameras[3].events[0].what, HasSubstr("another size"));
  EXPECT_EQ(session.cameras[4].stored, 15U);
  ASSERT_EQ(session.cameras[4].events.size(), 1U);
  EXPECT_THAT(session.cameras[4].events[0].what, HasSubstr("cable pulled"));
  ASSERT_EQ(session.cameras[5].events.size(), 2U);
  EXPECT_THAT(session.cameras[5].events[0].what, HasSubstr("no frame for"));
  EXPECT_THAT(session.cameras[5].events[1].what, HasSubstr("frames arrive again"));
  // The seven frames that the counter skipped have records at their positions.
  const auto all = records(1);
  for (std::size_t i = 20; i < 27; ++i) {
    EXPECT_EQ(all[i].status, store::FrameStatus::kDroppedBySource);
    EXPECT_EQ(all[i].sequence, i);
  }
}

TEST_F(Recording, ALostCameraMayStopAllOrComeBack) {
  testing::SourceScript dies = script({jpeg_frame(1)}, 100, 1000);
  dies.events.push_back({10, testing::SourceScript::Death{"gone"}});
  options.when_lost = CameraCapture::LostSourcePolicy::kStop;
  const auto stopped = record({dies, script({jpeg_frame(2)}, 100, 1000)});
  EXPECT_EQ(stopped.stop_reason, "a camera was lost");
  expect_audit(stopped);

  std::filesystem::remove_all(path());
  options.when_lost = CameraCapture::LostSourcePolicy::kReconnect;
  options.start_utc.reset();
  options.duration_s = 0.6;
  const auto again = record({dies});
  expect_audit(again);
  EXPECT_GT(again.cameras[0].stored, 15U);
  EXPECT_THAT(again.cameras[0].events.at(1).what, HasSubstr("connected again"));
}

/// A source that takes away the memory for more threads when the recorder asks it the last question
/// before it starts them.
class LeavesNoMemory final : public FrameSource {
 public:
  explicit LeavesNoMemory(std::unique_ptr<FrameSource> source) : source_(std::move(source)) {}
  const SourceDescription& description() const override { return source_->description(); }
  Outcome next(SourceFrame& frame, std::chrono::milliseconds patience) override {
    return source_->next(frame, patience);
  }
  std::string loss_reason() const override { return source_->loss_reason(); }
  std::size_t memory_overhead() const override { return source_->memory_overhead(); }
  bool survives_failed_allocations() const override {
    constexpr std::size_t kFewStacks = 48 << 20;  // glibc keeps up to 40 MB of those that ended
    rlimit limit{};
    getrlimit(RLIMIT_DATA, &limit);
    limit.rlim_cur = MemoryUseReader().read()->data + kFewStacks;
    setrlimit(RLIMIT_DATA, &limit);
    return true;
  }

 private:
  std::unique_ptr<FrameSource> source_;
};

TEST_F(Recording, FailsIfNotAllThreadsCanStart) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "sanitizers take memory of their own";
#endif
  rlimit before{};
  getrlimit(RLIMIT_DATA, &before);
  wrap = [](std::unique_ptr<FrameSource> source) {
    return std::make_unique<LeavesNoMemory>(std::move(source));
  };
  constexpr int kMany = 40;
  EXPECT_THROW(record(std::vector(kMany, script({jpeg_frame(1)}, 100, 1000))), std::system_error);
  setrlimit(RLIMIT_DATA, &before);
}

// Simulates a full disk by a limit on file size.
TEST_F(Recording, AFullDiskLosesNothingSilently) {
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  const auto old_handler = std::signal(SIGXFSZ, SIG_IGN);
  options.drain_timeout_s = 0.2;
  options.flush_interval_s = 0.05;
  std::string write_error;
  status = [&](const RecorderStatus& now) { write_error += now.write_error; };
  const SourceFrame frame = jpeg_frame(1);
  const rlimit limit{20 * frame.jpeg.size(), before.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &limit), 0);
  const auto session = record({script({frame}, 80, 100)});
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, old_handler);
  EXPECT_EQ(session.cameras[0].arrived, 100U);
  EXPECT_GT(session.cameras[0].stored, 10U);
  EXPECT_LT(session.cameras[0].stored, 25U);
  EXPECT_EQ(
      session.cameras[0].stored + session.cameras[0].dropped.at("dropped, could not be written"),
      100U);
  EXPECT_THAT(write_error, HasSubstr("too large"));
  // The audit reports that the index could not be written; all stored frames are readable.
  EXPECT_EQ(stored(0).size(), session.cameras[0].stored);
}

TEST_F(Recording, ResumesAndCountsTheNewSessionAlone) {
  expect_audit(record({script({jpeg_frame(1)}, 0, 20)}));
  resume = true;
  const auto session = record({script({jpeg_frame(2)}, 0, 15)});
  expect_audit(session);
  EXPECT_EQ(session.cameras[0].stored, 15U);
  EXPECT_EQ(stored(0).size(), 35U);
  EXPECT_EQ(schemas::read_recording(path() / "recording" / "node.json").sessions.size(), 2U);
}

TEST_F(Recording, StopsWhenToldAndStartsWhenToldTo) {
  const std::vector<testing::SourceScript> endless{script({jpeg_frame(1)}, 100, 100000)};
  options.start_utc =
      host_utc_now() + kNanosecondsPerSecond;  // opening takes long on a busy machine
  options.duration_s = 0.5;
  const auto session = record(endless);
  expect_audit(session);
  EXPECT_EQ(session.stop_reason, "the duration is over");
  // The limit is computed from the time since the start: a busy machine stops later than requested.
  const double since_start_s = static_cast<double>(host_utc_now() - *options.start_utc) * 1e-9;
  EXPECT_GT(session.cameras[0].stored, 10U);
  EXPECT_LE(static_cast<double>(session.cameras[0].stored), since_start_s * 100 + 2);
  EXPECT_GE(records(0).front().arrival_ns + store::Take(path()).document().epoch_utc,
            *options.start_utc);
  stop.request_stop();
  std::filesystem::remove_all(path());
  options.start_utc.reset();
  EXPECT_EQ(record(endless).stop_reason, "stopped as asked");
}

TEST_F(Recording, RefusesTooLittleMemoryAndWhatIsThere) {
  options.memory_bytes = 1000;
  EXPECT_THROW(record({script({jpeg_frame(1)}, 0, 20)}), Error);
  EXPECT_FALSE(std::filesystem::exists(path()));  // the name can be used again
  options.memory_bytes = 1 << 30;
  expect_audit(record({script({jpeg_frame(1)}, 0, 20)}));
  EXPECT_THROW(record({script({jpeg_frame(1)}, 0, 20)}), Error);  // the folder exists
  resume = true;
  EXPECT_THROW(record({script({jpeg_frame(1)}, 0, 2), script({jpeg_frame(1)}, 0, 2)}), Error);
  options.memory_bytes = 1000;
  EXPECT_THROW(record({script({jpeg_frame(1)}, 0, 2)}), Error);
  EXPECT_EQ(stored(0).size(), 20U);  // earlier frames remain
}

TEST_F(Recording, RefusesToResumeWithAnotherSize) {
  expect_audit(record({script({jpeg_frame(1)}, 0, 20)}));
  resume = true;
  try {
    record({script({jpeg_frame(1, kWidth + 16)}, 0, 20)});
    FAIL() << "resumed";
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
    EXPECT_THAT(error.what(), HasSubstr("\"c0\" is 96 x 64 pixels"));
    EXPECT_THAT(error.what(), HasSubstr("112 x 64"));
  }
}

TEST_F(Recording, NothingCountsBeforeTheEpoch) {
  epoch = host_utc_now() + 300'000'000;
  options.start_utc.reset();
  options.duration_s = 0.2;
  const auto session = record({script({jpeg_frame(1)}, 200, 100000)});
  expect_audit(session);
  // The limit is computed from the time since the epoch: a busy machine stops later than requested.
  const double since_epoch_s = static_cast<double>(host_utc_now() - epoch) * 1e-9;
  EXPECT_GT(session.cameras[0].stored, 10U);
  EXPECT_LE(static_cast<double>(session.cameras[0].stored), since_epoch_s * 200 + 2);
  EXPECT_EQ(session.cameras[0].corrected_timestamps, 0U);
}

// Times in an archive are limited to 104 days.
TEST_F(Recording, RefusesAnEpochThatIsTooFarAway) {
  constexpr Nanoseconds kDay = 86400 * kNanosecondsPerSecond;
  const Nanoseconds now = host_utc_now();
  for (const Nanoseconds days : {-106, 106}) {
    epoch = now + days * kDay;
    try {
      record({script({jpeg_frame(1)}, 0, 20)});
      FAIL() << days;
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
      EXPECT_THAT(error.what(), HasSubstr("104 days"));
    }
    EXPECT_FALSE(std::filesystem::exists(path()));
  }
  epoch = now - 100 * kDay;
  expect_audit(record({script({jpeg_frame(1)}, 0, 20)}));
}

}  // namespace
}  // namespace raystage::ingest
