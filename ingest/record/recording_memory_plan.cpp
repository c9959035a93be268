// SPDX-License-Identifier: Apache-2.0
// Estimates the RAM of a recording, bytes: the frame budget, buffers of sources, encoders, and the
// program itself.
#include "ingest/record/recording_memory_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "ingest/record/memory_ceiling.h"

namespace raystage::ingest {
namespace {

double megabytes(std::size_t bytes) { return static_cast<double>(bytes) / 1e6; }

}  // namespace

RecordingMemoryPlan plan_recording_memory(const RecorderOptions& options,
                                          const std::vector<RecorderCamera>& cameras) {
  // The growing JPEG of an RGB frame, twice because its buffer is doubled, and a copy without
  // slack.
  constexpr std::size_t kBytesOfAPixel = 3;
  RecordingMemoryPlan plan{options.memory_bytes, kProgramBytes};
  std::size_t largest = 0;
  for (const RecorderCamera& camera : cameras) {
    plan.overhead += camera.source->memory_overhead();
    const SourceDescription& source = camera.source->description();
    if (source.delivers_jpeg) continue;
    largest = std::max(
        largest, static_cast<std::size_t>(source.width) * static_cast<std::size_t>(source.height));
  }
  plan.overhead += static_cast<std::size_t>(options.threads) * kBytesOfAPixel * largest;
  return plan;
}

std::string format_memory_plan(const RecordingMemoryPlan& plan) {
  return fmt::format(
      "RAM: {:.0f} MB for frames, plus up to about {:.0f} MB for decoders, camera buffers and the "
      "program",
      megabytes(plan.frames), megabytes(plan.overhead));
}

void check_recording_memory(std::size_t frames, std::size_t machine) {
  if (frames <= machine) return;
  throw Error::bad_input(
      fmt::format("{:.0f} MB of memory for frames exceed the {:.0f} MB that this machine, or its "
                  "limit for this program, allows",
                  megabytes(frames), megabytes(machine)),
      "memory_mb", "Reduce the memory for frames")
      .concerning({"memory"});
}

void check_memory_ceiling(const RecordingMemoryPlan& plan, std::size_t ceiling) {
  const std::size_t usable = MemoryCeiling::usable(ceiling), all = plan.frames + plan.overhead;
  if (all <= usable) return;
  const std::size_t excess = all - usable;
  throw Error::bad_input(
      fmt::format(
          "a ceiling of {:.0f} MB leaves {:.0f} MB for the recording, which may need {:.0f} "
          "MB: {:.0f} MB for frames and {:.0f} MB for decoders, camera buffers and the "
          "program",
          megabytes(ceiling), megabytes(usable), megabytes(all), megabytes(plan.frames),
          megabytes(plan.overhead)),
      "memory_ceiling_mb",
      plan.frames > excess
          ? fmt::format("Raise the ceiling to {:.0f} MB, or reduce memory_mb to {:.0f}",
                        std::ceil(megabytes(MemoryCeiling::needed(all))),
                        std::floor(megabytes(plan.frames - excess)))
          : fmt::format("Raise the ceiling to {:.0f} MB, or record fewer cameras on this node",
                        std::ceil(megabytes(MemoryCeiling::needed(all)))))
      .concerning({"memory_ceiling", "memory"});
}

std::string memory_warning(const RecordingMemoryPlan& plan, std::size_t free_now) {
  constexpr double kMax = 0.8;
  const std::size_t all = plan.frames + plan.overhead;
  if (static_cast<double>(all) <= kMax * static_cast<double>(free_now)) return {};
  return fmt::format(
      "the recording may need {:.0f} MB of RAM in total, more than 80 % of the {:.0f} MB that are "
      "free now: the system may swap or kill it",
      megabytes(all), megabytes(free_now));
}

}  // namespace raystage::ingest
