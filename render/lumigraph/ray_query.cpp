// SPDX-License-Identifier: Apache-2.0
// Looks up arbitrary rays in a light field by the unstructured lumigraph (Buehler et al. 2001;
// thesis eq. 2.3), in chunks of 64 rays shared by threads (ray_chunk_kernels.cpp). Input: rays in
// the world, a surface; output: RaySample. Frames are decoded whole on first use. Cost: O(rays x
// cameras). Also contains the reference, ray by ray in double.
#include "render/lumigraph/ray_query.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <mutex>

#include "base/parallel.h"
#include "render/lumigraph/blend_reference.h"
#include "render/lumigraph/ray_chunk.h"

namespace raystage::render {
namespace {

/// Normalises the direction; returns false for an invalid ray.
bool normalise(WorldRay& ray) {
  const double length = ray.direction.stableNorm();
  if (!(length > 0) || !std::isfinite(length) || !ray.origin.allFinite()) return false;
  ray.direction /= length;
  return true;
}

class FramesOnDemand {
 public:
  explicit FramesOnDemand(const LightFieldFrame& instant)
      : instant_(instant), pixels_(instant.rig->cameras.size()) {}

  const std::uint16_t* pixels(int camera) {
    auto& known = pixels_[camera];
    if (const std::uint16_t* there = known.load(std::memory_order_acquire)) return there;
    // Threads that fetch the same frame concurrently get the same one.
    std::int64_t decoded = 0;
    auto frame = instant_.cache->fetch(camera, instant_.frame_of_camera[camera], {}, decoded);
    const std::uint16_t* pixels = frame->rgba.get();
    const std::scoped_lock lock(mutex_);
    held_.push_back(std::move(frame));
    known.store(pixels, std::memory_order_release);
    return pixels;
  }

 private:
  const LightFieldFrame& instant_;
  std::vector<std::atomic<const std::uint16_t*>> pixels_;
  std::mutex mutex_;  // of held_
  std::vector<std::shared_ptr<const store::DecodedFrame>> held_;
};

/// Weights of a chunk's rays for some cameras, by one thread; frames are fetched on demand.
class Weigher {
 public:
  Weigher(const std::vector<ChunkCamera>& all, const std::vector<int>& cameras)
      : weights_(cameras.size()) {
    for (const int camera : cameras) own_.push_back(all[camera]);
    for (const ChunkCamera& camera : own_) cameras_.push_back(&camera);
  }
  Weigher(const Weigher&) = delete;
  Weigher& operator=(const Weigher&) = delete;
  void set_frame(std::size_t camera, const std::uint16_t* rgba) { own_[camera].lens.rgba = rgba; }
  void weigh(const RayChunk& chunk, const ChunkWeightOptions& weighing) {
    compute_camera_weights(chunk, cameras_, weighing, weights_);
  }
  const std::vector<const ChunkCamera*>& cameras() const { return cameras_; }
  const std::vector<ChunkWeights>& weights() const { return weights_; }

 private:
  std::vector<ChunkCamera> own_;
  std::vector<const ChunkCamera*> cameras_;
  std::vector<ChunkWeights> weights_;
};

class Answers {
 public:
  Answers(const LightFieldFrame& instant, const RaySurface& surface,
          const std::vector<ChunkCamera>& cameras, const std::vector<int>& present,
          const ChunkWeightOptions& weighing, FramesOnDemand& frames)
      : instant_(instant),
        surface_(surface),
        middle_(instant.rig->centre()),
        weighing_(weighing),
        frames_(frames),
        present_(cameras, present),
        complete_(cameras, instant.included_cameras) {}

  void answer(std::span<const WorldRay> rays, std::span<RaySample> samples) {
    rays_.assign(rays.begin(), rays.end());
    inverse_distance_.resize(rays.size());
    std::vector<bool> is_ray(rays.size());
    for (std::size_t i = 0; i < rays.size(); ++i) {
      is_ray[i] = normalise(rays_[i]);
      if (!is_ray[i]) rays_[i] = {};
    }
    surface_(rays_, inverse_distance_);
    for (std::size_t i = 0; i < rays.size(); ++i) {
      if (!is_ray[i]) inverse_distance_[i] = std::numeric_limits<double>::quiet_NaN();
    }
    fill_chunk(rays_, inverse_distance_, middle_, chunk_);
    present_.weigh(chunk_, weighing_);
    blend(samples);
    if (present_.cameras().size() != complete_.cameras().size()) lower_coverage(samples);
  }

 private:
  void blend(std::span<RaySample> samples) {
    alignas(64) std::array<float, 4 * RayChunk::kSize> rgba{};
    alignas(64) std::array<float, RayChunk::kSize> effective{}, nearest{};
    for (std::size_t c = 0; c < present_.cameras().size(); ++c) {
      if (!has_weight(present_.weights()[c], chunk_.count)) continue;
      present_.set_frame(c, frames_.pixels(present_.cameras()[c]->camera));
    }
    blend_chunk(present_.cameras(), present_.weights(), chunk_.count, instant_.cache->blend_space(),
                static_cast<float>(instant_.cache->full_scale()), rgba.data());
    measure_effective_cameras(chunk_, present_.cameras(), present_.weights(), effective.data(),
                              nearest.data());
    for (std::size_t i = 0; i < samples.size(); ++i) {
      RaySample& sample = samples[i];
      sample = {};
      std::copy_n(&rgba[4 * i], 4, sample.rgba.begin());
      sample.coverage = sample.rgba[3];
      if (!(sample.coverage > 0)) continue;
      sample.depth = static_cast<float>(1 / inverse_distance_[i]);
      sample.cameras = effective[i];
      sample.nearest_ray = nearest[i];
    }
  }

  void lower_coverage(std::span<RaySample> samples) {
    complete_.weigh(chunk_, weighing_);
    for (std::size_t i = 0; i < samples.size(); ++i) {
      float total = 0, absent = 0;
      for (std::size_t c = 0; c < complete_.cameras().size(); ++c) {
        const float weight = complete_.weights()[c].weight[i];
        total += weight;
        if (!instant_.is_present(complete_.cameras()[c]->camera)) absent += weight;
      }
      if (total > 0) samples[i].coverage *= 1 - absent / total;
    }
  }

  const LightFieldFrame& instant_;
  const RaySurface& surface_;
  Eigen::Vector3d middle_;
  const ChunkWeightOptions& weighing_;
  FramesOnDemand& frames_;
  Weigher present_, complete_;
  std::vector<WorldRay> rays_;
  std::vector<double> inverse_distance_;
  RayChunk chunk_;
};

}  // namespace

void query_rays(std::span<const WorldRay> rays, const LightFieldFrame& instant,
                const RaySurface& surface, const RayWeightOptions& weighing,
                std::span<RaySample> samples) {
  const std::vector<ChunkCamera> cameras = chunk_cameras(*instant.rig);
  const std::vector<int> present = instant.present_cameras();
  const ChunkWeightOptions chunk_weighing(weighing, mean_nearest_baseline(*instant.rig));
  FramesOnDemand frames(instant);
  constexpr std::size_t kChunk = RayChunk::kSize, kPerTask = 32 * kChunk;
  const std::size_t tasks = (rays.size() + kPerTask - 1) / kPerTask;
  raystage::parallel_for(std::size_t{0}, tasks, [&](std::size_t task) {
    Answers answers(instant, surface, cameras, present, chunk_weighing, frames);
    const std::size_t end = std::min(rays.size(), (task + 1) * kPerTask);
    for (std::size_t begin = task * kPerTask; begin < end; begin += kChunk) {
      const std::size_t n = std::min(kChunk, end - begin);
      answers.answer(rays.subspan(begin, n), samples.subspan(begin, n));
    }
  });
}

void query_rays_reference(std::span<const WorldRay> rays, const LightFieldFrame& instant,
                          const RaySurface& surface, const RayWeightOptions& weighing,
                          std::span<RaySample> samples) {
  RenderStatistics unused;
  ReferenceFrames frames(instant, false, unused);
  const double spacing = mean_nearest_baseline(*instant.rig);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    RaySample& sample = samples[i];
    sample = {};
    WorldRay ray = rays[i];
    if (!normalise(ray)) continue;
    double inverse = 0;
    surface({&ray, 1}, {&inverse, 1});
    if (!(inverse >= 0)) continue;
    const auto cameras = compute_camera_weights_reference(*instant.rig, frames.present(), ray,
                                                          inverse, weighing, spacing);
    sample.rgba = blend_reference(frames, cameras, *instant.cache);
    sample.coverage = sample.rgba[3];
    if (!(sample.coverage > 0)) continue;
    sample.depth = static_cast<float>(1 / inverse);
    sample.cameras = static_cast<float>(effective_cameras(cameras));
    sample.nearest_ray = static_cast<float>(nearest_ray(cameras));
    if (frames.present().size() == instant.included_cameras.size()) continue;
    for (const WeightedCamera& camera : compute_camera_weights_reference(
             *instant.rig, instant.included_cameras, ray, inverse, weighing, spacing)) {
      if (instant.is_present(camera.camera)) continue;
      sample.coverage -= static_cast<float>(camera.weight) * sample.rgba[3];
    }
  }
}

}  // namespace raystage::render
