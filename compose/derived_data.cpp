// SPDX-License-Identifier: Apache-2.0
#include "compose/derived_data.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <memory>
#include <new>
#include <set>
#include <utility>

#include "base/atomic_file.h"
#include "base/cancellation.h"
#include "base/parallel.h"
#include "base/resources.h"
#include "render/depth/depth_store.h"
#include "render/methods.h"
#include "render/renderer.h"

namespace raystage::compose {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxByDefault = std::size_t{4} << 30;

/// Returns the kind of query for which a method stores data. Methods that store data for views
/// store the same for rays; plane_sweep stores depths for rays only.
render::QueryKind storing_use(const render::ReconstructionOptions& reconstruction) {
  return render::method_named(reconstruction.method).stores_data() ? render::QueryKind::kViews
                                                                   : render::QueryKind::kRays;
}

bool shows_geometry(const ShotPlan& plan, int frame) {
  for (std::size_t i = 0; i < plan.layers(); ++i) {
    if (plan.geometry(i) != nullptr && plan.is_visible(i, frame)) return true;
  }
  return false;
}

/// Returns whether a frame may need the layer for queries of kind storing_use().
bool is_used(const ShotPlan& plan, std::size_t layer, int frame) {
  const bool as_light = plan.is_light(layer) && shows_geometry(plan, frame);
  if (as_light) return true;
  const bool only_for_rays =
      storing_use(plan.light_field(layer)->reconstruction()) == render::QueryKind::kRays;
  // Equirectangular views are made of rays.
  return (!only_for_rays || plan.shot_camera().is_equirectangular()) &&
         plan.is_visible(layer, frame);
}

/// Returns the shown tick, and the adjacent ones if the method reads them.
std::vector<int> ticks_read(const LightFieldLayer& light_field, int shown) {
  if (!light_field.reads_adjacent_frames()) return {shown};
  std::vector<int> read{shown};
  for (const int tick : light_field.adjacent_ticks(shown)) {
    if (light_field.frames_of(tick).present() > 0) read.push_back(tick);
  }
  std::ranges::sort(read);
  return read;
}

std::vector<render::VirtualCamera> shown_views_at(const PlannedFrame& frame, std::size_t layer,
                                                  int tick) {
  return frame.shown_views ? frame.shown_views->of(layer, tick)
                           : std::vector<render::VirtualCamera>();
}

/// Returns the needed data without file names, ordered by the first frame that needs it.
std::vector<DerivedFrameData> needed_instants(const ShotPlan& plan,
                                              std::span<const PlannedFrame> frames) {
  std::vector<DerivedFrameData> needed;
  std::map<LayerTick, std::size_t> known;
  const std::vector<const LightFieldLayer*> light_fields = plan.light_fields();
  const auto add = [&](const PlannedFrame& frame) {
    for (const LightFieldLayer* light_field : light_fields) {
      const std::size_t layer = light_field->index();
      if (!frame.shown[layer].tick || !is_used(plan, layer, frame.frame)) continue;
      for (const int tick : ticks_read(*light_field, *frame.shown[layer].tick)) {
        const auto [at, is_new] = known.try_emplace({layer, tick}, needed.size());
        if (is_new) {
          needed.push_back({layer, tick, {}, false, {}, shown_views_at(frame, layer, tick)});
        }
        std::vector<int>& of_instant = needed[at->second].frames;
        if (of_instant.empty() || of_instant.back() != frame.frame) {
          of_instant.push_back(frame.frame);
        }
      }
    }
  };
  for (const PlannedFrame& frame : frames) {
    throw_if_cancelled();
    add(frame);
    for (const PlannedFrame& sample : plan.exposure_of(frame)) add(sample);
  }
  return needed;
}

/// Returns a renderer without the layer's matte: depths are computed from the recorded frames.
std::unique_ptr<const render::LightFieldRenderer> renderer_of(const ShotPlan& plan,
                                                              std::size_t layer,
                                                              std::size_t cache_bytes,
                                                              std::size_t working_bytes) {
  render::RendererOptions settings;
  settings.cache_bytes = cache_bytes;
  settings.result_cache_bytes = 0;
  settings.working_bytes = working_bytes;
  settings.cache_folder = plan.cache_folder();
  return std::make_unique<const render::LightFieldRenderer>(plan.light_field(layer)->take(),
                                                            settings);
}

store::FrameSelection frames_at(const ShotPlan& plan, const DerivedFrameData& instant) {
  return plan.light_field(instant.layer)->frames_of(instant.tick);
}

render::ReconstructionOptions reconstruction_of(const ShotPlan& plan,
                                                const DerivedFrameData& instant) {
  render::ReconstructionOptions how = plan.light_field(instant.layer)->reconstruction();
  how.shown_views = instant.shown_views;
  return how;
}

void name_files(const ShotPlan& plan, std::vector<DerivedFrameData>& instants) {
  std::map<std::size_t, std::unique_ptr<const render::LightFieldRenderer>> renderers;
  for (const DerivedFrameData& instant : instants) {
    if (renderers.contains(instant.layer)) continue;
    renderers.emplace(instant.layer, renderer_of(plan, instant.layer, 0, 0));
  }
  parallel_for(std::size_t{0}, instants.size(), [&](std::size_t i) {
    DerivedFrameData& instant = instants[i];
    const render::ReconstructionOptions how = reconstruction_of(plan, instant);
    const auto& renderer = renderers.at(instant.layer);
    instant.file = renderer->stored_file(frames_at(plan, instant), how, storing_use(how));
    instant.is_stored = !instant.file.empty() && file_exists(instant.file);
  });
}

/// Returns each file once, with all frames that need it. Entries without a file are omitted.
std::vector<DerivedFrameData> each_file_once(std::vector<DerivedFrameData> instants) {
  std::vector<DerivedFrameData> files;
  std::map<fs::path, std::size_t> known;
  for (DerivedFrameData& instant : instants) {
    if (instant.file.empty()) continue;
    const auto [at, is_new] = known.try_emplace(instant.file, files.size());
    if (is_new) {
      files.push_back(std::move(instant));
    } else {
      auto& frames = files[at->second].frames;
      frames.insert(frames.end(), instant.frames.begin(), instant.frames.end());
    }
  }
  for (DerivedFrameData& file : files) {
    std::ranges::sort(file.frames);
    file.frames.erase(std::unique(file.frames.begin(), file.frames.end()), file.frames.end());
  }
  return files;
}

std::set<fs::path> folders_of(std::span<const fs::path> files) {
  std::set<fs::path> folders;
  for (const fs::path& file : files) folders.insert(file.parent_path());
  return folders;
}

}  // namespace

std::vector<DerivedFrameData> list_derived_data(const ShotPlan& plan,
                                                std::span<const PlannedFrame> frames) {
  std::vector<DerivedFrameData> instants = needed_instants(plan, frames);
  name_files(plan, instants);
  return each_file_once(std::move(instants));
}

std::vector<DerivedFrameData> list_derived_data(const ShotPlan& plan,
                                                std::span<const PlannedFrame> frames,
                                                std::span<const LayerTick> wanted) {
  std::vector<DerivedFrameData> instants = needed_instants(plan, frames);
  std::set<LayerTick> missing(wanted.begin(), wanted.end());
  const std::set<LayerTick> all = missing;
  std::erase_if(instants, [&](const DerivedFrameData& instant) {
    missing.erase({instant.layer, instant.tick});
    return !all.contains({instant.layer, instant.tick});
  });
  if (!missing.empty()) {
    throw Error::bad_input(
        fmt::format("no requested frame needs stored data of tick {} of layer {}",
                    missing.begin()->tick, missing.begin()->layer),
        "", "Request ticks that the frames need; ticks and layers count from 0");
  }
  name_files(plan, instants);
  return each_file_once(std::move(instants));
}

ExitCode PrepareReport::exit_code() const {
  const int stored = stored_before + derived;
  if (stored == requested && status == RunStatus::kFinished) return ExitCode::kSuccess;
  if (status != RunStatus::kFinished) return ExitCode::kFailed;
  if (stored > 0) return ExitCode::kSomeFramesFailed;
  return std::ranges::all_of(failures, &Failure::is_bad_input) ? ExitCode::kBadInput
                                                               : ExitCode::kFailed;
}

PrepareReport prepare_derived_data(const ShotPlan& plan, std::span<const DerivedFrameData> instants,
                                   const PrepareOptions& options, std::stop_token stop) {
  const bool by_default = options.memory_bytes == 0;
  const std::size_t half = (by_default ? available_memory() / 2 : options.memory_bytes) / 2;
  const std::size_t share = by_default ? std::min(half, kMaxByDefault) : half;
  PrepareReport report;
  report.requested = static_cast<int>(instants.size());
  report.status = RunStatus::kFinished;
  options.progress(0);
  for (std::size_t i = 0; i < instants.size(); ++i) {
    if (stop.stop_requested()) {
      report.status = RunStatus::kStopped;
      break;
    }
    const DerivedFrameData& instant = instants[i];
    const auto fail = [&](std::string what, bool is_bad_input) {
      options.on_message(
          fmt::format("tick {} of layer {} failed: {}", instant.tick, instant.layer, what));
      report.failures.push_back({instant.layer, instant.tick, std::move(what), is_bad_input});
    };
    try {
      const render::ReconstructionOptions how = reconstruction_of(plan, instant);
      // A renderer for each: light field frames share no decoded frames.
      const auto renderer = renderer_of(plan, instant.layer, share, share);
      const CancellationScope cancellation(stop);
      render::StoreResult result = renderer->store(frames_at(plan, instant), how, storing_use(how));
      if (!result.failure_reason.empty()) {
        fail(std::move(result.failure_reason), false);
      } else {
        ++(result.was_already_stored ? report.stored_before : report.derived);
      }
    } catch (const Cancelled&) {
      report.status = RunStatus::kStopped;
      break;
    } catch (const std::bad_alloc&) {
      throw;  // the others would fail, too; a farm retries with more memory
    } catch (const std::exception& error) {
      const auto* known = dynamic_cast<const Error*>(&error);
      fail(error.what(), known != nullptr && known->exit_code() == ExitCode::kBadInput);
    }
    options.progress(static_cast<double>(i + 1) / instants.size());
  }
  return report;
}

void pin_derived_data(std::span<const fs::path> files, std::string_view job) {
  for (const fs::path& folder : folders_of(files)) render::pin_depth_set(folder, job);
}

void unpin_derived_data(std::span<const fs::path> files, std::string_view job) {
  for (const fs::path& folder : folders_of(files)) render::unpin_depth_set(folder, job);
}

std::string format_stored_data_counts(int solved, int read) {
  return fmt::format("depths of {} light field frames solved, of {} read", solved, read);
}

}  // namespace raystage::compose
