// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "schemas/geometry.h"
#include "schemas/photometric_response.h"

namespace raystage {

/// schema "raystage/rig/1" (TAKE/rig.json): the physical array.
struct RigDocument {
  struct Camera {
    CameraGeometry geometry;
    PhotometricResponse photometric;
  };
  std::string name;
  std::string topology = "auto";  ///< "auto" | "grid" | "delaunay": who neighbours whom
  std::vector<Camera> cameras;
};

/// The name of a rig whose places and lenses nobody measured: `raystage record` without a rig
/// guesses them, cameras in a row this far apart (metres).
inline constexpr std::string_view kUncalibratedRigName = "not calibrated";
inline constexpr double kDefaultCameraSpacing = 0.1;
inline bool is_calibrated(const RigDocument& rig) { return rig.name != kUncalibratedRigName; }

RigDocument read_rig(const std::filesystem::path& file);
void write_rig(const RigDocument& rig, const std::filesystem::path& file);

/// The same in memory; `name` stands for the file in errors.
RigDocument parse_rig(std::string_view text, std::string_view name);
std::string format_rig(const RigDocument& rig);

}  // namespace raystage
