// SPDX-License-Identifier: Apache-2.0
// Errors before a sequence starts, and frames that fail.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <random>

#include "base/atomic_file.h"
#include "store/archive.h"
#include "store/jpeg/encode.h"
#include "testing/compose/sequence_test_data.h"
#include "testing/compose/test_camera_key.h"

namespace raystage::compose::sequence_failures_test {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;

using testing::kCameras;
using testing::kHeight;
using testing::kInterval;
using testing::kTicks;
using testing::kWidth;

class SequenceFailures : public testing::SequenceTest {};

/// Replaces a camera's frames by noise, whose JPEG files are larger than a page.
void make_noisy(const std::filesystem::path& take_folder) {
  const std::filesystem::path archive = take_folder / "archive" / "c0.mkv";
  const std::filesystem::path journal = take_folder / "archive" / "c0.journal";
  ASSERT_TRUE(std::filesystem::remove(archive) && std::filesystem::remove(journal));
  store::ArchiveWriter writer(archive, journal,
                              {"c0", kWidth, kHeight, 1'700'000'000 * kNanosecondsPerSecond});
  std::mt19937 random(1);
  for (int tick = 0; tick < kTicks; ++tick) {
    store::RgbImage image(kWidth, kHeight);
    for (std::uint8_t& value : image.values) value = static_cast<std::uint8_t>(random());
    const auto jpeg = store::encode_jpeg(image, {.quality = 100});
    ASSERT_GT(jpeg.size(), 8192U);
    writer.append(jpeg, kInterval + tick * kInterval);
  }
  writer.close();
}

TEST_F(SequenceFailures, AnArchiveThatIsCutMeanwhileCostsTheFramesThatAreLost) {
  const std::filesystem::path archive = folder_.path() / "take" / "archive" / "c0.mkv";
  make_noisy(folder_.path() / "take");
  const store::Take noisy(folder_.path() / "take");
  store::write_timeline(store::build_timeline(noisy, 10, 0), noisy.folder());
  const std::string whole = read_file(archive);
  for (const char* method : {"focal_plane", "depth"}) {
    write_file_atomically(archive, whole);
    shot_.layers.front().method = method;
    options_.output = (folder_.path() / method / "a.####.exr").string();
    options_.frames_in_flight = 1;
    options_.on_message = [&](std::string_view line) {
      if (line.starts_with("writing")) std::filesystem::resize_file(archive, whole.size() / 2);
    };
    const SequenceReport report = run();
    EXPECT_EQ(report.exit_code(), ExitCode::kSomeFramesFailed) << method;
    ASSERT_EQ(report.failures.size(), 4U) << method;
    EXPECT_EQ(report.failures.front().frame, 103);  // the truncated one
    EXPECT_THAT(report.failures.back().what, HasSubstr("frame 5 cannot be read"));
  }
}

TEST_F(SequenceFailures, ADamagedFrameFailsAloneAndIsNamed) {
  {
    const store::Take take(folder_.path() / "take");
    for (int camera = 0; camera < kCameras; ++camera) {
      // By time, because camera 3 dropped a frame.
      const auto index = take.archive(camera).nearest_frame(kInterval * 4);
      const store::FrameRecord record = take.archive(camera).frames()[index.value()];
      std::fstream archive(folder_.path() / "take" / take.document().cameras[camera].archive,
                           std::ios::in | std::ios::out | std::ios::binary);
      archive.seekp(static_cast<std::streamoff>(record.offset));
      archive << "damaged";
    }
  }
  const SequenceReport report = run();
  EXPECT_EQ(report.exit_code(), ExitCode::kSomeFramesFailed);
  EXPECT_EQ(report.rendered, 5);
  ASSERT_EQ(report.failures.size(), 1U);
  EXPECT_EQ(report.failures[0].frame, 104);
  EXPECT_THAT(report.summary(), HasSubstr("1 failed (104)"));
  EXPECT_THAT(messages_, Contains(HasSubstr("frame 104 failed")));
  EXPECT_THAT(report.failures[0].what, HasSubstr("shot.json#/layers/0: "));
  EXPECT_FALSE(std::filesystem::exists(file(104)));
  EXPECT_EQ(files(), 5);
  EXPECT_EQ(progress_, 1);
}

TEST_F(SequenceFailures, FramesThatAllFailByBadInputNeedNoRetry) {
  // The folder exists, without mattes.
  std::filesystem::create_directories(folder_.path() / "take" / "mattes");
  shot_.layers[0].method = "visual_hull";
  const SequenceReport report = run();
  EXPECT_EQ(report.failures.size(), 6U);
  EXPECT_EQ(report.exit_code(), ExitCode::kBadInput);
  EXPECT_THAT(messages_, Contains(HasSubstr("no camera has a matte")));
}

TEST_F(SequenceFailures, ChecksTheMethodsOptionsFirst) {
  const struct {
    const char* method;
    schemas::OptionValues options;
    const char* said;
  } cases[] = {
      {"aperture", {{"radius", 0.5}, {"f_number", 2.0}}, "both options radius and f_number"},
      {"aperture",
       {{"depth_map", std::string("none.exr")}},
       "a file that frame 101 needs is missing"},
      {"focal_plane", {{"objects", std::string("none.json")}}, "none.json"},
      {"plane_sweep", {{"p1", 50.0}, {"p2", 10.0}}, "p2 is less than p1"},
      {"plane_sweep", {{"near", 5.0}, {"far", 2.0}}, "far is less than near"},
      {"depth", {{"near", 5.0}, {"far", 2.0}}, "far is less than near"},
      {"lumigraph", {{"proxy", std::string("mesh")}}, "the option mesh is empty"},
      {"lumigraph", {{"proxy", std::string("mesh")}, {"mesh", std::string("no.ply")}}, "no.ply"},
      {"visual_hull", {}, "has no mattes"},
  };
  for (const auto& wrong : cases) {
    shot_.layers[0].method = wrong.method;
    shot_.layers[0].options = wrong.options;
    EXPECT_THAT(refusal(), HasSubstr(wrong.said)) << wrong.method;
    EXPECT_EQ(files(), 0);
  }
}

TEST_F(SequenceFailures, ChecksEverythingFirst) {
  options_.output = (folder_.path() / "still.exr").string();
  EXPECT_THAT(refusal(), HasSubstr("same name"));
  options_.output = (folder_.path() / "a.####.png").string();
  EXPECT_THAT(refusal(), HasSubstr("output is not .exr"));
  options_.output = (shot_file() / "a.####.exr").string();
  EXPECT_NE(refusal(ExitCode::kFailed), "no error") << "a file where the folder should be";
  options_.output = (folder_.path() / "out" / "a.####.exr").string();
  options_.memory_bytes = 1000;
  EXPECT_THAT(refusal(), HasSubstr("memory budget"));
  options_.memory_bytes = 0;
  shot_.layers[0].method = "magic";
  EXPECT_THAT(refusal(), HasSubstr("magic"));
  shot_.layers[0].method = "focal_plane";
  shot_.layers[0].take = "elsewhere";
  EXPECT_THAT(refusal(), HasSubstr("shot.json#/layers/0: " + folder_.path().string()));
  shot_.layers[0].name = "wall";
  EXPECT_THAT(refusal(), HasSubstr("shot.json#/layers/0 (wall): " + folder_.path().string()));
  shot_.layers[0].take = "take";
  std::filesystem::remove(folder_.path() / "take" / "timeline.zst");
  EXPECT_THAT(refusal(), HasSubstr("raystage sync"));
  EXPECT_EQ(files(), 0);
}

TEST_F(SequenceFailures, MemoryIsWhatTheHeaviestFrameTakesWhereverItIs) {
  options_.memory_bytes = 1000;
  options_.missing = MissingFrames::kHold;
  shot_.first_frame = 1;
  shot_.last_frame = 100;
  shot_.camera.keys = {testing::camera_key(1, {0.03, -0.03, 0}, 10),
                       testing::camera_key(100, {0.04, -0.03, 0}, 10)};
  EXPECT_THAT(refusal(), HasSubstr("one frame needs 67.3 MB"));  // 64 MiB of cache; 1200 pixels
  const auto zoom = [](double frame, double degrees) {
    return testing::camera_key(frame, {0.035, -0.03, 0}, degrees);
  };
  shot_.camera.keys.insert(shot_.camera.keys.begin() + 1,
                           {zoom(50, 10), zoom(51, 100), zoom(52, 10)});
  // In addition 4 x 4 samples of 24 bytes.
  EXPECT_THAT(refusal(), HasSubstr("one frame needs 67.7 MB"));
}

}  // namespace
}  // namespace raystage::compose::sequence_failures_test
