// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "schemas/geometry.h"
#include "schemas/photometric_response.h"

namespace raystage {
struct ContainedPath;
}

namespace raystage::schemas {

/// Schema "raystage/rig/2" (TAKE/rig.json): the physical array. Rigs of pinholes with global
/// shutters are written in version 1, which programs before fisheyes read, too.
struct RigDocument {
  struct Camera {
    CameraGeometry geometry;
    PhotometricResponse photometric;
  };
  std::string name;
  std::string topology = "auto";  ///< "auto" | "grid" | "delaunay": which cameras are neighbours
  std::vector<Camera> cameras;

  /// Returns a camera; null if the rig has none with the ID.
  const Camera* find(std::string_view id) const;
};

/// The name of an uncalibrated rig. Without a rig, `raystage record` assumes default lenses, and
/// cameras in a row with this spacing (metres).
inline constexpr std::string_view kUncalibratedRigName = "not calibrated";
inline constexpr double kDefaultCameraSpacing = 0.1;
/// Returns the name of a projection in JSON, e.g. "ftheta".
std::string_view name_of(Projection projection);

inline bool is_calibrated(const RigDocument& rig) { return rig.name != kUncalibratedRigName; }

RigDocument read_rig(const std::filesystem::path& file);
RigDocument read_rig(const ContainedPath& file);
void write_rig(const RigDocument& rig, const std::filesystem::path& file);

/// Parses and formats the document in memory; errors use `name` as the file name.
RigDocument parse_rig(std::string_view text, std::string_view name);
std::string format_rig(const RigDocument& rig);

}  // namespace raystage::schemas
