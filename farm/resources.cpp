// SPDX-License-Identifier: Apache-2.0
// Estimates the resources of a task, GB = 10^9 bytes. Memory is the larger of twice the memory plan
// (required_memory()) and 1.3 times the measured peak. Stage prepare needs at least 160 bytes per
// pixel of all cameras. Time limits are four times the expected time. Cost: that of
// required_memory().
#include "farm/resources.h"

#include <algorithm>
#include <cmath>

#include "compose/sequence_memory_plan.h"

namespace raystage::farm {
namespace {

constexpr double kMinGb = 0.25, kStep = 0.05;  // GB = 10^9 bytes
/// Budget per pixel of all cameras; depth estimation uses a quarter (docs/performance.md#memory).
constexpr double kSolveBytesPerPixel = 160;
constexpr int kMaxFramesInFlight = 16;
constexpr double kLongerThanExpected = 4, kMoreThanMeasured = 1.3;
constexpr int kMinMinutes = 10;

double rounded_up(double gb) { return std::ceil(std::max(gb, kMinGb) / kStep) * kStep; }

double camera_pixels(const compose::ShotPlan& plan) {
  double most = 0;
  for (const compose::LightFieldLayer* light_field : plan.light_fields()) {
    double pixels = 0;
    for (const rig::Rig::Camera& camera : light_field->take().rig().cameras) {
      pixels += static_cast<double>(camera.model.width()) * camera.model.height();
    }
    most = std::max(most, pixels);
  }
  return most;
}

/// Returns the memory in GB: twice that of the frames, as a result cache gets half of the rest.
double render_gb(const ResourceRequest& request) {
  const auto frames_in_flight =
      static_cast<std::size_t>(std::clamp(request.threads, 1, kMaxFramesInFlight));
  const double planned =
      2e-9 * compose::required_memory(request.plan, request.frames, frames_in_flight, request.deep);
  const double measured =
      request.measured ? 1e-9 * kMoreThanMeasured * request.measured->peak_memory_bytes : 0;
  return rounded_up(std::max(planned, measured));
}

std::optional<int> minutes_for(double seconds, const ResourceRequest& request) {
  if (request.minutes) return request.minutes;
  if (!request.measured) return std::nullopt;
  return std::max(kMinMinutes, static_cast<int>(std::ceil(kLongerThanExpected * seconds / 60)));
}

}  // namespace

double estimate_frame_bytes(const compose::ShotPlan& plan, bool deep) {
  return static_cast<double>(compose::uncompressed_file_bytes(plan, deep)) / 4;
}

schemas::FarmResources estimate_resources(schemas::FarmStage stage,
                                          const ResourceRequest& request) {
  schemas::FarmResources resources;
  const double frame_seconds = request.measured ? request.measured->wall_seconds : 0;
  switch (stage) {
    case schemas::FarmStage::kPrepare:
      resources.threads = request.threads;
      resources.memory_gb =
          request.memory_gb > 0
              ? request.memory_gb
              : rounded_up(std::max(render_gb(request),
                                    1e-9 * kSolveBytesPerPixel * camera_pixels(request.plan)));
      // At least 10 minutes per instant: the measured frame may have found its depths stored.
      resources.minutes = minutes_for(std::max(frame_seconds, 600.0), request);
      break;
    case schemas::FarmStage::kRender:
      resources.threads = request.threads;
      resources.memory_gb = request.memory_gb > 0 ? request.memory_gb : render_gb(request);
      resources.minutes = minutes_for(frame_seconds * request.longest_chunk, request);
      break;
    case schemas::FarmStage::kVerify:
    case schemas::FarmStage::kPreview:
      resources.threads = 1;
      resources.memory_gb =
          rounded_up(4e-9 * compose::uncompressed_file_bytes(request.plan, request.deep));
      break;
  }
  return resources;
}

}  // namespace raystage::farm
