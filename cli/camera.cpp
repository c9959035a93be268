// SPDX-License-Identifier: Apache-2.0
// raystage camera: exports a shot's virtual camera.
#include <fmt/format.h>

#include <filesystem>
#include <vector>

#include "base/atomic_file.h"
#include "cli/command.h"
#include "cli/command_line_parsing.h"
#include "compose/camera/camera_export.h"
#include "compose/frame_range.h"

namespace raystage::cli {
namespace {

struct Options {
  std::string shot, output, frames, rotation_order = "ZXY";
  compose::Eye eye = compose::Eye::kBoth;
};

void declare(CommandLine& command, Options& options) {
  command.option("SHOT", options.shot, "the shot (shot.json)").required();
  command
      .option(
          "-o,--output FILE.chan|FILE.gltf|FILE.nk", options.output,
          "file to write: .nk for Nuke (a camera node with lens, shift and focus), .chan (frame "
          "tx ty\ntz rx ry rz and vertical field of view; metres, degrees), or .gltf for "
          "Blender, Maya, Houdini\n(glTF 2.0, with animation)")
      .required();
  command.option("--frames RANGE", options.frames,
                 "frames to write, e.g. 1-48 (default: all of the shot)");
  command
      .option(
          "--rotation-order ORDER", options.rotation_order,
          ".chan: rotation order; set the same in the importing camera (default: ZXY, as in Nuke)")
      .one_of_listed({"XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX"});
  command.choice("--eye", options.eye,
                 {{"left", compose::Eye::kLeft},
                  {"right", compose::Eye::kRight},
                  {"middle", compose::Eye::kBoth}},
                 "camera of a stereo shot; middle = between the eyes (default: middle)");
  command.footer("Exit codes: 0 written; 1 failed; 2 bad usage or input.");
}

std::vector<int> frames_of(const schemas::ShotDocument& shot, const std::string& range) {
  if (!range.empty()) return compose::parse_frame_range(range);
  std::vector<int> frames;
  for (int frame = shot.first_frame; frame <= shot.last_frame; ++frame) frames.push_back(frame);
  return frames;
}

ExitCode write_camera(const Options& options) {
  const std::filesystem::path output = options.output;
  const schemas::ShotDocument shot = schemas::read_shot(options.shot);
  const compose::ShotCamera camera(shot, options.shot);
  if (options.eye != compose::Eye::kBoth && !camera.is_stereo()) {
    throw Error::bad_input("the shot is not stereo: it has no left and right eye", options.shot,
                           "Omit --eye, or add \"stereo\" to the shot's camera");
  }
  const std::vector<int> frames = frames_of(shot, options.frames);
  compose::CameraExport exported{camera, shot, frames, options.eye};
  exported.order =
      compose::parse_rotation_order(options.rotation_order).value_or(compose::RotationOrder::kZxy);
  if (shot.name.empty()) exported.name = std::filesystem::path(options.shot).stem().string();
  write_file_atomically(output, compose::format_camera_file(exported, output));
  fmt::print("{}: {} frames, {}\n", options.output, frames.size(),
             compose::format_frame_range(frames));
  if (output.extension() != ".nk" && options.eye != compose::Eye::kBoth && shot.camera.stereo &&
      shot.camera.stereo->convergence_m) {
    fmt::print(
        "the eye's lens is shifted to converge at {} m; the file format cannot store the shift\n",
        *shot.camera.stereo->convergence_m);
  }
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
  return parse_and_run(command, argc, argv, "camera",
                       [&](std::stop_token) { return write_camera(options); });
}
