// SPDX-License-Identifier: Apache-2.0
// Tests the main task by its commands: a take is imported, resynchronised and rendered.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <nlohmann/json.hpp>

#include "testing/render/synthetic_take.h"
#include "tests/end_to_end/run_command.h"

namespace raystage::pipeline_test {
namespace {

using ::testing::AllOf;
using testing::CommandResult;
using testing::find_files;
using ::testing::Ge;
using ::testing::Gt;
using ::testing::HasSubstr;
using ::testing::Le;
using ::testing::Lt;
using ::testing::Not;
using testing::read_text;
using testing::run;
using testing::write_text;

using nlohmann::json;

json evaluation_in(const std::filesystem::path& file) { return json::parse(read_text(file)); }

/// Lower bounds: the measured values minus a margin for other processors.
struct AtLeast {
  double psnr_db, ssim, covered;
};

/// Checks a view of an evaluation or the mean: every documented field exists and is plausible.
void expect_quality(const json& view, const AtLeast& least) {
  SCOPED_TRACE(view.dump());
  for (const char* field :
       {"psnr_db", "ssim", "coverage", "decode_ms", "render_ms", "decoded_per_needed"}) {
    ASSERT_TRUE(view.contains(field)) << field;
  }
  EXPECT_THAT(view.at("psnr_db").get<double>(), AllOf(Ge(least.psnr_db), Lt(60)));
  EXPECT_THAT(view.at("ssim").get<double>(), AllOf(Ge(least.ssim), Le(1)));
  EXPECT_THAT(view.at("coverage").get<double>(), AllOf(Ge(least.covered), Le(1)));
  constexpr double kMinute = 60'000;  // milliseconds
  EXPECT_THAT(view.at("decode_ms").get<double>(), AllOf(Gt(0), Lt(kMinute)));
  EXPECT_THAT(view.at("render_ms").get<double>(), AllOf(Gt(0), Lt(kMinute)));
}

/// Expects that all needed pixels and few others are decoded.
void expect_few_decoded(const json& view, double at_most) {
  EXPECT_THAT(view.at("decoded_per_needed").get<double>(), AllOf(Ge(1), Le(at_most)))
      << view.dump();
}

TEST(Pipeline, SimulateSyncRenderEvaluate) {
  const testing::TestFolder folder;
  const std::string take = (folder.path() / "take").string();
  const std::string frames = (folder.path() / "frames").string();
  const CommandResult simulated =
      run("raystage simulate -o '" + take +
          "' --rows 3 --columns 3 --width 128 --height 96 --seconds 2 --truth-views 2 --seed 5");
  ASSERT_EQ(simulated.exit_code, 0) << simulated.err;
  const CommandResult synchronised = run("raystage sync '" + take + "'");
  ASSERT_EQ(synchronised.exit_code, 0) << synchronised.err;
  EXPECT_THAT(synchronised.out, HasSubstr("Spread"));
  const CommandResult info = run("raystage info '" + take + "' --json");
  ASSERT_EQ(info.exit_code, 0) << info.err;
  EXPECT_FALSE(nlohmann::json::parse(info.out).empty());

  const std::string render = "raystage render '" + take + "/shot.json' -o '" + frames +
                             "/s.####.exr' --frames 1-8x3 --existing ";
  const CommandResult rendered = run(render + "error");
  ASSERT_EQ(rendered.exit_code, 0) << rendered.err;
  EXPECT_THAT(rendered.err, HasSubstr("Progress: 100%"));
  EXPECT_EQ(find_files(frames, ".exr").size(), 3U);
  const std::string first = read_text(frames + "/s.0001.exr");
  EXPECT_NE(run(render + "error").exit_code, 0);  // the frames exist
  EXPECT_EQ(run(render + "skip").exit_code, 0);
  const CommandResult quiet = run(render + "overwrite --threads 1 -q");
  EXPECT_EQ(quiet.exit_code, 0) << quiet.err;
  EXPECT_THAT(quiet.err, Not(HasSubstr("Progress")));
  EXPECT_EQ(read_text(frames + "/s.0001.exr"), first);  // same bytes for any number of threads
  // An incomplete file is rendered again.
  write_text(frames + "/s.0001.exr", first.substr(0, first.size() / 2));
  EXPECT_EQ(run(render + "skip").exit_code, 0);
  EXPECT_EQ(read_text(frames + "/s.0001.exr"), first);

  const CommandResult evaluated = run(
      "raystage evaluate '" + take + "' '" + take + "/views.json' --method focal_plane --out '" +
      frames + "' --json '" + frames + "/e.json' --table '" + frames + "/t.md'");
  ASSERT_EQ(evaluated.exit_code, 0) << evaluated.err;
  const json evaluation = evaluation_in(frames + "/e.json");
  EXPECT_EQ(evaluation.at("schema"), "raystage/evaluation/1");
  EXPECT_EQ(evaluation.at("take"), "simulated stage");
  EXPECT_EQ(evaluation.at("method"), "focal_plane");
  EXPECT_EQ(evaluation.at("cameras"), 9);
  EXPECT_NEAR(evaluation.at("focal_depth_m").get<double>(), 3.545, 0.05);
  const json& views = evaluation.at("views");
  ASSERT_EQ(views.size(), 2U);
  EXPECT_EQ(views[0].at("id"), "view000");
  EXPECT_EQ(views[1].at("id"), "view001");
  expect_quality(views[0], {23.4, 0.785, 0.99});
  expect_quality(views[1], {23.0, 0.76, 0.99});
  for (const json& view : views) {
    expect_few_decoded(view, 1.7);
    EXPECT_TRUE(std::filesystem::exists(frames + "/" + view.at("id").get<std::string>() + ".png"));
  }
  const json& mean = evaluation.at("mean");
  EXPECT_FALSE(mean.contains("id"));
  for (const auto& [field, value] : mean.items()) {
    if (field == "regions") continue;  // an object
    SCOPED_TRACE(field);
    const double sum = views[0].at(field).get<double>() + views[1].at(field).get<double>();
    EXPECT_NEAR(value.get<double>(), sum / 2, 1e-6);
  }
  EXPECT_THAT(read_text(frames + "/t.md"), HasSubstr("| focal_plane |"));

  const CommandResult preview = run("raystage preview '" + frames + "/s.####.exr' -o '" + frames +
                                    "/p.mp4' --contact-sheet '" + frames + "/c.png' -q");
  EXPECT_EQ(preview.exit_code, 0) << preview.err;
  EXPECT_THAT(preview.err, Not(HasSubstr("Progress")));
  EXPECT_GT(std::filesystem::file_size(frames + "/p.mp4"), 500U);
  EXPECT_GT(std::filesystem::file_size(frames + "/c.png"), 500U);
  EXPECT_TRUE(find_files(folder.path(), ".tmp").empty());
}

TEST(Pipeline, LeftOutCamerasAreTheTruth) {
  const testing::TestFolder folder;
  const std::string take = (folder.path() / "take").string();
  testing::SyntheticTake settings;
  settings.cameras = testing::camera_grid(3, 3, 0.06, 96, 72, {-0.2, 0.03, 0, 0, 0});
  write_synthetic_take(settings, take);
  const CommandResult result =
      run("raystage evaluate '" + take + "' --exclude-cameras r1c1 --focal-depth 4 --json '" +
          take + "/e.json' --quiet");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(result.err, "");
  const json evaluation = evaluation_in(take + "/e.json");
  EXPECT_EQ(evaluation.at("cameras"), 8);
  ASSERT_EQ(evaluation.at("views").size(), 1U);
  EXPECT_EQ(evaluation.at("views")[0].at("id"), "r1c1");
  expect_quality(evaluation.at("views")[0], {42, 0.992, 0.93});  // the scene is on the focal plane
  EXPECT_THAT(run("raystage info '" + take + "' >/dev/full").err, HasSubstr("No space left"));
  EXPECT_EQ(run("raystage evaluate '" + take + "' --exclude-cameras nobody").exit_code, 2);
  EXPECT_EQ(run("raystage evaluate '" + take + "' --focal-depth -1").exit_code, 2);
}

TEST(Pipeline, InterruptedRendersLeaveOnlyWholeFrames) {
  const testing::TestFolder folder;
  const std::string take = (folder.path() / "take").string();
  testing::SyntheticTake settings;
  settings.cameras = testing::camera_grid(2, 2, 0.06, 320, 240);
  write_synthetic_take(settings, take);
  ASSERT_EQ(run("raystage sync '" + take + "'").exit_code, 0);
  write_text(folder.path() / "shot.json", R"({"schema": "raystage/shot/1", "name": "s",
    "width": 1280, "height": 960, "fps": 24, "first_frame": 1, "last_frame": 2000,
    "camera": [{"frame": 1, "position": [0, 0, 0.0], "orientation": [1, 0, 0, 0],
    "horizontal_fov_deg": 40}], "layers": [{"name": "lf", "take": "take", "speed": 0,
    "method": "focal_plane", "focal_plane": {"depth_m": 4}}]})");
  for (const int signal : {SIGINT, SIGTERM}) {
    const auto frames = folder.path() / ("frames" + std::to_string(signal));
    const CommandResult result =
        testing::run_and_signal("raystage render '" + (folder.path() / "shot.json").string() +
                                    "' -o '" + frames.string() + "/s.####.exr'",
                                signal, frames / "s.0003.exr");
    EXPECT_EQ(result.exit_code, 128 + signal) << result.err;
    EXPECT_TRUE(find_files(frames, ".tmp").empty());
    const std::size_t written = find_files(frames, ".exr").size();
    EXPECT_GE(written, 3U);
    EXPECT_LT(written, 2000U);
    const CommandResult resumed =  // complete files are kept: nothing is left to render
        run("raystage render '" + (folder.path() / "shot.json").string() + "' -o '" +
            frames.string() + "/s.####.exr' --frames 1-3 --existing skip");
    EXPECT_EQ(resumed.exit_code, 0) << resumed.err;
  }
}

/// Captured light fields. Views of shop are in the middle between four cameras, where a
/// triangulation blends only two of them (docs/benchmarks.md).
struct Captured {
  const char* set;
  const char* options;
  std::size_t views;
  AtLeast least;  ///< of the mean
  friend void PrintTo(const Captured& captured, std::ostream* out) { *out << captured.set; }
};

class CapturedLightField : public ::testing::TestWithParam<Captured> {};

TEST_P(CapturedLightField, ComesOutAsWellAsItCanOnOnePlane) {
  const auto data = testing::find_captured_data(GetParam().set);
  if (!data) GTEST_SKIP() << "no captured light field " << GetParam().set;
  const testing::TestFolder folder;
  const std::string take = (folder.path() / "take").string();
  ASSERT_EQ(run("raystage import '" + data->string() + "/import.json' -o '" + take +
                "' --restart-markers")
                .exit_code,
            0);
  const CommandResult result =
      run("raystage evaluate '" + take + "' '" + data->string() + "/views.json' " +
          GetParam().options + " --json '" + take + "/e.json'");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const json evaluation = evaluation_in(take + "/e.json");
  EXPECT_EQ(evaluation.at("views").size(), GetParam().views);
  expect_quality(evaluation.at("mean"), GetParam().least);
  for (const json& view : evaluation.at("views")) expect_few_decoded(view, 1.05);

  ASSERT_EQ(run("raystage sync '" + take + "'").exit_code, 0);
  write_text(take + "/shot.json", R"({"schema": "raystage/shot/1", "name": "s", "width": 480,
    "height": 320, "fps": 24, "first_frame": 1, "last_frame": 2, "camera": [{"frame": 1,
    "position": [0.01, 0.01, 0.02], "orientation": [1, 0, 0, 0], "horizontal_fov_deg": 40}],
    "layers": [{"name": "lf", "take": ".", "speed": 0, "method": "focal_plane",
    "focal_plane": "best"}]})");
  const CommandResult rendered =
      run("raystage render '" + take + "/shot.json' -o '" + take + "/f.####.exr'");
  EXPECT_EQ(rendered.exit_code, 0) << rendered.err;
  EXPECT_EQ(find_files(take, ".exr").size(), 2U);
}

INSTANTIATE_TEST_SUITE_P(
    Sets, CapturedLightField,
    ::testing::Values(Captured{"shop", "--focal-depth 8.69", 3, {28.1, 0.77, 0.98}},
                      Captured{"stanford_chess9x9", "--focal-depth best", 56, {30.4, 0.905, 0.99}}),
    [](const auto& test) { return std::string(test.param.set); });

}  // namespace
}  // namespace raystage::pipeline_test
