// SPDX-License-Identifier: Apache-2.0
// raystage camera: exports a shot's virtual camera.
#include <fmt/format.h>

#include <filesystem>
#include <vector>

#include "base/atomic_file.h"
#include "cli/choice_option.h"
#include "cli/command.h"
#include "cli/command_line_parsing.h"
#include "compose/camera/camera_export.h"
#include "compose/frame_range.h"

namespace raystage {
namespace {

struct Options {
  std::string shot, output, frames, rotation_order = "ZXY";
  Eye eye = Eye::kBoth;
};

void declare(CLI::App& app, Options& options) {
  app.add_option("SHOT", options.shot, "the shot whose camera is written (shot.json)")->required();
  app.add_option(
         "-o,--output", options.output,
         "the file: .chan for Nuke (frame tx ty tz rx ry rz and the vertical field of view; "
         "metres,\ndegrees) or .gltf for Blender, Maya, Houdini (glTF 2.0, with animation)")
      ->required()
      ->type_name("FILE.chan|FILE.gltf");
  app.add_option("--frames", options.frames,
                 "frames to write, e.g. 1-48 (default: all of the shot)")
      ->type_name("RANGE");
  app.add_option("--rotation-order", options.rotation_order,
                 ".chan: order in which the angles are applied; set the same in the reading camera "
                 "(default: ZXY,\nNuke's own)")
      ->check(CLI::IsMember({"XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX"}))
      ->type_name("ORDER");
  add_choice<Eye>(app, "--eye", options.eye,
                  {{"left", Eye::kLeft}, {"right", Eye::kRight}, {"middle", Eye::kBoth}},
                  "camera of a stereo shot; middle = between the eyes (default: middle)");
  app.footer("Exit codes: 0 written; 1 failed; 2 bad usage or input.");
}

std::vector<int> frames_of(const ShotDocument& shot, const std::string& range) {
  if (!range.empty()) return parse_frame_range(range);
  std::vector<int> frames;
  for (int frame = shot.first_frame; frame <= shot.last_frame; ++frame) frames.push_back(frame);
  return frames;
}

ExitCode write_camera(const Options& options) {
  const std::filesystem::path output = options.output;
  const ShotDocument shot = read_shot(options.shot);
  const ShotCamera camera(shot, options.shot);
  if (options.eye != Eye::kBoth && !camera.is_stereo()) {
    throw Error::bad_input("the shot is not stereo: it has no left and right eye", options.shot,
                           "Omit --eye, or add \"stereo\" to the shot's camera");
  }
  const std::vector<int> frames = frames_of(shot, options.frames);
  std::string text;
  if (output.extension() == ".chan") {
    const RotationOrder order =
        parse_rotation_order(options.rotation_order).value_or(RotationOrder::kZxy);
    text = camera_to_chan(camera, frames, options.eye, order);
  } else if (output.extension() == ".gltf") {
    const std::string name =
        shot.name.empty() ? std::filesystem::path(options.shot).stem().string() : shot.name;
    text = camera_to_gltf(camera, shot, frames, options.eye, name);
  } else {
    throw Error::bad_input("the camera can only be written as .chan or .gltf", options.output,
                           "Name the output FILE.chan or FILE.gltf");
  }
  write_file_atomically(output, text);
  fmt::print("{}: {} frames, {}\n", options.output, frames.size(), format_frame_range(frames));
  if (options.eye != Eye::kBoth && shot.camera.stereo && shot.camera.stereo->convergence_m) {
    fmt::print(
        "the eye's lens is shifted to converge at {} m; the file format cannot store the shift\n",
        *shot.camera.stereo->convergence_m);
  }
  return ExitCode::kSuccess;
}

}  // namespace
}  // namespace raystage

int main(int argc, char** argv) {
  using namespace raystage;
  CLI::App app{"Exports a shot's virtual camera for other programs.", "raystage camera"};
  Options options;
  declare(app, options);
  return parse_and_run(app, argc, argv, "camera",
                       [&](std::stop_token) { return write_camera(options); });
}
