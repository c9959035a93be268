// SPDX-License-Identifier: Apache-2.0
// Views of a quilt from the array's own pictures. Each frame is resampled to a pinhole at the
// camera's position with the orientation of the shot's camera (rectification), shifted so that the
// screen's plane has no horizontal disparity. Vertical differences of the positions remain. Where
// the view is coarser than the frame, it is sampled more finely and reduced by area.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/error.h"
#include "exports/quilt_views.h"
#include "exports/resample_lens.h"
#include "exports/source_frames.h"
#include "images/resize.h"
#include "replay/scene.h"

namespace raystage::exports {
namespace {

constexpr double kScreenWithoutFocus = 5;  // metres

class RecordedViews : public QuiltViews {
 public:
  RecordedViews(const store::Take& take, const compose::ShotCamera& camera,
                const QuiltExportOptions& options, const std::vector<int>& frames,
                QuiltViewShape shape)
      : take_(take), camera_(camera), screen_m_(options.screen_m), shape_(shape) {
    FrameChoiceOptions chosen;
    for (const int index : cameras_of_row(take, options.array_row.value_or(0))) {
      chosen.cameras.push_back(take.rig().cameras[index].id);
    }
    chosen.frames = frames;
    chosen.times = FrameTimes::kConstant;
    chosen.absent = AbsentFrames::kHold;
    choice_ = choose_frames(take, chosen);
    for (const CameraFrames& of_camera : choice_.cameras) {
      sources_.push_back(std::make_unique<SourceFrames>(take, of_camera, chosen.absent));
    }
  }

  void begin(int frame, QuiltReport& report) override {
    state_ = camera_.state(frame);
    state_.focal_length_mm *= shape_.zoom;
    report.screen_m = screen_m_.value_or(state_.focus_m.value_or(kScreenWithoutFocus));
    report.baseline_m = offset(static_cast<int>(sources_.size()) - 1) - offset(0);
    held_before_ = count(&ExportReport::Camera::held);
    black_before_ = count(&ExportReport::Camera::black);
    rotten_before_ = count(&ExportReport::Camera::rotten);
  }

  store::RgbImage view(int index, const std::stop_token& /*stop*/, QuiltReport& report) override {
    throw_if_cancelled();
    SourceFrames& source = *sources_.at(static_cast<std::size_t>(index));
    source.next();
    const rig::Rig::Camera& camera = take_.rig().cameras[choice_.cameras[index].camera];
    const render::VirtualCamera view =
        replay::make_view_camera(camera_, moved_state(state_, offset(index), report.screen_m),
                                 compose::Eye::kBoth, shape_.width, shape_.height)
            .view;
    const int finer = std::clamp(
        static_cast<int>(std::ceil(camera.model.intrinsics().fx / view.intrinsics.fx)), 1, 4);
    schemas::CameraGeometry pinhole;
    pinhole.id = camera.id;
    pinhole.width = finer * view.width;
    pinhole.height = finer * view.height;
    pinhole.intrinsics = view.intrinsics;
    for (double* length : {&pinhole.intrinsics.fx, &pinhole.intrinsics.fy, &pinhole.intrinsics.cx,
                           &pinhole.intrinsics.cy}) {
      *length *= finer;
    }
    const store::RgbImage picture =
        resample_lens(source.picture(), camera.model, rig::CameraModel(pinhole),
                      camera.pose.world_from_camera_rotation.transpose() *
                          state_.pose.world_from_camera_rotation);
    return finer == 1 ? picture : images::resize(picture, view.width, view.height);
  }

  void end(QuiltReport& report) override {
    report.held += count(&ExportReport::Camera::held) > held_before_ ? 1 : 0;
    report.black += count(&ExportReport::Camera::black) > black_before_ ? 1 : 0;
    report.rotten += count(&ExportReport::Camera::rotten) > rotten_before_ ? 1 : 0;
  }

 private:
  /// Returns how far a camera of the row is to the right of the shot's camera, metres.
  double offset(int index) const {
    const rig::Pose& pose = take_.rig().cameras[choice_.cameras[index].camera].pose;
    return state_.pose.world_from_camera_rotation.col(0).dot(pose.position - state_.pose.position);
  }
  int count(int ExportReport::Camera::*member) const {
    int sum = 0;
    for (const auto& source : sources_) sum += source->counts().*member;
    return sum;
  }

  const store::Take& take_;
  const compose::ShotCamera& camera_;
  std::optional<double> screen_m_;
  QuiltViewShape shape_;
  FrameChoice choice_;
  std::vector<std::unique_ptr<SourceFrames>> sources_;
  compose::CameraState state_;
  int held_before_ = 0, black_before_ = 0, rotten_before_ = 0;
};

}  // namespace

std::vector<int> cameras_of_row(const store::Take& take, int row) {
  const auto& all = take.rig().cameras;
  std::vector<int> cameras;
  for (int i = 0; i < static_cast<int>(all.size()); ++i) {
    if (all[i].row == row) cameras.push_back(i);
  }
  if (cameras.empty()) {
    throw Error::bad_input(fmt::format("no camera of the rig is in row {}", row),
                           take.file("rig.json").path().string(),
                           "Choose another row, or render views")
        .concerning({"array_row"});
  }
  const Eigen::Vector3d right =
      compose::look_at_rotation(Eigen::Vector3d::Zero(), take.rig().mean_viewing_direction())
          .col(0);
  std::ranges::sort(cameras, {}, [&](int camera) { return right.dot(all[camera].pose.position); });
  return cameras;
}

std::unique_ptr<QuiltViews> recorded_views(const store::Take& take,
                                           const compose::ShotCamera& camera,
                                           const QuiltExportOptions& options,
                                           const std::vector<int>& frames, QuiltViewShape shape) {
  return std::make_unique<RecordedViews>(take, camera, options, frames, shape);
}

}  // namespace raystage::exports
