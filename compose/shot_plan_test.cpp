// SPDX-License-Identifier: Apache-2.0
#include "compose/shot_plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <set>

#include "base/atomic_file.h"
#include "evaluation/evaluation_cases.h"
#include "testing/compose/sequence_test_data.h"

namespace raystage::compose::shot_plan_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

using testing::kInterval;

class ShotPlans : public testing::SequenceTest {};

TEST_F(ShotPlans, AFrameThatLooksBesideDependsOnTheTicksThere) {
  const auto fingerprints = [&](bool temporal) {
    shot_.layers.front().method = "depth";
    shot_.layers.front().options = {{"temporal", temporal}};
    schemas::write_shot(shot_, shot_file());
    const ShotPlan plan(shot_file());
    std::vector<std::string> prints;
    for (const int tick : {0, 1, 2})
      prints.push_back(plan.fingerprint({101 + tick, {{tick, false}}}, false));
    return prints;
  };
  const auto alone = fingerprints(false), beside = fingerprints(true);
  store::Timeline timeline = store::read_timeline(store::Take(folder_.path() / "take"));
  timeline.ticks[0].frame[1] = -1;
  timeline.ticks[0].difference[1] = 0;
  store::write_timeline(timeline, folder_.path() / "take");
  const auto alone_now = fingerprints(false), beside_now = fingerprints(true);
  EXPECT_NE(alone_now[0], alone[0]);
  EXPECT_EQ(alone_now[1], alone[1]);
  EXPECT_NE(beside_now[1], beside[1]);
  EXPECT_EQ(beside_now[2], beside[2]);
}

/// The views that each frame of the whole shot states for its light field frame.
std::vector<std::size_t> views_stated(const ShotPlan& plan, std::span<const int> frames) {
  std::vector<std::size_t> counts;
  for (const PlannedFrame& frame : plan.plan(frames, MissingFrames::kHold)) {
    counts.push_back(frame.views_shown(0).size());
  }
  return counts;
}

TEST_F(ShotPlans, StatesTheViewsThatAMovingTakeShows) {
  shot_.layers.front().method = "depth";
  const auto stated = [&] {
    schemas::write_shot(shot_, shot_file());
    return views_stated(ShotPlan(shot_file()), std::array{101, 103, 105});
  };
  EXPECT_THAT(stated(), ElementsAre(1, 1, 1));
  shot_.layers.front().speed = 0.5;  // two frames of the shot for each tick
  EXPECT_THAT(stated(), ElementsAre(2, 2, 2)) << "also of frames that are not asked for";
  shot_.last_frame = 140;
  shot_.layers.front().speed = 0.27;  // three or four frames for each tick
  for (const std::size_t views : stated()) EXPECT_THAT(views, ::testing::AnyOf(2, 3, 4));
  shot_.layers.front().speed = 0.22;  // four or five: too many in the mean, of all alike
  EXPECT_THAT(stated(), ElementsAre(0, 0, 0));
  shot_.layers.front().speed = 0;
  EXPECT_THAT(stated(), ElementsAre(0, 0, 0)) << "any view may be shown of a time that stands";
  shot_.last_frame = 106;
  shot_.layers.front().speed = 1;
  shot_.camera.stereo = schemas::ShotDocument::Stereo{};
  EXPECT_THAT(stated(), ElementsAre(2, 2, 2));
  shot_.camera.stereo.reset();
  for (const char* option : {"temporal", "all_cameras"}) {
    shot_.layers.front().options = {{option, true}};
    EXPECT_THAT(stated(), ElementsAre(0, 0, 0)) << option;
  }
  shot_.layers.front().options.clear();
  shot_.layers.front().method = "plane_sweep";
  EXPECT_THAT(stated(), ElementsAre(0, 0, 0)) << "its views do not depend on others";
}

TEST_F(ShotPlans, AFrameDependsOnTheViewsOfItsLightFieldFrame) {
  shot_.layers.front().method = "depth";
  shot_.layers.front().speed = 0.5;
  const auto prints = [&] {
    schemas::write_shot(shot_, shot_file());
    const ShotPlan plan(shot_file());
    std::vector<std::string> found;
    for (const PlannedFrame& frame : plan.plan(std::array{101, 104}, MissingFrames::kHold)) {
      found.push_back(plan.fingerprint(frame, false));
    }
    return found;
  };
  shot_.camera.keys = {testing::camera_key(101, {0.03, -0.03, 0}, 40),
                       testing::camera_key(102, {0.03, -0.03, 0}, 40),
                       testing::camera_key(103, {0.04, -0.03, 0}, 40)};
  const auto before = prints();
  shot_.camera.keys[1] = testing::camera_key(102, {0.035, -0.03, 0}, 40);
  const auto after = prints();
  EXPECT_NE(after[0], before[0]) << "frame 102 shows the tick of 101 from elsewhere";
  EXPECT_EQ(after[1], before[1]);
}

TEST_F(ShotPlans, ShowAllViewsWhileTheShutterIsOpen) {
  shot_.layers.front().method = "depth";
  for (auto& key : shot_.camera.keys) key.shutter_deg = 180;
  shot_.camera.keys.back().position = {{0.14, -0.03, 0}};
  for (const bool exact : {false, true}) {
    using Time = schemas::ShotDocument::Layer::Time;
    shot_.layers.front().time = exact ? Time::kExact : Time::kTick;
    schemas::write_shot(shot_, shot_file());
    const ShotPlan plan(shot_file());
    const PlannedFrame frame = plan.plan(std::array{103}, MissingFrames::kHold).front();
    const std::vector<PlannedFrame> samples = plan.exposure_of(frame);
    ASSERT_GE(samples.size(), 3U);
    for (const PlannedFrame& sample : samples) {
      const double x = plan.camera(sample.time(), Eye::kBoth).pose.position.x();
      double nearest = 1;
      for (const render::VirtualCamera& view : sample.views_shown(0)) {
        nearest = std::min(nearest, std::abs(view.pose.position.x() - x));
      }
      EXPECT_LT(nearest, 1e-3) << "at " << sample.offset << ", exact " << exact;
    }
  }
}

/// `evaluate` and `bench` use the same settings as `render`.
TEST_F(ShotPlans, EvaluationsShowTheInstantsThatAShotShows) {
  shot_.layers[0].start_seconds = -0.13;
  shot_.layers[0].speed = 0.37;
  shot_.last_frame = 130;
  schemas::write_shot(shot_, shot_file());
  const ShotPlan plan(shot_file());
  const LightFieldLayer& light_field = *plan.light_field(0);
  std::set<int> shown;
  for (int frame = shot_.first_frame; frame <= shot_.last_frame; ++frame) {
    schemas::ViewsDocument views;
    views.views.emplace_back().time_ns = light_field.take_time(frame);
    const auto subjects = evaluation::make_evaluation_cases(light_field.take(),
                                                            &light_field.timeline(), views, {}, {});
    const std::optional<int> tick = light_field.tick_at(frame);
    shown.insert(tick.value_or(-1));
    const store::FrameSelection& frames = subjects.at(0).frames;
    if (!tick) {
      EXPECT_EQ(frames.present(), 0) << frame;
      continue;
    }
    const store::FrameSelection& expected = light_field.timeline().ticks[*tick];
    EXPECT_EQ(frames.time_ns, expected.time_ns) << frame;
    EXPECT_EQ(frames.frame, expected.frame) << frame;
  }
  EXPECT_THAT(shown, ElementsAre(-1, 0, 1, 2, 3, 4, 5));
}

TEST_F(ShotPlans, ATargetKeepsHowDeepTheLayerSaysItsSceneIs) {
  shot_.layers[0].method = "depth";
  shot_.layers[0].options = {{"near", 1.5}, {"far", 6.0}, {"neighbours", 4.0}};
  schemas::write_shot(shot_, shot_file());
  const ShotPlan plan(shot_file(), {.target = {{"target_error", 30.0}}});
  const render::ReconstructionOptions& reconstruction = plan.light_field(0)->reconstruction();
  EXPECT_EQ(reconstruction.method, "auto");
  EXPECT_EQ(render::options_to_text(reconstruction.options), "far=6,near=1.5,target_error=30");
}

TEST_F(ShotPlans, WithoutADepthRangeAutoNeedsAPlaneOrDepths) {
  const auto file = folder_.path() / "take" / "take.json";
  std::string text = read_file(file);
  const std::size_t at = text.find("\"depth_range_m\"");
  ASSERT_NE(at, std::string::npos);
  text.replace(at, std::string("\"depth_range_m\"").size(), "\"x_range\"");
  std::ofstream(file) << text;
  const auto plane = [&] {
    schemas::write_shot(shot_, shot_file());
    const ShotPlan plan(shot_file(), {.target = options_.target});
    return plan.light_field(0)->reconstruction().focal_plane;
  };
  shot_.layers[0].method = "auto";
  EXPECT_THAT(refusal(), HasSubstr("no depth range"));
  shot_.layers[0].options = {{"near", 2.0}, {"far", 6.0}};
  EXPECT_NEAR(std::abs(plane()[3]), 3, 1e-9);
  shot_.layers[0].method = "depth";
  options_.target = {{"target_error", 30.0}};
  EXPECT_NEAR(std::abs(plane()[3]), 3, 1e-9);
}

TEST_F(ShotPlans, TheBestPlaneNeedsADepthRange) {
  schemas::TakeDocument take = schemas::read_take(folder_.path() / "take" / "take.json");
  take.depth_range.reset();
  schemas::write_take(take, folder_.path() / "take" / "take.json");
  const std::string text = refusal();
  EXPECT_THAT(text, HasSubstr("depth range"));
  EXPECT_THAT(text, HasSubstr("shot.json#/layers/0/focal_plane"));
}

TEST_F(ShotPlans, HeaderTellsWhatIsAbsentAndWhen) {
  schemas::write_shot(shot_, shot_file());
  const ShotPlan plan(shot_file());
  const auto frames = plan.plan(std::vector<int>{101, 103}, MissingFrames::kError);
  EXPECT_TRUE(plan.metadata(frames[0]).absent_cameras.empty());
  EXPECT_THAT(plan.metadata(frames[1]).absent_cameras, ElementsAre("c3"));
  const LightFieldLayer& light_field = *plan.light_field(0);
  const Nanoseconds first = light_field.timeline().ticks[0].time_ns;
  EXPECT_EQ(plan.metadata(frames[1]).capture_utc,
            light_field.take().document().epoch_utc + first + 2 * kInterval);
  EXPECT_EQ(plan.metadata(frames[0]).capture_rate, 10);
}

TEST_F(ShotPlans, FocalPlanesOfEveryKind) {
  schemas::write_shot(shot_, shot_file());
  const ShotPlan plan(shot_file());
  const rig::Rig& rig = plan.light_field(0)->take().rig();
  using Kind = schemas::ShotDocument::FocalPlane::Kind;
  const auto equation = [&](const schemas::ShotDocument::FocalPlane& plane) {
    return focal_plane_equation(plane, rig, schemas::DepthRange{2, 6}, "here");
  };
  // 2 / (1/2 + 1/6) = 3 m in front of an array that looks along -z.
  const Eigen::Vector4d best = equation({Kind::kBest, 0, {}});
  EXPECT_NEAR(std::abs(best[2]), 1, 1e-9);
  EXPECT_NEAR(best.dot(Eigen::Vector4d(0.3, 0.2, -3, 1)), 0, 1e-9);
  EXPECT_NEAR((best - equation({Kind::kDepth, 3, {}})).norm(), 0, 1e-12);
  EXPECT_EQ(equation({Kind::kInfinity, 0, {}}), Eigen::Vector4d(0, 0, 0, 1));
  EXPECT_EQ(equation({Kind::kEquation, 0, {0, 2, 0, 4}}), Eigen::Vector4d(0, 1, 0, 2));
  EXPECT_EQ(equation({Kind::kEquation, 0, {0, 0, 0, 4}}), Eigen::Vector4d(0, 0, 0, 1));
  EXPECT_THROW(equation({Kind::kEquation, 0, {0, 0, 0, 0}}), Error);
}

}  // namespace
}  // namespace raystage::compose::shot_plan_test
