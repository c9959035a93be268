// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "rig/camera_model.h"
#include "rig/pose.h"
#include "simulate/radiance_sampler.h"

namespace raystage {

/// The rays of a camera's pixels, worked out once.
class PixelRays {
 public:
  explicit PixelRays(const CameraModel& model, const Pose& pose);

  int width() const { return width_; }
  int height() const { return height_; }
  /// Whether the lens sees anything at this pixel (see CameraModel's fold).
  bool has_ray(int column, int row) const;
  /// Ray through a place in the pixel, each coordinate in [0, 1), 0.5 the middle. World.
  Ray ray(int column, int row, float x, float y) const;
  /// Width of a pixel at 1 m, metres.
  float footprint() const { return footprint_; }
  /// Metres in front of the camera per metre along the ray.
  float depth_per_distance(const Ray& ray) const { return forward_.dot(ray.direction); }

 private:
  const Eigen::Vector2f& ideal(int column, int row) const {
    return ideal_[static_cast<std::size_t>(row + 1) * static_cast<std::size_t>(width_ + 2) +
                  static_cast<std::size_t>(column + 1)];
  }

  int width_, height_;
  float footprint_;
  Eigen::Matrix3f world_from_camera_;
  Eigen::Vector3f position_, forward_;
  std::vector<Eigen::Vector2f> ideal_;  ///< of pixel centres, with a border of one; NaN: none
};

/// A picture in linear light, full scale 1, and what its pixel centres see.
struct LinearImage {
  int width = 0, height = 0;
  std::vector<Eigen::Vector3f> light;
  std::vector<LightSample> centre;
};

/// What one camera sees of the still parts, kept from frame to frame. Changes no picture, only how
/// long it takes.
class StaticSampleCache {
 public:
  /// `max_bytes`: of what is kept beyond one sample a pixel.
  explicit StaticSampleCache(std::size_t max_bytes = std::size_t{256} << 20U)
      : most_bytes_(max_bytes) {}

 private:
  friend class CameraRenderer;
  std::size_t most_bytes_;
  std::vector<Ray> rays_;              ///< through the pixel centres, tile by tile
  std::vector<StaticSample> centres_;  ///< of those
  /// Per pixel: light over several samples where nothing moves in sight; NaN: not known yet.
  std::vector<Eigen::Vector3f> supersampled_;
  std::vector<std::int32_t> block_of_;  ///< per pixel: its samples in blocks_, -1: none yet
  std::vector<StaticSample> blocks_;    ///< several samples per pixel
};

/// Renders pictures. Keeps scratch memory: one per thread.
class CameraRenderer {
 public:
  /// `edge_samples` (a square number) where neighbouring pixels see different surfaces or shadows,
  /// one sample elsewhere: textures are filtered anyway. Moving parts are found by the pixel
  /// centres. `cache`: of these rays and this number, empty at first.
  void render(const World& world, const PixelRays& rays, int edge_samples, StaticSampleCache& cache,
              LinearImage& image);
  /// `samples` (a square number) everywhere.
  void render_supersampled(const World& world, const PixelRays& rays, int samples,
                           LinearImage& image);

 private:
  struct Pixel {
    int column, row;
    std::size_t index;  ///< in the image
  };
  /// Fills `image` with one sample a pixel and is_dynamic_ with whether something that moves is
  /// seen or shades it.
  void render_centres(const World& world, const PixelRays& rays, StaticSampleCache& cache,
                      LinearImage& image);
  void find_edges(const LinearImage& image, const PixelRays& rays);
  void make_batch(const PixelRays& rays, std::span<const Pixel> group, int samples);
  /// `cache` may be null.
  void supersample(const World& world, const PixelRays& rays, std::span<const Pixel> pixels,
                   int samples, StaticSampleCache* cache, LinearImage& image);
  void supersample_static(const World& world, const PixelRays& rays, std::span<const Pixel> pixels,
                          int samples, StaticSampleCache& cache);
  void find_static(const World& world, std::span<const Pixel> group, float footprint,
                   StaticSampleCache* cache);

  RadianceSampler radiance_;
  std::vector<Ray> batch_, missing_rays_;
  std::vector<const StaticSample*> static_;
  std::vector<StaticSample> found_;
  std::vector<LightSample> samples_;
  std::vector<Pixel> pixels_, static_pixels_;
  std::vector<std::uint8_t> is_dynamic_, edge_;
  std::vector<std::size_t> missing_;
};

}  // namespace raystage
