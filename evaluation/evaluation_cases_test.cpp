// SPDX-License-Identifier: Apache-2.0
#include "evaluation/evaluation_cases.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <limits>
#include <optional>

#include "base/atomic_file.h"
#include "base/contained_path.h"
#include "base/error.h"
#include "base/transfer_function.h"
#include "images/image_file.h"
#include "schemas/rig_document.h"
#include "store/jpeg/encode.h"
#include "store/take.h"
#include "testing/render/synthetic_take.h"
#include "testing/test_folder.h"

namespace raystage::evaluation {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr int kCameras = 4, kTicks = 5, kWidth = 64, kHeight = 48;
constexpr Nanoseconds kInterval = kNanosecondsPerSecond / 10;
/// Clock offset of camera 1: its time stamps assign its frames to the next instant.
constexpr Nanoseconds kAhead = kInterval * 7 / 10;

int grey_at(int tick) { return 40 + 40 * tick; }

/// A wall that gets brighter from tick to tick; camera 3 lost one frame.
class Subjects : public ::testing::Test {
 protected:
  Subjects() {
    schemas::TakeDocument document;
    document.name = "wall";
    document.created_by = "test";
    document.nominal_fps = 10;
    document.color_space = "srgb_texture";
    schemas::RigDocument rig;
    rig.name = "four";
    for (const schemas::CameraGeometry& geometry :
         testing::camera_grid(2, 2, 0.1, kWidth, kHeight)) {
      document.cameras.push_back({geometry.id, "", "", ""});
      rig.cameras.emplace_back().geometry = geometry;
    }
    std::vector<std::vector<Nanoseconds>> times(kCameras);  // by the array's clock
    store::TakeWriter writer(folder_.path() / "take", document, rig);
    for (int camera = 0; camera < kCameras; ++camera) {
      for (int tick = 0; tick < kTicks; ++tick) {
        if (camera == 3 && tick == 2) continue;
        store::RgbImage image{kWidth, kHeight, std::vector<std::uint8_t>()};
        image.values.assign(std::size_t{3} * kWidth * kHeight,
                            static_cast<std::uint8_t>(grey_at(tick)));
        const Nanoseconds time = (1 + tick) * kInterval;
        times[camera].push_back(time);
        writer.archive(camera).append(store::encode_jpeg(image, {}),
                                      time + (camera == 1 ? kAhead : 0));
      }
    }
    writer.commit();
    take_.emplace(folder_.path() / "take");
    timeline_ = store::build_timeline(times, 10, 10, 0, "test");
    timeline_.clocks.resize(kCameras);
    timeline_.clocks[1].offset_ns = kAhead;
    store::write_timeline(timeline_, folder_.path() / "take");
  }

  std::vector<EvaluationCase> excluded_camera_ids(const std::string& id,
                                                  const store::Timeline* timeline) const {
    EvaluationOptions options;
    options.excluded_camera_ids = {id};
    return make_evaluation_cases(*take_, timeline, {}, {}, options);
  }

  store::FrameSelection frames_of_view_at(Nanoseconds time, const store::Timeline* timeline) const {
    schemas::ViewsDocument views;
    views.views.push_back({testing::camera_grid(1, 1, 1, kWidth, kHeight).front(), "", time});
    return make_evaluation_cases(*take_, timeline, views, {}, {}).front().frames;
  }

  testing::TestFolder folder_;
  std::optional<store::Take> take_;
  store::Timeline timeline_;
};

std::vector<std::string> ids_of(const std::vector<EvaluationCase>& subjects) {
  std::vector<std::string> ids;
  for (const EvaluationCase& subject : subjects) ids.push_back(subject.id);
  return ids;
}

TEST_F(Subjects, AViewShowsTheTickNearestToItsTime) {
  ASSERT_EQ(timeline_.ticks.size(), static_cast<std::size_t>(kTicks));
  const Nanoseconds third = timeline_.ticks[2].time_ns;
  for (const Nanoseconds beside : {-kInterval / 3, Nanoseconds{0}, kInterval / 3}) {
    const store::FrameSelection frames = frames_of_view_at(third + beside, &timeline_);
    EXPECT_EQ(frames.time_ns, third);
    EXPECT_THAT(frames.frame, ElementsAre(2, 2, 2, -1));
  }
  // By its time stamps camera 1 would show the previous instant.
  EXPECT_THAT(frames_of_view_at(third, nullptr).frame, ElementsAre(2, 1, 2, -1));
}

// A page that shows the truths is meant to be shared.
TEST_F(Subjects, TruthsAreFilesBelowTheFolderOfTheirDocument) {
  const std::filesystem::path folder = folder_.path() / "views";
  create_folder(folder / "truth");
  write_file_atomically(folder_.path() / "secret.png", "secret");
  write_file_atomically(folder / "truth" / "own.png", "own");
  std::filesystem::create_symlink(folder_.path(), folder / "link");
  const auto read = [&](const std::string& truth) {
    schemas::ViewsDocument views;
    views.color_space = "srgb_texture";
    views.views.push_back({testing::camera_grid(1, 1, 1, kWidth, kHeight).front(), truth, 0});
    schemas::write_views(views, folder / "views.json");
    return read_views_with_truths(folder / "views.json").views[0].file;
  };
  EXPECT_EQ(read("truth/own.png"), (folder / "truth/own.png").string());
  std::filesystem::create_symlink(folder_.path() / "secret.png", folder / "truth" / "link.png");
  EXPECT_THROW(read("truth/link.png"), Error);
  const std::filesystem::path before = std::filesystem::current_path();
  std::filesystem::current_path(folder);  // a document without a folder in its name
  EXPECT_THROW(read_views_with_truths("views.json"), Error);
  std::filesystem::current_path(before);
  for (const std::string& outside :
       {std::string("../secret.png"), (folder_.path() / "secret.png").string(),
        std::string("link/secret.png"), std::string("truth/../../secret.png")}) {
    try {
      read(outside);
      ADD_FAILURE() << outside;
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kBadInput) << outside;
    }
    setenv(kFollowLinksVariable, "1", 1);  // NOLINT(concurrency-mt-unsafe)
    EXPECT_NO_THROW(read(outside));
    unsetenv(kFollowLinksVariable);  // NOLINT(concurrency-mt-unsafe)
  }
}

// A view can state many more pixels than its truth has.
TEST_F(Subjects, ATruthOfAnotherSizeIsRefusedBeforeItsViewIsRendered) {
  images::write_image({8, 6, std::vector<std::uint8_t>(8 * 6 * 3)}, folder_.path() / "small.png");
  schemas::ViewsDocument views;
  views.color_space = "srgb_texture";
  views.views.push_back(
      {testing::camera_grid(1, 1, 1, 65535, 65535).front(), "small.png", 2 * kInterval});
  const auto refusal = [&](const EvaluationOptions& options) {
    try {
      evaluate_views(*take_, views, folder_.path(), options, [](double) {}, {});
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  EvaluationOptions options;
  options.focal_depth = 2;
  EXPECT_THAT(refusal(options), HasSubstr("need 206.2 GB of memory; 4.0 GB are granted"));
  options.memory_bytes = std::size_t{1} << 40;
  EXPECT_THAT(refusal(options), ::testing::AllOf(HasSubstr("small.png: found 8x6 pixels"),
                                                 HasSubstr("has 65535x65535")));
}

TEST_F(Subjects, ExactTimesNeedPlausibleLineTimes) {
  const std::filesystem::path file = folder_.path() / "take" / "rig.json";
  schemas::RigDocument rig = schemas::read_rig(file);
  rig.cameras[2].geometry.line_time_us = 3000;  // a read-out of 144 ms at 10 Hz
  schemas::write_rig(rig, file);
  const store::Take take(folder_.path() / "take");
  EvaluationOptions options;
  options.excluded_camera_ids = {take.rig().cameras[0].id};
  EXPECT_EQ(make_evaluation_cases(take, &timeline_, {}, {}, options).size(), 5U);
  options.exact_times = true;
  try {
    make_evaluation_cases(take, &timeline_, {}, {}, options);
    ADD_FAILURE() << "accepted";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("rig.json: camera " + take.rig().cameras[2].id));
    EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
  }
}

TEST_F(Subjects, BeyondTheTimelineThereIsNothing) {
  const Nanoseconds last = timeline_.ticks.back().time_ns;
  EXPECT_EQ(frames_of_view_at(last + kInterval / 3, &timeline_).present(), kCameras);
  const store::FrameSelection beyond = frames_of_view_at(last + kInterval, &timeline_);
  EXPECT_EQ(beyond.present(), 0);
  EXPECT_EQ(beyond.frame.size(), static_cast<std::size_t>(kCameras));
}

TEST_F(Subjects, ACameraLeftOutHasAViewPerTickThatTakesItsFrame) {
  const std::string fourth = take_->document().cameras[3].id;
  const auto views = excluded_camera_ids(fourth, &timeline_);
  EXPECT_THAT(ids_of(views),
              ElementsAre(fourth + "_0", fourth + "_1", fourth + "_3", fourth + "_4"));
  EXPECT_EQ(views[2].frames.frame, timeline_.ticks[3].frame);
  EXPECT_NEAR(views[2].truth().image.values.front(), grey_at(3), 1);
  timeline_.ticks[3].frame[3] = -1;  // stored, but not selected
  EXPECT_THAT(ids_of(excluded_camera_ids(fourth, &timeline_)),
              ElementsAre(fourth + "_0", fourth + "_1", fourth + "_4"));
  timeline_.ticks.resize(1);
  EXPECT_THAT(ids_of(excluded_camera_ids(fourth, &timeline_)), ElementsAre(fourth));
}

TEST_F(Subjects, ACameraLeftOutIsShownInTheColoursOfTheOthers) {
  const std::filesystem::path file = folder_.path() / "take" / "rig.json";
  schemas::RigDocument rig = schemas::read_rig(file);
  rig.cameras[3].photometric.contrast = {0.5, 0.5, 0.5};
  rig.cameras[3].photometric.matrix = {{{0, 1, 0}, {1, 0, 0}, {0, 0, 1.5}}};
  schemas::write_rig(rig, file);
  take_.emplace(folder_.path() / "take");
  const auto views = excluded_camera_ids(take_->document().cameras[3].id, &timeline_);
  const double light = linear_from_srgb(grey_at(3) / 255.0) / 2;
  const store::RgbImage image = views[2].truth().image;
  EXPECT_NEAR(image.values[0], 255 * srgb_from_linear(light), 2);
  EXPECT_NEAR(image.values[2], 255 * srgb_from_linear(1.5 * light), 2);
}

TEST_F(Subjects, WithoutATimelineStampsChoose) {
  const std::string fourth = take_->document().cameras[3].id;
  const auto views = excluded_camera_ids(fourth, nullptr);
  EXPECT_THAT(ids_of(views),
              ElementsAre(fourth + "_0", fourth + "_1", fourth + "_2", fourth + "_3"));
  EXPECT_THAT(views[2].frames.frame, ElementsAre(3, 2, 3, 2));
}

TEST_F(Subjects, WithoutATimelineOrARateTheNearestStampIsTaken) {
  const std::filesystem::path document = folder_.path() / "take" / "take.json";
  std::string text = read_file(document);
  const std::string rate = "\"nominal_fps\": 10";
  const std::size_t at = text.find(rate);
  ASSERT_NE(at, std::string::npos) << text;
  write_file_atomically(document, text.replace(at, rate.size(), "\"nominal_fps\": 0"));
  take_.emplace(folder_.path() / "take");
  EXPECT_THAT(frames_of_view_at(kInterval * 9, nullptr).frame, ElementsAre(4, 4, 4, 3));
  // At the third instant camera 3 has no frame: the earlier of two equally near frames is used.
  EXPECT_THAT(frames_of_view_at(kInterval * 3, nullptr).frame, ElementsAre(2, 1, 2, 1));
}

TEST_F(Subjects, EvaluationsSayHowManyViewsLieOutsideTheTakesTime) {
  const store::RgbImage grey{kWidth, kHeight,
                             std::vector<std::uint8_t>(std::size_t{3} * kWidth * kHeight,
                                                       static_cast<std::uint8_t>(grey_at(2)))};
  images::write_image(grey, folder_.path() / "truth.png");
  const auto evaluate = [&](std::initializer_list<Nanoseconds> times) {
    schemas::ViewsDocument views;
    views.color_space = "srgb_texture";
    for (const Nanoseconds time : times) {
      views.views.push_back(
          {testing::camera_grid(1, 1, 1, kWidth, kHeight).front(), "truth.png", time});
    }
    EvaluationOptions options;
    options.focal_depth = 4;
    return evaluate_views(*take_, views, folder_.path(), options, [](double) {}, {});
  };
  const Nanoseconds within = timeline_.ticks[2].time_ns, outside = within + 100 * kInterval;
  EXPECT_THAT(evaluate({within, within}).notes, IsEmpty());
  const Evaluation partly = evaluate({outside, within, outside});
  EXPECT_THAT(partly.notes, ElementsAre("2 of 3 views are outside the take's time and empty"));
  EXPECT_EQ(partly.views[0].quality.covered, 0);
  EXPECT_GT(partly.views[1].quality.covered, 0);
  try {
    evaluate({outside, -outside});
    ADD_FAILURE() << "measured nothing";
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
    EXPECT_THAT(error.what(), HasSubstr("no view is within the take's time"));
  }
}

TEST_F(Subjects, RottenFramesAreLeftOutAndNamed) {
  const std::string fourth = take_->document().cameras[3].id;
  EvaluationOptions options;
  options.focal_depth = 4;
  options.excluded_camera_ids = {fourth};
  double done = 0;
  const auto evaluate = [&] {
    take_.emplace(folder_.path() / "take");
    done = 0;
    const auto progress = [&](double share) {
      EXPECT_GT(share, done);
      done = share;
    };
    return evaluate_views(*take_, {}, {}, options, progress, {});
  };
  const Evaluation whole = evaluate();
  EXPECT_FALSE(whole.has_rot);
  const auto rot = [&](int camera, int frame) {
    const store::FrameRecord record = take_->archive(camera).frames()[frame];
    const std::filesystem::path file =
        folder_.path() / "take" / take_->document().cameras[camera].archive;
    std::string bytes = read_file(file);
    bytes[static_cast<std::size_t>(record.offset + record.size / 2)] ^= 1;
    write_file_atomically(file, bytes);
  };
  rot(3, 0);
  const Evaluation without_truth = evaluate();
  EXPECT_EQ(done, 1) << "views that are left out count";
  EXPECT_TRUE(without_truth.has_rot);
  EXPECT_EQ(without_truth.views.size() + 1, whole.views.size());
  EXPECT_THAT(without_truth.notes,
              ::testing::Contains(HasSubstr("is left out: its truth is a rotten frame")));
  const store::RgbImage grey{kWidth, kHeight,
                             std::vector<std::uint8_t>(std::size_t{3} * kWidth * kHeight,
                                                       static_cast<std::uint8_t>(grey_at(1)))};
  images::write_image(grey, folder_.path() / "truth.png");
  schemas::ViewsDocument views;
  views.color_space = "srgb_texture";
  views.views.push_back({testing::camera_grid(1, 1, 1, kWidth, kHeight).front(), "truth.png",
                         timeline_.ticks[1].time_ns});
  options.excluded_camera_ids.clear();
  rot(0, 1);
  take_.emplace(folder_.path() / "take");
  const Evaluation without_camera =
      evaluate_views(*take_, views, folder_.path(), options, [](double) {}, {});
  EXPECT_TRUE(without_camera.has_rot);
  EXPECT_THAT(without_camera.notes,
              ::testing::Contains(HasSubstr("lacks cameras whose stored frames are rotten: " +
                                            take_->document().cameras[0].id)));
}

/// A camera's frame at a tick is rendered from the other cameras' frames at that tick, whatever
/// their time stamps are.
TEST_F(Subjects, EvaluationsAreOfTheInstantsThatTheTimelineSays) {
  EvaluationOptions options;
  options.method = "lumigraph";  // a camera of the border has neighbours on one side only
  options.focal_depth = 4;
  options.excluded_camera_ids = {take_->document().cameras[0].id};
  const auto worst = [&] {
    double least = std::numeric_limits<double>::infinity();
    const Evaluation evaluation = evaluate_views(*take_, {}, {}, options, [](double) {}, {});
    EXPECT_EQ(evaluation.views.size(), static_cast<std::size_t>(kTicks));
    for (const ViewEvaluation& view : evaluation.views) {
      EXPECT_GT(view.quality.covered, 0.1);
      least = std::min(least, view.quality.psnr_db);
    }
    return least;
  };
  EXPECT_GT(worst(), 45);
  std::filesystem::remove(folder_.path() / "take" / "timeline.zst");
  EXPECT_LT(worst(), 30);
}

}  // namespace
}  // namespace raystage::evaluation
