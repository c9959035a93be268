// SPDX-License-Identifier: Apache-2.0
#include "evaluation/evaluation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>

#include "base/atomic_file.h"
#include "base/error.h"
#include "images/image_file.h"
#include "render/methods.h"
#include "store/jpeg/decode.h"
#include "testing/render/synthetic_take.h"
#include "testing/test_folder.h"
#include "testing/test_paths.h"

namespace raystage::evaluation {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::vector<ViewEvaluation> views_of(const std::vector<double>& psnr) {
  std::vector<ViewEvaluation> views(psnr.size());
  for (std::size_t i = 0; i < psnr.size(); ++i) views[i].quality.psnr_db = psnr[i];
  return views;
}

TEST(TemporalStability, IsSpreadAndLargestStep) {
  const TemporalStability temporal_stability =
      measure_temporal_stability(views_of({30, 32, 31, 35}));
  EXPECT_NEAR(temporal_stability.stddev_db, std::sqrt((4 + 0 + 1 + 9) / 4.0), 1e-9);
  EXPECT_EQ(temporal_stability.max_step_db, 4);
  EXPECT_EQ(measure_temporal_stability(views_of({30})).max_step_db, 0);
  EXPECT_EQ(measure_temporal_stability({}).stddev_db, 0);
}

TEST(TemporalStability, StepsWithinAShotOnly) {
  std::vector<ViewEvaluation> views = views_of({30, 36, 30.5, 37});
  const char* ids[] = {"dolly_0", "left_0", "dolly_1", "left_1"};
  for (std::size_t i = 0; i < views.size(); ++i) views[i].id = ids[i];
  EXPECT_EQ(measure_temporal_stability(views).max_step_db, 1);
  views[2].id = "elsewhere";
  views[3].id = "nowhere";
  EXPECT_EQ(measure_temporal_stability(views).max_step_db, 0);
}

TEST(TemporalStability, PassesOverViewsWithoutAValue) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double same = std::numeric_limits<double>::infinity();
  const TemporalStability temporal_stability =
      measure_temporal_stability(views_of({30, nan, 31, same, 30.5}));
  EXPECT_EQ(temporal_stability.max_step_db, 1);
  EXPECT_LT(temporal_stability.stddev_db, 1);
}

class EvaluatedTake : public ::testing::Test {
 protected:
  void SetUp() override {
    testing::SyntheticTake settings;
    settings.cameras = testing::camera_grid(5, 5, 0.03, 64, 48);
    for (schemas::CameraGeometry& camera : settings.cameras) {
      // Like a rig of which only every second row and column was kept.
      camera.row = 2 * *camera.row;
      camera.column = 2 * *camera.column;
    }
    write_synthetic_take(settings, folder_.path() / "take");
    settings_.focal_depth = 4;
    settings_.excluded_camera_ids = {"r2c2"};
  }
  Evaluation evaluate(const store::Take& take) const {
    return evaluate_views(take, {}, {}, settings_, [](double) {}, {});
  }
  testing::TestFolder folder_;
  EvaluationOptions settings_;
};

TEST_F(EvaluatedTake, StepsCountRowsNotTheirNumbers) {
  const store::Take take(folder_.path() / "take");
  EXPECT_TRUE(excluded_camera_indices(take, {}, 1).empty());
  // Rows 0, 4, 8 of 0, 2, 4, 6, 8: 9 of 25 stay.
  const std::vector<int> second = excluded_camera_indices(take, {}, 2);
  EXPECT_EQ(second.size(), 16U);
  EXPECT_THAT(excluded_camera_indices(take, {}, 4), ::testing::SizeIs(21));
  EXPECT_THAT(excluded_camera_indices(take, {"r0c1"}, 1), ElementsAre(1));
  EXPECT_THROW(excluded_camera_indices(take, {"nobody"}, 1), Error);
}

TEST_F(EvaluatedTake, RepeatingChangesTimesOnly) {
  const store::Take take(folder_.path() / "take");
  const Evaluation once = evaluate(take);
  settings_.repeat = 4;
  settings_.count_needed_pixels = false;
  std::size_t seen = 0;
  settings_.on_view = [&](const EvaluatedView& picture) {
    EXPECT_EQ(picture.index, seen++);
    EXPECT_EQ(picture.count, 1U);
    EXPECT_EQ(picture.id, "r2c2");
    EXPECT_EQ(picture.image.width, 64);
    EXPECT_EQ(picture.truth.height, 48);
    EXPECT_EQ(picture.covered.size(), 64U * 48U);
  };
  const Evaluation repeated = evaluate(take);
  EXPECT_EQ(seen, 1U);
  EXPECT_EQ(repeated.mean.quality.psnr_db, once.mean.quality.psnr_db);
  EXPECT_GT(repeated.mean.render_ms, 0);
  EXPECT_GT(repeated.mean.min_render_ms, 0);
  EXPECT_LE(repeated.mean.min_render_ms, repeated.mean.render_ms);
  EXPECT_EQ(repeated.prepare_ms, 0);  // one plane keeps nothing
  EXPECT_FALSE(std::isnan(once.mean.decoded_per_needed));
  EXPECT_TRUE(std::isnan(repeated.mean.decoded_per_needed));
  EXPECT_THAT(evaluation_as_text(repeated), HasSubstr(" -\n")) << "nothing was counted";
}

TEST_F(EvaluatedTake, EveryNthView) {
  const store::Take take(folder_.path() / "take");
  settings_.excluded_camera_ids = {"r2c2", "r1c1", "r3c3"};
  settings_.view_step = 2;
  Evaluation evaluation = evaluate(take);
  ASSERT_EQ(evaluation.views.size(), 2U);
  EXPECT_EQ(evaluation.views[1].id, "r3c3");
  EXPECT_EQ(evaluation.cameras, 22);
  const auto json = nlohmann::json::parse(evaluation_as_json(evaluation));
  EXPECT_EQ(json["temporal_stability"]["psnr_max_step_db"], 0);  // two positions, not a shot
  EXPECT_NEAR(
      json["temporal_stability"]["psnr_stddev_db"].get<double>(),
      std::abs(evaluation.views[0].quality.psnr_db - evaluation.views[1].quality.psnr_db) / 2,
      1e-6);
  EXPECT_EQ(json["steadiness"]["psnr_deviation_db"], json["temporal_stability"]["psnr_stddev_db"]);
  EXPECT_EQ(json["mean"]["covered"], json["mean"]["coverage"]) << "a deprecated alias";
  EXPECT_THAT(evaluation_as_text(evaluation), HasSubstr("largest step"));
  evaluation.notes = {"auto: focal_plane: it is enough"};
  EXPECT_THAT(evaluation_as_text(evaluation),
              HasSubstr("\nnote: auto: focal_plane: it is enough\n"));
}

/// Compares an excluded camera with lens distortion with its distorted view by the reference.
TEST_F(EvaluatedTake, ADistortedCameraIsMeasuredByTheFastWayAndNoWorse) {
  testing::SyntheticTake distorted;
  distorted.cameras = testing::camera_grid(3, 3, 0.05, 320, 240, {-0.15, 0.03, 0.001, 0, 0});
  write_synthetic_take(distorted, folder_.path() / "distorted");
  const store::Take take(folder_.path() / "distorted");
  settings_.excluded_camera_ids = {"r1c1"};
  const Evaluation left_out = evaluate(take);
  EXPECT_TRUE(left_out.notes.empty()) << left_out.notes.front();

  images::write_image(store::JpegDecoder().decode(take.archive(4).jpeg(0), "frame"),
                      folder_.path() / "r1c1.png");
  schemas::ViewsDocument views;
  views.color_space = "srgb_texture";
  views.views.push_back({distorted.cameras[4], "r1c1.png", 0});
  views.views.back().geometry.id = "lens";
  const Evaluation both = evaluate_views(take, views, folder_.path(), settings_, [](double) {}, {});
  ASSERT_EQ(both.views.size(), 2U);
  EXPECT_THAT(both.notes, ElementsAre(HasSubstr("the view's lens distorts")));  // the document's
  const ViewEvaluation &by_ray = both.views[0], &fast = both.views[1];
  EXPECT_EQ(fast.quality.psnr_db, left_out.views[0].quality.psnr_db);
  EXPECT_GT(fast.quality.psnr_db, 30);
  EXPECT_NEAR(fast.quality.psnr_db, by_ray.quality.psnr_db, 1);
  EXPECT_NEAR(fast.quality.covered, by_ray.quality.covered, 0.02);
}

TEST_F(EvaluatedTake, WhatFewerCamerasTellIsNotKeptInTheTake) {
  const std::filesystem::path folder = folder_.path() / "take";
  const auto files = [&folder] {
    std::set<std::filesystem::path> all;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
      all.insert(entry.path());
    }
    return all;
  };
  const auto before = files();
  settings_.method = "depth";
  settings_.options = {{"near", 3.0}, {"far", 6.0}};
  const store::Take take(folder);
  EXPECT_GT(evaluate(take).mean.quality.psnr_db, 20);
  EXPECT_EQ(files(), before);
  settings_.camera_step = 2;
  evaluate(take);
  EXPECT_EQ(files(), before);
}

TEST_F(EvaluatedTake, TheMemoryGrantedBoundsWhatTheMethodWorksInToo) {
  const store::Take take(folder_.path() / "take");
  settings_.method = "depth";
  const double most_mb = evaluate(take).mean.working_mb;
  settings_.memory_bytes = static_cast<std::size_t>(most_mb * 1e6 * 4 * 0.8);
  const double least_mb = evaluate(take).mean.working_mb;
  EXPECT_GT(least_mb, 0);
  EXPECT_LE(least_mb, most_mb * 0.8);
}

TEST_F(EvaluatedTake, ReportsAllOptionsAndWhatTheMethodHasToSay) {
  const store::Take take(folder_.path() / "take");
  settings_.method = "plane_sweep";
  settings_.options = {{"near", 0.05}, {"far", 1e3}, {"step_px", 0.05}};
  settings_.options["aggregation"] = std::string("none");
  const auto json = nlohmann::json::parse(evaluation_as_json(evaluate(take)));
  EXPECT_EQ(json["options"].size(), render::method_named("plane_sweep").options().size());
  EXPECT_EQ(json["options"]["near"], 0.05);
  EXPECT_EQ(json["options"]["aggregation"], "none");
  EXPECT_EQ(json["options"]["subplane_refinement"], true);  // not given
  EXPECT_GT(json["mean"]["working_mb"], 0);
  ASSERT_EQ(json["notes"].size(), 1U);
  EXPECT_THAT(json["notes"][0].get<std::string>(), HasSubstr("only 512 are used"));
  const std::string documentation =
      read_file(testing::source_folder() / "docs/formats/evaluation.md");
  for (const auto& [name, value] : json.items()) {
    EXPECT_THAT(documentation, HasSubstr("\"" + name + "\":"));
  }
  for (const auto& [name, value] : json["mean"].items()) {
    EXPECT_THAT(documentation, HasSubstr("\"" + name + "\":"));
  }
}

}  // namespace
}  // namespace raystage::evaluation
