// SPDX-License-Identifier: Apache-2.0
#include "compose/sequence_memory_plan.h"

#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <set>

#include "base/error.h"
#include "base/resources.h"
#include "render/memory_budgets.h"

namespace raystage {
namespace {

constexpr int kMaxFramesInFlight = 16;
constexpr std::size_t kMiB = std::size_t{1} << 20;
constexpr std::size_t kMinCache = 64 * kMiB;
constexpr std::size_t kDefaultCache = 4096 * kMiB, kDefaultKept = 1024 * kMiB;
/// Beside the view (24 at least): its EXR samples (16), the file being built (16) and the
/// renderer's own tables.
constexpr std::size_t kViewBytesPerPixel = 24, kBytesPerPixelBesideView = 72;
/// The coverage measures on top: for the file, in it.
constexpr std::size_t kMeasuresBytesPerPixelBesideView = 16, kConfidenceBytesPerPixelBesideView = 8;

/// A layer's picture that waits to be merged, and what merging writes.
constexpr std::size_t kLayerBytesPerPixel = 28;

/// AOVs in the merged picture, with their EXR samples, for each byte that they take in a layer's.
constexpr std::size_t kMergedAovFactor = 2;

/// Six ids and shares: of a layer, and of the picture with its channels and their EXR samples.
constexpr std::size_t kIdBytesPerPixel = 48, kIdBytesPerPixelMerged = 144;

/// Where a pixel's samples stand, for us and for OpenEXR; a sample, in lists that grow by
/// doubling, its halves and its place in the file.
constexpr std::size_t kDeepBytesPerPixel = 48, kDeepBytesPerSample = 76;

std::size_t pixels_of(const ShotDocument& shot) {
  const auto [x, y] = shot.output.overscan;
  return static_cast<std::size_t>(shot.width + 2 * x) *
         static_cast<std::size_t>(shot.height + 2 * y);
}

/// What the views of the frames take at most. Every one is looked at: of a zoom a single frame may
/// be the one that is supersampled most.
std::size_t most_view_bytes(const ShotPlan& plan, std::span<const PlannedFrame> frames) {
  std::size_t most = pixels_of(plan.shot()) * kViewBytesPerPixel;
  for (std::size_t i = 0; i < plan.layers(); ++i) {
    const LightFieldLayer* light_field = plan.light_field(i);
    if (light_field == nullptr) continue;
    RendererSettings settings;
    settings.cache_bytes = settings.result_cache_bytes = 0;
    settings.measure_coverage = plan.measures_coverage();
    settings.measure_confidence = plan.writes_aov("lf.confidence");
    const LightFieldRenderer renderer(light_field->take(), settings);
    for (const PlannedFrame& frame : frames) {
      if (!frame.shown[i].tick) continue;
      for (const Eye eye : plan.eyes()) {
        const ExrCamera camera = plan.exr_camera(frame.frame, eye);
        most = std::max(most,
                        renderer.view_bytes(camera.view, light_field->tick(frame.shown[i]),
                                            light_field->reconstruction_for(camera, frame.frame)));
      }
    }
  }
  return most;
}

std::size_t aov_bytes_per_pixel(const ShotPlan& plan) {
  std::size_t bytes = 0, most = 0;
  for (std::size_t i = 0; i < plan.layers(); ++i) {
    if (plan.layer(i) == nullptr) continue;
    const std::size_t of_layer = plan.layer(i)->aov_bytes_per_pixel();
    bytes += of_layer;
    most = std::max(most, of_layer);
  }
  bytes += kMergedAovFactor * most;
  if (plan.shot().output.cryptomatte) {
    bytes += plan.layers() * kIdBytesPerPixel + kIdBytesPerPixelMerged;
  }
  return bytes;
}

/// What a frame takes beside what is shared: its views, both eyes of which make one file.
std::size_t frame_bytes(const ShotPlan& plan, std::span<const PlannedFrame> frames,
                        const MemoryRequest& request) {
  const std::size_t beside =
      kBytesPerPixelBesideView +
      (request.deep ? kDeepBytesPerPixel + plan.layers() * kDeepBytesPerSample : 0) +
      (plan.measures_coverage() ? kMeasuresBytesPerPixelBesideView : 0) +
      (plan.writes_aov("lf.confidence") ? kConfidenceBytesPerPixelBesideView : 0) +
      (plan.layers() > 1 ? plan.layers() * kLayerBytesPerPixel : 0) + aov_bytes_per_pixel(plan);
  return plan.eyes().size() * (pixels_of(plan.shot()) * beside + most_view_bytes(plan, frames));
}

/// Frames of one instant share what is decoded of it.
std::size_t decoded_at_once(const ShotPlan& plan, std::span<const PlannedFrame> frames,
                            std::size_t frames_in_flight) {
  std::size_t bytes = 0;
  for (std::size_t i = 0; i < plan.layers(); ++i) {
    if (plan.light_field(i) == nullptr) continue;
    std::set<int> ticks;
    for (const PlannedFrame& frame : frames) {
      if (frame.shown[i].tick) ticks.insert(*frame.shown[i].tick);
    }
    bytes += std::min(frames_in_flight, ticks.size()) * plan.light_field(i)->decoded_frame_bytes();
  }
  return bytes;
}

/// Of one light field's part of what is left beside the frames.
LightFieldMemory share_out(const LightFieldLayer& light_field, std::size_t bytes,
                           std::size_t frames_in_flight, bool by_default) {
  MemoryBudgets shares = split_memory_budget(bytes, light_field.reconstruction());
  if (by_default) {
    shares.kept = std::min(shares.kept, kDefaultKept);
    shares.working = std::min(shares.working, kDefaultKept);
  }
  LightFieldMemory memory;
  memory.kept = shares.kept;
  memory.working = shares.working / frames_in_flight;
  memory.cache = bytes - memory.kept - memory.working * frames_in_flight;
  if (by_default) memory.cache = std::min(memory.cache, kDefaultCache);
  return memory;
}

std::string short_of_cache(const LightFieldLayer& light_field, std::size_t cache) {
  const std::size_t instant = light_field.decoded_frame_bytes();
  if (cache >= instant) return "";
  return fmt::format(
      "a view that looks through all {} cameras holds {} of decoded frames, and {} are left for "
      "them: it takes what it needs all the same",
      light_field.take().camera_count(), format_byte_size(static_cast<double>(instant)),
      format_byte_size(static_cast<double>(cache)));
}

/// Bytes of a value in a file.
constexpr std::size_t kHalf = 2, kFloat = 4;

}  // namespace

std::string format_byte_size(double bytes) {
  return bytes < 1e9 ? fmt::format("{:.1f} MB", bytes * 1e-6)
                     : fmt::format("{:.2f} GB", bytes * 1e-9);
}

std::size_t uncompressed_file_bytes(const ShotPlan& plan, bool deep) {
  const auto& layers = plan.shot().layers;
  const bool has_light_field = std::ranges::any_of(layers, &ShotDocument::Layer::is_light_field);
  const bool has_geometry =
      std::ranges::any_of(layers, [](const auto& layer) { return layer.geometry.has_value(); });
  std::size_t per_pixel = 4 * kHalf + kFloat;  // R, G, B, A and Z
  const auto add = [&](bool is_there, const char* aov, std::size_t bytes) {
    if (is_there && plan.writes_aov(aov)) per_pixel += bytes;
  };
  for (const char* aov : {"lf.coverage", "lf.confidence", "lf.cameras", "lf.nearest"}) {
    add(has_light_field, aov, kFloat);
  }
  add(has_geometry, "P", 3 * kFloat);
  add(has_geometry, "N", 3 * kHalf);
  add(has_geometry, "albedo", 3 * kHalf);
  if (plan.shot().output.cryptomatte) per_pixel += 2 * kIdRanks * kFloat;
  if (deep) per_pixel += layers.size() * (4 * kHalf + kFloat);
  return plan.eyes().size() * pixels_of(plan.shot()) * per_pixel;
}

namespace {

/// What is shared by all frames in flight, and the files on their way to the disk.
std::size_t held_bytes(const ShotPlan& plan, bool deep) {
  return plan.shared_bytes() + (1 + kMaxQueuedFrames) * uncompressed_file_bytes(plan, deep);
}

}  // namespace

std::size_t required_memory(const ShotPlan& plan, std::span<const PlannedFrame> frames,
                            std::size_t frames_in_flight, bool deep) {
  MemoryRequest request;
  request.deep = deep;
  return held_bytes(plan, deep) + frames_in_flight * frame_bytes(plan, frames, request) +
         std::max(kMinCache, decoded_at_once(plan, frames, frames_in_flight));
}

SequenceMemoryPlan plan_sequence_memory(const ShotPlan& plan, std::span<const PlannedFrame> frames,
                                        const MemoryRequest& request) {
  const std::size_t per_frame = frame_bytes(plan, frames, request);
  const std::size_t granted = request.bytes > 0 ? request.bytes : available_memory() / 2;
  const std::size_t held = held_bytes(plan, request.deep);
  const std::size_t least = held + per_frame + kMinCache;
  if (granted < least) {
    throw Error::bad_input(fmt::format("one frame needs {} of memory and {} are granted",
                                       format_byte_size(static_cast<double>(least)),
                                       format_byte_size(static_cast<double>(granted))),
                           "", "Raise the memory budget")
        .concerning({"memory"});
  }
  const std::size_t budget = granted - held;
  const auto fits = [&](std::size_t frames_in_flight) {
    return frames_in_flight * per_frame +
               std::max(kMinCache, decoded_at_once(plan, frames, frames_in_flight)) <=
           budget;
  };
  SequenceMemoryPlan result;
  result.frames_in_flight =
      request.frames_in_flight > 0
          ? request.frames_in_flight
          : std::min(tbb::this_task_arena::max_concurrency(), kMaxFramesInFlight);
  while (result.frames_in_flight > 1 && !fits(static_cast<std::size_t>(result.frames_in_flight))) {
    --result.frames_in_flight;
  }
  const auto frames_in_flight = static_cast<std::size_t>(result.frames_in_flight);
  result.per_layer.resize(plan.layers());
  std::size_t light_fields = 0;
  for (std::size_t i = 0; i < plan.layers(); ++i) light_fields += plan.light_field(i) != nullptr;
  for (std::size_t i = 0; i < plan.layers(); ++i) {
    if (plan.light_field(i) == nullptr) continue;
    LightFieldMemory& share = result.per_layer[i];
    share = share_out(*plan.light_field(i), (budget - frames_in_flight * per_frame) / light_fields,
                      frames_in_flight, request.bytes == 0);
    result.kept += share.kept;
    result.working += share.working;
    result.cache += share.cache;
    if (result.note.empty()) result.note = short_of_cache(*plan.light_field(i), share.cache);
  }
  return result;
}

}  // namespace raystage
