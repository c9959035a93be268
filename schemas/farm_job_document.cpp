// SPDX-License-Identifier: Apache-2.0
#include "schemas/farm_job_document.h"

#include "base/atomic_file.h"
#include "schemas/document.h"

namespace raystage {
namespace {

using Json = nlohmann::ordered_json;
using Engine = FarmJobDocument::Engine;

constexpr std::array<std::string_view, kFarmStages.size()> kStageNames{"prepare", "render",
                                                                       "verify", "preview"};
constexpr std::array<std::string_view, 3> kEngineNames{"slurm", "local", "openjd"};

FarmResources resources_from(const JsonNode& object) {
  FarmResources resources;
  resources.threads = object.at("threads").get<int>();
  resources.memory_gb = object.at("memory_gb").get<double>();
  resources.minutes = object.get_if<int>("time_limit_minutes");
  resources.options = object.get<std::vector<std::string>>("options", {});
  return resources;
}

Json json_from(const FarmResources& resources) {
  Json output{{"threads", resources.threads}, {"memory_gb", resources.memory_gb}};
  add_optional(output, "time_limit_minutes", resources.minutes);
  if (!resources.options.empty()) output["options"] = resources.options;
  return output;
}

FarmJobDocument::OutputOverrides picture_from(const JsonNode& object) {
  return {object.get<std::string>("fill", ""), object.get<std::string>("layout", ""),
          object.get("chromaticities", false), object.get("coverage", false),
          object.get("confidence", false),     object.get("deep", false)};
}

Json json_from(const FarmJobDocument::OutputOverrides& picture) {
  Json output = Json::object();
  if (!picture.fill.empty()) output["fill"] = picture.fill;
  if (!picture.layout.empty()) output["layout"] = picture.layout;
  if (picture.chromaticities) output["chromaticities"] = true;
  if (picture.coverage) output["coverage"] = true;
  if (picture.confidence) output["confidence"] = true;
  if (picture.deep) output["deep"] = true;
  return output;
}

/// Returns an empty list if the property is absent.
std::string path_if_any(const JsonNode& document, std::string_view key) {
  return document.has(key) ? path_from(document.at(key)) : std::string();
}

std::vector<FarmJobDocument::PrepareTask> instants_from(const JsonNode& document) {
  std::vector<FarmJobDocument::PrepareTask> instants;
  if (!document.has("prepare_tasks")) return instants;
  const JsonNode list = document.at("prepare_tasks");
  for (std::size_t i = 0; i < list.size(); ++i) {
    const JsonNode object = list.at(i);
    instants.push_back({object.at("layer").get<int>(), object.at("tick").get<int>(),
                        path_from(object.at("file"))});
  }
  return instants;
}

std::vector<FarmJobDocument::Chunk> chunks_from(const JsonNode& document, std::size_t instants) {
  std::vector<FarmJobDocument::Chunk> chunks;
  const JsonNode list = document.at("chunks");
  for (std::size_t i = 0; i < list.size(); ++i) {
    const JsonNode object = list.at(i);
    FarmJobDocument::Chunk chunk{path_from(object.at("frames")), {}};
    if (object.has("prepare_tasks")) {
      const JsonNode needed = object.at("prepare_tasks");
      for (std::size_t j = 0; j < needed.size(); ++j) {
        chunk.instants.push_back(needed.at(j).get<int>());
        if (static_cast<std::size_t>(chunk.instants.back()) >= instants) {
          throw needed.at(j).input_error("found " + describe_json_value(needed.at(j).value) +
                                             ", but the job has fewer instants",
                                         "Submit the shot again");
        }
      }
    }
    chunks.push_back(std::move(chunk));
  }
  return chunks;
}

std::vector<FarmJobDocument::PathMappingRule> paths_from(const JsonNode& document) {
  std::vector<FarmJobDocument::PathMappingRule> rules;
  if (!document.has("path_mapping_rules")) return rules;
  const JsonNode list = document.at("path_mapping_rules");
  for (std::size_t i = 0; i < list.size(); ++i) {
    const JsonNode rule = list.at(i);
    rules.push_back({path_from(rule.at("from")), path_from(rule.at("to"))});
  }
  return rules;
}

FarmJobDocument::Distributed distributed_from(const JsonNode& object) {
  FarmJobDocument::Distributed distributed;
  distributed.nodes = object.at("nodes").get<std::vector<std::string>>();
  distributed.mpirun = object.at("mpirun").get<std::string>();
  distributed.missing_archives = object.at("missing_archives").get<std::string>();
  distributed.fragments = object.at("fragments").get<std::string>();
  distributed.fragment_quality = object.get_if<int>("fragment_quality");
  return distributed;
}

Json json_from(const FarmJobDocument::Distributed& distributed) {
  Json output{{"nodes", distributed.nodes},
              {"mpirun", distributed.mpirun},
              {"missing_archives", distributed.missing_archives},
              {"fragments", distributed.fragments}};
  add_optional(output, "fragment_quality", distributed.fragment_quality);
  return output;
}

}  // namespace

std::string_view farm_stage_name(FarmStage stage) {
  return kStageNames[static_cast<std::size_t>(stage)];
}

FarmStage parse_farm_stage(std::string_view name) {
  for (const FarmStage stage : kFarmStages) {
    if (farm_stage_name(stage) == name) return stage;
  }
  throw Error::bad_input("there is no stage \"" + std::string(name) + "\"", "",
                         "Use prepare, render, verify or preview");
}

std::string_view farm_engine_name(Engine engine) {
  return kEngineNames[static_cast<std::size_t>(engine)];
}

FarmJobDocument parse_farm_job(std::string_view text, std::string_view name) {
  const nlohmann::json output = parse_document("farm_job", text, name);
  const JsonNode document{output, name, ""};
  FarmJobDocument job;
  job.id = document.at("id").get<std::string>();
  const auto engine = document.at("engine").get<std::string>();
  for (const Engine known : {Engine::kSlurm, Engine::kLocal, Engine::kOpenJd}) {
    if (farm_engine_name(known) == engine) job.engine = known;
  }
  job.submitted_utc = utc_from(document.at("submitted_utc"));
  job.submitted_by = document.get<std::string>("submitted_by", "");
  job.submitted_on = document.get<std::string>("submit_host", "");
  job.program_version = document.at("program_version").get<std::string>();
  job.build = document.get<std::string>("build", "");
  job.simd = document.at("simd").get<std::string>();
  job.umask = document.get_if<int>("umask");
  job.program = path_from(document.at("program"));
  job.command_prefix = path_if_any(document, "command_prefix");
  job.folder = path_from(document.at("folder"));
  job.shot = path_from(document.at("shot"));
  job.shot_folder = path_from(document.at("shot_folder"));
  job.output = path_from(document.at("output"));
  job.cache = path_if_any(document, "cache");
  job.color_config = path_if_any(document, "color_config");
  job.existing = document.at("existing").get<std::string>();
  job.missing = document.at("missing").get<std::string>();
  if (document.has("picture")) job.picture = picture_from(document.at("picture"));
  const JsonNode resources = document.at("resources");
  for (const FarmStage stage : kFarmStages) {
    job.of(stage) = resources_from(resources.at(farm_stage_name(stage)));
  }
  job.attempts = document.at("attempts").get<int>();
  job.preview = document.get("preview", true);
  job.max_array_size = document.get("max_array_size", job.max_array_size);
  job.max_minutes = document.get_if<int>("max_minutes");
  job.seconds_per_frame = document.get_if<double>("seconds_per_frame");
  job.frame_bytes = document.get("frame_bytes", 0.0);
  job.instants = instants_from(document);
  job.chunks = chunks_from(document, job.instants.size());
  job.inputs = document.get<std::vector<std::string>>("inputs", {});
  job.pinned = document.get<std::vector<std::string>>("pinned", {});
  job.paths = paths_from(document);
  if (document.has("distributed")) job.distributed = distributed_from(document.at("distributed"));
  return job;
}

std::string format_farm_job(const FarmJobDocument& job) {
  Json output = make_document("farm_job");
  output["id"] = job.id;
  output["engine"] = farm_engine_name(job.engine);
  output["submitted_utc"] = format_utc(job.submitted_utc);
  output["submitted_by"] = job.submitted_by;
  output["submit_host"] = job.submitted_on;
  output["program_version"] = job.program_version;
  output["build"] = job.build;
  output["simd"] = job.simd;
  add_optional(output, "umask", job.umask);
  output["program"] = job.program;
  if (!job.command_prefix.empty()) output["command_prefix"] = job.command_prefix;
  output["folder"] = job.folder;
  output["shot"] = job.shot;
  output["shot_folder"] = job.shot_folder;
  output["output"] = job.output;
  if (!job.cache.empty()) output["cache"] = job.cache;
  if (!job.color_config.empty()) output["color_config"] = job.color_config;
  output["existing"] = job.existing;
  output["missing"] = job.missing;
  output["picture"] = json_from(job.picture);
  for (const FarmStage stage : kFarmStages) {
    output["resources"][std::string(farm_stage_name(stage))] = json_from(job.of(stage));
  }
  output["attempts"] = job.attempts;
  output["preview"] = job.preview;
  output["max_array_size"] = job.max_array_size;
  add_optional(output, "max_minutes", job.max_minutes);
  add_optional(output, "seconds_per_frame", job.seconds_per_frame);
  if (job.distributed) output["distributed"] = json_from(*job.distributed);
  output["frame_bytes"] = job.frame_bytes;
  Json& instants = output["prepare_tasks"] = Json::array();
  for (const FarmJobDocument::PrepareTask& instant : job.instants) {
    instants.push_back({{"layer", instant.layer}, {"tick", instant.tick}, {"file", instant.file}});
  }
  Json& chunks = output["chunks"] = Json::array();
  for (const FarmJobDocument::Chunk& chunk : job.chunks) {
    Json object{{"frames", chunk.frames}};
    if (!chunk.instants.empty()) object["prepare_tasks"] = chunk.instants;
    chunks.push_back(std::move(object));
  }
  if (!job.inputs.empty()) output["inputs"] = job.inputs;
  if (!job.pinned.empty()) output["pinned"] = job.pinned;
  for (const FarmJobDocument::PathMappingRule& rule : job.paths) {
    output["path_mapping_rules"].push_back({{"from", rule.from}, {"to", rule.to}});
  }
  return format_json(output);
}

FarmJobDocument read_farm_job(const std::filesystem::path& file) {
  return parse_farm_job(read_file(file), file.string());
}

}  // namespace raystage
