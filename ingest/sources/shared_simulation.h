// SPDX-License-Identifier: Apache-2.0
// Internal to ingest/sources.
#pragma once

#include <chrono>
#include <map>
#include <memory>
#include <mutex>
#include <vector>

#include "ingest/sources/frame_source.h"
#include "rig/rig.h"
#include "schemas/record_config.h"
#include "simulate/exposure_schedule.h"
#include "simulate/simulation_options.h"
#include "simulate/world.h"

namespace raystage::ingest {

/// The frames of one simulated camera, which repeat endlessly.
struct SimulatedLoop {
  struct Exposure {
    Nanoseconds true_time = 0;     ///< middle of the exposure, in ns from the loop's start
    Nanoseconds stamped_time = 0;  ///< the same by the clock of its node
    std::vector<std::byte> jpeg;   ///< if the camera delivers JPEG; else `raw`
    store::RawImage raw;
  };
  std::vector<Exposure> exposures;
  Nanoseconds length = 0;  ///< in ns by this camera's own rate
};

/// The simulated array in real time, shared by its cameras. The scene plays forwards, then
/// backwards: a loop takes twice the settings' seconds. Cameras keep their own rates: after an hour
/// at 50 ppm one shows what its neighbour showed 0.18 s before. Their time stamps stay true.
class SharedSimulation {
 public:
  using Clock = std::chrono::steady_clock;

  explicit SharedSimulation(const schemas::RecordConfig::SimulatedSource& source);

  /// Returns the simulation that all existing cameras with these settings (except the index) share.
  /// Throws Error (bad input) for invalid settings.
  static std::shared_ptr<SharedSimulation> shared(
      const schemas::RecordConfig::SimulatedSource& source);

  /// Returns a camera's frames. The first call renders them on all threads of the TBB arena.
  std::shared_ptr<const SimulatedLoop> loop(int index);
  /// Returns an upper estimate of the bytes of the scene and of rendering, without the loops.
  std::size_t memory() const;
  /// Returns the time at which all loops start.
  Clock::time_point start() const { return start_; }

 private:
  SimulatedLoop render(int index) const;

  schemas::RecordConfig::SimulatedSource source_;
  simulate::SimulationOptions options_;
  simulate::Scene scene_;
  simulate::SceneGeometry geometry_;
  rig::Rig rig_;
  simulate::ExposureSchedule schedule_;
  Clock::time_point start_ = Clock::now();
  std::mutex mutex_;
  std::map<int, std::weak_ptr<const SimulatedLoop>> loops_;
};

}  // namespace raystage::ingest
