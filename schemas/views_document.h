// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "base/time.h"
#include "schemas/geometry.h"

namespace raystage::schemas {

/// Schema "raystage/views/1": views that no camera recorded, with their ground-truth images.
struct ViewsDocument {
  struct View {
    CameraGeometry geometry;  ///< geometry.id names the view
    std::string file;  ///< ground-truth image, relative to the document's folder; may be empty
    Nanoseconds time_ns = 0;  ///< since the take's epoch
    /// EXR file of the true planar depths (Z, metres), relative likewise; may be empty.
    std::string depth_file = {};
    /// EXR file of the true linear light (R, G, B, white = 1, not clipped), relative likewise; may
    /// be empty.
    std::string light_file = {};
  };
  std::string color_space;
  std::vector<View> views;
};

/// Reads the document. Throws Error (bad input) with the file, the JSON pointer, the value found
/// and what is allowed.
ViewsDocument read_views(const std::filesystem::path& file);
void write_views(const ViewsDocument& views, const std::filesystem::path& file);

/// Parses and formats the document in memory; errors use `name` as the file name.
ViewsDocument parse_views(std::string_view text, std::string_view name);
std::string format_views(const ViewsDocument& views);

}  // namespace raystage::schemas
