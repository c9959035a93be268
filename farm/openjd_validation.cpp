// SPDX-License-Identifier: Apache-2.0
// Checks the rules of "Template Schemas [Version: 2023-09]" (openjd-specifications, wiki) for the
// elements that our templates use, without extensions. Section numbers are those of that page.
#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <regex>
#include <set>

#include "base/error.h"
#include "farm/openjd.h"
#include "schemas/json_text.h"

namespace raystage::farm {
namespace {

using Json = nlohmann::json;

constexpr std::size_t kJobName = 128, kStepName = 64, kDescription = 2048, kParameters = 50,
                      kParameterValue = 1024, kIdentifier = 64, kRequirements = 50,
                      kCapability = 100, kTaskParameters = 16, kRangeList = 1024;

bool is_identifier(const std::string& text) {
  static const std::regex pattern("[A-Za-z_][A-Za-z0-9_]*");
  return text.size() <= kIdentifier && std::regex_match(text, pattern);
}

class TemplateCheck {
 public:
  std::vector<std::string> run(const Json& document) {
    check_object(document, "", {"specificationVersion", "name", "steps"},
                 {"$schema", "description", "parameterDefinitions", "jobEnvironments"});
    if (!document.is_object()) return faults_;
    if (document.value("specificationVersion", Json()) != "jobtemplate-2023-09") {
      fault("/specificationVersion", "it must be \"jobtemplate-2023-09\"");
    }
    check_text(document, "", "name", kJobName, true);
    check_text(document, "", "description", kDescription, false);
    if (document.contains("parameterDefinitions")) {
      check_parameters(document["parameterDefinitions"]);
    }
    check_steps(document.value("steps", Json::array()));
    return faults_;
  }

 private:
  void fault(const std::string& pointer, const std::string& what) {
    faults_.push_back((pointer.empty() ? "/" : pointer) + ": " + what);
  }

  bool check_object(const Json& object, const std::string& pointer,
                    std::initializer_list<const char*> required,
                    std::initializer_list<const char*> optional) {
    if (!object.is_object()) {
      fault(pointer, "it must be an object");
      return false;
    }
    for (const char* key : required) {
      if (!object.contains(key)) fault(pointer, fmt::format("\"{}\" is missing", key));
    }
    for (const auto& [key, value] : object.items()) {
      const auto is_key = [&key = key](const char* known) { return key == known; };
      if (std::ranges::none_of(required, is_key) && std::ranges::none_of(optional, is_key)) {
        fault(pointer, fmt::format("\"{}\" is unknown", key));
      }
    }
    return true;
  }

  void check_text(const Json& object, const std::string& pointer, const char* key,
                  std::size_t longest, bool without_control_characters) {
    if (!object.contains(key)) return;
    const std::string place = pointer + "/" + key;
    if (!object[key].is_string()) return fault(place, "it must be text");
    const auto text = object[key].get<std::string>();
    if (text.empty()) fault(place, "it is empty");
    if (text.size() > longest) fault(place, fmt::format("it is longer than {}", longest));
    const bool has_control = std::ranges::any_of(
        text, [](char c) { return static_cast<unsigned char>(c) < ' ' || c == 0x7f; });
    if (without_control_characters && has_control) fault(place, "it has a control character");
  }

  void check_enum(const Json& object, const std::string& pointer, const char* key,
                  std::initializer_list<const char*> words) {
    if (!object.contains(key)) return;
    const bool known = object[key].is_string() && std::ranges::any_of(words, [&](const char* word) {
                         return object[key] == word;
                       });
    if (!known) fault(pointer + "/" + key, "the value is not allowed");
  }

  std::string check_identifier(const Json& object, const std::string& pointer) {
    if (!object.contains("name") || !object["name"].is_string()) return "";
    auto name = object["name"].get<std::string>();
    if (!is_identifier(name)) fault(pointer + "/name", "it is not an identifier (7.1)");
    return name;
  }

  /// Checks section 2: STRING and PATH parameters.
  void check_parameters(const Json& list) {
    if (!list.is_array() || list.empty() || list.size() > kParameters) {
      return fault("/parameterDefinitions", "1 to 50 elements are allowed (1.1)");
    }
    for (std::size_t i = 0; i < list.size(); ++i) {
      const std::string pointer = fmt::format("/parameterDefinitions/{}", i);
      const Json& parameter = list[i];
      if (!check_object(parameter, pointer, {"name", "type"},
                        {"description", "default", "allowedValues", "minLength", "maxLength",
                         "userInterface", "objectType", "dataFlow"})) {
        continue;
      }
      const std::string name = check_identifier(parameter, pointer);
      if (!scope_.insert("Param." + name).second) fault(pointer + "/name", "it is not unique");
      scope_.insert("RawParam." + name);
      check_enum(parameter, pointer, "type", {"STRING", "PATH"});
      check_enum(parameter, pointer, "objectType", {"FILE", "DIRECTORY"});
      check_enum(parameter, pointer, "dataFlow", {"NONE", "IN", "OUT", "INOUT"});
      check_text(parameter, pointer, "description", kDescription, false);
      check_text(parameter, pointer, "default", kParameterValue, false);
    }
  }

  void check_steps(const Json& steps) {
    if (!steps.is_array() || steps.empty()) return fault("/steps", "at least one is needed");
    std::set<std::string> names;
    for (std::size_t i = 0; i < steps.size(); ++i) {
      const std::string pointer = fmt::format("/steps/{}", i);
      if (!check_object(steps[i], pointer, {"name", "script"},
                        {"description", "dependencies", "stepEnvironments", "hostRequirements",
                         "parameterSpace"})) {
        continue;
      }
      check_text(steps[i], pointer, "name", kStepName, true);
      const auto name = steps[i].value("name", std::string());
      // Stricter than the rules, which exclude only cycles: our steps depend on earlier ones.
      check_dependencies(steps[i], pointer, names);
      if (!names.insert(name).second) fault(pointer + "/name", "it is not unique (3)");
      if (steps[i].contains("hostRequirements")) {
        check_requirements(steps[i]["hostRequirements"], pointer + "/hostRequirements");
      }
      std::set<std::string> scope = scope_;
      scope.insert({"Session.WorkingDirectory", "Session.HasPathMappingRules",
                    "Session.PathMappingRulesFile"});
      if (steps[i].contains("parameterSpace")) {
        check_space(steps[i]["parameterSpace"], pointer + "/parameterSpace", scope);
      }
      check_script(steps[i].value("script", Json()), pointer + "/script", scope);
    }
  }

  void check_dependencies(const Json& step, const std::string& pointer,
                          const std::set<std::string>& earlier) {
    if (!step.contains("dependencies")) return;
    const Json& list = step["dependencies"];
    if (!list.is_array() || list.empty()) {
      return fault(pointer + "/dependencies", "at least one element is needed (3)");
    }
    for (const Json& dependency : list) {
      check_object(dependency, pointer + "/dependencies", {"dependsOn"}, {});
      const bool known = dependency.is_object() && dependency.contains("dependsOn") &&
                         dependency["dependsOn"].is_string() &&
                         earlier.contains(dependency["dependsOn"].get<std::string>());
      if (!known) fault(pointer + "/dependencies", "it does not name an earlier step (3.2)");
    }
  }

  /// Checks section 3.3.
  void check_requirements(const Json& requirements, const std::string& pointer) {
    if (!check_object(requirements, pointer, {}, {"amounts", "attributes"})) return;
    const Json amounts = requirements.value("amounts", Json::array());
    const Json attributes = requirements.value("attributes", Json::array());
    if (amounts.empty() && attributes.empty()) fault(pointer, "amounts or attributes are needed");
    if (amounts.size() + attributes.size() > kRequirements) fault(pointer, "more than 50 elements");
    static const std::regex amount("([A-Za-z_]\\w*:)?amount\\.[A-Za-z_]\\w*(\\.[A-Za-z_]\\w*)*");
    static const std::regex attribute("([A-Za-z_]\\w*:)?attr\\.[A-Za-z_]\\w*(\\.[A-Za-z_]\\w*)*");
    const auto check_names = [&](const Json& list, const char* key, const std::regex& pattern) {
      std::set<std::string> names;
      for (const Json& item : list) {
        const auto name = item.value("name", std::string());
        if (name.size() > kCapability || !std::regex_match(name, pattern)) {
          fault(pointer + "/" + key, "\"" + name + "\" is not a capability");
        }
        if (!names.insert(name).second) fault(pointer + "/" + key, "a name is not unique");
      }
    };
    check_names(amounts, "amounts", amount);
    check_names(attributes, "attributes", attribute);
    for (const Json& item : amounts) {
      check_object(item, pointer + "/amounts", {"name"}, {"min", "max"});
      if (!item.contains("min") && !item.contains("max"))
        fault(pointer + "/amounts", "min or max is needed");
      for (const char* key : {"min", "max"}) {
        if (item.contains(key) && (!item[key].is_number() || item[key].get<double>() < 0)) {
          fault(pointer + "/amounts", fmt::format("{} must be a number of at least 0", key));
        }
      }
    }
    for (const Json& item : attributes) {
      check_object(item, pointer + "/attributes", {"name"}, {"anyOf", "allOf"});
      if (!item.contains("anyOf") && !item.contains("allOf")) {
        fault(pointer + "/attributes", "anyOf or allOf is needed");
      }
    }
  }

  /// Checks section 3.4: INT parameters with range expressions.
  void check_space(const Json& space, const std::string& pointer, std::set<std::string>& scope) {
    if (!check_object(space, pointer, {"taskParameterDefinitions"}, {"combination"})) return;
    const Json list = space.value("taskParameterDefinitions", Json::array());
    if (!list.is_array() || list.empty() || list.size() > kTaskParameters) {
      return fault(pointer, "1 to 16 task parameters are allowed");
    }
    static const std::regex range(
        "\\s*-?\\d+(\\s*-\\s*-?\\d+(:-?[1-9]\\d*)?)?"
        "(\\s*,\\s*-?\\d+(\\s*-\\s*-?\\d+(:-?[1-9]\\d*)?)?)*\\s*");
    for (const Json& parameter : list) {
      check_object(parameter, pointer, {"name", "type", "range"}, {});
      const std::string name = check_identifier(parameter, pointer);
      check_enum(parameter, pointer, "type", {"INT"});
      scope.insert({"Task.Param." + name, "Task.RawParam." + name});
      const Json values = parameter.value("range", Json());
      const bool is_list = values.is_array() && !values.empty() && values.size() <= kRangeList;
      const bool is_text = values.is_string() && values.get<std::string>().size() <= kRangeList &&
                           std::regex_match(values.get<std::string>(), range);
      if (!is_list && !is_text) fault(pointer, "the range must be a list or a range expression");
    }
  }

  /// Checks sections 3.5 and 5.
  void check_script(const Json& script, const std::string& pointer,
                    const std::set<std::string>& scope) {
    if (!check_object(script, pointer, {"actions"}, {"embeddedFiles"})) return;
    const Json actions = script.value("actions", Json());
    if (!check_object(actions, pointer + "/actions", {"onRun"}, {})) return;
    const std::string place = pointer + "/actions/onRun";
    const Json action = actions.value("onRun", Json());
    if (!check_object(action, place, {"command"}, {"args", "timeout", "cancelation"})) return;
    if (!action.value("command", Json()).is_string())
      return fault(place, "the command must be text");
    check_format(action["command"].get<std::string>(), place + "/command", scope);
    for (const Json& argument : action.value("args", Json::array())) {
      if (!argument.is_string()) {
        fault(place + "/args", "every argument must be text");
      } else {
        check_format(argument.get<std::string>(), place + "/args", scope);
      }
    }
    if (action.contains("timeout") &&
        (!action["timeout"].is_number_integer() || action["timeout"].get<long long>() < 1)) {
      fault(place + "/timeout", "it must be a positive integer");
    }
    if (!action.contains("cancelation")) return;
    const Json& cancelation = action["cancelation"];
    check_object(cancelation, place + "/cancelation", {"mode"}, {"notifyPeriodInSeconds"});
    check_enum(cancelation, place + "/cancelation", "mode", {"TERMINATE", "NOTIFY_THEN_TERMINATE"});
    constexpr long long kLongestNotice = 600;
    const Json notice = cancelation.value("notifyPeriodInSeconds", Json(1));
    if (!notice.is_number_integer() || notice.get<long long>() < 1 ||
        notice.get<long long>() > kLongestNotice) {
      fault(place + "/cancelation", "notifyPeriodInSeconds must be 1 to 600");
    }
  }

  /// Checks section 7.3: every {{reference}} is in scope.
  void check_format(const std::string& text, const std::string& pointer,
                    const std::set<std::string>& scope) {
    static const std::regex reference("\\{\\{\\s*([^{}]*?)\\s*\\}\\}");
    for (auto it = std::sregex_iterator(text.begin(), text.end(), reference);
         it != std::sregex_iterator(); ++it) {
      if (!scope.contains((*it)[1].str())) {
        fault(pointer, fmt::format("{{{{{}}}}} is not in scope", (*it)[1].str()));
      }
    }
  }

  std::vector<std::string> faults_;
  std::set<std::string> scope_;
};

}  // namespace

std::vector<std::string> validate_openjd_template(std::string_view template_text) {
  try {
    return TemplateCheck().run(schemas::parse_json(template_text, "template"));
  } catch (const Error& error) {
    return {error.what()};
  } catch (const Json::exception& error) {  // a value has the wrong type
    return {std::string("/: ") + error.what()};
  }
}

}  // namespace raystage::farm
