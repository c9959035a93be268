// SPDX-License-Identifier: Apache-2.0
// Internal to schemas/: tables of the properties of a JSON object, for reading and writing.
//   constexpr Fields kStereo(defaulted("interaxial_m", &Stereo::interaxial_m),
//                            optional("convergence_m", &Stereo::convergence_m));
// Properties are read and written in the order of the table.
#pragma once

#include <array>
#include <functional>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "base/atomic_file.h"
#include "base/time.h"
#include "schemas/document.h"

namespace raystage::schemas {

/// Codec of the values that nlohmann::json converts.
struct PlainCodec {
  template <typename T>
  void read(const JsonNode& node, T& value) const {
    value = node.get<T>();
  }
  template <typename T>
  nlohmann::ordered_json write(const T& value) const {
    return value;
  }
};

/// Codec of values that `from` makes of a JsonNode, and `to` converts to JSON.
template <typename From, typename To>
struct Converter {
  From from;
  To to;

  constexpr Converter(From reader, To writer) : from(reader), to(writer) {}
  template <typename T>
  void read(const JsonNode& node, T& value) const {
    value = from(node);
  }
  template <typename T>
  nlohmann::ordered_json write(const T& value) const {
    return to(value);
  }
};
inline constexpr Converter kPath(path_from, std::identity{});
inline constexpr Converter kRelativePath(relative_path_from, std::identity{});
inline constexpr Converter kUtc(utc_from, format_utc);
struct JsonFrom {
  template <typename T>
  nlohmann::ordered_json operator()(const T& value) const {
    return json_from(value);
  }
};
inline constexpr Converter kOptionValues(options_from, JsonFrom{});
inline constexpr Converter kDepthRange(depth_range_from, JsonFrom{});

/// Codec of an enumeration: names of the enumerators 0, 1 ... The schema rejects other names.
template <typename Enum, std::size_t count>
struct EnumNames {
  std::array<std::string_view, count> names;

  constexpr std::string_view name(Enum value) const {
    return names[static_cast<std::size_t>(value)];
  }
  void read(const JsonNode& node, Enum& value) const {
    const auto text = node.get<std::string>();
    for (std::size_t i = 0; i < count; ++i) {
      if (names[i] == text) value = static_cast<Enum>(i);
    }
  }
  nlohmann::ordered_json write(Enum value) const { return name(value); }
};
template <typename Enum, typename... Name>
constexpr auto enum_names(Name... names) {
  return EnumNames<Enum, sizeof...(names)>{{names...}};
}
/// "scale" of a take: whether it is arbitrary.
inline constexpr auto kScaleNames = enum_names<bool>("metres", "arbitrary");

template <typename Codec, bool unique_ids, typename After>
struct ListCodec {
  Codec codec;
  After after;

  template <typename T>
  void read(const JsonNode& list, std::vector<T>& values) const {
    std::set<std::string, std::less<>> seen;
    for (std::size_t i = 0; i < list.size(); ++i) {
      const JsonNode item = list.at(i);
      if constexpr (unique_ids) unique_id_from(item, seen);
      codec.read(item, values.emplace_back());
      after(item, values);
    }
  }
  template <typename T>
  nlohmann::ordered_json write(const std::vector<T>& values) const {
    auto list = nlohmann::ordered_json::array();
    for (const T& value : values) list.push_back(codec.write(value));
    return list;
  }
};
struct NoCheck {
  void operator()(const auto&...) const {}
};
/// `after_item(item, values)` is called after each item with its node and the values so far.
template <typename Codec, typename After = NoCheck>
constexpr auto list_of(Codec codec, After after_item = {}) {
  return ListCodec<Codec, false, After>{codec, after_item};
}
/// A list of objects with unique ids.
template <typename Codec>
constexpr auto list_with_ids(Codec codec) {
  return ListCodec<Codec, true, NoCheck>{codec, {}};
}

enum class Presence {
  kRequired,   ///< the schema requires it
  kDefaulted,  ///< keeps its default if absent, always written
  kOptional    ///< keeps its default if absent, not written if it is empty or the default
};

/// A property that is stored in a member.
template <Presence presence, typename Struct, typename T, typename Codec>
struct Field {
  const char* key;
  T Struct::*member;
  Codec codec;

  void read(const JsonNode& object, Struct& value) const {
    if (presence != Presence::kRequired && !object.has(key)) return;
    read_value(object.at(key), value.*member);
  }
  void write(const Struct& value, nlohmann::ordered_json& object) const {
    if constexpr (presence == Presence::kOptional) {
      if (is_empty(value.*member)) return;
    }
    write_value(value.*member, object[key]);
  }

 private:
  template <typename Value>
  void read_value(const JsonNode& node, Value& value) const {
    codec.read(node, value);
  }
  template <typename Value>
  void read_value(const JsonNode& node, std::optional<Value>& value) const {
    Value found{};
    codec.read(node, found);
    value = std::move(found);
  }
  template <typename Value>
  void write_value(const Value& value, nlohmann::ordered_json& json) const {
    json = codec.write(value);
  }
  template <typename Value>
  void write_value(const std::optional<Value>& value, nlohmann::ordered_json& json) const {
    json = codec.write(*value);
  }
  bool is_empty(const T& value) const {
    if constexpr (requires(T copy) { copy.clear(); }) {
      return value.empty();
    } else if constexpr (requires { value.has_value(); }) {
      return !value.has_value();
    } else {
      return value == Struct{}.*member;
    }
  }
};
template <typename Struct, typename T, typename Codec = PlainCodec>
constexpr auto required(const char* key, T Struct::*member, Codec codec = {}) {
  return Field<Presence::kRequired, Struct, T, Codec>{key, member, codec};
}
template <typename Struct, typename T, typename Codec = PlainCodec>
constexpr auto defaulted(const char* key, T Struct::*member, Codec codec = {}) {
  return Field<Presence::kDefaulted, Struct, T, Codec>{key, member, codec};
}
template <typename Struct, typename T, typename Codec = PlainCodec>
constexpr auto optional(const char* key, T Struct::*member, Codec codec = {}) {
  return Field<Presence::kOptional, Struct, T, Codec>{key, member, codec};
}

/// Part of a table: `reader(object, value)` and `writer(value, object)`.
template <typename Reader, typename Writer>
struct CustomField {
  Reader reader;
  Writer writer;

  template <typename Struct>
  void read(const JsonNode& object, Struct& value) const {
    reader(object, value);
  }
  template <typename Struct>
  void write(const Struct& value, nlohmann::ordered_json& object) const {
    writer(value, object);
  }
};
template <typename Reader, typename Writer>
constexpr auto custom(Reader reader, Writer writer) {
  return CustomField<Reader, Writer>{reader, writer};
}
/// `function(object, value)` throws Error (bad input) for values that the schema cannot reject.
template <typename Function>
constexpr auto check(Function function) {
  return CustomField<Function, NoCheck>{function, {}};
}

/// The properties of `geometry` in the object of the camera that has it.
inline constexpr auto kGeometryFields =
    custom([](const JsonNode& object, auto& camera) { camera.geometry = camera_from(object); },
           [](const auto& camera, nlohmann::ordered_json& object) {
             object.update(json_from(camera.geometry));
           });

/// Codec of an object: what its properties are. A table may be a part of another one.
template <typename... Parts>
struct Fields {
  std::tuple<Parts...> parts;

  constexpr explicit Fields(Parts... list) : parts(list...) {}
  template <typename Struct>
  void read(const JsonNode& object, Struct& value) const {
    std::apply([&](const auto&... part) { (part.read(object, value), ...); }, parts);
  }
  template <typename Struct>
  Struct make(const JsonNode& object) const {
    Struct value;
    read(object, value);
    return value;
  }
  template <typename Struct>
  void write(const Struct& value, nlohmann::ordered_json& object) const {
    std::apply([&](const auto&... part) { (part.write(value, object), ...); }, parts);
  }
  template <typename Struct>
  nlohmann::ordered_json write(const Struct& value) const {
    auto object = nlohmann::ordered_json::object();
    write(value, object);
    return object;
  }
};

/// Parts that are written only if `condition(value)`.
template <typename Condition, typename... Parts>
constexpr auto written_if(Condition condition, Parts... parts) {
  const Fields<Parts...> fields(parts...);
  return custom([fields](const JsonNode& object, auto& value) { fields.read(object, value); },
                [=](const auto& value, nlohmann::ordered_json& object) {
                  if (std::invoke(condition, value)) fields.write(value, object);
                });
}

template <typename Document, typename Table>
Document parse_document_as(std::string_view kind, const Table& fields, std::string_view text,
                           std::string_view name) {
  const nlohmann::json json = parse_document(kind, text, name);
  return fields.template make<Document>(JsonNode{json, name, ""});
}
/// Writes a document atomically. Throws Error (bad input) if `parse` rejects its text.
template <typename Document>
void write_document(const std::string& text, Document (*parse)(std::string_view, std::string_view),
                    const std::filesystem::path& file) {
  parse(text, file.string());
  write_file_atomically(file, text);
}
template <typename Document, typename Table>
std::string format_document(std::string_view kind, const Table& fields, const Document& document,
                            std::optional<int> version = {}) {
  nlohmann::ordered_json json = make_document(kind, version);
  fields.write(document, json);
  return format_json(json);
}

}  // namespace raystage::schemas
