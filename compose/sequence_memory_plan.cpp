// SPDX-License-Identifier: Apache-2.0
// Divides the memory budget of a sequence. Meshes, textures, mattes and queued files get fixed
// shares. Then as many frames are in flight as fit with the decoded source frames that their views
// use at once. The light fields get equal parts of the rest. A frame is estimated in bytes per
// pixel of each stage. Cost: frames x views x layers.
#include "compose/sequence_memory_plan.h"

#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <set>

#include "base/error.h"
#include "base/parallel.h"
#include "base/resources.h"
#include "compose/geometry/gathered_light.h"
#include "compose/layers/exposure.h"
#include "render/memory_budgets.h"

namespace raystage::compose {
namespace {

constexpr int kMaxFramesInFlight = 16;
constexpr std::size_t kMiB = std::size_t{1} << 20;
constexpr std::size_t kMinCache = 64 * kMiB;
constexpr std::size_t kDefaultCache = 4096 * kMiB, kDefaultResultCache = 1024 * kMiB;
/// A view (at least 24); in addition its EXR samples (16), the file (16) and the renderer's tables.
constexpr std::size_t kViewBytesPerPixel = 24, kExtraBytesPerPixel = 72;
/// Additional coverage measures: EXR samples, and in the file.
constexpr std::size_t kMeasuresBytesPerPixel = 16, kConfidenceBytesPerPixel = 8;

/// A layer's image that waits to be merged, and its part of the result.
constexpr std::size_t kLayerBytesPerPixel = 28;

/// Bytes of AOVs in the merged image with EXR samples, for each byte in a layer's image.
constexpr std::size_t kMergedAovFactor = 2, kMotionBytesPerPixel = 16;

/// Six ids and shares: of a layer, and of the merged image with its channels and EXR samples.
constexpr std::size_t kIdBytesPerPixel = 48, kIdBytesPerPixelMerged = 144;

/// Per pixel: indices of samples, ours and OpenEXR's. Per sample: growing lists, halves, file.
constexpr std::size_t kDeepBytesPerPixel = 48, kDeepBytesPerSample = 76;

std::size_t pixels_of(const schemas::ShotDocument& shot) {
  const auto [x, y] = shot.output.overscan;
  return static_cast<std::size_t>(shot.width + 2 * x) *
         static_cast<std::size_t>(shot.height + 2 * y);
}

/// Returns the most memory that a view of the frames takes, bytes. Checks all frames, because a
/// single frame of a zoom may need the most supersampling.
std::size_t max_view_bytes(const ShotPlan& plan, std::span<const PlannedFrame> frames) {
  const bool gathers =
      std::ranges::any_of(plan.shot().lights, [](const auto& light) { return light.rays > 0; });
  std::size_t most =
      pixels_of(plan.shot()) * (kViewBytesPerPixel + (gathers ? GatheredLight::kBytesPerPixel : 0));
  for (const LightFieldLayer* light_field : plan.light_fields()) {
    const std::size_t i = light_field->index();
    render::RendererOptions options;
    options.cache_bytes = options.result_cache_bytes = 0;
    options.measure_coverage = plan.measures_coverage();
    options.measure_confidence = plan.writes_aov("lf.confidence");
    const render::LightFieldRenderer renderer(light_field->take(), options);
    std::vector<std::size_t> bytes(frames.size(), 0);
    parallel_for(std::size_t{0}, frames.size(), [&](std::size_t f) {
      const PlannedFrame& frame = frames[f];
      if (!frame.shown[i].tick) return;
      for (const Eye eye : plan.eyes()) {
        const ExrCamera camera = plan.exr_camera(frame.frame, eye);
        if (camera.view.is_equirectangular) {
          constexpr std::size_t kMeasuresPerPixel = 8, kRaysPerColumn = std::size_t{64} * 80;
          const std::size_t measures = plan.measures_coverage() ? kMeasuresPerPixel : 0;
          bytes[f] =
              std::max(bytes[f], pixels_of(plan.shot()) * (kViewBytesPerPixel + measures) +
                                     kRaysPerColumn * static_cast<std::size_t>(camera.view.width));
          continue;
        }
        bytes[f] = std::max(
            bytes[f], renderer.view_bytes(camera.view, light_field->frames_of(*frame.shown[i].tick),
                                          light_field->reconstruction_for(camera, frame.frame)));
      }
    });
    for (const std::size_t of_frame : bytes) most = std::max(most, of_frame);
  }
  return most;
}

/// Returns whether a layer may have a second image, of what is behind its surfaces at edges of
/// depth (LayerSurfaces).
bool may_have_two_images(const ShotPlan& plan, std::size_t layer) {
  const LightFieldLayer* light_field = plan.light_field(layer);
  const bool is_by_depth = plan.shot().merge == schemas::ShotDocument::Merge::kDepth;
  return light_field != nullptr && light_field->method().tells_surfaces_apart() &&
         plan.shot().layers[layer].volume.empty() && (is_by_depth || plan.layers() == 1);
}

std::size_t image_count(const ShotPlan& plan) {
  std::size_t count = plan.layers();
  for (std::size_t i = 0; i < plan.layers(); ++i) count += may_have_two_images(plan, i) ? 1 : 0;
  return count;
}

std::size_t aov_bytes_per_pixel(const ShotPlan& plan) {
  std::size_t bytes = 0, most = 0;
  for (std::size_t i = 0; i < plan.layers(); ++i) {
    if (plan.layer(i) == nullptr) continue;
    const std::size_t of_layer = plan.layer(i)->aov_bytes_per_pixel();
    bytes += (may_have_two_images(plan, i) ? 2 : 1) * of_layer;
    most = std::max(most, of_layer);
  }
  bytes += kMergedAovFactor * most;
  if (plan.shot().output.cryptomatte) {
    bytes +=
        (plan.layers() + plan.light_fields().size()) * kIdBytesPerPixel + kIdBytesPerPixelMerged;
  }
  return bytes;
}

/// Returns the memory of a frame without shared data, bytes: its views, for stereo of both eyes.
std::size_t frame_bytes(const ShotPlan& plan, std::span<const PlannedFrame> frames,
                        const MemoryRequest& request) {
  const std::size_t images = image_count(plan);
  const std::size_t per_pixel =
      kExtraBytesPerPixel + (request.deep ? kDeepBytesPerPixel + images * kDeepBytesPerSample : 0) +
      (plan.measures_coverage() ? kMeasuresBytesPerPixel : 0) +
      (plan.writes_aov("lf.confidence") ? kConfidenceBytesPerPixel : 0) +
      (images > 1 ? images * kLayerBytesPerPixel : 0) + aov_bytes_per_pixel(plan) +
      (plan.writes_aov("motion") ? (images + kMergedAovFactor) * kMotionBytesPerPixel : 0);
  std::size_t of_layers = 0;
  for (std::size_t i = 0; i < plan.layers(); ++i) {
    if (plan.layer(i) != nullptr) of_layers += plan.layer(i)->frame_bytes();
  }
  // One view at a time: its averages, and the picture of the middle.
  const bool is_blurred = std::ranges::any_of(
      frames, [](const PlannedFrame& frame) { return !frame.exposure.empty(); });
  if (is_blurred) {
    constexpr std::size_t kAveragedAovChannels = 4;  // albedo and coverage
    of_layers +=
        pixels_of(plan.shot()) *
        (ExposureAverage::bytes_per_pixel(kAveragedAovChannels, plan.shot().output.cryptomatte) +
         kViewBytesPerPixel + aov_bytes_per_pixel(plan) +
         (plan.measures_coverage() ? kMeasuresBytesPerPixel : 0) +
         (plan.writes_aov("lf.confidence") ? kConfidenceBytesPerPixel : 0) +
         (plan.writes_aov("motion") ? kMotionBytesPerPixel : 0));
  }
  return of_layers +
         plan.eyes().size() * (pixels_of(plan.shot()) * per_pixel + max_view_bytes(plan, frames));
}

/// Returns the memory of decoded source frames, which shot frames of one instant share, bytes.
std::size_t decoded_bytes(const ShotPlan& plan, std::span<const PlannedFrame> frames,
                          std::size_t frames_in_flight) {
  std::size_t bytes = 0;
  for (const LightFieldLayer* light_field : plan.light_fields()) {
    std::set<int> ticks;
    for (const PlannedFrame& frame : frames) {
      const ShownTick& shown = frame.shown[light_field->index()];
      if (shown.tick) ticks.insert(*shown.tick);
      for (const PlannedFrame& sample : plan.exposure_of(frame)) {
        if (const auto& tick = sample.shown[light_field->index()].tick) ticks.insert(*tick);
      }
    }
    bytes += std::min(frames_in_flight, ticks.size()) * light_field->decoded_frame_bytes();
  }
  return bytes;
}

/// Divides the `bytes` of one light field.
LightFieldMemory divide_budget(const LightFieldLayer& light_field, std::size_t bytes,
                               std::size_t frames_in_flight, bool by_default) {
  render::MemoryBudgets shares = render::split_memory_budget(bytes, light_field.reconstruction());
  if (by_default) {
    shares.result_cache = std::min(shares.result_cache, kDefaultResultCache);
    shares.working = std::min(shares.working, kDefaultResultCache);
  }
  LightFieldMemory memory;
  memory.result_cache = shares.result_cache;
  memory.working = shares.working / frames_in_flight;
  memory.cache = bytes - memory.result_cache - memory.working * frames_in_flight;
  if (by_default) memory.cache = std::min(memory.cache, kDefaultCache);
  return memory;
}

/// Returns a note if one view may need more decoded frames than `cache` holds, or "".
std::string cache_note(const LightFieldLayer& light_field, std::size_t cache) {
  const std::size_t instant = light_field.decoded_frame_bytes();
  if (cache >= instant) return "";
  return fmt::format(
      "a view that uses all {} cameras needs {} of decoded frames, but their budget is {}: it "
      "exceeds the budget",
      light_field.take().camera_count(), format_byte_size(instant), format_byte_size(cache));
}

constexpr std::size_t kHalf = 2, kFloat = 4;  // bytes

}  // namespace

std::string format_byte_size(double bytes) {
  return bytes < 1e9 ? fmt::format("{:.1f} MB", bytes * 1e-6)
                     : fmt::format("{:.2f} GB", bytes * 1e-9);
}

std::size_t uncompressed_file_bytes(const ShotPlan& plan, bool deep) {
  const auto& layers = plan.shot().layers;
  const bool has_light_field =
      std::ranges::any_of(layers, &schemas::ShotDocument::Layer::is_light_field);
  const bool has_geometry =
      std::ranges::any_of(layers, [](const auto& layer) { return layer.geometry.has_value(); });
  std::size_t per_pixel = 4 * kHalf + kFloat;  // R, G, B, A and Z
  const auto add = [&](bool is_there, const char* aov, std::size_t bytes) {
    if (is_there && plan.writes_aov(aov)) per_pixel += bytes;
  };
  for (const char* aov : {"lf.coverage", "lf.confidence", "lf.cameras", "lf.nearest"}) {
    add(has_light_field, aov, kFloat);
  }
  add(has_geometry || has_light_field, "motion", 4 * kFloat);
  add(has_geometry, "P", 3 * kFloat);
  add(has_geometry, "N", 3 * kHalf);
  add(has_geometry, "albedo", 3 * kHalf);
  if (plan.shot().output.cryptomatte) per_pixel += 2 * kIdRanks * kFloat;
  if (deep) per_pixel += image_count(plan) * (4 * kHalf + kFloat);
  return plan.eyes().size() * pixels_of(plan.shot()) * per_pixel;
}

namespace {

/// Returns the memory that all frames share and that of queued files, bytes.
std::size_t shared_and_queued_bytes(const ShotPlan& plan, bool deep) {
  return plan.shared_bytes() + (1 + kMaxQueuedFrames) * uncompressed_file_bytes(plan, deep);
}

}  // namespace

std::size_t required_memory(const ShotPlan& plan, std::span<const PlannedFrame> frames,
                            std::size_t frames_in_flight, bool deep) {
  MemoryRequest request;
  request.deep = deep;
  return shared_and_queued_bytes(plan, deep) +
         frames_in_flight * frame_bytes(plan, frames, request) +
         std::max(kMinCache, decoded_bytes(plan, frames, frames_in_flight));
}

SequenceMemoryPlan plan_sequence_memory(const ShotPlan& plan, std::span<const PlannedFrame> frames,
                                        const MemoryRequest& request) {
  const std::size_t per_frame = frame_bytes(plan, frames, request);
  const std::size_t granted = request.bytes > 0 ? request.bytes : available_memory() / 2;
  const std::size_t held = shared_and_queued_bytes(plan, request.deep);
  const std::size_t least = held + per_frame + kMinCache;
  if (granted < least) {
    throw Error::bad_input(fmt::format("one frame needs {} of memory, but the budget is {}",
                                       format_byte_size(least), format_byte_size(granted)),
                           "", "Raise the memory budget")
        .concerning({"memory"});
  }
  const std::size_t budget = granted - held;
  const auto fits = [&](std::size_t frames_in_flight) {
    return frames_in_flight * per_frame +
               std::max(kMinCache, decoded_bytes(plan, frames, frames_in_flight)) <=
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
  const std::vector<const LightFieldLayer*> light_fields = plan.light_fields();
  for (const LightFieldLayer* light_field : light_fields) {
    LightFieldMemory& share = result.per_layer[light_field->index()];
    share =
        divide_budget(*light_field, (budget - frames_in_flight * per_frame) / light_fields.size(),
                      frames_in_flight, request.bytes == 0);
    result.result_cache += share.result_cache;
    result.working += share.working;
    result.cache += share.cache;
    if (result.note.empty()) result.note = cache_note(*light_field, share.cache);
  }
  return result;
}

}  // namespace raystage::compose
