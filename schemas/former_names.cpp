// SPDX-License-Identifier: Apache-2.0
#include "schemas/former_names.h"

#include <string>

#include "base/error.h"
#include "schemas/json_text.h"

namespace raystage::schemas {
namespace {

/// Walks a document along its schema. Branches of oneOf and anyOf are applied one after the other:
/// a former name belongs to one property only.
class FormerNames {
 public:
  FormerNames(const nlohmann::json& root, std::string_view name) : root_(root), name_(name) {}

  void replace_in(const nlohmann::json& schema, nlohmann::json& value,
                  const std::string& pointer) const {
    if (!schema.is_object()) return;
    if (const auto reference = schema.find("$ref"); reference != schema.end()) {
      constexpr std::string_view kPrefix = "#/$defs/";
      const std::string target = reference->get<std::string>().substr(kPrefix.size());
      replace_in(root_.at("$defs").at(target), value, pointer);
    }
    for (const char* branches : {"oneOf", "anyOf"}) {
      if (!schema.contains(branches)) continue;
      for (const nlohmann::json& branch : schema.at(branches)) replace_in(branch, value, pointer);
    }
    if (value.is_object() && schema.contains("properties")) {
      replace_in_object(schema.at("properties"), value, pointer);
    }
    if (value.is_array() && schema.contains("items")) {
      for (std::size_t i = 0; i < value.size(); ++i) {
        replace_in(schema.at("items"), value[i], append_json_pointer(pointer, i));
      }
    }
  }

 private:
  void replace_in_object(const nlohmann::json& properties, nlohmann::json& object,
                         const std::string& pointer) const {
    for (const auto& [key, property] : properties.items()) {
      if (property.is_object() && property.contains("formerly")) {
        for (const nlohmann::json& former : property.at("formerly")) {
          rename(former.get<std::string>(), key, object, pointer);
        }
      }
      if (const auto member = object.find(key); member != object.end()) {
        replace_in(property, *member, append_json_pointer(pointer, key));
      }
    }
  }

  void rename(const std::string& former, const std::string& key, nlohmann::json& object,
              const std::string& pointer) const {
    const auto member = object.find(former);
    if (member == object.end()) return;
    if (object.contains(key)) {
      throw json_value_error(
          name_, append_json_pointer(pointer, former),
          "\"" + former + "\" is the former name of \"" + key + "\", which is given as well",
          "Remove one of them");
    }
    nlohmann::json value = std::move(*member);
    object.erase(member);
    object[key] = std::move(value);
  }

  const nlohmann::json& root_;
  std::string_view name_;
};

}  // namespace

void replace_former_names(const nlohmann::json& schema, nlohmann::json& document,
                          std::string_view name) {
  FormerNames(schema, name).replace_in(schema, document, "");
}

}  // namespace raystage::schemas
