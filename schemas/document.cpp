// SPDX-License-Identifier: Apache-2.0
#include "schemas/document.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <limits>
#include <memory>
#include <mutex>
#include <vector>

#include "schemas/embedded_schemas.h"
#include "schemas/former_names.h"
#include "schemas/validator.h"

namespace raystage::schemas {
namespace {

using nlohmann::json;

/// Returns the newest version of a kind of document. Versions start at 1.
int newest_version(std::string_view kind) {
  if (kind == "shot") return 3;
  return kind == "rig" || kind == "import" || kind == "take" ? 2 : 1;
}

std::string schema_name(std::string_view kind, int version) {
  return fmt::format("raystage/{}/{}", kind, version);
}

/// Returns the validator of a schema. It is created on first use: most commands need one or two.
const SchemaValidator& validator_of(std::string_view kind) {
  struct Slot {
    std::once_flag once;
    std::unique_ptr<const SchemaValidator> validator;
  };
  static std::vector<Slot> slots(embedded_schemas().size());
  const auto schema = std::ranges::find(embedded_schemas(), kind, &EmbeddedSchema::name);
  if (schema == embedded_schemas().end()) {
    throw std::logic_error("there is no embedded schema of this name: " + std::string(kind));
  }
  Slot& slot = slots[schema - embedded_schemas().begin()];
  std::call_once(slot.once, [&] {
    slot.validator = std::make_unique<const SchemaValidator>(json::parse(schema->text));
  });
  return *slot.validator;
}

/// Returns the version that the document states. Throws Error (bad input) if it is not supported.
int version_of(std::string_view kind, const json& document, std::string_view name) {
  const std::string expected = schema_name(kind, newest_version(kind));
  if (!document.is_object()) {
    throw json_value_error(name, "",
                           fmt::format("found {}, allowed: an object with \"schema\": \"{}\"",
                                       describe_json_value(document), expected),
                           "Check that this is the right file");
  }
  const auto schema = document.find("schema");
  if (schema == document.end()) {
    throw json_value_error(
        name, "",
        fmt::format("the property \"schema\" is missing, allowed there: \"{}\"", expected),
        "Add it, or check that this is the right file");
  }
  const std::string text = schema->is_string() ? schema->get<std::string>() : "";
  const std::string prefix = fmt::format("raystage/{}/", kind);
  if (text.starts_with(prefix)) {
    int version = 0;
    const int newest = newest_version(kind);
    const char* begin = text.data() + prefix.size();
    const char* end = text.data() + text.size();
    const auto [stop, error] = std::from_chars(begin, end, version);
    const bool too_large = error == std::errc::result_out_of_range;
    if (begin != end && stop == end && (too_large || version > newest)) {
      throw json_value_error(name, "/schema",
                             fmt::format("the file has version {}, but this program reads up to {}",
                                         std::string_view(begin, end), newest),
                             "Update Raystage");
    }
    // Only one spelling is valid: not "raystage/shot/01".
    if (version >= 1 && text == fmt::format("{}{}", prefix, version)) return version;
  }
  throw json_value_error(
      name, "/schema",
      fmt::format("found {}, allowed: \"{}\"", describe_json_value(*schema), expected),
      "Check that this is the right file");
}

}  // namespace

JsonNode JsonNode::at(std::string_view key) const {
  return {value.at(std::string(key)), name, append_json_pointer(pointer, key)};
}

JsonNode JsonNode::at(std::size_t index) const {
  return {value.at(index), name, append_json_pointer(pointer, index)};
}

VersionedDocument parse_versioned_document(std::string_view kind, std::string_view text,
                                           std::string_view name) {
  VersionedDocument document{parse_json(text, name), 0};
  document.version = version_of(kind, document.json, name);
  const bool newest = document.version == newest_version(kind);
  const SchemaValidator& validator =
      validator_of(newest ? std::string(kind) : fmt::format("{}-{}", kind, document.version));
  replace_former_names(validator.schema(), document.json, name);
  validator.validate(document.json, name);
  return document;
}

nlohmann::json parse_document(std::string_view kind, std::string_view text, std::string_view name) {
  return parse_versioned_document(kind, text, name).json;
}

nlohmann::ordered_json make_document(std::string_view kind, std::optional<int> version) {
  return {{"schema", schema_name(kind, version.value_or(newest_version(kind)))}};
}

std::string unique_id_from(const JsonNode& object, std::set<std::string, std::less<>>& seen) {
  const JsonNode id = object.at("id");
  auto text = id.get<std::string>();
  if (!seen.insert(text).second) {
    throw id.input_error(fmt::format("the id \"{}\" is used twice", text),
                         "Give each item a unique id");
  }
  return text;
}

std::string path_from(const JsonNode& text) {
  auto path = text.get<std::string>();
  for (const char c : path) {
    if (static_cast<unsigned char>(c) < ' ') {
      throw text.input_error(
          fmt::format("found {}, a path with a control character", describe_json_value(text.value)),
          "Rename the file");
    }
  }
  return path;
}

std::string relative_path_from(const JsonNode& text) {
  std::string path = path_from(text);
  const std::filesystem::path parts(path);
  bool inside = parts.is_relative();
  for (const auto& part : parts) inside = inside && part != "..";
  if (!inside) {
    throw text.input_error(
        fmt::format("found {}, allowed: a path inside the take", describe_json_value(text.value)),
        "Move the file into the take's folder");
  }
  return path;
}

Nanoseconds utc_from(const JsonNode& text) {
  try {
    return parse_utc(text.get<std::string>());
  } catch (const Error& error) {
    throw text.input_error(error.what_happened(), error.what_to_do());
  }
}

DepthRange depth_range_from(const JsonNode& range) {
  const json& values = range.value;
  DepthRange result{0, std::numeric_limits<double>::infinity()};
  if (values[0].is_number()) result.near = values[0].get<double>();
  if (values.size() > 1 && !values[1].is_null()) result.far = values[1].get<double>();
  if (!values[0].is_number() || result.near > result.far) {
    throw range.input_error(
        fmt::format("found {}, allowed: the nearest and then the farthest distance, in metres",
                    values.dump()),
        "Correct the range; omit the farthest distance for infinity");
  }
  return result;
}

nlohmann::ordered_json json_from(const DepthRange& range) {
  if (range.far == std::numeric_limits<double>::infinity()) return {range.near, nullptr};
  return {range.near, range.far};
}

OptionValues options_from(const JsonNode& object) {
  OptionValues options;
  for (const auto& [name, value] : object.value.items()) {
    if (name.starts_with("x_") || name.starts_with("comment")) continue;
    if (value.is_boolean()) {
      options[name] = value.get<bool>();
    } else if (value.is_number()) {
      options[name] = value.get<double>();
    } else if (value.is_string()) {
      options[name] = value.get<std::string>();
    } else {
      throw object.at(name).input_error(
          fmt::format("found {}, allowed: a number, text, true or false",
                      describe_json_value(value)),
          "Correct the value; docs/artist.md lists the options of each method");
    }
  }
  return options;
}

nlohmann::ordered_json json_from(const OptionValues& options) {
  nlohmann::ordered_json json = nlohmann::ordered_json::object();
  for (const auto& [name, value] : options) {
    std::visit([&json, &key = name](const auto& of_type) { json[key] = of_type; }, value);
  }
  return json;
}

}  // namespace raystage::schemas
