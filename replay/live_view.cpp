// SPDX-License-Identifier: Apache-2.0
#include "replay/live_view.h"

#include <Eigen/Geometry>
#include <chrono>
#include <utility>

#include "base/cancellation.h"
#include "base/stopwatch.h"
#include "compose/layers/layer_image.h"
#include "render/renderer.h"
#include "replay/picture.h"
#include "replay/server_messages.h"
#include "replay/take_shot.h"

namespace raystage::replay {
namespace {

using schemas::ViewerMessage;

Nanoseconds now_utc() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

/// Returns the camera in the middle of the array, as the shot of a take has it.
compose::CameraState middle_camera(const store::Take& take, const store::FrameSelection& newest) {
  constexpr double kAnyRate = 30;  // of a shot of one frame
  store::Timeline timeline;
  timeline.fps = take.document().nominal_fps > 0 ? take.document().nominal_fps : kAnyRate;
  timeline.ticks = {newest};
  const schemas::ShotDocument shot = make_take_shot(take, timeline, "live");
  return compose::ShotCamera(shot, "live").state(shot.first_frame);
}

render::ReconstructionOptions focal_plane_at(const compose::CameraState& camera) {
  constexpr double kWithoutFocus = 5;  // metres
  const Eigen::Vector3d ahead = -camera.pose.world_from_camera_rotation.col(2);
  const Eigen::Vector3d point =
      camera.pose.position + ahead * camera.focus_m.value_or(kWithoutFocus);
  render::ReconstructionOptions options;
  options.method = "focal_plane";
  options.focal_plane << ahead, -ahead.dot(point);
  return options;
}

SourceAnswer render_view(const store::Take& take, const store::FrameSelection& newest,
                         const ViewerMessage& request, const std::stop_token& stop) {
  constexpr std::size_t kCacheBytes = std::size_t{512} << 20;
  const CancellationScope scope(stop);
  const Stopwatch total;
  const compose::CameraState camera =
      request.camera ? camera_state_of(*request.camera) : middle_camera(take, newest);
  render::RendererOptions settings;
  settings.cache_bytes = kCacheBytes;
  settings.use_take_folder = false;
  const render::LightFieldRenderer renderer(take, settings);
  const compose::LayerImage image = compose::make_layer_image(
      renderer.render(compose::make_virtual_camera(camera, request.width, request.height), newest,
                      focal_plane_at(camera)));
  PictureMessage message;
  message.content = PictureContent::kView;
  message.id = request.id;
  message.width = request.width;
  message.height = request.height;
  message.quality = "live";
  message.method = "focal_plane";
  message.camera = camera;
  message.render_ms = total.ms();
  message.notes = image.notes;
  const store::RgbImage picture =
      PictureMaker(request.look, compose::ShotColorSpaces{}).make(image);
  return {message.content, picture_message(message, encode_source_picture(picture))};
}

}  // namespace

LiveView::LiveView(std::filesystem::path folder) : folder_(std::move(folder)), take_(folder_) {
  if (is_being_recorded(folder_)) lower_priority_of_process();
}

const LiveStatus& LiveView::update() {
  take_.update(now_utc());
  return take_.status();
}

std::optional<SourceAnswer> LiveView::picture(const ViewerMessage& request,
                                              const std::stop_token& stop) const {
  if (!take_.newest()) return std::nullopt;
  if (!request.mosaic) return render_view(take_.take(), *take_.newest(), request, stop);
  const Mosaic mosaic = make_mosaic({take_.take(), *take_.newest()}, request.width, request.height);
  SourcePictureMessage header;
  header.content = PictureContent::kLive;
  header.id = request.id;
  header.width = request.width;
  header.height = request.height;
  header.mosaic = &mosaic;
  return SourceAnswer{header.content,
                      source_picture_message(header, encode_source_picture(mosaic.picture))};
}

}  // namespace raystage::replay
