// SPDX-License-Identifier: Apache-2.0
// Include in .cpp files only: nlohmann/json takes a second to compile.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "base/frame_rate.h"
#include "compose/camera/gltf_timing.h"

namespace raystage::compose {

class GltfFile;

/// An animated property of a glTF file: keys of `width` numbers, interpolated as the file defines.
class GltfSampler {
 public:
  enum class Kind { kStep, kLinear, kCubic };

  GltfSampler(Kind kind, std::vector<double> times, std::vector<double> values, std::size_t width,
              bool is_rotation)
      : kind_(kind),
        times_(std::move(times)),
        values_(std::move(values)),
        width_(width),
        is_rotation_(is_rotation) {}

  /// Returns the times of the keys, seconds, ascending.
  const std::vector<double>& times() const { return times_; }
  /// Returns the value at a time: that of the nearest key before the first and after the last.
  std::vector<double> at(double seconds) const;

 private:
  /// Returns a key. `part` of a CUBICSPLINE key: 0 in-tangent, 1 value, 2 out-tangent.
  std::vector<double> key(std::size_t i, std::size_t part = 1) const;
  std::vector<double> spline(std::size_t from, std::size_t to, double u) const;

  Kind kind_;
  std::vector<double> times_, values_;
  std::size_t width_;
  bool is_rotation_;
};

/// The animated properties by target, such as "/nodes/3/rotation".
using GltfSamplers = std::map<std::string, GltfSampler>;

/// The local transform of a node; samplers replace animated properties.
struct GltfNode {
  std::string path;  ///< "/nodes/3"
  std::vector<double> translation, rotation, scale;
  std::optional<Eigen::Matrix4d> matrix;

  Eigen::Matrix4d parent_from_node(double seconds, const GltfSamplers& samplers) const;
  /// Adds the targets of the node's properties.
  void add_targets(std::set<std::string>& targets) const;
};

/// Reads a node. Throws Error (bad input) for an invalid index or values that are not numbers.
GltfNode read_gltf_node(const GltfFile& file, std::size_t index);

/// Returns the samplers of those targets in `wanted` that are animated, by all animations of the
/// file. Key times that differ from those of frames at `rate` by the rounding of floats only are
/// corrected. Throws Error (bad input) if a target is animated twice or a sampler is damaged.
GltfSamplers read_gltf_samplers(const GltfFile& file, const std::set<std::string>& wanted,
                                FrameRate rate);

/// Returns the times of all keys, seconds, ascending.
std::vector<double> key_seconds_of(const GltfSamplers& samplers);

/// Reads what the file states about its frames. Throws Error (bad input) if that is no frame rate
/// or frame number.
GltfTiming read_gltf_timing(const GltfFile& file, const GltfFrameRate& rate);

/// Returns a property that is text, or "" if the object has none.
std::string gltf_text(const nlohmann::json& object, const char* key);

}  // namespace raystage::compose
