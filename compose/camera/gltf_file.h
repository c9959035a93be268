// SPDX-License-Identifier: Apache-2.0
// Include in .cpp files only: nlohmann/json takes a second to compile.
#pragma once

#include <cstddef>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"

namespace raystage::compose {

/// A glTF 2.0 file: its JSON and its buffers.
class GltfFile {
 public:
  /// Reads .gltf or .glb, which differ in their first bytes. `file`: buffer paths are relative to
  /// it, and errors name it. Throws Error (bad input) if the file or a buffer cannot be used.
  GltfFile(std::string_view bytes, const std::filesystem::path& file);

  const nlohmann::json& document() const { return json_; }

  /// Returns an element of a top-level array. Throws Error (bad input) if the index is invalid.
  const nlohmann::json& element(const char* list, const nlohmann::json& index) const;
  std::size_t count(const char* list) const;

  /// Returns the finite numbers of an accessor, `width` per element; normalised integers as -1 to 1
  /// or 0 to 1. Throws Error (bad input) if it is sparse, exceeds its buffer or has another width.
  std::vector<double> numbers(const nlohmann::json& accessor_index, std::size_t width) const;

  /// Returns an Error (bad input) about this file. `where`: JSON pointer, such as "/nodes/3".
  Error input_error(std::string what_happened, std::string_view where,
                    std::string what_to_do =
                        "Export the file again, or check it with a glTF "
                        "validator") const;

 private:
  void load_glb(std::string_view bytes);
  void load_buffers();
  /// `read_bytes`: of the buffers before.
  std::string load_buffer(const nlohmann::json& buffer, std::size_t index,
                          std::uint64_t read_bytes) const;

  std::filesystem::path file_;
  nlohmann::json json_;
  std::vector<std::string> buffers_;
  std::string embedded_;  ///< binary chunk of a .glb
  bool has_embedded_ = false;
};

}  // namespace raystage::compose
