// SPDX-License-Identifier: Apache-2.0
// raystage camera: exports a shot's virtual camera.
#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <optional>
#include <vector>

#include "base/atomic_file.h"
#include "base/cancellation.h"
#include "base/frame_rate.h"
#include "base/number_text.h"
#include "cli/command.h"
#include "cli/command_line_parsing.h"
#include "cli/printing.h"
#include "compose/camera/camera_export.h"
#include "compose/frame_range.h"

namespace raystage::cli {
namespace {

struct Options {
  std::string shot, output, frames, rotation_order = "ZXY";
  compose::Eye eye = compose::Eye::kBoth;
  bool lossy = false;
  std::string gltf_fps;
};

void declare(CommandLine& command, Options& options) {
  command.option("SHOT", options.shot, "the shot (shot.json)").required();
  command
      .option(
          "-o,--output FILE.chan|FILE.gltf|FILE.nk", options.output,
          "file to write: .nk for Nuke (a camera node with lens, shift and focus), .chan (frame "
          "tx ty\ntz rx ry rz and vertical field of view; metres, degrees), or .gltf for "
          "Blender, Maya, Houdini\n(glTF 2.0, with animation; the time of a frame is its number "
          "divided by the frame rate)")
      .required();
  command.option("--frames RANGE", options.frames,
                 "frames to write, e.g. 1-48 (default: all of the shot)");
  command
      .option("--rotation-order ORDER", options.rotation_order,
              ".chan: rotation order; set the same in the importing camera (default: ZXY, as in "
              "Nuke; Blender: XYZ)")
      .one_of_listed({"XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX"});
  command.choice("--eye", options.eye,
                 {{"left", compose::Eye::kLeft},
                  {"right", compose::Eye::kRight},
                  {"middle", compose::Eye::kBoth}},
                 "camera of a stereo shot; middle = between the eyes (default: middle)");
  command.option(
      "--gltf-fps FPS", options.gltf_fps,
      ".gltf: frames per second of its times, a number or a ratio (default: the shot's). "
      "Blender\nignores the base of its frame rate: write 24 for 24000/1001");
  command.flag("--lossy", options.lossy,
               "write the file although it cannot hold lens shift (.chan, .gltf) or an animated "
               "focal\nlength (.gltf)");
  command.footer("Exit codes: 0 written; 1 failed; 2 bad usage or input.");
}

std::vector<int> frames_of(const schemas::ShotDocument& shot, const std::string& range) {
  if (!range.empty()) return compose::parse_frame_range(range);
  std::vector<int> frames;
  for (int frame = shot.first_frame; frame <= shot.last_frame; ++frame) frames.push_back(frame);
  return frames;
}

FrameRate parse_rate(const std::string& text) {
  std::optional<FrameRate> rate = frame_rate_from(text);
  if (const auto number = parse_number<double>(text)) rate = frame_rate_from(*number);
  if (rate) return *rate;
  throw Error::bad_input(fmt::format("found \"{}\", allowed: a frame rate", text), "--gltf-fps",
                         "Use for example 24 or 24000/1001");
}

/// Prints what the importing program must be told, since the file does not hold it.
void print_import_settings(const compose::CameraExport& exported, const std::filesystem::path& file,
                           const std::string& rotation_order) {
  const schemas::ShotDocument& shot = exported.shot;
  if (file.extension() == ".chan") {
    print(
        "Set the film back of the importing camera to {:.6g} x {:.6g} mm and its rotation order to "
        "{} (the default is ZXY in Nuke, XYZ in Blender).\n",
        shot.camera.film_back_mm, shot.camera.film_back_mm * shot.height / shot.width,
        rotation_order);
  }
  if (file.extension() == ".gltf") {
    const FrameRate rate =
        exported.gltf_rate.value_or(FrameRate{shot.fps_numerator, shot.fps_denominator});
    print("Set the frame rate of the importing scene to {} fps before the import.\n",
          rate.denominator == 1 ? fmt::format("{}", rate.numerator)
                                : fmt::format("{}/{}", rate.numerator, rate.denominator));
    if (rate.denominator != 1) {
      print("Blender ignores the base of its frame rate: for Blender, add --gltf-fps {}.\n",
            std::lround(rate.fps()));
    }
  }
  for (const std::string& loss : compose::camera_file_losses(exported, file)) {
    print("The {} is lost.\n", loss);
  }
  const compose::CameraState first = exported.camera.state(exported.frames.front());
  if (file.extension() != ".nk" && (first.focus_m || first.f_number)) {
    print("Focus distance and f-number are not in the file; .nk files hold them.\n");
  }
}

ExitCode write_camera(const Options& options) {
  const std::filesystem::path output = options.output;
  const schemas::ShotDocument shot = schemas::read_shot(options.shot);
  const compose::ShotCamera camera(shot, options.shot);
  if (camera.is_equirectangular()) {
    throw Error::bad_input("an equirectangular camera has no lens that these files could hold",
                           options.shot, "Export a perspective camera with the same keys");
  }
  if (options.eye != compose::Eye::kBoth && !camera.is_stereo()) {
    throw Error::bad_input("the shot is not stereo: it has no left and right eye", options.shot,
                           "Omit --eye, or add \"stereo\" to the shot's camera");
  }
  const std::vector<int> frames = frames_of(shot, options.frames);
  compose::CameraExport exported{camera, shot, frames, options.eye};
  exported.order =
      compose::parse_rotation_order(options.rotation_order).value_or(compose::RotationOrder::kZxy);
  if (!options.gltf_fps.empty()) exported.gltf_rate = parse_rate(options.gltf_fps);
  if (shot.name.empty()) exported.name = std::filesystem::path(options.shot).stem().string();
  if (!options.lossy) {
    compose::check_camera_file_losses(exported, output,
                                      "Write a .nk file, which holds it, or accept the loss with "
                                      "--lossy");
  }
  write_file_atomically(output, compose::format_camera_file(exported, output));
  if (!camera.file_summary().empty()) print("Camera: {}\n", camera.file_summary());
  print("{}: {} frames, {}\n", options.output, frames.size(), compose::format_frame_range(frames));
  print_import_settings(exported, output, options.rotation_order);
  return ExitCode::kSuccess;
}

}  // namespace
}  // namespace raystage::cli

int main(int argc, char** argv) {
  using namespace raystage;
  using namespace raystage::cli;
  CommandLine command{"Exports a shot's virtual camera for other programs.", "raystage camera"};
  Options options;
  declare(command, options);
  return parse_and_run(command, argc, argv, "camera", [&](std::stop_token stop) {
    const CancellationScope cancellation(std::move(stop));
    return write_camera(options);
  });
}
