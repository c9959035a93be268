// SPDX-License-Identifier: Apache-2.0
// Inside ingest/sources only.
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
#include "simulate/simulation_settings.h"
#include "simulate/world.h"

namespace raystage {

/// What one simulated camera shows, over and over.
struct SimulatedLoop {
  struct Exposure {
    Nanoseconds true_time = 0;     ///< middle of the exposure, from the loop's start
    Nanoseconds stamped_time = 0;  ///< by the clock of its node
    std::vector<std::byte> jpeg;   ///< or
    RawImage raw;
  };
  std::vector<Exposure> exposures;
  Nanoseconds length = 0;  ///< of the loop by this camera's own rate
};

/// The simulated array in motion, shared by its cameras. The scene runs to and fro: a loop is twice
/// the settings' seconds. Cameras keep their own rates, so that after an hour at 50 ppm one shows
/// what its neighbour showed 0.18 s before; their time stamps stay true.
class SharedSimulation {
 public:
  using Clock = std::chrono::steady_clock;

  explicit SharedSimulation(const RecordConfig::SimulatedSource& source);

  /// The stage for these settings (all but the index): one for all cameras that live at the same
  /// time. Throws Error (bad input) for settings that cannot be.
  static std::shared_ptr<SharedSimulation> shared(const RecordConfig::SimulatedSource& source);

  /// Renders when first asked for this camera, on all threads of the TBB arena.
  std::shared_ptr<const SimulatedLoop> loop(int index);
  /// Bytes of the scene and of rendering it, at most about; the loops are not in it.
  std::size_t memory() const;
  /// When the loops started.
  Clock::time_point start() const { return start_; }

 private:
  SimulatedLoop render(int index) const;

  RecordConfig::SimulatedSource source_;
  SimulationSettings settings_;
  Scene scene_;
  SceneGeometry geometry_;
  Rig rig_;
  ExposureSchedule schedule_;
  Clock::time_point start_ = Clock::now();
  std::mutex mutex_;
  std::map<int, std::weak_ptr<const SimulatedLoop>> loops_;
};

}  // namespace raystage
