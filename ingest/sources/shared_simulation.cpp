// SPDX-License-Identifier: Apache-2.0
#include "ingest/sources/shared_simulation.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <thread>

#include "base/parallel.h"
#include "ingest/sources/pixel_conversion.h"
#include "simulate/camera_renderer.h"
#include "simulate/hash_random.h"
#include "simulate/sensor_model.h"
#include "simulate/simulated_rig.h"
#include "store/jpeg/encode.h"

namespace raystage {
namespace {

constexpr std::uint64_t kNoiseSalt = 22;
constexpr int kWebcamQuality = 90;
// Of each thread that renders: a recording has promised how little memory it takes.
constexpr std::size_t kCacheBytes = 16 << 20;
constexpr std::size_t kSceneBytes = 100 << 20;        // textures and Embree's trees
constexpr std::size_t kRenderingBytesOfAPixel = 300;  // of each thread that renders

SimulationSettings settings_from(const RecordConfig::SimulatedSource& source) {
  SimulationSettings settings;
  settings.scene = source.scene;
  settings.seed = source.seed;
  settings.rows = source.rows;
  settings.columns = source.columns;
  settings.width = source.width;
  settings.height = source.height;
  settings.fps = source.fps;
  settings.seconds = 2 * source.seconds;  // there and back
  settings.jitter = std::min(settings.jitter, 0.05 / source.fps);
  // What gets lost is the recorder's to find out.
  settings.startup_loss_s = 0;
  settings.drop_probability = 0;
  check_simulation_settings(settings);
  return settings;
}

std::size_t render_threads() { return std::max(1U, std::thread::hardware_concurrency()); }

/// All that makes two arrays differ.
std::string key_of(const RecordConfig::SimulatedSource& s) {
  return fmt::format("{} {} {} {} {} {} {} {} {}", s.seed, s.rows, s.columns, s.width, s.height,
                     s.fps, s.seconds, s.jpeg, s.scene);
}

/// As a raw camera would deliver it: half the bytes of RGB.
RawImage planes_of(const RgbImage& rgb, PixelConverter& converter) {
  const AvPtr<AVFrame> frame(check_allocation(av_frame_alloc()));
  frame->width = rgb.width;
  frame->height = rgb.height;
  frame->format = AV_PIX_FMT_RGB24;
  frame->data[0] = const_cast<std::uint8_t*>(rgb.pixels.data());
  frame->linesize[0] = 3 * rgb.width;
  RawImage image;
  converter.convert_to(PixelFormat::kYuv420, *frame, image);
  return image;
}

}  // namespace

SharedSimulation::SharedSimulation(const RecordConfig::SimulatedSource& source)
    : source_(source),
      settings_(settings_from(source)),
      scene_(make_scene(settings_.scene)),
      geometry_(scene_),
      rig_(rig_from_document(make_simulated_rig(settings_).truth)),
      schedule_(make_exposure_schedule(settings_)) {}

std::shared_ptr<SharedSimulation> SharedSimulation::shared(
    const RecordConfig::SimulatedSource& source) {
  // Remembers what others keep alive; holds nothing itself.
  static std::mutex mutex;
  static std::map<std::string, std::weak_ptr<SharedSimulation>> stages;
  const std::string key = key_of(source);
  const auto find = [&] {
    const std::scoped_lock lock(mutex);
    return stages[key].lock();
  };
  if (auto stage = find(); stage) return stage;
  // Made outside the lock: Embree builds with tasks, and a thread that waits for tasks may take up
  // another one that comes here.
  auto made = std::make_shared<SharedSimulation>(source);
  const std::scoped_lock lock(mutex);
  std::weak_ptr<SharedSimulation>& known = stages[key];
  if (auto stage = known.lock(); stage) return stage;
  known = made;
  return made;
}

std::size_t SharedSimulation::memory() const {
  const auto pixels =
      static_cast<std::size_t>(source_.width) * static_cast<std::size_t>(source_.height);
  return kSceneBytes + render_threads() * (kCacheBytes + kRenderingBytesOfAPixel * pixels);
}

std::shared_ptr<const SimulatedLoop> SharedSimulation::loop(int index) {
  {
    const std::scoped_lock lock(mutex_);
    if (auto known = loops_[index].lock(); known) return known;
  }
  auto rendered = std::make_shared<const SimulatedLoop>(render(index));
  const std::scoped_lock lock(mutex_);
  loops_[index] = rendered;
  return rendered;
}

SimulatedLoop SharedSimulation::render(int index) const {
  const Rig::Camera& camera = rig_.cameras[static_cast<std::size_t>(index)];
  const ExposureSchedule::Camera& times = schedule_.cameras[static_cast<std::size_t>(index)];
  const PixelRays rays(camera.model, camera.pose);
  SimulatedLoop loop;
  loop.exposures.resize(times.frames.size());
  loop.length = std::llround(times.period_ns * static_cast<double>(times.frames.size()));
  const SensorModel developer(camera.photometric, {rays.width(), rays.height()}, settings_.noise);
  const std::size_t parts = render_threads();
  parallel_for(std::size_t{0}, parts, [&](std::size_t part) {
    const std::size_t count = loop.exposures.size();
    const std::size_t first = part * count / parts, last = (part + 1) * count / parts;
    if (first == last) return;
    World world(geometry_);
    CameraRenderer renderer;
    StaticSampleCache cache(kCacheBytes);
    LinearImage light;
    PixelConverter converter;
    for (std::size_t number = first; number < last; ++number) {
      const ExposureSchedule::Frame& frame = times.frames[number];
      const double seconds = static_cast<double>(frame.true_time) * 1e-9;
      world.set_time(
          std::abs(seconds <= source_.seconds ? seconds : 2 * source_.seconds - seconds));
      renderer.render(world, rays, settings_.edge_samples, cache, light);
      const RgbImage picture = developer.develop(
          light,
          hash_keys({settings_.seed, kNoiseSalt, static_cast<std::uint64_t>(index), number}));
      SimulatedLoop::Exposure& exposure = loop.exposures[number];
      exposure.true_time = frame.true_time;
      exposure.stamped_time = frame.stamped_time;
      if (source_.jpeg) {
        exposure.jpeg = encode_jpeg(picture, {.quality = kWebcamQuality,
                                              .chroma = JpegEncodeSettings::Chroma::k420,
                                              .restart_interval = 0});
      } else {
        exposure.raw = planes_of(picture, converter);
      }
    }
  });
  return loop;
}

}  // namespace raystage
