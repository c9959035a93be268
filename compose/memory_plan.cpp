// SPDX-License-Identifier: Apache-2.0
#include "compose/memory_plan.h"

#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <set>

#include "render/memory_shares.h"
#include "schemas/error.h"
#include "schemas/resources.h"

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
constexpr std::size_t kMeasuresBytesPerPixelBesideView = 16;

const FrameSelection& tick_of(const ShotPlan& plan, const PlannedFrame& frame) {
  return plan.timeline().ticks[static_cast<std::size_t>(*frame.tick)];
}

/// What the views of the frames take at most. Every one is looked at: of a zoom a single frame may
/// be the one that is supersampled most.
std::size_t most_view_bytes(const ShotPlan& plan, std::span<const PlannedFrame> frames,
                            bool coverage_measures) {
  RendererSettings settings;
  settings.cache_bytes = settings.kept_bytes = 0;
  settings.measure_coverage = coverage_measures;
  const LightFieldRenderer renderer(plan.take(), settings);
  std::size_t most = static_cast<std::size_t>(plan.shot().width) *
                     static_cast<std::size_t>(plan.shot().height) * kViewBytesPerPixel;
  for (const PlannedFrame& frame : frames) {
    if (!frame.tick) continue;
    most = std::max(most, renderer.view_bytes(plan.camera(frame.frame), tick_of(plan, frame),
                                              plan.reconstruction()));
  }
  return most;
}

/// Of all cameras, decoded: what a view may hold while it is rendered. Most look through fewer.
std::size_t instant_bytes(const ShotPlan& plan) {
  constexpr std::size_t kBytesPerPixel = 8;  // R, G, B and one more, 16 bits each
  std::size_t bytes = 0;
  for (const Rig::Camera& camera : plan.take().rig().cameras) {
    bytes += static_cast<std::size_t>(camera.model.width()) *
             static_cast<std::size_t>(camera.model.height()) * kBytesPerPixel;
  }
  return bytes;
}

}  // namespace

std::string size_text(double bytes) {
  return bytes < 1e9 ? fmt::format("{:.1f} MB", bytes * 1e-6)
                     : fmt::format("{:.2f} GB", bytes * 1e-9);
}

MemoryPlan plan_memory(const ShotPlan& plan, std::span<const PlannedFrame> frames,
                       const MemoryRequest& request) {
  const ShotDocument& shot = plan.shot();
  const std::size_t per_frame =
      static_cast<std::size_t>(shot.width) * static_cast<std::size_t>(shot.height) *
          (kBytesPerPixelBesideView +
           (request.coverage_measures ? kMeasuresBytesPerPixelBesideView : 0)) +
      most_view_bytes(plan, frames, request.coverage_measures);
  const std::size_t budget = request.bytes > 0 ? request.bytes : available_memory() / 2;
  if (budget < per_frame + kMinCache) {
    throw Error::bad_input(fmt::format("one frame needs {} of memory and {} are granted",
                                       size_text(static_cast<double>(per_frame + kMinCache)),
                                       size_text(static_cast<double>(budget))),
                           "", "Raise --memory");
  }
  const std::size_t instant = instant_bytes(plan);
  std::set<int> ticks;
  for (const PlannedFrame& frame : frames) {
    if (frame.tick) ticks.insert(*frame.tick);
  }
  const auto fits = [&](std::size_t in_flight) {
    // Frames of one instant share what is decoded of it.
    const std::size_t decoded = std::min(in_flight, ticks.size()) * instant;
    return in_flight * per_frame + std::max(kMinCache, decoded) <= budget;
  };

  MemoryPlan result;
  result.in_flight = request.frames_in_flight > 0
                         ? request.frames_in_flight
                         : std::min(tbb::this_task_arena::max_concurrency(), kMaxFramesInFlight);
  while (result.in_flight > 1 && !fits(static_cast<std::size_t>(result.in_flight))) {
    --result.in_flight;
  }
  const auto in_flight = static_cast<std::size_t>(result.in_flight);
  const std::size_t beside_frames = budget - in_flight * per_frame;
  MemoryShares shares = share_memory(beside_frames, plan.reconstruction());
  if (request.bytes == 0) {
    shares.kept = std::min(shares.kept, kDefaultKept);
    shares.working = std::min(shares.working, kDefaultKept);
  }
  result.kept = shares.kept;
  result.working = shares.working / in_flight;
  result.cache = beside_frames - result.kept - result.working * in_flight;
  if (request.bytes == 0) result.cache = std::min(result.cache, kDefaultCache);
  if (result.cache < instant) {
    result.note = fmt::format(
        "a view that looks through all {} cameras holds {} of decoded frames, and {} are left for "
        "them: it takes what it needs all the same",
        plan.take().camera_count(), size_text(static_cast<double>(instant)),
        size_text(static_cast<double>(result.cache)));
  }
  return result;
}

}  // namespace raystage
