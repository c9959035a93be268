// SPDX-License-Identifier: Apache-2.0
#include "schemas/json_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>
#include <vector>

namespace raystage::schemas {
namespace {

using nlohmann::json;
using nlohmann::ordered_json;

constexpr std::size_t kDeepest = 64;
constexpr std::size_t kColumns = 100;
constexpr const char* kCorrectSyntax = "Correct the file; it must be strict JSON";

/// Returns "NAME:line:column" of the byte before `end`, where the parser stopped.
std::string place_in_text(std::string_view text, std::size_t end, std::string_view name) {
  const std::string_view before = text.substr(0, std::min(end == 0 ? 0 : end - 1, text.size()));
  const auto line = 1 + std::count(before.begin(), before.end(), '\n');
  const std::size_t start = before.rfind('\n') == before.npos ? 0 : before.rfind('\n') + 1;
  return fmt::format("{}:{}:{}", name, line, before.size() - start + 1);
}

/// Builds the document like nlohmann's parser, but also rejects duplicate keys and deep nesting.
class DocumentBuilder final : public json::json_sax_t {
 public:
  DocumentBuilder(std::string_view text, std::string_view name) : text_(text), name_(name) {}

  json take() { return std::move(root_); }

  bool null() override { return add(nullptr); }
  bool boolean(bool value) override { return add(value); }
  bool number_integer(number_integer_t value) override { return add(value); }
  bool number_unsigned(number_unsigned_t value) override { return add(value); }
  bool number_float(number_float_t value, const string_t&) override { return add(value); }
  bool string(string_t& value) override { return add(std::move(value)); }
  bool binary(binary_t&) override { return false; }
  bool start_object(std::size_t) override { return open(json::object()); }
  bool start_array(std::size_t) override { return open(json::array()); }
  bool end_object() override { return close(); }
  bool end_array() override { return close(); }

  bool key(string_t& key) override {
    Level& level = levels_.back();
    level.key = std::move(key);
    if (level.container->contains(level.key)) {
      throw json_value_error(name_, pointer(),
                             fmt::format("the property \"{}\" is given twice", level.key),
                             "Keep one of them");
    }
    return true;
  }

  bool parse_error(std::size_t position, const std::string&,
                   const nlohmann::detail::exception& error) override {
    std::string reason = error.what();
    // Removes nlohmann's prefix "[json.exception...] parse error at line 1, column 5: ".
    for (const std::string_view lead : {"] ", "parse error", ": "}) {
      const std::size_t at = reason.find(lead);
      if (at == reason.npos) continue;
      if (lead != "parse error") reason.erase(0, at + lead.size());
    }
    throw Error::bad_input("this is not valid JSON: " + reason,
                           place_in_text(text_, position, name_), kCorrectSyntax);
  }

 private:
  struct Level {
    json* container;
    std::string key;  ///< of the member being read, in an object
  };

  json* place(json value) {
    if (levels_.empty()) {
      root_ = std::move(value);
      return &root_;
    }
    Level& level = levels_.back();
    if (level.container->is_array()) {
      level.container->push_back(std::move(value));
      return &level.container->back();
    }
    json& member = (*level.container)[level.key];
    member = std::move(value);
    return &member;
  }
  bool add(json value) {
    place(std::move(value));
    return true;
  }
  bool open(json empty) {
    if (levels_.size() == kDeepest) {
      throw json_value_error(name_, pointer(),
                             fmt::format("arrays and objects are nested deeper than {}", kDeepest),
                             "Reduce the nesting");
    }
    levels_.push_back({place(std::move(empty)), {}});
    return true;
  }
  bool close() {
    levels_.pop_back();
    return true;
  }
  std::string pointer() const {
    std::string result;
    for (const Level& level : levels_) {
      if (level.container->is_array()) {
        if (!level.container->empty())
          result = append_json_pointer(result, level.container->size() - 1);
      } else {
        result = append_json_pointer(result, level.key);
      }
    }
    return result;
  }

  std::string_view text_, name_;
  json root_;
  std::vector<Level> levels_;
};

bool is_plain(const ordered_json& value) {
  return std::none_of(value.begin(), value.end(),
                      [](const ordered_json& item) { return item.is_structured(); });
}

std::string compact(const ordered_json& value) {
  if (!value.is_structured()) return value.dump();
  std::vector<std::string> parts;
  for (const auto& [key, item] : value.items()) {
    parts.push_back(value.is_object() ? fmt::format("{}: {}", ordered_json(key).dump(), item.dump())
                                      : item.dump());
  }
  const std::string inner = fmt::format("{}", fmt::join(parts, ", "));
  return value.is_object() ? fmt::format("{{{}}}", inner) : fmt::format("[{}]", inner);
}

void append_formatted(const ordered_json& value, std::size_t indent, std::size_t column,
                      std::string& out) {
  if (!value.is_structured() || value.empty()) {
    out += value.dump();
    return;
  }
  if (indent > 0 && is_plain(value)) {
    const std::string line = compact(value);
    if (column + line.size() + 1 <= kColumns) {
      out += line;
      return;
    }
  }
  const std::string pad(indent + 2, ' ');
  out += value.is_object() ? "{\n" : "[\n";
  const char* separator = "";
  for (const auto& [key, item] : value.items()) {
    out += separator;
    separator = ",\n";
    const std::string lead =
        value.is_object() ? fmt::format("{}{}: ", pad, ordered_json(key).dump()) : pad;
    out += lead;
    append_formatted(item, indent + 2, lead.size(), out);
  }
  out += fmt::format("\n{:{}}{}", "", indent, value.is_object() ? '}' : ']');
}

}  // namespace

nlohmann::json parse_json(std::string_view text, std::string_view name) {
  DocumentBuilder builder(text, name);
  json::sax_parse(text.begin(), text.end(), &builder);
  return builder.take();
}

std::string format_json(const nlohmann::ordered_json& value) {
  std::string out;
  append_formatted(value, 0, 0, out);
  out += '\n';
  return out;
}

std::string append_json_pointer(std::string_view pointer, std::string_view key) {
  std::string result(pointer);
  result += '/';
  for (const char c : key) {
    if (c == '~') {
      result += "~0";
    } else if (c == '/') {
      result += "~1";
    } else {
      result += c;
    }
  }
  return result;
}

std::string append_json_pointer(std::string_view pointer, std::size_t index) {
  return fmt::format("{}/{}", pointer, index);
}

Error json_value_error(std::string_view name, std::string_view pointer, std::string what_happened,
                       std::string what_to_do) {
  return Error::bad_input(std::move(what_happened), fmt::format("{}#{}", name, pointer),
                          std::move(what_to_do));
}

std::string describe_json_value(const nlohmann::json& value) {
  if (value.is_object()) return "an object";
  if (value.is_array()) return fmt::format("an array of {}", value.size());
  constexpr std::size_t kLongest = 80;
  std::string text = value.dump(-1, ' ', true);  // ASCII, so that it can be cut anywhere
  if (text.size() > kLongest) text = text.substr(0, kLongest) + "...";
  return text;
}

}  // namespace raystage::schemas
