// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "base/atomic_file.h"
#include "compose/exr/exr_deep_file.h"
#include "compose/exr/exr_file.h"
#include "render/common/view.h"

namespace raystage::testing {

/// Returns layers with colours, depth, coverage and measures. Keeps references to the view.
inline compose::ExrView exr_view(const render::RenderedView& view, const std::string& name = "") {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  compose::ExrView result{name, {}};
  result.layers.push_back({"", {"R", "G", "B", "A"}, true, view.rgba, 0});
  result.layers.push_back({"depth", {"Z"}, false, view.z, kInfinity});
  result.layers.push_back({"lf", {"coverage"}, false, view.coverage, 0});
  if (!view.cameras.empty()) {
    result.layers.push_back({"lf", {"cameras"}, false, view.cameras, 0});
    result.layers.push_back({"lf", {"nearest"}, false, view.nearest_ray, kInfinity});
  }
  return result;
}

/// Writes encode_exr(), returns the bytes written.
inline std::size_t write_exr(std::span<const compose::ExrView> views,
                             std::span<const compose::ExrCamera> cameras,
                             const compose::ExrMetadata& metadata,
                             const std::filesystem::path& file) {
  const std::vector<std::byte> bytes = encode_exr(views, cameras, metadata);
  write_file_atomically(file, bytes);
  return bytes.size();
}

/// Writes encode_deep_exr(), returns the bytes written.
inline std::size_t write_deep_exr(std::span<const compose::ExrDeepView> views,
                                  std::span<const compose::ExrCamera> cameras,
                                  const compose::ExrMetadata& metadata,
                                  const std::filesystem::path& file) {
  const std::vector<std::byte> bytes = encode_deep_exr(views, cameras, metadata);
  write_file_atomically(file, bytes);
  return bytes.size();
}

}  // namespace raystage::testing
