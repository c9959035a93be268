// SPDX-License-Identifier: Apache-2.0
#include "compose/camera/camera_export.h"

#include <fmt/format.h>

#include <array>
#include <cctype>
#include <cmath>
#include <numbers>
#include <optional>
#include <vector>

#include "base/cancellation.h"
#include "base/error.h"
#include "compose/camera/gltf_camera.h"

namespace raystage::compose {
namespace {

double vertical_fov(const render::VirtualCamera& view) {
  return 2 * std::atan(view.height / (2 * view.intrinsics.fy));
}

/// The values of one knob of a Nuke node, a key at each frame.
class NukeCurve {
 public:
  void add(int frame, double value) { text_ += fmt::format(" x{} {}", frame, value); }
  std::string text() const { return text_.empty() ? "0" : "{curve" + text_ + "}"; }

 private:
  std::string text_;
};

std::string nuke_name(std::string_view name) {
  std::string result;
  for (const char c : name) result += std::isalnum(static_cast<unsigned char>(c)) != 0 ? c : '_';
  // A node's name does not begin with a digit.
  if (result.empty() || std::isdigit(static_cast<unsigned char>(result.front())) != 0) {
    result.insert(0, "camera_");
  }
  return result;
}

}  // namespace

std::string camera_to_chan(const ShotCamera& camera, std::span<const int> frames, Eye eye,
                           RotationOrder order) {
  std::vector<ChanLine> lines;
  for (const int frame : frames) {
    throw_if_cancelled();
    const render::VirtualCamera view = camera.camera(frame, eye);
    lines.push_back({static_cast<double>(frame), view.pose.position,
                     Eigen::Quaterniond(view.pose.world_from_camera_rotation), vertical_fov(view)});
  }
  return format_chan(lines, order);
}

std::string camera_to_gltf(const ShotCamera& camera, const schemas::ShotDocument& shot,
                           std::span<const int> frames, Eye eye, const std::string& name,
                           std::optional<FrameRate> rate) {
  const FrameRate fps = rate.value_or(FrameRate{shot.fps_numerator, shot.fps_denominator});
  std::vector<GltfCameraKey> keys;
  for (const int frame : frames) {
    throw_if_cancelled();
    const render::VirtualCamera view = camera.camera(frame, eye);
    keys.push_back({static_cast<double>(frame) * fps.denominator / fps.numerator, view.pose,
                    vertical_fov(view)});
  }
  return format_gltf_camera(name, static_cast<double>(shot.width) / shot.height, keys, fps,
                            frames.front());
}

std::string camera_to_nuke_script(const ShotCamera& camera, const schemas::ShotDocument& shot,
                                  std::span<const int> frames, Eye eye, std::string_view name) {
  constexpr double kDegrees = 180 / std::numbers::pi;
  const double film_back = shot.camera.film_back_mm;
  std::array<NukeCurve, 3> translate, rotate;
  NukeCurve focal, shift_x, shift_y, focus, f_number;
  Eigen::Vector3d angles = Eigen::Vector3d::Zero();
  for (const int frame : frames) {
    throw_if_cancelled();
    const CameraState state = camera.state(frame);
    const render::VirtualCamera view = camera.camera(state, eye);
    angles = angles_from_rotation(Eigen::Quaterniond(view.pose.world_from_camera_rotation),
                                  RotationOrder::kZxy, angles);
    for (int axis = 0; axis < 3; ++axis) {
      translate[axis].add(frame, view.pose.position[axis]);
      rotate[axis].add(frame, angles[axis] * kDegrees);
    }
    focal.add(frame, view.intrinsics.fx * film_back / view.width);
    // In half widths of the film back, positive if the picture's centre is right of or above the
    // axis.
    shift_x.add(frame, 1 - 2 * view.intrinsics.cx / view.width);
    shift_y.add(frame, (2 * view.intrinsics.cy - view.height) / view.width);
    if (state.focus_m) focus.add(frame, *state.focus_m);
    if (state.f_number) f_number.add(frame, *state.f_number);
  }
  std::string script = fmt::format(
      "Camera2 {{\n inputs 0\n rot_order ZXY\n translate {{{} {} {}}}\n rotate {{{} {} {}}}\n"
      " focal {{{}}}\n haperture {}\n vaperture {}\n win_translate {{{} {}}}\n",
      translate[0].text(), translate[1].text(), translate[2].text(), rotate[0].text(),
      rotate[1].text(), rotate[2].text(), focal.text(), film_back,
      film_back * shot.height / shot.width, shift_x.text(), shift_y.text());
  if (focus.text() != "0") script += fmt::format(" focal_point {{{}}}\n", focus.text());
  if (f_number.text() != "0") script += fmt::format(" fstop {{{}}}\n", f_number.text());
  return script + fmt::format(" name {}\n}}\n", nuke_name(name));
}

std::vector<std::string> camera_file_losses(const CameraExport& exported,
                                            const std::filesystem::path& file) {
  const std::string extension = file.extension().string();
  if (extension == ".nk") return {};
  bool shifted = false, zooms = false;
  std::optional<double> focal;
  constexpr double kRounding = 1e-9;
  for (const int frame : exported.frames) {
    throw_if_cancelled();
    const render::VirtualCamera view = exported.camera.camera(frame, exported.eye);
    shifted |= std::abs(view.intrinsics.cx / view.width - 0.5) > kRounding ||
               std::abs(view.intrinsics.cy / view.height - 0.5) > kRounding;
    if (!focal) focal = view.intrinsics.fx;
    zooms |= std::abs(view.intrinsics.fx / *focal - 1) > kRounding;
  }
  std::vector<std::string> losses;
  if (shifted) losses.emplace_back("lens shift");
  // KHR_animation_pointer holds it, which hardly any program reads.
  if (zooms && extension == ".gltf") losses.emplace_back("animated focal length");
  return losses;
}

void check_camera_file_losses(const CameraExport& exported, const std::filesystem::path& file,
                              const std::string& what_to_do) {
  const std::vector<std::string> losses = camera_file_losses(exported, file);
  if (losses.empty()) return;
  throw Error::bad_input(fmt::format("{} files cannot hold the camera's {}",
                                     file.extension().string(), fmt::join(losses, " and ")),
                         file.string(), what_to_do);
}

std::string format_camera_file(const CameraExport& exported, const std::filesystem::path& file) {
  std::string name = exported.name.empty() ? exported.shot.name : exported.name;
  if (name.empty()) name = "camera";
  const std::string extension = file.extension().string();
  if (extension == ".chan") {
    return camera_to_chan(exported.camera, exported.frames, exported.eye, exported.order);
  }
  if (extension == ".gltf") {
    return camera_to_gltf(exported.camera, exported.shot, exported.frames, exported.eye, name,
                          exported.gltf_rate);
  }
  if (extension == ".nk") {
    return camera_to_nuke_script(exported.camera, exported.shot, exported.frames, exported.eye,
                                 name);
  }
  throw Error::bad_input("the camera can only be written as .chan, .gltf or .nk", file.string(),
                         "Name the output FILE.chan, FILE.gltf or FILE.nk");
}

}  // namespace raystage::compose
