// SPDX-License-Identifier: Apache-2.0
#include "ingest/sources/shared_simulation.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <thread>

#include "base/options.h"
#include "base/parallel.h"
#include "ingest/sources/pixel_conversion.h"
#include "simulate/camera_renderer.h"
#include "simulate/hash_random.h"
#include "simulate/sensor_model.h"
#include "simulate/simulated_rig.h"
#include "store/jpeg/encode.h"

// Renders the frames of one simulated camera over one loop. Ray-traced linear light with edge
// samples at its exposure times goes through the sensor model and becomes a JPEG or YUV 4:2:0
// planes. The scene plays forwards for `seconds` and backwards for as long. Cost per camera: 2 *
// seconds * fps frames of width * height pixels, in parallel over chunks of frames.

namespace raystage::ingest {
namespace {

constexpr std::uint64_t kNoiseSalt = 22;
constexpr int kWebcamQuality = 90;
constexpr std::size_t kCacheBytes = 16 << 20;      // of each render thread, kept small
constexpr std::size_t kSceneBytes = 100 << 20;     // textures and Embree's hierarchies
constexpr std::size_t kRenderBytesPerPixel = 300;  // of each render thread

simulate::SimulationOptions settings_from(const schemas::RecordConfig::SimulatedSource& source) {
  simulate::SimulationOptions options;
  options.scene = source.scene;
  options.seed = source.seed;
  options.rows = source.rows;
  options.columns = source.columns;
  options.width = source.width;
  options.height = source.height;
  options.fps = source.fps;
  options.seconds = 2 * source.seconds;  // there and back
  options.jitter = std::min(options.jitter, 0.05 / source.fps);
  // Only the recorder drops frames.
  options.startup_loss_s = 0;
  options.drop_probability = 0;
  require_valid(options, "simulation");
  return options;
}

std::size_t render_threads() { return std::max(1U, std::thread::hardware_concurrency()); }

/// Returns a key of all settings of an array.
std::string key_of(const schemas::RecordConfig::SimulatedSource& s) {
  return fmt::format("{} {} {} {} {} {} {} {} {}", s.seed, s.rows, s.columns, s.width, s.height,
                     s.fps, s.seconds, s.jpeg, s.scene);
}

/// Returns YUV 4:2:0 planes, as a raw camera delivers them: half the bytes of RGB.
store::RawImage planes_of(const store::RgbImage& rgb, PixelConverter& converter) {
  const AvPtr<AVFrame> frame(check_allocation(av_frame_alloc()));
  frame->width = rgb.width;
  frame->height = rgb.height;
  frame->format = AV_PIX_FMT_RGB24;
  frame->data[0] = const_cast<std::uint8_t*>(rgb.values.data());
  frame->linesize[0] = 3 * rgb.width;
  store::RawImage image;
  converter.convert_to(store::PixelFormat::kYuv420, *frame, image);
  return image;
}

}  // namespace

SharedSimulation::SharedSimulation(const schemas::RecordConfig::SimulatedSource& source)
    : source_(source),
      options_(settings_from(source)),
      scene_(simulate::make_scene(options_.scene)),
      geometry_(scene_),
      rig_(rig::rig_from_document(simulate::make_simulated_rig(options_).truth)),
      schedule_(simulate::make_exposure_schedule(options_)) {}

std::shared_ptr<SharedSimulation> SharedSimulation::shared(
    const schemas::RecordConfig::SimulatedSource& source) {
  static std::mutex mutex;
  static std::map<std::string, std::weak_ptr<SharedSimulation>> simulations;  // owned by cameras
  const std::string key = key_of(source);
  const auto find = [&] {
    const std::scoped_lock lock(mutex);
    return simulations[key].lock();
  };
  if (auto existing = find(); existing) return existing;
  // Created outside the lock: Embree builds with TBB tasks, and a thread that waits for them may
  // run another task that calls this function.
  auto created = std::make_shared<SharedSimulation>(source);
  const std::scoped_lock lock(mutex);
  std::weak_ptr<SharedSimulation>& known = simulations[key];
  if (auto existing = known.lock(); existing) return existing;
  known = created;
  return created;
}

std::size_t SharedSimulation::memory() const {
  const auto pixels =
      static_cast<std::size_t>(source_.width) * static_cast<std::size_t>(source_.height);
  return kSceneBytes + render_threads() * (kCacheBytes + kRenderBytesPerPixel * pixels);
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
  const rig::Rig::Camera& camera = rig_.cameras[index];
  const simulate::ExposureSchedule::Camera& times = schedule_.cameras[index];
  const simulate::PixelRays rays(camera.model, camera.pose);
  SimulatedLoop loop;
  loop.exposures.resize(times.frames.size());
  loop.length = std::llround(times.period_ns * static_cast<double>(times.frames.size()));
  const simulate::SensorModel developer(camera.photometric, {rays.width(), rays.height()},
                                        options_.noise);
  const std::size_t chunks = render_threads();
  parallel_for(std::size_t{0}, chunks, [&](std::size_t chunk) {
    const std::size_t count = loop.exposures.size();
    const std::size_t first = chunk * count / chunks, last = (chunk + 1) * count / chunks;
    if (first == last) return;
    simulate::World world(geometry_);
    simulate::CameraRenderer renderer;
    simulate::StaticSampleCache cache(kCacheBytes);
    simulate::LinearImage light;
    PixelConverter converter;
    for (std::size_t number = first; number < last; ++number) {
      const simulate::ExposureSchedule::Frame& frame = times.frames[number];
      const double seconds = static_cast<double>(frame.true_time) * 1e-9;
      world.set_time(
          std::abs(seconds <= source_.seconds ? seconds : 2 * source_.seconds - seconds));
      renderer.render(world, rays, options_.edge_samples, cache, light);
      const store::RgbImage picture = developer.develop(
          light, simulate::hash_keys(
                     {options_.seed, kNoiseSalt, static_cast<std::uint64_t>(index), number}));
      SimulatedLoop::Exposure& exposure = loop.exposures[number];
      exposure.true_time = frame.true_time;
      exposure.stamped_time = frame.stamped_time;
      if (source_.jpeg) {
        exposure.jpeg =
            store::encode_jpeg(picture, {.quality = kWebcamQuality,
                                         .chroma = store::JpegEncodeOptions::Chroma::k420,
                                         .restart_interval = 0});
      } else {
        exposure.raw = planes_of(picture, converter);
      }
    }
  });
  return loop;
}

}  // namespace raystage::ingest
