// SPDX-License-Identifier: Apache-2.0
// Reads any bytes as another program's camera: .chan if the first byte is 'c', otherwise glTF,
// whose nodes may move meshes, too. A camera that is read has finite values and does not change
// when written and read again.
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <string_view>

#include "base/error.h"
#include "compose/camera/chan_file.h"
#include "compose/camera/gltf_camera.h"
#include "compose/geometry/mesh_animation.h"

namespace {

void read_chan(std::string_view text) {
  std::vector<raystage::compose::ChanLine> lines;
  try {
    lines = raystage::compose::parse_chan(text, raystage::compose::RotationOrder::kZxy, "input");
  } catch (const raystage::Error&) {
    return;
  }
  const auto again = raystage::compose::parse_chan(
      raystage::compose::format_chan(lines, raystage::compose::RotationOrder::kXyz),
      raystage::compose::RotationOrder::kXyz, "again");
  if (again.size() != lines.size()) std::abort();
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (again[i].frame != lines[i].frame || again[i].position != lines[i].position) std::abort();
    // Angles of a billion turns have no significant digits below a turn.
    if (!(again[i].orientation.angularDistance(lines[i].orientation) < 1e-6)) std::abort();
  }
}

void read_gltf(std::string_view bytes) {
  try {
    const auto camera = raystage::compose::parse_gltf_camera(bytes, "nowhere/input.gltf", "");
    for (const double part : {-1.0, 0.0, 0.3, 1.0, 2.0}) {
      const double seconds = camera.key_seconds.empty() ? part : part * camera.key_seconds.back();
      const raystage::rig::Pose pose = camera.pose(seconds);
      if (!pose.world_from_camera_rotation.allFinite()) std::abort();
      if (!(std::abs(pose.world_from_camera_rotation.determinant() - 1) < 1e-6)) std::abort();
      if (!(camera.vertical_fov(seconds) > 0)) std::abort();
    }
  } catch (const raystage::Error&) {
  }
}

void read_motion(std::string_view bytes) {
  constexpr std::size_t kNodes[] = {0, 1, 2, 7};
  try {
    const auto motion = raystage::compose::parse_mesh_animation(bytes, "nowhere/input.gltf",
                                                                {{}, {24, 1}}, {}, kNodes);
    if (!motion) return;
    if (motion->key_seconds.empty()) std::abort();
    const std::size_t nodes = motion->file_from_node(0).size();
    for (const double part : {-1.0, 0.3, 1.0, 2.0}) {
      if (motion->file_from_node(part * motion->key_seconds.back()).size() != nodes) std::abort();
    }
  } catch (const raystage::Error&) {
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::string_view rest(reinterpret_cast<const char*>(data) + 1, size - 1);
  if (data[0] == 'c') {
    read_chan(rest);
  } else {
    read_gltf(rest);
    read_motion(rest);
  }
  return 0;
}
