// SPDX-License-Identifier: Apache-2.0
#include "schemas/farm_job_document.h"

#include "schemas/fields.h"

namespace raystage::schemas {
namespace {

using Json = nlohmann::ordered_json;
using Job = FarmJobDocument;

constexpr auto kStageNames = enum_names<FarmStage>("prepare", "render", "verify", "preview");
constexpr auto kEngineNames = enum_names<Job::Engine>("slurm", "local", "openjd");

constexpr Fields kFarmResources(required("threads", &FarmResources::threads),
                                required("memory_gb", &FarmResources::memory_gb),
                                optional("time_limit_minutes", &FarmResources::minutes),
                                optional("options", &FarmResources::options));

constexpr auto kResourcesByStage = custom(
    [](const JsonNode& document, Job& job) {
      const JsonNode resources = document.at("resources");
      for (const FarmStage stage : kFarmStages) {
        kFarmResources.read(resources.at(farm_stage_name(stage)), job.of(stage));
      }
    },
    [](const Job& job, Json& document) {
      for (const FarmStage stage : kFarmStages) {
        document["resources"][farm_stage_name(stage)] = kFarmResources.write(job.of(stage));
      }
    });

constexpr Fields kOverrides(optional("fill", &Job::OutputOverrides::fill),
                            optional("layout", &Job::OutputOverrides::layout),
                            optional("chromaticities", &Job::OutputOverrides::chromaticities),
                            optional("coverage", &Job::OutputOverrides::coverage),
                            optional("confidence", &Job::OutputOverrides::confidence),
                            optional("deep", &Job::OutputOverrides::deep));

constexpr Fields kPrepareTask(required("layer", &Job::PrepareTask::layer),
                              required("tick", &Job::PrepareTask::tick),
                              required("file", &Job::PrepareTask::file, kPath));

constexpr Fields kChunk(required("frames", &Job::Chunk::frames, kPath),
                        optional("prepare_tasks", &Job::Chunk::instants));

void check_chunks(const JsonNode& document, const Job& job) {
  for (std::size_t i = 0; i < job.chunks.size(); ++i) {
    for (std::size_t j = 0; j < job.chunks[i].instants.size(); ++j) {
      if (static_cast<std::size_t>(job.chunks[i].instants[j]) < job.instants.size()) continue;
      const JsonNode index = document.at("chunks").at(i).at("prepare_tasks").at(j);
      throw index.input_error("found " + describe_json_value(index.value) +
                                  ", allowed: an index into \"prepare_tasks\"",
                              "Submit the shot again");
    }
  }
}

constexpr Fields kDistributed(required("nodes", &Job::Distributed::nodes),
                              required("mpirun", &Job::Distributed::mpirun),
                              required("missing_archives", &Job::Distributed::missing_archives),
                              required("fragments", &Job::Distributed::fragments),
                              optional("fragment_quality", &Job::Distributed::fragment_quality));

constexpr Fields kPathMappingRule(required("from", &Job::PathMappingRule::from, kPath),
                                  required("to", &Job::PathMappingRule::to, kPath));

constexpr Fields kFarmJob(
    required("id", &Job::id), required("engine", &Job::engine, kEngineNames),
    required("submitted_utc", &Job::submitted_utc, kUtc),
    defaulted("submitted_by", &Job::submitted_by), defaulted("submit_host", &Job::submitted_on),
    required("program_version", &Job::program_version), defaulted("build", &Job::build),
    required("simd", &Job::simd), optional("umask", &Job::umask),
    required("program", &Job::program, kPath),
    optional("command_prefix", &Job::command_prefix, kPath),
    required("folder", &Job::folder, kPath), required("shot", &Job::shot, kPath),
    required("shot_folder", &Job::shot_folder, kPath), required("output", &Job::output, kPath),
    optional("cache", &Job::cache, kPath), optional("color_config", &Job::color_config, kPath),
    required("existing", &Job::existing), required("missing", &Job::missing),
    defaulted("rotten", &Job::rotten), defaulted("picture", &Job::picture, kOverrides),
    kResourcesByStage, required("attempts", &Job::attempts),
    defaulted("least_coverage", &Job::least_coverage), defaulted("preview", &Job::preview),
    defaulted("max_array_size", &Job::max_array_size), optional("max_minutes", &Job::max_minutes),
    optional("seconds_per_frame", &Job::seconds_per_frame),
    optional("distributed", &Job::distributed, kDistributed),
    defaulted("frame_bytes", &Job::frame_bytes),
    defaulted("prepare_tasks", &Job::instants, list_of(kPrepareTask)),
    required("chunks", &Job::chunks, list_of(kChunk)), check(check_chunks),
    optional("inputs", &Job::inputs), optional("pinned", &Job::pinned),
    optional("path_mapping_rules", &Job::paths, list_of(kPathMappingRule)));

}  // namespace

std::string_view farm_stage_name(FarmStage stage) { return kStageNames.name(stage); }

FarmStage parse_farm_stage(std::string_view name) {
  for (const FarmStage stage : kFarmStages) {
    if (farm_stage_name(stage) == name) return stage;
  }
  throw Error::bad_input("there is no stage \"" + std::string(name) + "\"", "",
                         "Use prepare, render, verify or preview");
}

std::string_view farm_engine_name(FarmJobDocument::Engine engine) {
  return kEngineNames.name(engine);
}

FarmJobDocument parse_farm_job(std::string_view text, std::string_view name) {
  return parse_document_as<FarmJobDocument>("farm_job", kFarmJob, text, name);
}

std::string format_farm_job(const FarmJobDocument& job) {
  return format_document("farm_job", kFarmJob, job);
}

}  // namespace raystage::schemas
