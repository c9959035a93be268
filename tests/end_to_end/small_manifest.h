// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "store/jpeg/encode.h"
#include "tests/end_to_end/run_command.h"

namespace raystage::testing {

/// Returns an import manifest of three cameras in a row, each with one picture next to the
/// manifest.
inline std::string small_manifest() {
  const auto camera = [](const std::string& id, double x) {
    return R"({"id": ")" + id + R"(", "width": 32, "height": 24,
      "intrinsics": {"fx": 30, "fy": 30, "cx": 16, "cy": 12},
      "world_from_camera": [[1,0,0,)" +
           std::to_string(x) + R"(],[0,1,0,0],[0,0,1,0],[0,0,0,1]],
      "frames": [{"file": ")" +
           id + R"(.jpg", "time_ns": 0}]})";
  };
  return R"({"schema": "raystage/import/1", "name": "row", "epoch_utc": "2026-01-01T00:00:00Z",
      "nominal_fps": 15, "color_space": "srgb_texture", "depth_range_m": [1, 4],
      "cameras": [)" +
         camera("a", 0) + "," + camera("b", 0.06) + "," + camera("c", 0.12) + "]}";
}

/// Writes small_manifest() to folder/import.json, and its pictures. They show stripes, so that no
/// derived file is tiny.
inline void write_small_manifest(const std::filesystem::path& folder) {
  store::RgbImage picture{32, 24, std::vector<std::uint8_t>(32 * 24 * 3)};
  for (std::size_t i = 0; i < picture.values.size(); ++i) {
    picture.values[i] = static_cast<std::uint8_t>(40 + i * i % 170);
  }
  const auto jpeg = store::encode_jpeg(picture, {});
  for (const char* name : {"a.jpg", "b.jpg", "c.jpg"}) {
    write_text(folder / name, {reinterpret_cast<const char*>(jpeg.data()), jpeg.size()});
  }
  write_text(folder / "import.json", small_manifest());
}

}  // namespace raystage::testing
