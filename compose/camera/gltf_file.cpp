// SPDX-License-Identifier: Apache-2.0
#include "compose/camera/gltf_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <utility>

#include "base/atomic_file.h"
#include "base/base64.h"
#include "base/contained_path.h"
#include "schemas/json_text.h"

namespace raystage::compose {
namespace {

using nlohmann::json;

constexpr std::size_t kMaxNumbers = std::size_t{1} << 26;

std::uint32_t word_at(std::string_view bytes, std::size_t offset) {
  std::uint32_t word = 0;
  std::memcpy(&word, bytes.data() + offset, sizeof word);  // glTF is little-endian, as is this host
  return word;
}

/// Decodes percent-encoding: "my%20file.bin".
std::string file_name_from_uri(std::string_view uri) {
  std::string name;
  const auto hex = [](char c) {
    if (c >= '0' && c <= '9') return c - '0';
    if (c >= 'a' && c <= 'f') return c - 'a' + 10;
    if (c >= 'A' && c <= 'F') return c - 'A' + 10;
    return -1;
  };
  for (std::size_t i = 0; i < uri.size(); ++i) {
    if (uri[i] == '%' && i + 2 < uri.size() && hex(uri[i + 1]) >= 0 && hex(uri[i + 2]) >= 0) {
      name += static_cast<char>(hex(uri[i + 1]) * 16 + hex(uri[i + 2]));
      i += 2;
    } else {
      name += uri[i];
    }
  }
  return name;
}

struct Component {
  int type;
  std::size_t bytes;
};
constexpr std::array<Component, 6> kComponents{
    {{5120, 1}, {5121, 1}, {5122, 2}, {5123, 2}, {5125, 4}, {5126, 4}}};

template <class T>
double as_number(const char* bytes, bool normalised) {
  T value;
  std::memcpy(&value, bytes, sizeof value);
  const auto number = static_cast<double>(value);
  if constexpr (std::is_floating_point_v<T>) return number;
  if (!normalised) return number;
  return std::max(number / static_cast<double>(std::numeric_limits<T>::max()), -1.0);
}

double number_at(const char* bytes, int type, bool normalised) {
  switch (type) {
    case 5120:
      return as_number<std::int8_t>(bytes, normalised);
    case 5121:
      return as_number<std::uint8_t>(bytes, normalised);
    case 5122:
      return as_number<std::int16_t>(bytes, normalised);
    case 5123:
      return as_number<std::uint16_t>(bytes, normalised);
    case 5125:
      return as_number<std::uint32_t>(bytes, normalised);
    default:
      return as_number<float>(bytes, false);
  }
}

std::size_t width_of(const std::string& type) {
  if (type == "SCALAR") return 1;
  if (type == "VEC2") return 2;
  if (type == "VEC3") return 3;
  if (type == "VEC4") return 4;
  if (type == "MAT4") return 16;
  return 0;
}

/// Returns a non-negative integer member, `otherwise` if it is missing, -1 for any other value.
std::int64_t integer_member(const json& object, const char* key, std::int64_t otherwise) {
  const auto at = object.find(key);
  if (at == object.end()) return otherwise;
  if (!at->is_number_integer()) return -1;
  const auto value = at->get<std::int64_t>();
  return value < 0 || value > (std::int64_t{1} << 40) ? -1 : value;
}

constexpr std::int64_t kMaxStride = 252;  // glTF 2.0, bufferView.byteStride

}  // namespace

GltfFile::GltfFile(std::string_view bytes, const std::filesystem::path& file) : file_(file) {
  if (bytes.starts_with("glTF")) {
    load_glb(bytes);
  } else {
    json_ = schemas::parse_json(bytes, file.string());
  }
  const json* asset = json_.is_object() && json_.contains("asset") ? &json_["asset"] : nullptr;
  if (asset == nullptr || !asset->is_object() || !asset->contains("version") ||
      !(*asset)["version"].is_string() ||
      !(*asset)["version"].get_ref<const std::string&>().starts_with("2.")) {
    throw input_error("the file is not glTF 2.0", "/asset", "Export it as glTF 2.0");
  }
  load_buffers();
}

void GltfFile::load_glb(std::string_view bytes) {
  constexpr std::uint32_t kJson = 0x4E4F534A, kBinary = 0x004E4942;
  constexpr std::size_t kHeader = 12, kChunk = 8;
  if (bytes.size() < kHeader + kChunk || word_at(bytes, 4) != 2 ||
      word_at(bytes, 8) > bytes.size()) {
    throw input_error("the GLB header is truncated or not of version 2", "");
  }
  bytes = bytes.substr(0, word_at(bytes, 8));
  for (std::size_t at = kHeader; at + kChunk <= bytes.size();) {
    const std::size_t size = word_at(bytes, at);
    const std::uint32_t kind = word_at(bytes, at + 4);
    if (size > bytes.size() - at - kChunk) {
      throw input_error("a chunk exceeds the file", fmt::format("@byte {}", at));
    }
    const std::string_view chunk = bytes.substr(at + kChunk, size);
    if (kind == kJson && json_.is_null()) json_ = schemas::parse_json(chunk, file_.string());
    if (kind == kBinary && !has_embedded_) {
      embedded_ = chunk;
      has_embedded_ = true;
    }
    at += kChunk + (size + 3) / 4 * 4;
  }
}

std::string GltfFile::load_buffer(const json& buffer, std::size_t index,
                                  std::uint64_t read_bytes) const {
  const std::string where = fmt::format("/buffers/{}", index);
  if (!buffer.is_object()) throw input_error("this is not an object", where);
  if (!buffer.contains("uri")) {
    if (index == 0 && has_embedded_) return embedded_;
    throw input_error("the buffer has no data", where);
  }
  if (!buffer["uri"].is_string()) throw input_error("the uri is not a string", where);
  const std::string& uri = buffer["uri"].get_ref<const std::string&>();
  if (!uri.starts_with("data:")) {
    // A stranger's file must not read others than its own: a link could lead anywhere.
    const ContainedPath beside{file_.parent_path(), file_name_from_uri(uri)};
    require_contained(beside);  // says why
    return read_file(beside, kMaxSceneBytes - std::min(kMaxSceneBytes, read_bytes));
  }
  const std::size_t comma = uri.find(',');
  if (comma != std::string::npos && uri.substr(0, comma).ends_with(";base64")) {
    if (auto bytes = decode_base64(std::string_view(uri).substr(comma + 1))) return *bytes;
  }
  throw input_error("the data URI is not base64", where);
}

void GltfFile::load_buffers() {
  std::uint64_t read_bytes = 0;  // many buffers may name one large file
  for (std::size_t i = 0; i < count("buffers"); ++i) {
    buffers_.push_back(load_buffer(json_["buffers"][i], i, read_bytes));
    read_bytes += buffers_.back().size();
  }
}

std::size_t GltfFile::count(const char* list) const {
  const auto at = json_.find(list);
  if (at == json_.end()) return 0;
  if (!at->is_array()) throw input_error("this is not an array", fmt::format("/{}", list));
  return at->size();
}

const json& GltfFile::element(const char* list, const json& index) const {
  if (!index.is_number_integer() || index.get<std::int64_t>() < 0 ||
      index.get<std::uint64_t>() >= count(list)) {
    throw input_error(fmt::format("an index is {}, but there are {} {}",
                                  schemas::describe_json_value(index), count(list), list),
                      fmt::format("/{}", list));
  }
  const json& result = json_[list][index.get<std::size_t>()];
  if (!result.is_object()) {
    throw input_error("this is not an object",
                      fmt::format("/{}/{}", list, index.get<std::size_t>()));
  }
  return result;
}

std::vector<double> GltfFile::numbers(const json& accessor_index, std::size_t width) const {
  const json& accessor = element("accessors", accessor_index);
  const std::string where = fmt::format("/accessors/{}", accessor_index.get<std::size_t>());
  if (accessor.contains("sparse")) {
    throw input_error("sparse accessors of cameras and animations are not supported", where,
                      "Export it without sparse accessors");
  }
  const auto type = accessor.find("type");
  const auto component =
      std::ranges::find(kComponents, static_cast<int>(integer_member(accessor, "componentType", 0)),
                        &Component::type);
  if (type == accessor.end() || !type->is_string() ||
      width_of(type->get_ref<const std::string&>()) != width || component == kComponents.end() ||
      !accessor.contains("bufferView")) {
    throw input_error(fmt::format("the accessor does not have {} numbers per element", width),
                      where);
  }
  const json& view = element("bufferViews", accessor["bufferView"]);
  const std::int64_t buffer = integer_member(view, "buffer", -1);
  const std::int64_t in_buffer = integer_member(view, "byteOffset", 0);
  const std::int64_t length = integer_member(view, "byteLength", -1);
  const std::int64_t in_view = integer_member(accessor, "byteOffset", 0);
  const std::int64_t count = integer_member(accessor, "count", -1);
  const auto packed = static_cast<std::int64_t>(width * component->bytes);
  const std::int64_t stride = integer_member(view, "byteStride", packed);
  if (buffer < 0 || static_cast<std::size_t>(buffer) >= buffers_.size() || in_buffer < 0 ||
      length < 0 || in_view < 0 || count < 1 || stride < packed || stride > kMaxStride ||
      static_cast<std::size_t>(count) * width > kMaxNumbers ||
      in_view + (count - 1) * stride + packed > length ||
      in_buffer + length > static_cast<std::int64_t>(buffers_[buffer].size())) {
    throw input_error("the accessor exceeds its buffer or has no size", where);
  }
  const bool normalised = accessor.value("normalized", json(false)) == json(true);
  const char* begin = buffers_[buffer].data() + in_buffer + in_view;
  std::vector<double> numbers;
  numbers.reserve(static_cast<std::size_t>(count) * width);
  for (std::int64_t i = 0; i < count; ++i) {
    for (std::size_t k = 0; k < width; ++k) {
      const double value =
          number_at(begin + i * stride + static_cast<std::int64_t>(k * component->bytes),
                    component->type, normalised);
      if (!std::isfinite(value)) {
        throw input_error(fmt::format("element {} is not finite", i), where);
      }
      numbers.push_back(value);
    }
  }
  return numbers;
}

Error GltfFile::input_error(std::string what_happened, std::string_view where,
                            std::string what_to_do) const {
  return Error::bad_input(std::move(what_happened), fmt::format("{}#{}", file_.string(), where),
                          std::move(what_to_do));
}

}  // namespace raystage::compose
