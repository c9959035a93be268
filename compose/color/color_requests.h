// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "sandbox/byte_encoding.h"

namespace raystage::compose {

/// What raystage-apply-ocio is asked for.
enum class ColorQuestion : std::uint8_t {
  kDescription,         ///< result: text
  kInteropId,           ///< of the space names[0]; result: text
  kSpaceFromInteropId,  ///< names[0]; result: text
  kProperties,          ///< of the transform; result: TransformProperties
  kApply                ///< number of channels (int) and values follow; result: the values
};

enum class TransformKind : std::uint8_t { kToSpace, kFromSpace, kBetween, kToDisplay };

/// A request without state: it states the config and the transform.
struct ColorRequest {
  ColorQuestion question{};
  std::string file, rec709_name;  ///< of the config
  TransformKind kind{};
  std::array<std::string, 3> names;  ///< arguments of ColorConfig's function

  bool operator==(const ColorRequest&) const = default;
};

inline void write_request(sandbox::ByteWriter& writer, const ColorRequest& request) {
  writer.write(static_cast<std::uint8_t>(request.question));
  writer.write_plain(request.file);
  writer.write_plain(request.rec709_name);
  writer.write(static_cast<std::uint8_t>(request.kind));
  for (const std::string& name : request.names) writer.write_plain(name);
}

inline ColorRequest read_request(sandbox::ByteReader& reader) {
  ColorRequest request;
  request.question = static_cast<ColorQuestion>(reader.read<std::uint8_t>());
  reader.read_plain(request.file);
  reader.read_plain(request.rec709_name);
  request.kind = static_cast<TransformKind>(reader.read<std::uint8_t>());
  for (std::string& name : request.names) reader.read_plain(name);
  return request;
}

/// See OcioTransform.
struct TransformProperties {
  bool is_no_op = false, is_linear = false, is_matrix = false;
  std::array<std::array<float, 3>, 3> columns{};
};

}  // namespace raystage::compose
