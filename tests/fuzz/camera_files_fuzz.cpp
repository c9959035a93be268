// SPDX-License-Identifier: Apache-2.0
// Reads any bytes as another program's camera or rig, by the first byte: .chan (c), a rig of
// facebook360 (F), Google (G), NeRF (N) or COLMAP (M: cameras.txt and images.txt with a form feed
// between them), otherwise glTF, whose nodes may move meshes, too. A camera that is read has finite
// values and does not change when written and read again.
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "compose/camera/chan_file.h"
#include "compose/camera/gltf_camera.h"
#include "compose/geometry/mesh_animation.h"
#include "ingest/rig_formats/rig_format.h"
#include "rig/camera_model.h"
#include "rig/pose.h"

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

std::vector<raystage::ingest::NamedText> files_of(const raystage::ingest::RigFormat& format,
                                                  std::string_view text) {
  std::vector<raystage::ingest::NamedText> files;
  for (std::size_t i = 0; i < format.needed_files(); ++i) {
    const std::size_t end = std::min(text.find('\f'), text.size());
    files.push_back({format.files()[i], std::string(text.substr(0, end))});
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return files;
}

void check_camera(const raystage::schemas::CameraGeometry& camera) {
  const raystage::rig::Pose pose = raystage::rig::pose_from_matrix(camera.world_from_camera);
  if (!pose.position.allFinite() || !pose.world_from_camera_rotation.allFinite()) std::abort();
  if (!(std::abs(pose.world_from_camera_rotation.determinant() - 1) < 1e-6)) std::abort();
  try {
    const raystage::rig::CameraModel model(camera);
    const auto ray = model.unproject({camera.width / 3.0, camera.height / 3.0});
    if (ray && !ray->allFinite()) std::abort();
  } catch (const raystage::Error&) {  // a lens that sees nothing
  }
}

constexpr std::size_t kLongestId = 90;  // characters that ids keep of a file name

bool has_long_ids(const raystage::schemas::RigDocument& rig) {
  for (const auto& camera : rig.cameras) {
    if (camera.geometry.id.size() > kLongestId) return true;
  }
  return false;
}

/// COLMAP, Google and NeRF have no half angle.
bool is_same_lens(const raystage::schemas::Intrinsics& a, const raystage::schemas::Intrinsics& b) {
  return a.fx == b.fx && a.fy == b.fy && a.cx == b.cx && a.cy == b.cy &&
         a.projection == b.projection && a.distortion == b.distortion &&
         a.radial_distortion == b.radial_distortion;
}

void read_rig_of(std::string_view name, std::string_view text) {
  const raystage::ingest::RigFormat& format = raystage::ingest::rig_format(name);
  raystage::schemas::RigDocument rig;
  std::vector<raystage::ingest::NamedText> written;
  try {
    for (const auto& camera : format.parse(files_of(format, text), nullptr).cameras) {
      check_camera(camera.geometry);
      rig.cameras.push_back({camera.geometry, {}});
    }
    written = format.format(rig).files;
  } catch (const raystage::Error&) {
    return;
  }
  if (has_long_ids(rig)) return;
  written.resize(format.needed_files());
  const auto again = format.parse(written, nullptr).cameras;
  if (again.size() != rig.cameras.size()) std::abort();
  for (const auto& camera : again) {
    const auto* before = rig.find(camera.geometry.id);
    if (before == nullptr) std::abort();
    if (!is_same_lens(camera.geometry.intrinsics, before->geometry.intrinsics)) std::abort();
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::string_view rest(reinterpret_cast<const char*>(data) + 1, size - 1);
  switch (data[0]) {
    case 'c':
      read_chan(rest);
      break;
    case 'F':
      read_rig_of("facebook360", rest);
      break;
    case 'G':
      read_rig_of("google", rest);
      break;
    case 'N':
      read_rig_of("nerf", rest);
      break;
    case 'M':
      read_rig_of("colmap", rest);
      break;
    default:
      read_gltf(rest);
      read_motion(rest);
  }
  return 0;
}
