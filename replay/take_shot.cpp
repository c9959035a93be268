// SPDX-License-Identifier: Apache-2.0
#include "replay/take_shot.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "base/atomic_file.h"
#include "base/error.h"
#include "base/frame_rate.h"
#include "compose/camera/camera_state.h"

namespace raystage::replay {
namespace {

constexpr double kFocusWithoutDepthRange = 5;  // metres
constexpr double kFullFrameWidth = 36;         // millimetres
constexpr int kMaxWidth = 1920;                // pixels

/// Sets the frame rate of the shot, and the speed of the take with which each frame shows one tick.
void set_rate(const store::Timeline& timeline, schemas::ShotDocument& shot,
              schemas::ShotDocument::Layer& layer) {
  constexpr FrameRate kPlayback{24, 1};  // of takes that are faster than any shot
  // Measured rates have any number of decimals, and may be near those of film.
  const double written = std::max(std::round(timeline.fps * 1e6), 1.0) / 1e6;
  const FrameRate rate = frame_rate_from(written).value_or(kPlayback);
  shot.fps = rate.fps();
  shot.fps_numerator = rate.numerator;
  shot.fps_denominator = rate.denominator;
  const double speed = rate.fps() / timeline.fps;
  constexpr double kSmallDrift = 0.01;  // ticks, in the whole take
  if (std::abs(speed - 1) * static_cast<double>(timeline.ticks.size()) > kSmallDrift) {
    layer.speed = speed;
  }
}

}  // namespace

int central_camera(const rig::Rig& rig) {
  const Eigen::Vector3d centre = rig.centre();
  const auto nearest = std::ranges::min_element(
      rig.cameras, {},
      [&](const rig::Rig::Camera& camera) { return (camera.pose.position - centre).norm(); });
  return static_cast<int>(std::distance(rig.cameras.begin(), nearest));
}

ShotText open_take_shot(const std::filesystem::path& take_folder,
                        const std::filesystem::path& shot_folder) {
  const store::Take take(take_folder);
  const std::filesystem::path relative = std::filesystem::relative(take_folder, shot_folder);
  const std::string name = relative.filename().string();
  // The shot is beside the take if that is below the folder of shots, else in that folder. Paths in
  // a shot are relative to its folder.
  const bool is_below = *relative.begin() != "..";
  const schemas::ShotDocument shot =
      make_take_shot(take, store::read_timeline(take), is_below ? name : relative.string());
  const std::filesystem::path file =
      (is_below ? relative.parent_path() : std::filesystem::path()) / (name + ".shot.json");
  return {file.string(), schemas::format_shot(shot)};
}

ShotText saved_shot(const ShotFiles& files, const ShotText& shot) {
  try {
    if (!file_exists(files.path(shot.file))) return shot;
    const std::string text = files.read(shot.file);
    const std::string take = schemas::parse_shot(shot.text, shot.file).layers.front().take;
    const schemas::ShotDocument saved = schemas::parse_shot(text, shot.file);
    const bool shows_it =
        std::ranges::find(saved.layers, take, &schemas::ShotDocument::Layer::take) !=
        saved.layers.end();
    return shows_it ? ShotText{shot.file, text} : shot;
  } catch (const Error&) {
    return shot;  // the page reports what is wrong when the file is opened by its name
  }
}

schemas::ShotDocument make_take_shot(const store::Take& take, const store::Timeline& timeline,
                                     const std::string& path) {
  const rig::Rig& rig = take.rig();
  const rig::Rig::Camera& central = rig.cameras[central_camera(rig)];
  schemas::ShotDocument shot;
  shot.name = take.document().name;
  const int divisor = (central.model.width() + kMaxWidth - 1) / kMaxWidth;
  shot.width = std::max(1, central.model.width() / divisor);
  shot.height = std::max(1, central.model.height() / divisor);
  shot.first_frame = 1;
  shot.last_frame = static_cast<int>(timeline.ticks.size());

  schemas::ShotDocument::CameraKey key;
  key.frame = 1;
  const Eigen::Vector3d centre = rig.centre();
  key.position = {centre.x(), centre.y(), centre.z()};
  const Eigen::Quaterniond orientation(
      compose::look_at_rotation(centre, centre + rig.mean_viewing_direction()));
  key.orientation = {orientation.w(), orientation.x(), orientation.y(), orientation.z()};
  key.focal_length_mm = kFullFrameWidth * central.model.intrinsics().fx / central.model.width();
  key.focus_m = take.document().depth_range ? rig::optimal_focal_depth(*take.document().depth_range)
                                            : kFocusWithoutDepthRange;
  shot.camera.film_back_mm = kFullFrameWidth;
  shot.camera.keys = {key};

  schemas::ShotDocument::Layer layer;
  layer.name = "light_field";
  layer.take = path;
  layer.focal_plane.kind = schemas::ShotDocument::FocalPlane::Kind::kCamera;
  set_rate(timeline, shot, layer);
  shot.layers = {layer};
  return shot;
}

}  // namespace raystage::replay
