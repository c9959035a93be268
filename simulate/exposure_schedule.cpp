// SPDX-License-Identifier: Apache-2.0
//
// Simulates free-running cameras (thesis chapter 4): a random phase and period per camera, normal
// jitter (clipped at 5 sigma) per frame, a clock offset per node. Frames during start-up are lost,
// later ones are dropped at random. Times are in nanoseconds. Cost: linear in the frames.
#include "simulate/exposure_schedule.h"

#include <algorithm>
#include <cmath>

#include "simulate/hash_random.h"

namespace raystage::simulate {
namespace {

constexpr std::uint64_t kNodeSalt = 11, kCameraSalt = 12, kFrameSalt = 13;

Nanoseconds nanoseconds(double seconds) {
  return static_cast<Nanoseconds>(std::llround(seconds * kNanosecondsPerSecond));
}

}  // namespace

ExposureSchedule make_exposure_schedule(const SimulationOptions& s) {
  ExposureSchedule schedule;
  const int nodes = (s.camera_count() + s.cameras_per_node - 1) / s.cameras_per_node;
  for (int node = 0; node < nodes; ++node) {
    HashRandom random{s.seed, kNodeSalt, static_cast<std::uint64_t>(node)};
    schedule.clock_offset.push_back(nanoseconds(random.uniform(-s.clock_offset, s.clock_offset)));
  }
  // Keeps every time stamp after the epoch.
  const double lead = s.clock_offset + 5 * s.jitter;
  for (int index = 0; index < s.camera_count(); ++index) {
    const auto salt = static_cast<std::uint64_t>(index);
    HashRandom random{s.seed, kCameraSalt, salt};
    ExposureSchedule::Camera camera;
    camera.node = index / s.cameras_per_node;
    const double phase = lead + random.uniform() / s.fps;
    const double period = (1 + s.period_error_ppm * 1e-6 * random.normal()) / s.fps;
    const Nanoseconds offset = schedule.clock_offset[camera.node];
    camera.phase = nanoseconds(phase);
    camera.period_ns = period * kNanosecondsPerSecond;
    for (int number = 0; number < s.frames_per_camera(); ++number) {
      HashRandom chance{s.seed, kFrameSalt, salt, static_cast<std::uint64_t>(number)};
      ExposureSchedule::Frame frame;
      const double jitter = std::clamp(s.jitter * chance.normal(), -5 * s.jitter, 5 * s.jitter);
      frame.true_time = nanoseconds(phase + number * period + jitter);
      frame.stamped_time = frame.true_time + offset;
      if (frame.true_time < nanoseconds(s.startup_loss_s)) {
        frame.status = store::FrameStatus::kStartUp;
      } else if (chance.uniform() < s.drop_probability) {
        frame.status = store::FrameStatus::kDroppedBySource;
      }
      camera.frames.push_back(frame);
    }
    schedule.cameras.push_back(std::move(camera));
  }
  return schedule;
}

}  // namespace raystage::simulate
