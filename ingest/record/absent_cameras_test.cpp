// SPDX-License-Identifier: Apache-2.0
// Cameras that cannot be opened when a recording begins: the others are recorded.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <mutex>

#include "base/error.h"
#include "ingest/record/open_cameras.h"
#include "ingest/record/record_setup.h"
#include "ingest/sources/configuration_error.h"
#include "store/jpeg/encode.h"
#include "store/take.h"
#include "testing/ingest/scripted_source.h"
#include "testing/store/test_images.h"
#include "testing/test_folder.h"

namespace raystage::ingest {
namespace {

using ::testing::HasSubstr;
using Policy = schemas::RecordConfig::LostSourcePolicy;

/// A source that states a size and never delivers a frame.
class StatedSize final : public FrameSource {
 public:
  StatedSize(int width, int height) {
    description_.width = width;
    description_.height = height;
  }
  const SourceDescription& description() const override { return description_; }
  Outcome next(SourceFrame& /*frame*/, std::chrono::milliseconds /*patience*/) override {
    return Outcome::kEnded;
  }

 private:
  SourceDescription description_;
};

/// Records two good cameras, "a" and "b", and "bad".
class AbsentCameras : public ::testing::Test {
 protected:
  using Open = std::function<std::unique_ptr<FrameSource>(int attempt)>;

  static std::unique_ptr<FrameSource> good(int width = 96, std::uint64_t count = 30) {
    testing::SourceScript script;
    SourceFrame frame;
    frame.jpeg = store::encode_jpeg(testing::make(testing::Kind::kMixed, width, 64, 1),
                                    {80, store::JpegEncodeOptions::Chroma::k420, -1});
    script.frames = {frame};
    script.fps = 50;
    script.count = count;
    return testing::make_scripted_source(script);
  }
  static std::unique_ptr<FrameSource> refuse() {
    throw Error::failed("no data arrived in time", "tcp://camera", "Check the camera");
  }

  schemas::RecordingDocument::Session record(const Open& bad, Policy policy = Policy::kContinue) {
    schemas::RecordConfig config;
    config.name = "test";
    config.memory_mb = 100;
    config.when_lost = policy;
    for (const std::string id : {"a", "bad", "b"}) {
      config.cameras.push_back({id, schemas::RecordConfig::SimulatedSource{}});
    }
    std::mutex mutex;
    std::map<std::string, int> attempts;
    cameras_ = open_cameras(config, [&](const schemas::RecordConfig::Camera& camera) {
      const std::scoped_lock lock(mutex);
      const int attempt = attempts[camera.id]++;
      return camera.id == "bad" ? bad(attempt) : good();
    });
    absence_ = cameras_[1].absence;
    RecordingTake take =
        RecordingTake::create(path(),
                              make_take_document(config, cameras_, "node",
                                                 host_utc_now() - kNanosecondsPerSecond, "test"),
                              make_recording_rig(config, {}, cameras_), "node");
    RecorderOptions options = make_recorder_options(config);
    options.start_utc = 0;
    Recorder recorder(options, std::move(cameras_), take, "test");
    return recorder.run({});
  }
  std::filesystem::path path() const { return folder_.path() / "take"; }
  static std::string events(const schemas::RecordingDocument::Camera& camera) {
    std::string all;
    for (const auto& event : camera.events) all += event.what + "\n";
    return all;
  }
  void expect_good_ones(const schemas::RecordingDocument::Session& session) const {
    ASSERT_TRUE(session.audit);
    EXPECT_TRUE(session.audit->holds) << ::testing::PrintToString(session.audit->problems);
    const store::Take take(path());
    for (const int camera : {0, 2}) {
      EXPECT_EQ(session.cameras[camera].stored, 30U);
      EXPECT_EQ(take.archive(camera).frames().size(), 30U);
    }
  }

  std::string absence_;

 private:
  std::vector<RecorderCamera> cameras_;
  testing::TestFolder folder_;
};

TEST_F(AbsentCameras, DoNotKeepTheOthersFromBeingRecorded) {
  for (const Policy policy : {Policy::kContinue, Policy::kReconnect}) {
    const auto session = record([](int) { return refuse(); }, policy);
    expect_good_ones(session);
    EXPECT_EQ(session.stop_reason, "every source has ended");
    EXPECT_THAT(absence_, HasSubstr("no data arrived in time"));
    EXPECT_THAT(events(session.cameras[1]), HasSubstr("lost: absent at the start: "));
    EXPECT_EQ(session.cameras[1].arrived, 0U);
    std::filesystem::remove_all(path());
  }
}

TEST_F(AbsentCameras, AreTakenInWhenTheyCome) {
  const auto session = record([](int attempt) { return attempt < 2 ? refuse() : good(96, 25); });
  expect_good_ones(session);
  EXPECT_EQ(session.cameras[1].stored, 25U);
  EXPECT_EQ(store::Take(path()).archive(1).frames().size(), 25U);
  EXPECT_THAT(events(session.cameras[1]), HasSubstr("connected after "));
  EXPECT_THAT(session.cameras[1].source, ::testing::Not(HasSubstr("no data")));
}

TEST_F(AbsentCameras, AreNotRecordedInAnotherSizeThanTheirArchive) {
  const auto session = record([](int attempt) { return attempt < 1 ? refuse() : good(112); });
  expect_good_ones(session);
  EXPECT_EQ(session.cameras[1].stored, 0U);
  EXPECT_THAT(events(session.cameras[1]),
              HasSubstr("delivers 112 x 64 pixels, the take has 96 x 64: it is not recorded"));
}

TEST_F(AbsentCameras, AreTriedAgainWhileTheyHaveNoSize) {
  const auto session = record([](int attempt) {
    return attempt < 2 ? std::unique_ptr<FrameSource>(std::make_unique<StatedSize>(0, 0))
                       : good(96, 25);
  });
  expect_good_ones(session);
  EXPECT_THAT(absence_, HasSubstr("does not report the size of its frames"));
  EXPECT_EQ(session.cameras[1].stored, 25U);
  EXPECT_THAT(events(session.cameras[1]), ::testing::Not(HasSubstr("0 x 0")));
}

TEST_F(AbsentCameras, AreThoseWhoseFramesNoMemoryHolds) {
  const auto session = record([](int) { return std::make_unique<StatedSize>(65535, 65535); });
  expect_good_ones(session);
  EXPECT_THAT(absence_, HasSubstr("65535 x 65535 pixels are too large for the memory of 100 MB"));
}

TEST_F(AbsentCameras, EndARecordingThatEndsWithALostCamera) {
  EXPECT_THROW(record([](int) { return refuse(); }, Policy::kStop), Error);
  EXPECT_FALSE(std::filesystem::exists(path()));
}

TEST_F(AbsentCameras, AreNotThoseWhoseConfigurationIsWrong) {
  for (const Policy policy : {Policy::kContinue, Policy::kReconnect, Policy::kStop}) {
    try {
      record(
          [](int) -> std::unique_ptr<FrameSource> {
            throw ConfigurationError(Error::bad_input("no such option", "bad", "Correct it"));
          },
          policy);
      FAIL() << "recorded";
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
      EXPECT_EQ(error.what_happened(), "no such option");
    }
    EXPECT_FALSE(std::filesystem::exists(path()));
  }
}

TEST_F(AbsentCameras, CountInTheDataRate) {
  const auto rate_of = [](std::size_t absent) {
    std::vector<RecorderCamera> cameras(2 + absent);
    for (std::size_t i = 0; i < cameras.size(); ++i) {
      cameras[i].source = good(96, 10'000);
      if (i < 2) continue;
      cameras[i].source = std::make_unique<StatedSize>(96, 64);
      cameras[i].absence = "no data arrived in time";
    }
    return measure_data_rate(cameras, {}, 0.5);
  };
  const auto present = rate_of(0), all = rate_of(2);
  ASSERT_TRUE(present && all);
  EXPECT_GT(*present, 0);
  EXPECT_NEAR(*all / *present, 2, 0.6);
}

TEST(OpenCameras, AllAbsentIsTheFirstError) {
  schemas::RecordConfig config;
  config.cameras = {{"a", schemas::RecordConfig::SimulatedSource{}},
                    {"b", schemas::RecordConfig::SimulatedSource{}}};
  try {
    open_cameras(config,
                 [](const schemas::RecordConfig::Camera& camera) -> std::unique_ptr<FrameSource> {
                   throw Error::bad_input("gone", camera.id, "wait");
                 });
    FAIL() << "opened";
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
    EXPECT_EQ(error.where(), "a");
  }
}

TEST(OpenCameras, AnotherSizeThanInTheRigIsAbsent) {
  schemas::RecordConfig config;
  schemas::RigDocument rig;
  for (const std::string id : {"a", "b"}) {
    config.cameras.push_back({id, schemas::RecordConfig::SimulatedSource{}});
    schemas::RigDocument::Camera camera;
    camera.geometry.id = id;
    camera.geometry.width = 64;
    camera.geometry.height = 48;
    rig.cameras.push_back(camera);
  }
  const auto cameras = open_cameras(
      config,
      [](const schemas::RecordConfig::Camera& camera) {
        return std::make_unique<StatedSize>(camera.id == "a" ? 64 : 640, 48);
      },
      &rig);
  EXPECT_EQ(cameras[0].absence, "");
  EXPECT_THAT(cameras[1].absence, HasSubstr("is 64 x 48 pixels, but its source delivers 640 x 48"));
  EXPECT_EQ(cameras[1].source->description().width, 64);
}

}  // namespace
}  // namespace raystage::ingest
