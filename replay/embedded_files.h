// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string_view>

namespace raystage::replay {

/// A file of replay/web/ when the library was built.
struct EmbeddedFile {
  std::string_view name;  ///< "index.html"
  std::string_view content_type;
  std::string_view content;
};

std::span<const EmbeddedFile> embedded_files();

}  // namespace raystage::replay
