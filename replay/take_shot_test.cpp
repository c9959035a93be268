// SPDX-License-Identifier: Apache-2.0
#include "replay/take_shot.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "compose/shot_plan.h"
#include "testing/store/take_test_data.h"
#include "testing/test_folder.h"

namespace raystage::replay::take_shot_test {
namespace {

using ::testing::HasSubstr;

store::Timeline timeline_of(double fps, std::size_t ticks) {
  store::Timeline timeline;
  timeline.fps = fps;
  timeline.ticks.resize(ticks);
  for (std::size_t k = 0; k < ticks; ++k) {
    timeline.ticks[k].time_ns =
        std::llround(static_cast<double>(k) / fps * static_cast<double>(kNanosecondsPerSecond));
  }
  return timeline;
}

class TakeShot : public ::testing::Test {
 protected:
  TakeShot() {
    std::vector<Nanoseconds> times;
    for (int i = 0; i < kFrames; ++i) times.push_back(i * kNanosecondsPerSecond / kFastFps);
    testing::write_take(folder_.path() / "take", {times, times}, kFastFps);
  }
  store::Take take() const { return store::Take(folder_.path() / "take"); }
  /// Returns the shot as a reader of its text has it.
  schemas::ShotDocument shot_of(const store::Timeline& timeline) const {
    const std::string text = schemas::format_shot(make_take_shot(take(), timeline, "take"));
    schemas::ShotDocument shot = schemas::parse_shot(text, "shot.json");
    EXPECT_EQ(schemas::format_shot(shot), text);
    return shot;
  }

  static constexpr int kFrames = 6, kFastFps = 1200;
  testing::TestFolder folder_;
};

TEST_F(TakeShot, EachFrameOfAnHourIsItsTick) {
  // Cameras at 29.9715 Hz; shots write 29.97, which lags by 5 frames in an hour.
  for (const double fps : {29.9715, 23.98, 0.0123456789, 4567.89}) {
    const store::Timeline timeline = timeline_of(fps, 107'897);
    const schemas::ShotDocument shot = shot_of(timeline);
    const double speed = shot.layers[0].speed;
    for (int frame = shot.first_frame; frame <= shot.last_frame; ++frame) {
      const double seconds = (frame - shot.first_frame) / shot.fps * speed;
      const auto tick = store::nearest_tick(
          timeline.ticks, std::llround(seconds * static_cast<double>(kNanosecondsPerSecond)));
      ASSERT_EQ(tick, static_cast<std::size_t>(frame - 1)) << fps;
    }
  }
}

TEST_F(TakeShot, RatesThatAreWrittenExactlyNeedNoSpeed) {
  for (const double fps : {15.0, 30000.0 / 1001, 14.9987654321}) {
    const schemas::ShotDocument shot = shot_of(timeline_of(fps, 10'000));
    EXPECT_EQ(shot.layers[0].speed, 1) << fps;
    EXPECT_NEAR(shot.fps, fps, 1e-6);
  }
  const schemas::ShotDocument shot = shot_of(timeline_of(29.9715, 10'000));
  EXPECT_THAT(schemas::format_shot(shot), HasSubstr("\"fps\": \"30000/1001\""));
}

TEST_F(TakeShot, TakesFasterThanAnyShotPlaySlowly) {
  const store::Take recorded = take();
  store::write_timeline(store::build_timeline(recorded, kFastFps, 0), recorded);
  const schemas::ShotDocument shot = shot_of(store::read_timeline(recorded));
  EXPECT_EQ(shot.fps, 24);
  EXPECT_EQ(shot.last_frame, kFrames);
  EXPECT_THAT(schemas::format_shot(shot), HasSubstr("\"speed\": 0.02,"));
  const compose::ShotPlan plan(shot, folder_.path() / "take.shot.json", {});
  for (int frame = 1; frame <= kFrames; ++frame) {
    EXPECT_EQ(plan.light_field(0)->tick_at(frame), frame - 1);
  }
  const auto frames = plan.plan(std::vector<int>{1, kFrames}, compose::MissingFrames::kError);
  EXPECT_NEAR(plan.metadata(frames[1]).capture_rate.value_or(0), kFastFps, 1e-6);
}

}  // namespace
}  // namespace raystage::replay::take_shot_test
