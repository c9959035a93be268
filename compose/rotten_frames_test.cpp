// SPDX-License-Identifier: Apache-2.0
// Stored frames that are not as they were recorded: their cameras are absent, and the files say so.
#include <OpenEXR/ImfInputFile.h>
#include <OpenEXR/ImfStringVectorAttribute.h>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <fstream>
#include <vector>

#include "base/atomic_file.h"
#include "compose/exr/exr_file.h"
#include "images/exr_reader.h"
#include "testing/compose/sequence_test_data.h"
#include "testing/render/test_matte.h"

namespace raystage::compose::rotten_frames_test {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::ThrowsMessage;

constexpr int kShown = 104;  // shows tick 3

class RottenFramesOfTakes : public testing::SequenceTest {
 protected:
  void SetUp() override {
    SequenceTest::SetUp();
    options_.existing = ExistingFiles::kOverwrite;
    archive_ = folder_.path() / "take" / "archive" / "c1.mkv";
    whole_ = read_file(archive_);
  }

  /// Changes one bit of the entropy-coded data of camera c1 at the tick that kShown shows.
  void rot() const {
    const store::Take take(folder_.path() / "take");
    const store::Timeline timeline = store::read_timeline(take);
    const store::FrameRecord frame = take.archive(1).frames()[timeline.ticks[kTick].frame[1]];
    std::string bytes = whole_;
    bytes[static_cast<std::size_t>(frame.offset + frame.size - frame.size / 4)] ^= 1;
    write_file_atomically(archive_, bytes);
  }
  void mend() const { write_file_atomically(archive_, whole_); }

  std::vector<float> pixels() const { return read_exr(file(kShown)).rgba; }
  std::vector<float> coverage() const {
    constexpr images::ExrChannel kCoverage[] = {{"coverage.V"}};
    return images::read_exr_channels(file(kShown), kCoverage, "").values;
  }
  std::vector<std::string> rotten(int frame) const {
    return read_frame_quality(file(frame)).rotten_cameras;
  }

  static constexpr int kTick = kShown - 101;
  std::filesystem::path archive_;
  std::string whole_;
};

TEST_F(RottenFramesOfTakes, CamerasAreAbsentAndTheFileSaysSo) {
  const std::filesystem::path timeline_file = folder_.path() / "take" / "timeline.zst";
  for (const char* method :
       {"focal_plane", "lumigraph", "aperture", "slabs", "plane_sweep", "depth"}) {
    SCOPED_TRACE(method);
    shot_.layers.front().method = method;
    mend();
    const std::string timeline = read_file(timeline_file);
    {
      const store::Take take(folder_.path() / "take");
      store::Timeline without = store::read_timeline(take);
      without.ticks[kTick].frame[1] = -1;
      store::write_timeline(without, take.folder());
    }
    EXPECT_EQ(run().exit_code(), ExitCode::kSuccess);
    const std::vector<float> expected = pixels(), expected_coverage = coverage();
    write_file_atomically(timeline_file, timeline);

    rot();
    options_.existing = ExistingFiles::kOverwrite;
    SequenceReport report = run();
    EXPECT_EQ(report.exit_code(), ExitCode::kFellShort);
    EXPECT_THAT(report.frames_with_rot, ElementsAre(kShown));
    EXPECT_EQ(report.rendered, 6);
    EXPECT_THAT(rotten(kShown), ElementsAre("c1"));
    EXPECT_THAT(rotten(kShown + 1), IsEmpty());
    EXPECT_EQ(pixels(), expected);
    EXPECT_EQ(coverage(), expected_coverage);
    EXPECT_THAT(messages_, Contains(HasSubstr("frame 104 was rendered without cameras")));
    EXPECT_THAT(report.summary(),
                HasSubstr("1 without cameras whose stored frames were rotten (104)"));

    options_.existing = ExistingFiles::kSkip;
    report = run();
    EXPECT_EQ(report.skipped, 6);
    EXPECT_EQ(report.exit_code(), ExitCode::kFellShort);

    mend();
    options_.existing = ExistingFiles::kOverwrite;
    EXPECT_EQ(run().exit_code(), ExitCode::kSuccess);
    EXPECT_THAT(rotten(kShown), IsEmpty());
    EXPECT_NE(coverage(), expected_coverage);
  }
}

// The archive is a copy that was interrupted: the timeline still fits, and frames without the lost
// ones are as before.
TEST_F(RottenFramesOfTakes, FramesLostWithTheEndOfAnArchiveAreRotten) {
  ASSERT_EQ(run().exit_code(), ExitCode::kSuccess);
  const std::string before = read_file(file(kShown - 1));
  const store::Take take(folder_.path() / "take");
  const int frame = store::read_timeline(take).ticks[kTick].frame[1];
  const std::uint64_t end = take.archive(1).frames()[static_cast<std::size_t>(frame)].offset;
  std::filesystem::resize_file(archive_, end);
  const SequenceReport report = run();
  EXPECT_EQ(report.exit_code(), ExitCode::kFellShort);
  EXPECT_THAT(report.frames_with_rot, ElementsAre(kShown, kShown + 1, kShown + 2));
  EXPECT_THAT(rotten(kShown), ElementsAre("c1"));
  EXPECT_EQ(read_file(file(kShown - 1)), before);
  options_.rotten_frames = store::RottenFrames::kError;
  EXPECT_EQ(run().exit_code(), ExitCode::kSomeFramesFailed);
}

TEST_F(RottenFramesOfTakes, AMissingArchiveIsAnErrorOrItsCameraIsAbsent) {
  std::filesystem::remove(archive_);
  EXPECT_THAT([&] { run(); },
              ThrowsMessage<Error>(AllOf(HasSubstr("the archive of camera \"c1\" is missing"),
                                         HasSubstr("--missing-archives absent"))));
  options_.accepts_missing_archives = true;
  const SequenceReport report = run();
  EXPECT_EQ(report.exit_code(), ExitCode::kSuccess);
  EXPECT_EQ(report.rendered, 6);
  const Imf::InputFile frame(file(kShown).c_str());
  const auto& absent =
      frame.header().typedAttribute<Imf::StringVectorAttribute>("lf:absentCameras").value();
  EXPECT_THAT(absent, Contains("c1"));
  EXPECT_THAT(messages_, Contains(HasSubstr("the archives of 1 of ")));
  for (int camera = 0; camera < testing::kCameras; ++camera) {
    std::filesystem::remove(archive_.parent_path() / fmt::format("c{}.mkv", camera));
  }
  EXPECT_THAT([&] { run(); }, ThrowsMessage<Error>(HasSubstr("archives of all cameras")));
  EXPECT_THAT(rotten(kShown), IsEmpty());
}

/// Methods whose frames are not compared above.
TEST_F(RottenFramesOfTakes, OtherMethodsRenderWithoutTheCamera) {
  const std::vector<std::uint8_t> opaque(
      static_cast<std::size_t>(testing::kWidth) * static_cast<std::size_t>(testing::kHeight), 255);
  for (int camera = 0; camera < testing::kCameras; ++camera) {
    for (int frame = 0; frame < testing::kTicks; ++frame) {
      testing::write_matte(folder_.path() / "take", "c" + std::to_string(camera), frame,
                           testing::kWidth, testing::kHeight, opaque);
    }
  }
  struct Way {
    std::string method;
    schemas::OptionValues options = {};
  };
  for (const Way& way :
       {Way{"auto", {{"target_error", 20.0}}}, Way{"nearest"}, Way{"visual_hull"}}) {
    SCOPED_TRACE(way.method);
    shot_.layers.front().method = way.method;
    shot_.layers.front().options = way.options;
    mend();
    EXPECT_EQ(run().exit_code(), ExitCode::kSuccess);
    rot();
    const SequenceReport report = run();
    EXPECT_EQ(report.exit_code(), ExitCode::kFellShort);
    EXPECT_EQ(report.rendered, 6);
    EXPECT_THAT(report.frames_with_rot, Contains(kShown));
    EXPECT_THAT(rotten(kShown), ElementsAre("c1"));
  }
}

TEST_F(RottenFramesOfTakes, TemporalFiltersLackTheCamerasOfAdjacentTicks) {
  shot_.layers.front().method = "depth";
  shot_.layers.front().options = {{"temporal", true}};
  rot();
  const SequenceReport report = run();
  EXPECT_EQ(report.exit_code(), ExitCode::kFellShort);
  for (const int frame : {kShown - 1, kShown, kShown + 1}) {
    EXPECT_THAT(rotten(frame), ElementsAre("c1")) << frame;
  }
  EXPECT_THAT(rotten(101), IsEmpty());
}

TEST_F(RottenFramesOfTakes, LightFieldsThatAreLightsLackTheCamera) {
  std::ofstream(folder_.path() / "square.obj")
      << "v -0.5 -0.5 0\nv 0.5 -0.5 0\nv 0.5 0.5 0\nv -0.5 0.5 0\nf 1 2 3 4\n";
  shot_.layers.front().name = "wall";
  schemas::ShotDocument::Layer mirror;
  mirror.geometry = schemas::ShotDocument::Geometry{
      .file = "square.obj",
      .material = schemas::ShotDocument::Material{.kind = "mirror", .color = {{1, 1, 1}}},
      .keys = {{.frame = 101,
                .position = {{0.03, -0.03, -2}},
                .orientation = {{0.7934, -0.6088, 0, 0}}}},  // reflects rays to the wall
      .samples = 4};
  shot_.layers.front().opacity = 0;  // a light only
  shot_.layers.push_back(mirror);
  shot_.lights = {{.light_field = "wall"}};
  rot();
  const SequenceReport report = run();
  EXPECT_EQ(report.exit_code(), ExitCode::kFellShort);
  EXPECT_THAT(rotten(kShown), ElementsAre("c1"));
  EXPECT_THAT(rotten(kShown + 1), IsEmpty());
}

TEST_F(RottenFramesOfTakes, FailTheFrameOnRequest) {
  rot();
  options_.rotten_frames = store::RottenFrames::kError;
  const SequenceReport report = run();
  EXPECT_EQ(report.exit_code(), ExitCode::kSomeFramesFailed);
  ASSERT_EQ(report.failures.size(), 1U);
  EXPECT_EQ(report.failures[0].frame, kShown);
  EXPECT_THAT(report.failures[0].what,
              HasSubstr("c1.mkv: frame 3 of camera \"c1\" is not as it was recorded"));
}

TEST_F(RottenFramesOfTakes, RaysAvoidThemToo) {
  rot();
  shot_.layers.front().method = "lumigraph";
  shot_.camera.projection = schemas::ShotDocument::Camera::Projection::kEquirectangular;
  shot_.width = 64;
  shot_.height = 32;
  options_.frames = {kShown, kShown + 1};
  const SequenceReport report = run();
  EXPECT_EQ(report.exit_code(), ExitCode::kFellShort);
  EXPECT_THAT(rotten(kShown), ElementsAre("c1"));
  EXPECT_THAT(rotten(kShown + 1), IsEmpty());
}

}  // namespace
}  // namespace raystage::compose::rotten_frames_test
