// SPDX-License-Identifier: Apache-2.0
// Simulates a take: makes the scene, the array and its exposure times, renders each frame
// (camera_renderer.h), applies the sensor model and encodes. Also writes the truth and ground-truth
// views. Cost: cameras times frames times pixels, in parallel.
#include "simulate/simulate.h"

#include <fmt/format.h>
#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <cmath>
#include <mutex>
#include <numeric>
#include <vector>

#include "base/atomic_file.h"
#include "base/error.h"
#include "base/half_float.h"
#include "base/options.h"
#include "base/parallel.h"
#include "images/image_file.h"
#include "rig/rig.h"
#include "simulate/camera_renderer.h"
#include "simulate/exposure_schedule.h"
#include "simulate/hash_random.h"
#include "simulate/sensor_model.h"
#include "simulate/simulated_rig.h"
#include "simulate/simulated_shot.h"
#include "simulate/truth_document.h"
#include "store/jpeg/encode.h"
#include "store/jpegxl/picture_codec.h"
#include "store/take.h"

namespace raystage::simulate {
namespace {

constexpr std::uint64_t kNoiseSalt = 21;
// 2026-01-01T00:00:00Z. A constant, as the same settings must give the same bytes.
constexpr Nanoseconds kEpoch = 1'767'225'600 * kNanosecondsPerSecond;

Scene scene_of(const SimulationOptions& options) {
  Scene scene = make_scene(options.scene);
  if (!options.hdr) return scene;
  scene.max_light = kLargestHalf;
  for (ScenePart& part : scene.parts) {
    if (part.material.is_lamp) part.material.emission *= SimulationOptions::kHighlights;
  }
  return scene;
}

double seconds_of(Nanoseconds time) { return static_cast<double>(time) * 1e-9; }

// The state of one rendering thread.
struct Worker {
  explicit Worker(const SceneGeometry& geometry) : world(geometry) {}
  World world;
  CameraRenderer renderer;
  LinearImage image;
};

class Simulation {
 public:
  Simulation(const SimulationOptions& options, const std::function<void(double)>& progress,
             std::stop_token stop)
      : options_(options),
        progress_(progress),
        stop_(std::move(stop)),
        scene_(scene_of(options)),
        geometry_(scene_),
        workers_([this] { return Worker(geometry_); }),
        array_(make_simulated_rig(options)),
        schedule_(make_exposure_schedule(options)),
        path_(make_simulated_shot(options, schedule_, scene_.focus)),
        true_rig_(rig::rig_from_document(array_.truth)) {
    for (const auto& [x, y, z, radius] : options.truth_spheres) {
      spheres_.push_back({Eigen::Vector3d(x, y, z).cast<float>(), static_cast<float>(radius)});
    }
    // Costs are in frames: a truth image takes about as long as half its samples in frames.
    const auto times =
        path_.exposures.empty() ? 1.0 : static_cast<double>(path_.exposures[0].size());
    truth_cost_ = times * std::max(1.0, options.truth_samples / 2.0) * options.view_width() *
                  options.view_height() / options.width / options.height;
    total_cost_ = options.truth_views * truth_cost_ +
                  static_cast<double>(options.camera_count()) * options.frames_per_camera();
  }

  SimulationReport run(const std::filesystem::path& folder, const std::string& created_by) {
    require_frames();
    // Before rendering, so that an unwritable folder is reported at once.
    store::TakeWriter writer(folder, take_document(created_by),
                             options_.nominal_calibration ? array_.nominal : array_.truth);
    SimulationReport report;
    report.cameras = options_.camera_count();
    report.truth_views = options_.truth_views;
    raystage::parallel_for(0, options_.camera_count(), [&](int index, const ParallelLoop& loop) {
      record(writer, index, loop);
    });
    for (const ExposureSchedule::Camera& camera : schedule_.cameras) {
      for (const ExposureSchedule::Frame& frame : camera.frames) {
        (frame.status == store::FrameStatus::kStored ? report.frames_stored
                                                     : report.frames_missing)++;
      }
    }
    if (options_.truth_views > 0) {
      write_truth_images(writer.working_folder());
      schemas::write_views(path_.views, writer.working_folder() / "views.json");
    }
    schemas::write_shot(path_.shot, writer.working_folder() / "shot.json");
    write_file_atomically(writer.working_folder() / "truth.json",
                          format_truth_document(options_, array_, schedule_));
    writer.commit();
    report.status = RunStatus::kFinished;
    return report;
  }

 private:
  // Throws if the take would have no frame.
  void require_frames() const {
    for (const ExposureSchedule::Camera& camera : schedule_.cameras) {
      for (const ExposureSchedule::Frame& frame : camera.frames) {
        if (frame.status == store::FrameStatus::kStored) return;
      }
    }
    throw Error::bad_input(
        fmt::format("the take would have no frame: the frames of the first {:g} s are lost at "
                    "start-up, and the take has {:g} s",
                    options_.startup_loss_s, options_.seconds),
        options_.scene, "Make the take longer, or the loss at start-up shorter");
  }

  // Throws if a stop is requested or another camera has failed.
  void check_stop(const ParallelLoop& loop) const {
    if (stop_.stop_requested() || loop.failed()) {
      throw Error::failed("the simulation was stopped", options_.scene,
                          "Start it again to write the take");
    }
  }

  void advance(double cost) {
    if (!progress_) return;
    const std::scoped_lock lock(progress_mutex_);
    done_cost_ += cost;
    progress_(std::min(1.0, done_cost_ / total_cost_));
  }

  schemas::TakeDocument take_document(const std::string& created_by) {
    schemas::TakeDocument take;
    take.name = "simulated " + scene_.name;
    take.created_by = created_by;
    take.epoch_utc = kEpoch;
    take.nominal_fps = options_.fps;
    take.color_space = "srgb_texture";
    take.clock = "simulated";
    take.timestamp_event = "exposure_middle";
    take.depth_range = visible_depths();
    for (std::size_t i = 0; i < array_.truth.cameras.size(); ++i) {
      schemas::TakeDocument::Camera camera;
      camera.id = array_.truth.cameras[i].geometry.id;
      camera.node = "node" + std::to_string(schedule_.cameras[i].node);
      if (options_.records_half) camera.pixels.emplace();  // the peak is known later
      take.cameras.push_back(std::move(camera));
    }
    return take;
  }

  // Returns the depths of the nearest and farthest surface that the cameras (the corner and central
  // ones of a grid) see
  // during the take, rounded outwards to a centimetre.
  std::optional<schemas::DepthRange> visible_depths() {
    std::vector<int> cameras(static_cast<std::size_t>(options_.camera_count()));
    std::iota(cameras.begin(), cameras.end(), 0);
    if (!options_.given_rig) {
      const int last_row = options_.rows - 1, last_column = options_.columns - 1;
      cameras = {0, last_column, last_row * options_.columns, options_.camera_count() - 1,
                 options_.camera_count() / 2};
    }
    constexpr int kInstants = 12;
    constexpr int kStride = 2;
    const Eigen::Vector3f centre = true_rig_.centre().cast<float>();
    const Eigen::Vector3f forward = true_rig_.mean_viewing_direction().cast<float>();
    const bool looks_around = true_rig_.looks_around();
    std::mutex mutex;
    float nearest = std::numeric_limits<float>::infinity(), farthest = 0;
    const auto trace_camera = [&](std::size_t index, const ParallelLoop& loop) {
      const rig::Rig::Camera& camera = true_rig_.cameras[cameras[index]];
      const PixelRays pixels(camera.model, camera.pose);
      Worker& worker = workers_.local();
      std::vector<Ray> rays;
      for (int row = 0; row < pixels.height(); row += kStride) {
        for (int column = 0; column < pixels.width(); column += kStride) {
          if (pixels.has_ray(column, row)) rays.push_back(pixels.ray(column, row, 0.5F, 0.5F));
        }
      }
      std::vector<Hit> hits(rays.size()), moving_hits(rays.size());
      worker.world.trace_static(rays, hits);
      std::vector<float> limits;
      for (const Hit& hit : hits) limits.push_back(hit.distance);
      for (int instant = 0; instant < kInstants; ++instant) {
        check_stop(loop);
        worker.world.set_time(options_.seconds * instant / (kInstants - 1));
        worker.world.trace_moving(rays, limits, moving_hits);
        const std::scoped_lock lock(mutex);
        for (std::size_t i = 0; i < rays.size(); ++i) {
          const float distance = std::min(hits[i].distance, moving_hits[i].distance);
          if (!std::isfinite(distance)) continue;
          const Eigen::Vector3f point = rays[i].origin + rays[i].direction * distance - centre;
          const float depth = looks_around ? point.norm() : forward.dot(point);
          nearest = std::min(nearest, depth);
          farthest = std::max(farthest, depth);
        }
      }
    };
    raystage::parallel_for(std::size_t{0}, cameras.size(), trace_camera);
    if (!(nearest > 0 && farthest >= nearest)) return std::nullopt;
    return schemas::DepthRange{std::max(0.01, std::floor(static_cast<double>(nearest) * 100) / 100),
                               std::ceil(static_cast<double>(farthest) * 100) / 100};
  }

  // Writes all frames of one camera in temporal order.
  void record(store::TakeWriter& writer, int index, const ParallelLoop& loop) {
    const rig::Rig::Camera& camera = true_rig_.cameras[index];
    const ExposureSchedule::Camera& times = schedule_.cameras[index];
    const PixelRays rays(camera.model, camera.pose);
    const SensorModel developer(camera.photometric, {rays.width(), rays.height()}, options_.noise);
    store::ArchiveWriter& archive = writer.archive(index);
    Worker& worker = workers_.local();
    StaticSampleCache cache;
    int stored = 0;
    double peak = 0;
    for (std::size_t number = 0; number < times.frames.size(); ++number) {
      const ExposureSchedule::Frame& frame = times.frames[number];
      if (frame.status != store::FrameStatus::kStored) {
        archive.append_missing(frame.status, frame.stamped_time);
      } else {
        check_stop(loop);
        const Exposure exposure{seconds_of(frame.true_time), camera.line_time_us * 1e-6};
        worker.renderer.render(worker.world, exposure, rays, options_.edge_samples, cache,
                               worker.image);
        const std::uint64_t seed =
            hash_keys({options_.seed, kNoiseSalt, static_cast<std::uint64_t>(index), number});
        if (options_.records_half) {
          append_half(developer.develop_half(worker.image, seed), frame.stamped_time, archive,
                      peak);
        } else {
          archive.append(store::encode_jpeg(developer.develop(worker.image, seed), options_.jpeg),
                         frame.stamped_time);
        }
        ++stored;
        if (options_.camera_depths) {
          write_camera_depths(worker.image, rays, writer.working_folder(), camera.id, stored);
        }
      }
      advance(1);
    }
    archive.close();
    constexpr double kLeastPeak = 1e-3;  // of black frames
    if (options_.records_half) writer.set_peak(index, std::max(peak, kLeastPeak));
  }

  /// Appends a frame of half floats and raises the camera's brightest light.
  void append_half(const store::DeepPicture& picture, Nanoseconds time,
                   store::ArchiveWriter& archive, double& peak) const {
    for (const std::uint16_t sample : picture.samples) {
      peak = std::max(peak, static_cast<double>(float_from_half(sample)));
    }
    archive.append(codec_.encode(picture, {}, {}, "simulated frame"), time);
  }

  /// Returns four values for each pixel: the planar depth of what its centre sees, infinite where
  /// that is nothing, and 0 for a mirror, which shows things at other depths than its own; then the
  /// share of its surface in front, and the planar depths of that and of what is behind it.
  static std::vector<float> planar_depths(const LinearImage& image, const PixelRays& rays) {
    std::vector<float> values;
    values.reserve(4 * image.centre.size());
    for (std::size_t i = 0; i < image.centre.size(); ++i) {
      const auto width = static_cast<std::size_t>(image.width);
      const float forward =
          rays.forward_share(static_cast<int>(i % width), static_cast<int>(i / width));
      const LightSample& seen = image.centre[i];
      const PixelSurfaces& surfaces = image.surfaces[i];
      values.push_back(seen.reflected_part >= 0 ? 0 : seen.distance * forward);
      values.push_back(surfaces.front_share);
      values.push_back(surfaces.front_distance * forward);
      values.push_back(surfaces.behind_distance * forward);
    }
    return values;
  }

  /// Writes the depths at the pixel centres of a camera's frame; `number`: of its stored frames.
  static void write_camera_depths(const LinearImage& image, const PixelRays& rays,
                                  const std::filesystem::path& folder, const std::string& id,
                                  int number) {
    std::vector<float> z;
    z.reserve(image.centre.size());
    for (std::size_t i = 0; i < image.centre.size(); ++i) {
      const auto width = static_cast<std::size_t>(image.width);
      const auto column = static_cast<int>(i % width), row = static_cast<int>(i / width);
      const LightSample& seen = image.centre[i];
      const bool is_known = seen.reflected_part < 0 && rays.has_ray(column, row);
      // Fisheyes see what has no planar depth.
      const float depth = is_known ? seen.distance * rays.forward_share(column, row) : 0;
      z.push_back(depth > 0 ? depth : 0);
    }
    const std::filesystem::path of_camera = folder / "truth" / "depths" / id;
    create_folder(of_camera);
    images::write_depth_image(image.width, image.height, z,
                              of_camera / fmt::format("{:06}.exr", number));
  }

  /// Replaces the light of the worker's image by its mean over an exposure.
  void expose(std::span<const schemas::ViewsDocument::View> exposure, Worker& worker,
              const ParallelLoop& loop) const {
    std::vector<Eigen::Vector3f> sum(worker.image.light.size(), Eigen::Vector3f::Zero());
    std::vector<float> share(worker.image.sphere_share.size(), 0.0F);
    for (const schemas::ViewsDocument::View& at : exposure) {
      check_stop(loop);
      const PixelRays rays(rig::CameraModel(at.geometry),
                           rig::pose_from_matrix(at.geometry.world_from_camera));
      worker.world.set_time(seconds_of(at.time_ns));
      worker.renderer.render_supersampled(worker.world, rays, options_.truth_samples, worker.image,
                                          spheres_);
      for (std::size_t i = 0; i < share.size(); ++i) share[i] += worker.image.sphere_share[i];
      for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += worker.image.light[i];
    }
    for (std::size_t i = 0; i < sum.size(); ++i) {
      worker.image.light[i] = sum[i] / static_cast<float>(exposure.size());
    }
    for (std::size_t i = 0; i < share.size(); ++i) {
      worker.image.sphere_share[i] = share[i] / static_cast<float>(exposure.size());
    }
  }

  void write_truth_images(const std::filesystem::path& folder) {
    create_folder(folder / "truth");
    const auto render = [&](std::size_t index, const ParallelLoop& loop) {
      check_stop(loop);
      const schemas::ViewsDocument::View& view = path_.views.views[index];
      const PixelRays rays(rig::CameraModel(view.geometry),
                           rig::pose_from_matrix(view.geometry.world_from_camera));
      Worker& worker = workers_.local();
      worker.world.set_time(seconds_of(view.time_ns));
      worker.renderer.render_supersampled(worker.world, rays, options_.truth_samples, worker.image,
                                          spheres_);
      images::write_channels(worker.image.width, worker.image.height,
                             {"Z", "front.A", "front.Z", "behind.Z"},
                             planar_depths(worker.image, rays), folder / view.depth_file);
      if (path_.exposures[index].size() > 1) expose(path_.exposures[index], worker, loop);
      images::write_image(develop(worker.image), folder / view.file);
      if (!view.light_file.empty()) {
        std::vector<float> light;
        for (const Eigen::Vector3f& rgb : worker.image.light) {
          light.insert(light.end(), rgb.begin(), rgb.end());
        }
        images::write_channels(worker.image.width, worker.image.height, {"R", "G", "B"}, light,
                               folder / view.light_file);
      }
      if (!spheres_.empty()) {
        images::write_depth_image(worker.image.width, worker.image.height,
                                  worker.image.sphere_share,
                                  folder / ("truth/" + view.geometry.id + ".sphere.exr"));
      }
      advance(truth_cost_);
    };
    raystage::parallel_for(std::size_t{0}, path_.views.views.size(), render);
  }

  const SimulationOptions& options_;
  const std::function<void(double)>& progress_;
  std::stop_token stop_;
  Scene scene_;
  SceneGeometry geometry_;
  // Nothing that uses a worker waits for tasks of another camera: see commit() in world.cpp.
  tbb::enumerable_thread_specific<Worker> workers_;
  SimulatedRig array_;
  ExposureSchedule schedule_;
  SimulatedShot path_;
  rig::Rig true_rig_;
  const store::PictureCodec codec_;
  std::vector<UnlitSphere> spheres_;
  double truth_cost_ = 0, total_cost_ = 0, done_cost_ = 0;
  std::mutex progress_mutex_;
};

}  // namespace

SimulationReport simulate(const SimulationOptions& options, const std::filesystem::path& folder,
                          const std::string& created_by,
                          const std::function<void(double)>& progress, std::stop_token stop) {
  require_valid(options, "simulation");
  return Simulation(options, progress, std::move(stop)).run(folder, created_by);
}

}  // namespace raystage::simulate
