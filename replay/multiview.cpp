// SPDX-License-Identifier: Apache-2.0
#include "replay/multiview.h"

#include <algorithm>
#include <cmath>

namespace raystage::replay {
namespace {

using Arrangement = schemas::ViewerMessage::Arrangement;

constexpr double kInteraxial = 0.065;  // metres, between human eyes
constexpr double kScreenDistance = 5;  // metres, where the camera has no focus distance

double screen_distance(const compose::CameraState& state) {
  return state.focus_m.value_or(kScreenDistance);
}

/// Returns the state `offset` metres to the right, with the same picture of the focal plane.
compose::CameraState shifted_state(const compose::CameraState& state, double offset) {
  const compose::StereoSettings pair{2 * std::abs(offset), screen_distance(state)};
  return compose::stereo_eye_state(state, pair,
                                   offset < 0 ? compose::Eye::kLeft : compose::Eye::kRight);
}

std::vector<EyeView> stereo_views(const compose::ShotCamera& camera,
                                  const compose::CameraState& state) {
  if (camera.is_stereo()) {
    return {{state, compose::Eye::kLeft}, {state, compose::Eye::kRight}};
  }
  return {{shifted_state(state, -kInteraxial / 2)}, {shifted_state(state, kInteraxial / 2)}};
}

store::RgbImage anaglyph(const store::RgbImage& left, const store::RgbImage& right) {
  store::RgbImage picture = right;
  for (std::size_t i = 0; i < picture.values.size(); i += 3) picture.values[i] = left.values[i];
  return picture;
}

}  // namespace

ArrangedViews arrange_views(const compose::ShotCamera& camera, const compose::CameraState& state,
                            compose::Eye eye, const ArrangementOptions& options) {
  const PictureSize size = options.size;
  switch (options.arrangement) {
    case Arrangement::kSingle:
      break;
    case Arrangement::kSideBySide:
      return {stereo_views(camera, state), {std::max(1, size.width / 2), size.height}};
    case Arrangement::kAnaglyph:
      return {stereo_views(camera, state), size};
    case Arrangement::kQuilt: {
      ArrangedViews arranged;
      constexpr int kViews = kQuiltColumns * kQuiltRows;
      constexpr double kInner = 0.9;  // of the array: at its edge, half of a view has no cameras
      for (int i = 0; i < kViews; ++i) {
        const double share = static_cast<double>(i) / (kViews - 1) - 0.5;
        arranged.views.push_back({shifted_state(state, share * kInner * options.array_width_m)});
      }
      arranged.view_size = {std::max(1, size.width / kQuiltColumns),
                            std::max(1, size.height / kQuiltRows)};
      return arranged;
    }
  }
  return {{{state, eye}}, size};
}

store::RgbImage assemble_picture(const ArrangementOptions& options,
                                 const std::vector<store::RgbImage>& views) {
  const store::RgbImage& first = views.front();
  switch (options.arrangement) {
    case Arrangement::kSingle:
      break;
    case Arrangement::kAnaglyph:
      return anaglyph(views[0], views[1]);
    case Arrangement::kSideBySide: {
      store::RgbImage picture(2 * first.width, first.height);
      copy_into(views[0], 0, 0, picture);
      copy_into(views[1], first.width, 0, picture);
      return picture;
    }
    case Arrangement::kQuilt: {
      store::RgbImage picture(kQuiltColumns * first.width, kQuiltRows * first.height);
      for (int i = 0; i < static_cast<int>(views.size()); ++i) {
        // From the lower left, as Looking Glass displays read quilts.
        copy_into(views[i], i % kQuiltColumns * first.width,
                  (kQuiltRows - 1 - i / kQuiltColumns) * first.height, picture);
      }
      return picture;
    }
  }
  return first;
}

}  // namespace raystage::replay
