// SPDX-License-Identifier: Apache-2.0
// For tests: images, cameras and manifests to import.
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/atomic_file.h"
#include "schemas/import_manifest.h"
#include "store/jpeg/encode.h"

namespace raystage::testing {

/// Returns an image for each `seed`, so smooth that JPEG changes it little.
inline store::RgbImage picture(int width, int height, int seed) {
  store::RgbImage image{width, height, std::vector<std::uint8_t>()};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (const int value : {40 + 2 * x + 9 * seed, 200 - 2 * y, 60 + x + y}) {
        image.values.push_back(static_cast<std::uint8_t>(value & 255));
      }
    }
  }
  return image;
}

inline std::string bytes_to_string(std::span<const std::byte> bytes) {
  std::string text;
  for (const std::byte byte : bytes) text.push_back(static_cast<char>(byte));
  return text;
}

/// Returns a JPEG without restart markers, as most cameras send it.
inline std::string jpeg_as_string(const store::RgbImage& image) {
  return bytes_to_string(store::encode_jpeg(image, {.quality = 90, .restart_interval = 0}));
}

inline schemas::ImportManifest::Camera camera(std::string id, int width, int height) {
  schemas::ImportManifest::Camera result;
  result.geometry.id = std::move(id);
  result.geometry.width = width;
  result.geometry.height = height;
  result.geometry.intrinsics.fx = result.geometry.intrinsics.fy = 50;
  result.geometry.intrinsics.cx = width / 2.0;
  result.geometry.intrinsics.cy = height / 2.0;
  return result;
}

inline schemas::ImportManifest empty_manifest() {
  schemas::ImportManifest manifest;
  manifest.name = "test";
  manifest.epoch_utc = 5;
  manifest.nominal_fps = 15;
  manifest.color_space = "srgb_texture";
  return manifest;
}

/// Writes three JPEG frames of each of two cameras to `folder`, and returns their manifest.
inline schemas::ImportManifest write_two_cameras(const std::filesystem::path& folder) {
  schemas::ImportManifest manifest = empty_manifest();
  for (int c = 0; c < 2; ++c) {
    manifest.cameras.push_back(camera("cam" + std::to_string(c), 48, 40));
    for (int i = 0; i < 3; ++i) {
      const std::string file = std::to_string(c) + "_" + std::to_string(i) + ".jpg";
      write_file_atomically(folder / file, jpeg_as_string(picture(48, 40, c * 3 + i)));
      manifest.cameras.back().frames.push_back({file, i * 66'666'667LL + c});
    }
  }
  return manifest;
}

}  // namespace raystage::testing
