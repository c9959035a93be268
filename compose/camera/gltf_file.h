// SPDX-License-Identifier: Apache-2.0
// For .cpp files only: shows nlohmann's types, which take a second to compile.
#pragma once

#include <cstddef>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"

namespace raystage {

/// A glTF 2.0 file: its JSON, and the numbers in its buffers.
class GltfFile {
 public:
  /// .gltf or .glb, told apart by what they begin with. Throws Error (bad input).
  /// `file`: what buffers beside it are found by, and what errors name.
  GltfFile(std::string_view bytes, const std::filesystem::path& file);

  const nlohmann::json& document() const { return json_; }

  /// Of a list at the top of the document, by index. Throws Error (bad input) where it is not
  /// there.
  const nlohmann::json& element(const char* list, const nlohmann::json& index) const;
  std::size_t count(const char* list) const;

  /// The numbers of an accessor, `width` for each element, finite; normalised integers as -1 to 1
  /// or 0 to 1. Throws Error (bad input): another shape, beyond its buffer, sparse.
  std::vector<double> numbers(const nlohmann::json& accessor_index, std::size_t width) const;

  /// Bad input in this file; `where` is what it is about, such as "/nodes/3".
  Error input_error(std::string what_happened, std::string_view where,
                    std::string what_to_do) const;

 private:
  void load_glb(std::string_view bytes);
  void load_buffers();
  std::string load_buffer(const nlohmann::json& buffer, std::size_t index) const;

  std::filesystem::path file_;
  nlohmann::json json_;
  std::vector<std::string> buffers_;
  std::string embedded_;  ///< binary chunk of a .glb
  bool has_embedded_ = false;
};

}  // namespace raystage
