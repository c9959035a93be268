// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "base/time.h"
#include "schemas/geometry.h"

namespace raystage {

/// schema "raystage/views/1": views that were never recorded, with the image that is true there.
struct ViewsDocument {
  struct View {
    CameraGeometry geometry;  ///< geometry.id names the view
    std::string file;         ///< truth image, relative to the document's folder; may be empty
    Nanoseconds time_ns = 0;  ///< since the take's epoch
  };
  std::string color_space;
  std::vector<View> views;
};

/// Throws Error with file, JSON pointer, what was found and what is allowed.
ViewsDocument read_views(const std::filesystem::path& file);
void write_views(const ViewsDocument& views, const std::filesystem::path& file);

/// The same in memory; `name` stands for the file in errors.
ViewsDocument parse_views(std::string_view text, std::string_view name);
std::string format_views(const ViewsDocument& views);

}  // namespace raystage
