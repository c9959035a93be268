// SPDX-License-Identifier: Apache-2.0
#include "farm/openjd.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "schemas/json_text.h"

namespace raystage::farm {
namespace {

using OrderedJson = nlohmann::ordered_json;

constexpr std::size_t kLongestName = 64;

OrderedJson host_requirements(const schemas::FarmResources& resources) {
  // amount.worker.memory is in MiB (specification 3.3.1).
  const double mebibytes = resources.memory_gb * 1e9 * 1.1 / (1 << 20) + 400;
  return {
      {"amounts", OrderedJson::array(
                      {{{"name", "amount.worker.vcpu"}, {"min", resources.threads}},
                       {{"name", "amount.worker.memory"}, {"min", static_cast<int>(mebibytes)}}})},
      {"attributes", OrderedJson::array({{{"name", "attr.worker.os.family"},
                                          {"anyOf", OrderedJson::array({"linux"})}}})}};
}

/// Returns the script of a step. A shell runs the command if it has a prefix, which is shell text.
OrderedJson script(const std::string& command_prefix, schemas::FarmStage stage,
                   const std::string& index, const schemas::FarmResources& resources) {
  OrderedJson arguments = OrderedJson::array();
  if (!command_prefix.empty())
    arguments = {"-c", command_prefix + " \"$@\"", "sh", "{{Param.Raystage}}"};
  for (const std::string_view word : {"farm", "task", "{{Param.JobFolder}}"}) {
    arguments.push_back(word);
  }
  arguments.push_back(schemas::farm_stage_name(stage));
  arguments.push_back(index);
  for (const std::string_view word :
       {"--progress", "openjd", "--path-mapping", "{{Session.PathMappingRulesFile}}"}) {
    arguments.push_back(word);
  }
  OrderedJson on_run{
      {"command", command_prefix.empty() ? "{{Param.Raystage}}" : "sh"},
      {"args", std::move(arguments)},
      // The command gets SIGTERM and time to abandon the frames in flight.
      {"cancelation", {{"mode", "NOTIFY_THEN_TERMINATE"}, {"notifyPeriodInSeconds", 90}}}};
  if (resources.minutes) on_run["timeout"] = *resources.minutes * 60;
  return {{"actions", {{"onRun", std::move(on_run)}}}};
}

std::string step_name(schemas::FarmStage stage) {
  std::string name(schemas::farm_stage_name(stage));
  name.front() = static_cast<char>(name.front() - 'a' + 'A');
  return name;
}

OrderedJson step(const schemas::FarmJobDocument& job, schemas::FarmStage stage, std::size_t tasks) {
  OrderedJson result{{"name", step_name(stage)}};
  const bool has_space =
      stage == schemas::FarmStage::kPrepare || stage == schemas::FarmStage::kRender;
  result["hostRequirements"] = host_requirements(job.of(stage));
  if (has_space) {
    result["parameterSpace"] = {
        {"taskParameterDefinitions",
         OrderedJson::array({{{"name", "Task"},
                              {"type", "INT"},
                              {"range", tasks == 1 ? "0" : fmt::format("0-{}", tasks - 1)}}})}};
  }
  result["script"] =
      script(job.command_prefix, stage, has_space ? "{{Task.Param.Task}}" : "0", job.of(stage));
  return result;
}

}  // namespace

std::string openjd_template(const schemas::FarmJobDocument& job) {
  OrderedJson json{{"specificationVersion", "jobtemplate-2023-09"},
                   {"name", job.id.substr(0, kLongestName)}};
  json["description"] =
      fmt::format("Raystage {} renders {} to {}", job.program_version, job.shot, job.output)
          .substr(0, 2048);
  json["parameterDefinitions"] = OrderedJson::array(
      {{{"name", "JobFolder"},
        {"type", "PATH"},
        {"objectType", "DIRECTORY"},
        {"dataFlow", "INOUT"},
        {"default", job.folder},
        {"description", "The farm job's folder, as the submitting host sees it."}},
       {{"name", "Raystage"},
        {"type", "STRING"},
        {"default", job.program},
        {"description", "Command that runs Raystage on a worker."}}});
  OrderedJson& steps = json["steps"] = OrderedJson::array();
  const auto depends = [&](OrderedJson made, schemas::FarmStage on) {
    made["dependencies"] = OrderedJson::array({{{"dependsOn", step_name(on)}}});
    steps.push_back(std::move(made));
  };
  const bool prepares = !job.instants.empty();
  if (prepares) steps.push_back(step(job, schemas::FarmStage::kPrepare, job.instants.size()));
  OrderedJson render = step(job, schemas::FarmStage::kRender, job.chunks.size());
  if (prepares) {
    depends(std::move(render), schemas::FarmStage::kPrepare);
  } else {
    steps.push_back(std::move(render));
  }
  depends(step(job, schemas::FarmStage::kVerify, 1), schemas::FarmStage::kRender);
  if (job.preview) depends(step(job, schemas::FarmStage::kPreview, 1), schemas::FarmStage::kVerify);
  return schemas::format_json(json);
}

}  // namespace raystage::farm
