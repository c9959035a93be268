// SPDX-License-Identifier: Apache-2.0
// Renders the views of a viewer. A patch is a view of the same camera whose picture is cropped: its
// principal point is shifted. Cost of a patch: that of its pixels, after the frames are decoded.
#include "replay/view_rendering.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <limits>
#include <utility>

#include "base/error.h"
#include "base/stopwatch.h"
#include "compose/layers/light_field_layer.h"
#include "render/common/blending_field.h"
#include "replay/multiview.h"
#include "replay/picture.h"
#include "store/jpeg/encode.h"

namespace raystage::replay {
namespace {

using schemas::ViewerMessage;

compose::Eye eye_of(ViewerMessage::Eye eye) {
  switch (eye) {
    case ViewerMessage::Eye::kLeft:
      return compose::Eye::kLeft;
    case ViewerMessage::Eye::kRight:
      return compose::Eye::kRight;
    case ViewerMessage::Eye::kBoth:
      break;
  }
  return compose::Eye::kBoth;
}

compose::CameraState camera_state(const ShownShot& shown, const ViewerMessage& request) {
  if (!request.camera) return shown.camera.state(request.frame);
  return camera_state_of(*request.camera);
}

int frame_in_shot(const ShownShot& shown, int frame) {
  return std::clamp(frame, shown.shot.first_frame, shown.shot.last_frame);
}

/// Returns the extent of the first light field's cameras along the view's x axis, metres.
double array_width(const ShownShot& shown, const compose::CameraState& state) {
  constexpr double kWithoutArray = 0.065;  // as far apart as eyes
  const auto layers = shown.scene->plan().light_fields();
  if (layers.empty()) return kWithoutArray;
  double least = std::numeric_limits<double>::infinity(), most = -least;
  for (const rig::Rig::Camera& camera : layers.front()->take().rig().cameras) {
    const double x = state.pose.world_from_camera_rotation.col(0).dot(camera.pose.position);
    least = std::min(least, x);
    most = std::max(most, x);
  }
  return most - least;
}

std::string_view name_of(ViewerMessage::Quality quality) {
  switch (quality) {
    case ViewerMessage::Quality::kMoving:
      return "moving";
    case ViewerMessage::Quality::kPlaying:
      return "playing";
    case ViewerMessage::Quality::kResting:
      break;
  }
  return "resting";
}

/// Resting pictures are looked at: they keep all of their colour.
store::JpegEncodeOptions jpeg_options(ViewerMessage::Quality quality) {
  store::JpegEncodeOptions options;
  options.restart_interval = 0;
  if (quality == ViewerMessage::Quality::kResting) {
    options.quality = 95;
  } else {
    options.quality = 85;
    options.chroma = store::JpegEncodeOptions::Chroma::k420;
  }
  return options;
}

void add_instant(const ShownShot& shown, int frame, PictureMessage& message) {
  const compose::PlannedFrame planned = shown.scene->planned(frame);
  for (const compose::LightFieldLayer* layer : shown.scene->plan().light_fields()) {
    const compose::ShownTick& tick = planned.shown[layer->index()];
    message.is_held = message.is_held || tick.held;
    if (!tick.tick) continue;
    const store::FrameSelection frames = layer->frames_of(*tick.tick);
    for (std::size_t i = 0; i < frames.frame.size(); ++i) {
      if (frames.frame[i] < 0) {
        message.absent_cameras.push_back(layer->take().document().cameras[i].id);
      }
    }
  }
}

/// Returns a view of the pixels around one: `size` in width and height, an odd number. `scale`: at
/// most 1, of the requested size.
SceneView patch_view(const ShownShot& shown, const ViewerMessage& request, int size, double scale,
                     const std::string& method) {
  const int width = std::max(1, static_cast<int>(std::lround(request.width * scale)));
  const int height = std::max(1, static_cast<int>(std::lround(request.height * scale)));
  SceneView view{frame_in_shot(shown, request.frame),
                 requested_camera(shown, request, width, height),
                 {.method = method}};
  schemas::Intrinsics& lens = view.camera.view.intrinsics;
  const int half = size / 2;
  lens.cx -= std::floor(request.pixel[0] * width / request.width) - half;
  lens.cy -= std::floor(request.pixel[1] * height / request.height) - half;
  view.camera.view.width = size;
  view.camera.view.height = size;
  return view;
}

/// Returns the cameras from which a pixel of a view is blended, with their weights, the largest
/// first. `z`: its planar depth, or infinite.
std::vector<ProbeMessage::Source> sources_of_pixel(const ShownShot& shown, const SceneView& view,
                                                   int x, int y, double z) {
  constexpr int kBlended = 4;  // cameras of a ray
  constexpr schemas::DepthRange kAnyDepth{0.3, std::numeric_limits<double>::infinity()};
  std::vector<ProbeMessage::Source> sources;
  const compose::PlannedFrame planned = shown.scene->planned(view.frame);
  for (const compose::LightFieldLayer* layer : shown.scene->plan().light_fields()) {
    const compose::ShownTick& tick = planned.shown[layer->index()];
    if (!tick.tick || !shown.scene->plan().is_visible(layer->index(), view.frame)) continue;
    const rig::Rig& rig = layer->take().rig();
    const std::vector<std::int32_t> frames = layer->frames_of(*tick.tick).frame;
    std::vector<int> members;
    for (int i = 0; i < static_cast<int>(frames.size()); ++i) {
      if (frames[i] >= 0) members.push_back(i);
    }
    const bool has_depth = std::isfinite(z) && z > 0;
    const render::InverseDepthRange range =
        has_depth
            ? render::InverseDepthRange{1 / z, 1 / z}
            : render::inverse_depth_range_in_view(
                  view.camera.view, rig, layer->take().document().depth_range.value_or(kAnyDepth));
    if (members.empty() || range.empty()) continue;
    const render::BlendingField field(view.camera.view, rig, members, range, kBlended);
    const render::BlendingField::Tile& tile = field.tile_at(x, y);
    for (const render::BlendingField::TileCamera& camera : tile.cameras) {
      const double share = render::BlendingField::share(tile, camera, x, y);
      if (share > 0) sources.push_back({rig.cameras[camera.camera].id, share});
    }
    break;  // the foremost light field
  }
  std::ranges::sort(sources, std::greater(), &ProbeMessage::Source::share);
  return sources;
}

/// Returns the scale of the requested view at which its pixels are about as large as those of the
/// cameras, at most 1: a patch of an enlarged view would show too little to find its depth.
double scale_of_sources(const ShownShot& shown, const ViewerMessage& request) {
  const double focal =
      requested_camera(shown, request, request.width, request.height).view.intrinsics.fx;
  double scale = 1;
  for (const compose::LightFieldLayer* layer : shown.scene->plan().light_fields()) {
    for (const rig::Rig::Camera& camera : layer->take().rig().cameras) {
      scale = std::min(scale, camera.model.intrinsics().fx / focal);
    }
  }
  return scale;
}

}  // namespace

int ResolutionControl::divisor(int width, int height) const {
  constexpr double kTarget = 30;  // ms
  constexpr int kMax = 8;
  int divisor = 1;
  const double pixels = static_cast<double>(width) * height;
  while (divisor < kMax && ms_per_pixel_ * pixels / (divisor * divisor) > kTarget) ++divisor;
  return divisor;
}

void ResolutionControl::record(double pixels, double ms) {
  constexpr double kNew = 0.25;  // weight of the newest picture
  const double now = ms / std::max(pixels, 1.0);
  ms_per_pixel_ = ms_per_pixel_ == 0 ? now : (1 - kNew) * ms_per_pixel_ + kNew * now;
}

compose::CameraState camera_state_of(const ViewerMessage::Camera& given) {
  compose::CameraState state;
  const auto& [w, x, y, z] = given.orientation;
  state.pose.world_from_camera_rotation =
      Eigen::Quaterniond(w, x, y, z).normalized().toRotationMatrix();
  state.pose.position = Eigen::Vector3d(given.position.data());
  state.focal_length_mm = given.focal_length_mm;
  state.film_back_mm = given.film_back_mm;
  state.shift_x = given.shift_x;
  state.shift_y = given.shift_y;
  state.focus_m = given.focus_m;
  state.f_number = given.f_number;
  return state;
}

compose::ExrCamera requested_camera(const ShownShot& shown, const ViewerMessage& request, int width,
                                    int height) {
  return make_view_camera(shown.camera, camera_state(shown, request), eye_of(request.eye), width,
                          height);
}

double requested_interaxial(const ShownShot& shown, const ViewerMessage& request) {
  const bool is_stereo = request.eye != ViewerMessage::Eye::kBoth ||
                         request.arrangement != ViewerMessage::Arrangement::kSingle;
  return is_stereo && shown.shot.camera.stereo ? shown.shot.camera.stereo->interaxial_m : 0;
}

SourceFrames requested_source(const ShownShot& shown, const ViewerMessage& request) {
  const compose::ShotPlan& plan = shown.scene->plan();
  const compose::PlannedFrame planned = shown.scene->planned(frame_in_shot(shown, request.frame));
  const auto shown_at = [&](const compose::LightFieldLayer& layer) {
    return planned.shown[layer.index()].tick.has_value();
  };
  const auto index = static_cast<std::size_t>(request.layer);
  const compose::LightFieldLayer* chosen =
      index < plan.layers() ? plan.light_field(index) : nullptr;
  for (const compose::LightFieldLayer* layer : plan.light_fields()) {
    if (chosen == nullptr || !shown_at(*chosen)) chosen = layer;
  }
  if (chosen == nullptr || !shown_at(*chosen)) {
    throw Error::bad_input("no camera recorded this frame", "", "Choose another frame");
  }
  store::FrameSelection frames = chosen->frames_of(*planned.shown[chosen->index()].tick);
  constexpr double kHalf = 0.5;  // of the time between two frames
  for (std::size_t camera = 0; camera < frames.frame.size(); ++camera) {
    if (!frames.is_interpolated(camera)) continue;
    if (frames.second[camera].part >= kHalf) frames.frame[camera] = frames.second[camera].frame;
  }
  frames.second = {};
  return {chosen->take(), std::move(frames)};
}

store::RgbImage render_arranged(const ShownShot& shown, const ViewerMessage& request,
                                PictureSize size, const compose::PreviewOptions& preview,
                                const std::stop_token& stop, PictureMessage& facts) {
  const compose::CameraState state = camera_state(shown, request);
  const ArrangementOptions arrangement{request.arrangement, size, array_width(shown, state)};
  const ArrangedViews arranged =
      arrange_views(shown.camera, state, eye_of(request.eye), arrangement);
  const PictureMaker maker(request.look, shown.scene->plan().colors());
  std::vector<store::RgbImage> pictures;
  for (const EyeView& eye : arranged.views) {
    const Stopwatch rendering;
    const compose::CompositedView view =
        shown.scene->render({frame_in_shot(shown, request.frame),
                             make_view_camera(shown.camera, eye.state, eye.eye,
                                              arranged.view_size.width, arranged.view_size.height),
                             preview},
                            stop);
    facts.render_ms += rendering.ms();
    std::ranges::copy(view.rotten_cameras, std::back_inserter(facts.absent_cameras));
    for (const double share : view.uncovered_share) {
      facts.uncovered_share = std::max(facts.uncovered_share, share);
    }
    if (pictures.empty()) {
      facts.notes = view.picture.notes;
      if (request.look.channel == ViewerMessage::Look::Channel::kDepth) {
        facts.false_colors = compose::inverse_depth_span(view.picture.z);
      }
    }
    pictures.push_back(maker.make(view.picture));
  }
  if (pictures.size() == 1) return std::move(pictures.front());
  return assemble_picture(arrangement, pictures);
}

std::vector<std::byte> render_picture(const ShownShot& shown, const ViewerMessage& request,
                                      const PictureOptions& options, const std::stop_token& stop,
                                      double* elapsed_ms) {
  PictureMessage message;
  message.content = options.content;
  message.id = request.id;
  message.frame = frame_in_shot(shown, request.frame);
  message.quality = name_of(request.quality);
  message.method = options.preview.method;
  message.is_final = options.is_final;
  const Stopwatch total;
  const PictureSize size{std::max(1, request.width / options.divisor),
                         std::max(1, request.height / options.divisor)};
  const store::RgbImage picture =
      render_arranged(shown, request, size, options.preview, stop, message);
  add_instant(shown, message.frame, message);
  message.ranges = shown.scene->ranges_of_motion().of_view(
      requested_camera(shown, request, request.width, request.height).view,
      requested_interaxial(shown, request));
  message.width = picture.width;
  message.height = picture.height;
  const std::vector<std::byte> jpeg = store::encode_jpeg(picture, jpeg_options(request.quality));
  message.picture_ms = total.ms() - message.render_ms;
  if (elapsed_ms != nullptr) *elapsed_ms = total.ms();
  return picture_message(message, jpeg);
}

double find_focus_distance(const ShownShot& shown, const ViewerMessage& request,
                           const std::stop_token& stop) {
  constexpr int kPatch = 33, kMiddle = 5;  // pixels
  const compose::LayerImage patch =
      shown.scene
          ->render(
              patch_view(shown, request, kPatch, scale_of_sources(shown, request), "plane_sweep"),
              stop)
          .picture;
  std::vector<float> depths;
  for (int y = kPatch / 2 - kMiddle / 2; y <= kPatch / 2 + kMiddle / 2; ++y) {
    for (int x = kPatch / 2 - kMiddle / 2; x <= kPatch / 2 + kMiddle / 2; ++x) {
      const float z = patch.z[static_cast<std::size_t>(y) * kPatch + x];
      if (std::isfinite(z) && z > 0) depths.push_back(z);
    }
  }
  if (depths.empty()) {
    throw Error::bad_input("nothing with a depth is at this pixel", "",
                           "Click on something that the cameras saw");
  }
  const auto middle = depths.begin() + static_cast<std::ptrdiff_t>(depths.size() / 2);
  std::nth_element(depths.begin(), middle, depths.end());
  return *middle;
}

ProbeMessage probe_pixel(const ShownShot& shown, const ViewerMessage& request,
                         const std::stop_token& stop) {
  constexpr int kPatch = 5;  // for methods that read neighbours
  // A pixel must not wait for the depths of all cameras.
  const bool is_slow = shown.scene->must_estimate_depths(frame_in_shot(shown, request.frame));
  const SceneView view = patch_view(shown, request, kPatch, 1, is_slow ? "plane_sweep" : "");
  const compose::LayerImage patch = shown.scene->render(view, stop).picture;
  const std::size_t middle = kPatch * kPatch / 2;
  ProbeMessage message;
  message.id = request.id;
  std::copy_n(&patch.rgba[4 * middle], 4, message.rgba.begin());
  message.z = patch.z[middle];
  message.sources = sources_of_pixel(shown, view, kPatch / 2, kPatch / 2, message.z);
  for (const compose::Aov& aov : patch.aovs) {
    if (aov.layer == "lf" && aov.channels.front() == "coverage")
      message.coverage = aov.values[middle];
  }
  ViewerMessage::Look look = request.look;
  look.channel = ViewerMessage::Look::Channel::kColor;
  look.peaking = false;
  const store::RgbImage shown_codes = PictureMaker(look, shown.scene->plan().colors()).make(patch);
  std::ranges::copy(shown_codes.pixel(kPatch / 2, kPatch / 2), message.display.begin());
  return message;
}

}  // namespace raystage::replay
