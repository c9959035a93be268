// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "base/time.h"
#include "store/processing/sync/resync.h"

namespace raystage::testing {

/// For tests: time stamps of free-running cameras with known truth.
struct SimulatedStamps {
  enum class Jitter { kGaussian, kDelay };  ///< kDelay: exponential, never negative
  struct Options {
    unsigned seed = 1;
    int cameras = 64, cameras_per_node = 16;
    double seconds = 60, fps = 15;
    double jitter_ms = 5;     ///< sigma
    double crystal_ppm = 50;  ///< sigma of each camera's rate
    double node_ppm = 0;      ///< sigma of each node's clock rate
    double drop = 0.03;
    int start_up_frames = 45;
    double start_up_loss = 0.5;  ///< share of the start-up frames that are lost
    double step_ms = 40, step_at_s = 31.2;
    int step_node = 2;     ///< -1: none
    double offset_ms = 0;  ///< largest error of a node's clock
    Jitter jitter = Jitter::kGaussian;
  };
  struct Camera {
    int node = 0;
    /// ns by the node's clock before the step; frame n at phase + n period
    double period = 0, phase = 0;
    std::vector<std::int64_t> index;  ///< n of each frame that arrived
    std::vector<Nanoseconds> stamps;
    std::vector<Nanoseconds> exposed;  ///< true time, without step and jitter
  };
  std::vector<Camera> cameras;
  std::vector<Nanoseconds> node_offsets;

  explicit SimulatedStamps(const Options& s) {
    std::mt19937_64 random(s.seed);
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> uniform;
    std::exponential_distribution<double> exponential;
    const double nominal = 1e9 / s.fps, start = 1e9;
    const int frames = static_cast<int>(s.seconds * s.fps);
    std::vector<double> node_rate;
    for (int node = 0; node * s.cameras_per_node < s.cameras; ++node) {
      node_rate.push_back(1 + s.node_ppm * 1e-6 * normal(random));
      node_offsets.push_back(std::llround((2 * uniform(random) - 1) * s.offset_ms * 1e6));
    }
    for (int c = 0; c < s.cameras; ++c) {
      Camera camera;
      camera.node = c / s.cameras_per_node;
      const auto n = static_cast<std::size_t>(camera.node);
      camera.period = nominal * (1 + s.crystal_ppm * 1e-6 * normal(random)) * node_rate[n];
      camera.phase = start + uniform(random) * nominal;
      for (int i = 0; i < frames; ++i) {
        const double lost = uniform(random);
        const double jitter =
            s.jitter_ms * 1e6 * (s.jitter == Jitter::kDelay ? exponential(random) : normal(random));
        if (lost < (i < s.start_up_frames ? s.start_up_loss : s.drop)) continue;
        const double exposed = camera.phase + i * camera.period;
        const bool stepped = camera.node == s.step_node && exposed >= s.step_at_s * 1e9;
        double stamp = exposed + jitter + (stepped ? s.step_ms * 1e6 : 0) +
                       static_cast<double>(node_offsets[n]);
        if (!camera.stamps.empty()) {  // frames arrive in order
          stamp = std::max(stamp, static_cast<double>(camera.stamps.back()) + 1000);
        }
        camera.index.push_back(i);
        camera.exposed.push_back(std::llround(exposed));
        camera.stamps.push_back(std::llround(stamp));
      }
      cameras.push_back(std::move(camera));
    }
  }
};

/// Returns the time stamps as input of resynchronisation: cameras c0, c1, ... of node0, node1, ...
inline std::vector<store::CameraTimestamps> cameras_of(const SimulatedStamps& truth) {
  std::vector<store::CameraTimestamps> cameras;
  for (const auto& camera : truth.cameras) {
    cameras.push_back({"c" + std::to_string(cameras.size()),
                       "node" + std::to_string(camera.node),
                       camera.stamps,
                       {},
                       {}});
  }
  return cameras;
}

/// Returns the recording of `first`, resumed `behind` later as `second`, whose time stamps are
/// shifted by it.
inline std::vector<store::CameraTimestamps> resumed(const SimulatedStamps& first,
                                                    const SimulatedStamps& second,
                                                    Nanoseconds behind) {
  std::vector<store::CameraTimestamps> cameras = cameras_of(first);
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    for (const Nanoseconds stamp : second.cameras[c].stamps) {
      cameras[c].stamps.push_back(stamp + behind);
    }
    cameras[c].restarts = {behind + second.cameras[c].stamps.front() - 200'000'000};
  }
  return cameras;
}

}  // namespace raystage::testing
