// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "rig/row_times.h"
#include "simulate/pixel_rays.h"
#include "simulate/radiance_sampler.h"

namespace raystage::simulate {

/// A ball of one colour that neither receives light nor casts shadows, for composites: a renderer
/// of geometry shows the same.
struct UnlitSphere {
  Eigen::Vector3f centre;                                        ///< world, metres
  float radius = 0;                                              ///< metres
  Eigen::Vector3f colour = Eigen::Vector3f(0.75F, 0.15F, 0.6F);  ///< linear light

  /// Returns the distance along a ray to its front; infinite: the ray misses it.
  float distance(const Ray& ray) const;
};

/// The surfaces that the samples of a pixel see, in two groups: those in front of the largest gap
/// of their inverse distances, and those behind it.
struct PixelSurfaces {
  float front_share = 1;  ///< of the samples; 0: unknown, as a mirror shows other distances
  float front_distance = 0, behind_distance = 0;  ///< along the rays, metres; means of the inverse
};

/// An image in linear light (full scale 1), and the sample at each pixel centre; row by row.
struct LinearImage {
  int width = 0, height = 0;
  std::vector<Eigen::Vector3f> light;
  std::vector<LightSample> centre;
  /// Share of each pixel's samples that shows a sphere; empty: there is none.
  std::vector<float> sphere_share = {};
  /// Of each pixel, without spheres; empty unless all pixels are supersampled.
  std::vector<PixelSurfaces> surfaces = {};
};

/// When the rows of a picture are exposed.
struct Exposure {
  double seconds = 0;       ///< of the middle of the picture, since the take's epoch
  double line_seconds = 0;  ///< from a row to the row below; 0: all rows at once

  bool is_global() const { return line_seconds == 0; }
  double seconds_of_row(int row, int height) const {
    return seconds + rig::row_time(line_seconds, height, row + 0.5);
  }
};

/// Keeps a camera's samples of static parts between frames. Saves time and changes no image.
class StaticSampleCache {
 public:
  /// `max_bytes` limits the samples that are kept in addition to one per pixel.
  explicit StaticSampleCache(std::size_t max_bytes = std::size_t{256} << 20U)
      : max_bytes_(max_bytes) {}

 private:
  friend class CameraRenderer;
  std::size_t max_bytes_;
  std::vector<Ray> rays_;              ///< through the pixel centres, in the order of tiles
  std::vector<StaticSample> centres_;  ///< of rays_
  /// Per pixel: mean light of its samples if they see no moving part; NaN: not computed yet.
  std::vector<Eigen::Vector3f> supersampled_;
  std::vector<std::int32_t> block_of_;  ///< per pixel: index of its samples in blocks_; -1: none
  std::vector<StaticSample> blocks_;    ///< `edge_samples` per block
};

/// Renders images of a world. Has scratch memory: use one object per thread.
class CameraRenderer {
 public:
  /// Takes `edge_samples` (a square number) samples in pixels whose neighbours see different
  /// surfaces or shadows, and one elsewhere, as textures are filtered. Detects moving parts at the
  /// pixel centres. `cache` belongs to these rays and this number of samples; it is empty at first.
  /// Shows the world's present time.
  void render(const World& world, const PixelRays& rays, int edge_samples, StaticSampleCache& cache,
              LinearImage& image);
  /// Renders each row at its own time, exactly; the world has an undefined time afterwards. `cache`
  /// belongs also to whether the shutter is global.
  void render(World& world, const Exposure& exposure, const PixelRays& rays, int edge_samples,
              StaticSampleCache& cache, LinearImage& image);
  /// Takes `samples` (a square number) samples in every pixel. `spheres`: added to the world,
  /// except to `LinearImage::centre` and `surfaces`.
  void render_supersampled(const World& world, const PixelRays& rays, int samples,
                           LinearImage& image, std::span<const UnlitSphere> spheres = {});

 private:
  struct Pixel {
    int column, row;
    std::size_t index;  ///< in the image
  };
  /// Takes one sample per pixel. Sets is_dynamic_ where a moving part or its shadow is seen.
  void render_centres(const World& world, const PixelRays& rays, StaticSampleCache& cache,
                      LinearImage& image);
  /// As render_centres(), with each row at its own time.
  void render_rows(World& world, const Exposure& exposure, const PixelRays& rays,
                   StaticSampleCache& cache, LinearImage& image);
  /// Prepares an image and `is_dynamic_` for samples at the pixels' centres.
  void begin_centres(const PixelRays& rays, LinearImage& image);
  /// Samples the centres of `pixels_`; their rays in the cache begin at `start`, with the number of
  /// those before them. Returns the end of their rays.
  std::size_t sample_centres(const World& world, const PixelRays& rays, std::size_t start,
                             StaticSampleCache& cache, LinearImage& image);
  /// Adds a pixel to `pixels_`, unless it has no ray.
  void add_pixel(const PixelRays& rays, int column, int row);
  /// Supersamples edges that do not move, and finds those that do: pixels_.
  void supersample_edges(const World& world, const PixelRays& rays, int edge_samples,
                         StaticSampleCache& cache, LinearImage& image);
  void find_edges(const LinearImage& image, const PixelRays& rays);
  void make_batch(const PixelRays& rays, std::span<const Pixel> group, int samples);
  /// Takes `samples` samples in each of `pixels`. `cache` may be null.
  void supersample(const World& world, const PixelRays& rays, std::span<const Pixel> pixels,
                   int samples, StaticSampleCache* cache, LinearImage& image);
  /// Shows spheres that are in front of the samples of a pixel; returns the share of these samples.
  float add_spheres(std::size_t first, std::size_t count);
  void supersample_static(const World& world, const PixelRays& rays, std::span<const Pixel> pixels,
                          int samples, StaticSampleCache& cache);
  void find_static(const World& world, std::span<const Pixel> group, float footprint,
                   StaticSampleCache* cache);

  RadianceSampler radiance_;
  std::span<const UnlitSphere> spheres_;
  std::vector<Ray> batch_, missing_rays_;
  std::vector<const StaticSample*> static_;
  std::vector<StaticSample> found_;
  std::vector<LightSample> samples_;
  std::vector<Pixel> pixels_, static_pixels_;
  std::vector<std::uint8_t> is_dynamic_, edge_;
  std::vector<std::size_t> missing_;
};

}  // namespace raystage::simulate
