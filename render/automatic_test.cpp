// SPDX-License-Identifier: Apache-2.0
#include "render/automatic/automatic.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <vector>

#include "base/atomic_file.h"
#include "base/large_buffer.h"
#include "base/transfer_function.h"
#include "render/automatic/extrapolation_note.h"
#include "render/automatic/leave_one_out.h"
#include "render/automatic/light_field_sequence.h"
#include "render/automatic/undistorted_image.h"
#include "render/common/image_quality.h"
#include "render/common/ray_cells.h"
#include "render/methods.h"
#include "render/planar/focal_plane.h"
#include "render/renderer.h"
#include "testing/render/synthetic_take.h"

namespace raystage::render {
namespace {

using ::testing::Each;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

/// A take of a painted plane 4 m away, recorded by a grid of 4 x 4 cameras, and requests for it.
class Automatic : public ::testing::Test {
 protected:
  void write(double spacing, std::optional<schemas::DepthRange> range, int frames = 1) {
    testing::SyntheticTake settings;
    settings.cameras = testing::camera_grid(4, 4, spacing, 96, 64);
    settings.depth_range = range;
    settings.frames = frames;
    settings.has_depth_range = range.has_value();
    testing::write_synthetic_take(settings, folder_.path() / "take");
    take_ = std::make_unique<store::Take>(folder_.path() / "take");
    cache_ = std::make_unique<store::FrameCache>(*take_, 1 << 28, store::BlendSpace::kPerceptual);
    instant_.take = take_.get();
    instant_.rig = &take_->rig();
    instant_.cache = cache_.get();
    instant_.frame_of_camera.assign(16, 0);
    std::vector<int> all;
    for (int i = 0; i < 16; ++i) all.push_back(i);
    instant_.included_cameras = all;
    instant_.present = std::make_shared<const rig::Topology>(rig::make_topology(take_->rig(), all));
    instant_.complete = instant_.present;
  }

  ViewRequest request(double plane_depth = 4) {
    return {view_, instant_, {0, 0, 1, plane_depth}, none_, kept_, 1 << 28, buffers_, false};
  }

  /// Returns candidates that differ mainly in cost, so that the choice shows in the label.
  std::vector<MethodCandidate> ladder() const {
    MethodCandidate quick{.label = "quick", .method = &focal_plane_method(), .pixel_ns = 10};
    MethodCandidate slow = quick;
    slow.label = "slow";
    slow.method = &nearest_method();
    slow.pixel_ns = 1000;
    MethodCandidate best = quick;
    best.label = "best";
    best.pixel_ns = 1e6;
    best.instant_ns = 1.6e4;  // 16 cameras of 96 x 64: 0.8 s on two threads
    return {quick, slow, best};
  }

  testing::TestFolder folder_;
  std::unique_ptr<store::Take> take_;
  std::unique_ptr<store::FrameCache> cache_;
  LightFieldFrame instant_;
  ResultCache kept_{1 << 28};
  BufferPool buffers_;
  MethodOptions none_;
  VirtualCamera view_ = virtual_camera_with_fov(1000, 1000, 0.6, {});
};

TEST_F(Automatic, ASinglePlaneIsUsedWhereItIsFreeOfGhosts) {
  write(0.02, schemas::DepthRange{3, 5});
  // f = 80 px: 80 * 0.02 * (1/3 - 1/5) = 0.21 px.
  const MethodChoice choice = choose(ladder(), {.psnr_db = 90}, request());
  EXPECT_EQ(choice.candidate, 0U);
  EXPECT_THAT(choice.why, HasSubstr("baseline is 20 mm"));
  EXPECT_THAT(choice.why, HasSubstr("eq. 2.1"));
  EXPECT_THAT(choice.why, HasSubstr("may miss the target of 90.0 dB"));
}

TEST_F(Automatic, WithoutATargetTheMostAccurateIsTaken) {
  write(0.2, schemas::DepthRange{1, 5});  // 12.8 px
  const MethodChoice choice = choose(ladder(), {}, request());
  EXPECT_EQ(choice.candidate, 2U);
  EXPECT_THAT(choice.why, StartsWith("best: the most accurate"));
}

TEST_F(Automatic, TheMostAccurateWithinTheTimeIsTaken) {
  write(0.2, schemas::DepthRange{1, 5});
  // A megapixel on two threads: 5 ms, 0.5 s, 501 s.
  EXPECT_EQ(choose(ladder(), {.seconds_per_frame = 600}, request()).candidate, 2U);
  EXPECT_EQ(choose(ladder(), {.seconds_per_frame = 500}, request()).candidate, 1U);
  EXPECT_EQ(choose(ladder(), {.seconds_per_frame = 0.4}, request()).candidate, 0U);
  const MethodChoice none = choose(ladder(), {.seconds_per_frame = 0.001}, request());
  EXPECT_EQ(none.candidate, 0U);
  EXPECT_THAT(none.why, HasSubstr("the fastest candidate"));
}

TEST_F(Automatic, TheCheapestThatMeetsTheErrorIsTaken) {
  write(0.2, schemas::DepthRange{2.5, 10});  // best at 4 m
  // The focal plane coincides with the scene, so focal_plane and nearest are equally good.
  const double good =
      measure_leave_one_out_quality(focal_plane_method(), {}, request()).expected_db();
  EXPECT_GT(good, 30);
  const MethodChoice cheap = choose(ladder(), {.psnr_db = good - 1}, request());
  EXPECT_EQ(cheap.candidate, 0U);
  EXPECT_THAT(cheap.why, HasSubstr("at 9 left-out cameras"));
  EXPECT_EQ(choose(ladder(), {.psnr_db = 99}, request()).candidate, 2U);
}

TEST_F(Automatic, SaysOfWhatItDidNotMeasureThatItMayMissTheTarget) {
  const auto warning = HasSubstr("not measured and may miss the target of 20.0 dB");
  write(0.2, schemas::DepthRange{2.5, 10});
  const MethodCandidate first = ladder().front();
  const std::span<const MethodCandidate> alone(&first, 1);
  EXPECT_THAT(choose(alone, {.psnr_db = 20}, request()).why, warning);
  EXPECT_THAT(choose(alone, {.psnr_db = 20, .seconds_per_frame = 1e-3}, request()).why, warning);
  EXPECT_THAT(choose(ladder(), {.psnr_db = 20}, request()).why, Not(HasSubstr("may miss")));
  EXPECT_THAT(choose(ladder(), {}, request()).why, Not(HasSubstr("may miss")));
}

TEST_F(Automatic, AWrongPlaneIsMeasuredAsSuch) {
  write(0.2, schemas::DepthRange{1, 5});
  const double right =
      measure_leave_one_out_quality(focal_plane_method(), {}, request(4)).expected_db();
  const double wrong =
      measure_leave_one_out_quality(focal_plane_method(), {}, request(2)).expected_db();
  EXPECT_GT(right, wrong + 10);
}

TEST_F(Automatic, WithoutADepthRangeThereIsOnlyThePlane) {
  write(0.2, std::nullopt);
  const MethodChoice choice = choose(ladder(), {.psnr_db = 99}, request());
  EXPECT_EQ(choice.candidate, 0U);
  EXPECT_THAT(choice.why, HasSubstr("no depth range"));
  EXPECT_THAT(choice.why, HasSubstr("may miss the target of 99.0 dB"));
}

TEST_F(Automatic, GivesWhatTheChosenMethodGivesAndSaysWhich) {
  write(0.02, schemas::DepthRange{3, 5});
  const store::FrameSelection frames = store::select_frames(*take_, 0, 1);
  const VirtualCamera view = virtual_camera_with_fov(40, 30, 0.6, {});
  const LightFieldRenderer renderer(*take_, {});
  // The view uses the plane of eq. 2.2 (3.75 m), without ghosts, whatever plane is requested.
  const RenderedView chosen = renderer.render(view, frames, {"auto", {0, 0, 1, 1}});
  const RenderedView plane = renderer.render(view, frames, {"focal_plane", {0, 0, 1, 3.75}});
  EXPECT_EQ(chosen.rgba, plane.rgba);
  ASSERT_EQ(chosen.notes.size(), 1U);
  EXPECT_THAT(chosen.notes[0], StartsWith("auto: focal_plane: the baseline is 20 mm"));
  EXPECT_THAT(chosen.notes[0], HasSubstr("plane at 3.75 m"));
}

TEST_F(Automatic, WithoutADepthRangeEachViewHasThePlaneThatItAsksFor) {
  write(0.2, std::nullopt);
  const store::FrameSelection frames = store::select_frames(*take_, 0, 1);
  const VirtualCamera view = virtual_camera_with_fov(40, 30, 0.6, {});
  const LightFieldRenderer renderer(*take_, {});
  const auto rendered = [&](const char* method, double depth) {
    return renderer.render(view, frames, {method, {0, 0, 1, depth}}).rgba;
  };
  for (const double depth : {4.0, 2.0}) {
    EXPECT_EQ(rendered("auto", depth), rendered("focal_plane", depth)) << depth << " m";
  }
  EXPECT_NE(rendered("auto", 4), rendered("auto", 2));
}

TEST_F(Automatic, SaysThatSamplesBesideTheFirstAreNotInTheTime) {
  write(0.2, schemas::DepthRange{1, 5});
  const LightFieldRenderer renderer(*take_, {});
  const auto note = [&](int width, const schemas::OptionValues& options) {
    const VirtualCamera view = virtual_camera_with_fov(width, width, 0.6, {});
    return renderer
        .render(view, store::select_frames(*take_, 0, 1), {"auto", {0, 0, 1, 4}, options})
        .notes.at(0);
  };
  const schemas::OptionValues timed{{"target_time", 1e-6}};  // a pixel covers 5 x 5 of the cameras'
  EXPECT_THAT(note(10, timed), HasSubstr("for one sample per pixel, this view takes 25"));
  EXPECT_THAT(note(40, timed), Not(HasSubstr("sample per pixel")));
  EXPECT_THAT(note(10, {{"target_error", 1.0}}), Not(HasSubstr("sample per pixel")));
}

/// The real candidates of auto, on a scene of a wall in front of another wall.
class AutomaticAmongAll : public ::testing::Test {
 protected:
  AutomaticAmongAll() {
    testing::SyntheticTake settings;
    settings.cameras = testing::camera_grid(4, 4, 0.1, 96, 72);
    settings.depth_range = schemas::DepthRange{2, 8};  // 80 px * 0.1 m * (1/2 - 1/8) = 3 px
    settings.scene = two_walls;
    testing::write_synthetic_take(settings, folder_.path() / "take");
    take_ = std::make_unique<store::Take>(folder_.path() / "take");
  }

  static std::array<double, 3> two_walls(const Eigen::Vector3d& from,
                                         const Eigen::Vector3d& direction) {
    const Eigen::Vector3d front = from - direction * ((2.1 + from.z()) / direction.z());
    const Eigen::Vector3d back = from - direction * ((7.8 + from.z()) / direction.z());
    const Eigen::Vector3d& hit = front.x() < 0.1 ? front : back;
    return testing::painted_plane(1.5 * hit.x(), 1.5 * hit.y());
  }

  struct Rendered {
    std::string why;     ///< the note, without "auto: "
    double psnr_db = 0;  ///< against the truth
    double seconds = 0;  ///< of the processor for a view, on two threads
  };
  Rendered render(const std::string& method, const schemas::OptionValues& options) const {
    const LightFieldRenderer renderer(*take_, {});
    const VirtualCamera view = unseen_view();
    const store::FrameSelection frames = store::select_frames(*take_, 0, 1);
    Rendered rendered;
    std::vector<std::clock_t> took;
    for (int run = 0; run < 4; ++run) {  // the first chooses, decodes, and prepares the instant
      const std::clock_t start = std::clock();
      const RenderedView image = renderer.render(view, frames, {method, {0, 0, 1, 4}, options});
      took.push_back(std::clock() - start);
      if (run > 0) continue;
      if (!image.notes.empty()) rendered.why = image.notes.front().substr(6);
      rendered.psnr_db =
          compare_images(srgb_image(image), truth(view), coverage_mask(image)).psnr_db;
    }
    const auto least = static_cast<double>(*std::min_element(took.begin() + 1, took.end()));
    rendered.seconds = least / CLOCKS_PER_SEC / 2;
    return rendered;
  }
  Rendered choose(const std::string& target, double value) const {
    return render("auto", {{target, value}});
  }

  static VirtualCamera unseen_view() {
    rig::Pose pose;
    pose.position = {0.05, -0.04, 0.01};
    return virtual_camera_with_fov(320, 240, 0.7, pose);
  }
  static store::RgbImage truth(const VirtualCamera& view) {
    const Eigen::Matrix3d ray_from_pixel = world_ray_from_pixel(view);
    store::RgbImage image{view.width, view.height, std::vector<std::uint8_t>()};
    for (int y = 0; y < view.height; ++y) {
      for (int x = 0; x < view.width; ++x) {
        const auto linear =
            two_walls(view.pose.position, ray_from_pixel * Eigen::Vector3d(x + 0.5, y + 0.5, 1));
        for (const double value : linear) {
          image.values.push_back(
              static_cast<std::uint8_t>(std::lround(255 * srgb_from_linear(value))));
        }
      }
    }
    return image;
  }

  testing::TestFolder folder_;
  std::unique_ptr<store::Take> take_;
};

TEST_F(AutomaticAmongAll, MeetsATargetOfErrorByTheCheapestThatDoes) {
  const Rendered low = choose("target_error", 17), middle = choose("target_error", 27),
                 high = choose("target_error", 50);
  EXPECT_THAT(low.why, StartsWith("focal_plane: "));
  EXPECT_THAT(middle.why, StartsWith("plane_sweep with few planes: "));
  for (const auto& [chosen, target] : {std::pair{low, 17.0}, {middle, 27.0}}) {
    EXPECT_GE(chosen.psnr_db, target);
    EXPECT_THAT(chosen.why,
                HasSubstr(fmt::format(" at 9 left-out cameras, target {:.1f} dB", target)));
  }
  EXPECT_THAT(high.why, StartsWith("depth: the most accurate, "));
  EXPECT_THAT(high.why, HasSubstr("the best other one reaches"));
  EXPECT_THAT(high.why, HasSubstr("not measured and may miss the target of 50.0 dB"));
  EXPECT_GT(middle.psnr_db, low.psnr_db);
  EXPECT_GT(high.psnr_db, middle.psnr_db);
  EXPECT_LT(low.seconds, middle.seconds);
  EXPECT_LT(middle.seconds, high.seconds);
}

TEST_F(AutomaticAmongAll, MeetsATargetOfTimeByTheMostAccurateThatDoes) {
  const Rendered little = choose("target_time", 0.002), some = choose("target_time", 0.04),
                 much = choose("target_time", 1);
  EXPECT_THAT(little.why, StartsWith("focal_plane: the most accurate within 2 ms per frame, "));
  EXPECT_THAT(some.why, StartsWith("plane_sweep: the most accurate within 40 ms per frame, "));
  EXPECT_THAT(much.why, StartsWith("depth: the most accurate within 1.0 s per frame, "));
  EXPECT_GT(some.psnr_db, little.psnr_db);
  EXPECT_GT(much.psnr_db, some.psnr_db);
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)  // sanitizers change the times
  EXPECT_LE(little.seconds, 0.002);
  EXPECT_LE(some.seconds, 0.04);
  EXPECT_LE(much.seconds, 1);
#endif
}

TEST_F(AutomaticAmongAll, SaysThatNothingMeetsATargetOfTime) {
  EXPECT_THAT(choose("target_time", 1e-5).why, StartsWith("focal_plane: the fastest candidate, "));
}

/// focal_plane with another render().
class ChangedFocalPlane : public Method {
 public:
  std::string_view name() const override { return "focal_plane"; }
  MethodDescription description() const override { return focal_plane_method().description(); }
  std::span<const OptionSpec> options() const override { return focal_plane_method().options(); }
  RenderedView render_reference(const ViewRequest& request) const override {
    return focal_plane_method().render_reference(request);
  }
};

/// A focal plane of which a share of the rows of the view shows nothing.
class OnlyTheTop final : public ChangedFocalPlane {
 public:
  explicit OnlyTheTop(int percent_shown) : percent_shown_(percent_shown) {}
  RenderedView render(const ViewRequest& request) const override {
    RenderedView view = focal_plane_method().render(request);
    const auto from = static_cast<std::size_t>(view.height * percent_shown_ / 100) *
                      static_cast<std::size_t>(view.width) * 4;
    std::fill(view.rgba.begin() + static_cast<std::ptrdiff_t>(from), view.rgba.end(), 0.0F);
    return view;
  }

 private:
  int percent_shown_;
};

TEST_F(Automatic, WhatShowsLittleDoesNotMeetATarget) {
  write(0.2, schemas::DepthRange{2.5, 10});
  std::vector<MethodCandidate> all = ladder();
  const OnlyTheTop tenth(10), nearly_all(98);
  all[0].method = &tenth;
  const LeaveOneOutQuality little = measure_leave_one_out_quality(tenth, {}, request());
  EXPECT_GT(little.expected_db(), 30) << "what it shows is right";
  EXPECT_NEAR(little.covered, 0.07, 0.04);
  EXPECT_EQ(choose(all, {.psnr_db = 20}, request()).candidate, 1U);
  all[0].method = &nearly_all;
  EXPECT_EQ(choose(all, {.psnr_db = 20}, request()).candidate, 0U);
}

/// The method focal_plane with an error in the middle of the view, where the view shows anything.
class WrongInTheMiddle final : public ChangedFocalPlane {
 public:
  RenderedView render(const ViewRequest& request) const override {
    RenderedView view = focal_plane_method().render(request);
    for (int y = view.height * 2 / 5; y < view.height * 3 / 5; ++y) {
      for (int x = view.width * 2 / 5; x < view.width * 3 / 5; ++x) {
        const auto pixel = static_cast<std::size_t>(y) * static_cast<std::size_t>(view.width) +
                           static_cast<std::size_t>(x);
        view.rgba[pixel * 4] = 0.0F;
      }
    }
    return view;
  }
};

/// Records the positions of the requested views.
class Noting final : public ChangedFocalPlane {
 public:
  RenderedView render(const ViewRequest& asked) const override {
    seen.push_back(asked.view.pose.position);
    return focal_plane_method().render(asked);
  }
  mutable std::vector<Eigen::Vector3d> seen;
};

TEST_F(Automatic, CountsOnThePartOfThePicturesThatFaresWorst) {
  write(0.2, schemas::DepthRange{2.5, 10});
  const WrongInTheMiddle wrong;
  const LightFieldFrame rest = instant_;
  const rig::Rig::Camera& camera = take_->rig().cameras[5];
  const VirtualCamera view{camera.model.width(), camera.model.height(), camera.model.intrinsics(),
                           camera.pose};
  const MethodOptions options(wrong.options(), {}, wrong.name());
  const ViewRequest there{view, rest, {0, 0, 1, 4}, options, kept_, 1 << 28, buffers_, false};
  const store::RgbImage right = srgb_image(focal_plane_method().render(there));
  const store::RgbImage image = srgb_image(wrong.render(there));
  const std::vector<std::uint8_t> all(image.values.size() / 3, 1);
  const double whole = compare_images(image, right, all).psnr_db;
  // The error is the same, in four ninths of the pixels.
  EXPECT_NEAR(measure_leave_one_out_quality(wrong, {}, request()).mean_db,
              whole + 10 * std::log10(4.0 / 9), 1.0);
}

TEST_F(Automatic, MeasuresCamerasFromTheCentreToTheRimAndNoneAtTheCorners) {
  write(0.2, schemas::DepthRange{2.5, 10});
  const Noting noting;
  EXPECT_EQ(measure_leave_one_out_quality(noting, {}, request()).cameras, 9);
  int rim = 0;
  for (const Eigen::Vector3d& position : noting.seen) {
    const Eigen::Vector2d beside = position.head<2>().cwiseAbs();
    rim += beside.maxCoeff() > 0.29 ? 1 : 0;
    EXPECT_LT(beside.minCoeff(), 0.29) << "a corner";
  }
  EXPECT_GT(rim, 0);
  EXPECT_LT(rim, 9);
}

TEST_F(Automatic, PixelsThatTheCameraDidNotSeeAreNoTruth) {
  schemas::CameraGeometry geometry = testing::camera_grid(1, 1, 1, 96, 64).front();
  geometry.intrinsics.distortion.k1 = 0.4;  // a pinhole's corners lie beyond the frame
  const rig::CameraModel model(geometry);
  store::DecodedFrame frame{96, 64, std::make_unique<std::uint16_t[]>((96 * 65 + 1) * 4), {}, 0};
  std::fill_n(frame.rgba.get(), (96 * 65 + 1) * 4, 65535);
  const UndistortedImage picture = undistort_frame(frame, model, 1, store::BlendSpace::kPerceptual);
  EXPECT_EQ(picture.within.front(), 0);
  EXPECT_EQ(picture.image.values.front(), 0);
  EXPECT_EQ(picture.within[32 * 96 + 48], 1);
  EXPECT_EQ(picture.image.values[(32 * 96 + 48) * 3], 255);
}

TEST_F(Automatic, SaysThatNoCameraCanBeLeftOut) {
  write(0.2, schemas::DepthRange{2.5, 10});
  instant_.included_cameras = {0, 1, 4};
  instant_.present = std::make_shared<const rig::Topology>(
      rig::make_topology(take_->rig(), instant_.included_cameras));
  instant_.complete = instant_.present;
  const MethodChoice choice = choose(ladder(), {.psnr_db = 20}, request());
  EXPECT_EQ(choice.candidate, 2U);
  EXPECT_THAT(choice.why, HasSubstr("no camera lies between three others"));
}

TEST_F(Automatic, MeasuresTheFramesThatTheTimelineSelects) {
  write(0.2, schemas::DepthRange{2.5, 10}, 4);
  store::Timeline timeline = store::build_timeline(*take_, 15, 0);
  for (store::FrameSelection& tick : timeline.ticks) {
    tick.frame[7] = -1;  // not trusted
    tick.difference[7] = 0;
  }
  store::write_timeline(timeline, folder_.path() / "take");
  const LightFieldSequence instants(instant_);
  ASSERT_EQ(instants.count(), 4);
  EXPECT_EQ(instants.at(0).frame_of_camera[4], 0);
  EXPECT_EQ(instants.at(3).frame_of_camera[4], 3);
  EXPECT_EQ(instants.at(0).frame_of_camera[7], -1);
}

TEST_F(Automatic, WithoutATimelineOrARateItTakesTheNearestFrames) {
  write(0.2, schemas::DepthRange{2.5, 10}, 4);
  const std::filesystem::path document = folder_.path() / "take" / "take.json";
  std::string text = read_file(document);
  const std::string rate = "\"nominal_fps\": 15";
  const std::size_t at = text.find(rate);
  ASSERT_NE(at, std::string::npos) << text;
  write_file_atomically(document, text.replace(at, rate.size(), "\"nominal_fps\": 0"));
  const store::Take unrated(folder_.path() / "take");
  instant_.take = &unrated;
  const LightFieldSequence instants(instant_);
  ASSERT_EQ(instants.count(), 4);
  EXPECT_THAT(instants.at(2).frame_of_camera, Each(2));
}

TEST_F(Automatic, SaysWhereAViewLiesOffTheArray) {
  write(0.2, schemas::DepthRange{2.5, 10});
  const auto note = [&](const Eigen::Vector3d& position) {
    VirtualCamera view = view_;
    view.pose.position = position;
    return extrapolation_note(view, instant_).value_or("");
  };
  EXPECT_EQ(note({0, 0, 0}), "");
  EXPECT_EQ(note({0.1, 0.05, -0.05}), "");
  EXPECT_THAT(note({0, 0, -0.4}), HasSubstr("0.4 m in front of the array"));
  EXPECT_THAT(note({0, 0, 0.6}), HasSubstr("0.6 m behind the array"));
  EXPECT_THAT(note({0.8, 0.1, 0}), HasSubstr("0.5 m next to the array"));
}

TEST_F(Automatic, TakesTheSceneFromItsOptionsWhereTheTakeDoesNotSay) {
  write(0.2, std::nullopt);
  const LightFieldRenderer renderer(*take_, {});
  const VirtualCamera view = virtual_camera_with_fov(40, 30, 0.6, {});
  const store::FrameSelection frames = store::select_frames(*take_, 0, 1);
  const schemas::OptionValues scene{{"near", 2.5}, {"far", 10.0}}, timed{{"target_time", 1e-6}};
  schemas::OptionValues both = scene;
  both.insert(timed.begin(), timed.end());
  const RenderedView chosen = renderer.render(view, frames, {"auto", {0, 0, 0, 1}, both});
  EXPECT_EQ(chosen.rgba, renderer.render(view, frames, {"focal_plane", {0, 0, 1, 4}}).rgba);
  const Method& depth = method_named("depth");
  const RenderedView best = renderer.render(view, frames, {"auto", {0, 0, 0, 1}, scene});
  EXPECT_EQ(best.rgba,
            renderer.render(view, frames, {std::string(depth.name()), {0, 0, 0, 1}, scene}).rgba);
}

TEST_F(Automatic, ChoosesAlikeHoweverFinelyAViewIsSampled) {
  write(0.2, schemas::DepthRange{1, 5});
  const ViewRequest coarse = request();
  VirtualCamera larger = coarse.view;
  larger.width *= 4;
  larger.height *= 4;
  const ViewRequest sampled{larger,
                            coarse.instant,
                            coarse.focal_plane,
                            coarse.options,
                            coarse.result_cache,
                            coarse.working_bytes,
                            coarse.buffers,
                            false,
                            false,
                            true,
                            4};
  for (const double seconds : {0.4, 500.0, 600.0}) {
    const QualityTarget target{.seconds_per_frame = seconds};
    EXPECT_EQ(choose(ladder(), target, sampled).candidate,
              choose(ladder(), target, coarse).candidate);
  }
}

}  // namespace
}  // namespace raystage::render
