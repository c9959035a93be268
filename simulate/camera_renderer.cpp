// SPDX-License-Identifier: Apache-2.0
//
// Renders the linear image of one camera (width x height) from a world. Takes one sample at each
// pixel centre, then several samples in pixels whose neighbours see different surfaces or
// shadows. Samples of static parts are cached from frame to frame. The cost is one sample per
// pixel and `edge_samples` per edge pixel; render_supersampled() takes `samples` in every pixel.
#include "simulate/camera_renderer.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <functional>
#include <limits>

#include "base/transfer_function.h"
#include "simulate/hash_random.h"

namespace raystage::simulate {
namespace {

using Eigen::Vector3f;

constexpr int kTile = 16;
constexpr std::size_t kBatch = 256;

// Returns whether there may be an edge between two neighbouring pixels.
bool differ(const LightSample& a, const LightSample& b) {
  if (a.part != b.part || a.reflected_part != b.reflected_part || a.lit != b.lit) return true;
  if (a.part < 0) return false;
  if (a.normal.dot(b.normal) < 0.7F) return true;
  const float nearer = std::min(a.distance, b.distance), farther = std::max(a.distance, b.distance);
  return farther - nearer > 0.02F * nearer;
}

/// Returns the two groups of a pixel's samples.
PixelSurfaces surfaces_of(std::span<const LightSample> samples) {
  std::vector<float> inverse;
  for (const LightSample& sample : samples) {
    if (sample.reflected_part >= 0) return {0, 0, 0};
    inverse.push_back(std::isinf(sample.distance) ? 0 : 1 / sample.distance);
  }
  std::ranges::sort(inverse, std::greater());
  std::size_t in_front = inverse.size();
  float largest = 0;
  for (std::size_t i = 1; i < inverse.size(); ++i) {
    if (inverse[i - 1] - inverse[i] <= largest) continue;
    largest = inverse[i - 1] - inverse[i];
    in_front = i;
  }
  const auto distance = [](std::span<const float> group) {
    float sum = 0;
    for (const float one : group) sum += one;
    return static_cast<float>(group.size()) / sum;  // infinite for nothing
  };
  const std::span<const float> all(inverse);
  const float front = distance(all.first(in_front));
  return {static_cast<float>(in_front) / static_cast<float>(inverse.size()), front,
          in_front < inverse.size() ? distance(all.subspan(in_front)) : front};
}

}  // namespace

float UnlitSphere::distance(const Ray& ray) const {
  constexpr float kMiss = std::numeric_limits<float>::infinity();
  const Vector3f towards = centre - ray.origin;
  const float along = towards.dot(ray.direction);
  const float square = radius * radius - (towards - along * ray.direction).squaredNorm();
  if (!(square > 0)) return kMiss;
  const float front = along - std::sqrt(square);
  return front > 0 ? front : kMiss;
}

void CameraRenderer::begin_centres(const PixelRays& rays, LinearImage& image) {
  image.width = rays.width();
  image.height = rays.height();
  const std::size_t count =
      static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height);
  image.light.assign(count, Vector3f::Zero());
  image.centre.assign(count, LightSample{});
  is_dynamic_.assign(count, 0);
}

void CameraRenderer::add_pixel(const PixelRays& rays, int column, int row) {
  if (column >= rays.width() || row >= rays.height() || !rays.has_ray(column, row)) return;
  const auto width = static_cast<std::size_t>(rays.width());
  pixels_.push_back(
      {column, row, static_cast<std::size_t>(row) * width + static_cast<std::size_t>(column)});
}

std::size_t CameraRenderer::sample_centres(const World& world, const PixelRays& rays,
                                           std::size_t start, StaticSampleCache& cache,
                                           LinearImage& image) {
  const std::size_t size = pixels_.size();
  const bool is_first_time = cache.centres_.size() < start + size;
  if (is_first_time) {
    for (const Pixel& pixel : pixels_) {
      cache.rays_.push_back(rays.ray(pixel.column, pixel.row, 0.5F, 0.5F));
    }
    cache.centres_.resize(start + size);
  }
  const auto batch = std::span(cache.rays_).subspan(start, size);
  const auto still = std::span(cache.centres_).subspan(start, size);
  if (is_first_time) radiance_.sample_static(world, batch, rays.footprint(), still);
  samples_.resize(size);
  static_.clear();
  for (const StaticSample& sample : still) static_.push_back(&sample);
  radiance_.sample(world, batch, rays.footprint(), static_, samples_);
  for (std::size_t i = 0; i < size; ++i) {
    const std::size_t at = pixels_[i].index;
    const LightSample& sample = samples_[i];
    image.centre[at] = sample;
    image.light[at] = sample.light.cwiseMin(world.geometry().scene().max_light);
    is_dynamic_[at] = sample.part != still[i].part ||
                      sample.reflected_part != still[i].reflected_part ||
                      sample.lit == still[i].lamp.isZero(0);
  }
  return start + size;
}

void CameraRenderer::render_centres(const World& world, const PixelRays& rays,
                                    StaticSampleCache& cache, LinearImage& image) {
  begin_centres(rays, image);
  std::size_t start = 0;
  for (int top = 0; top < image.height; top += kTile) {
    for (int left = 0; left < image.width; left += kTile) {
      pixels_.clear();
      for (int block = 0; block < 16; ++block) {
        for (int i = 0; i < 16; ++i) {
          add_pixel(rays, left + 4 * (block % 4) + i % 4, top + 4 * (block / 4) + i / 4);
        }
      }
      start = sample_centres(world, rays, start, cache, image);
    }
  }
}

void CameraRenderer::render_rows(World& world, const Exposure& exposure, const PixelRays& rays,
                                 StaticSampleCache& cache, LinearImage& image) {
  begin_centres(rays, image);
  std::size_t start = 0;
  for (int row = 0; row < image.height; ++row) {
    world.set_time(exposure.seconds_of_row(row, image.height));
    for (int left = 0; left < image.width; left += static_cast<int>(kBatch)) {
      pixels_.clear();
      for (int i = 0; i < static_cast<int>(kBatch); ++i) add_pixel(rays, left + i, row);
      start = sample_centres(world, rays, start, cache, image);
    }
  }
}

void CameraRenderer::make_batch(const PixelRays& rays, std::span<const Pixel> group, int samples) {
  const int side = static_cast<int>(std::lround(std::sqrt(samples)));
  assert(side * side == samples);
  batch_.clear();
  for (const Pixel& pixel : group) {
    for (int i = 0; i < samples; ++i) {
      // A lattice sheared in both directions: no two samples share a row or column.
      const int column = i % side, row = i / side;
      const auto a = static_cast<float>(column), b = static_cast<float>(row);
      const auto n = static_cast<float>(side);
      const float x = (a + (b + 0.5F) / n) / n, y = (b + (n - a - 0.5F) / n) / n;
      batch_.push_back(rays.ray(pixel.column, pixel.row, x, y));
    }
  }
}

// Fills static_ for the rays in batch_, from the cache for the pixels that it contains.
void CameraRenderer::find_static(const World& world, std::span<const Pixel> group, float footprint,
                                 StaticSampleCache* cache) {
  const std::size_t per_pixel = batch_.size() / group.size();
  missing_.clear();
  missing_rays_.clear();
  for (std::size_t p = 0; p < group.size(); ++p) {
    if (cache != nullptr && cache->block_of_[group[p].index] >= 0) continue;
    missing_.push_back(p);
    const auto rays = std::span(batch_).subspan(p * per_pixel, per_pixel);
    missing_rays_.insert(missing_rays_.end(), rays.begin(), rays.end());
  }
  found_.resize(missing_rays_.size());
  radiance_.sample_static(world, missing_rays_, footprint, found_);
  static_.assign(batch_.size(), nullptr);
  for (std::size_t m = 0; m < missing_.size(); ++m) {
    const auto found = std::span(found_).subspan(m * per_pixel, per_pixel);
    for (std::size_t i = 0; i < per_pixel; ++i) static_[missing_[m] * per_pixel + i] = &found[i];
    if (cache == nullptr ||
        (cache->blocks_.size() + per_pixel) * sizeof(StaticSample) > cache->max_bytes_) {
      continue;
    }
    cache->block_of_[group[missing_[m]].index] =
        static_cast<std::int32_t>(cache->blocks_.size() / per_pixel);
    cache->blocks_.insert(cache->blocks_.end(), found.begin(), found.end());
  }
  // Not earlier: inserting may have reallocated the cache.
  for (std::size_t i = 0; i < static_.size(); ++i) {
    if (static_[i] != nullptr) continue;
    const std::int32_t block = cache->block_of_[group[i / per_pixel].index];
    static_[i] = &cache->blocks_[static_cast<std::size_t>(block) * per_pixel + i % per_pixel];
  }
}

void CameraRenderer::supersample(const World& world, const PixelRays& rays,
                                 std::span<const Pixel> pixels, int samples,
                                 StaticSampleCache* cache, LinearImage& image) {
  const auto per_pixel = static_cast<std::size_t>(samples);
  const float footprint = rays.footprint() / std::sqrt(static_cast<float>(samples));
  const std::size_t at_once = std::max<std::size_t>(1, kBatch / per_pixel);
  for (std::size_t first = 0; first < pixels.size(); first += at_once) {
    const auto group = pixels.subspan(first, std::min(at_once, pixels.size() - first));
    make_batch(rays, group, samples);
    find_static(world, group, footprint, cache);
    samples_.resize(batch_.size());
    radiance_.sample(world, batch_, footprint, static_, samples_);
    for (std::size_t p = 0; p < group.size(); ++p) {
      if (!image.surfaces.empty()) {
        image.surfaces[group[p].index] =
            surfaces_of(std::span(samples_).subspan(p * per_pixel, per_pixel));
      }
      if (!spheres_.empty()) {
        image.sphere_share[group[p].index] = add_spheres(p * per_pixel, per_pixel);
      }
      Vector3f sum = Vector3f::Zero();
      // Clips each sample, not the mean: otherwise the edge of a highlight stays jagged.
      for (std::size_t i = 0; i < per_pixel; ++i) {
        sum += samples_[p * per_pixel + i].light.cwiseMin(world.geometry().scene().max_light);
      }
      image.light[group[p].index] = sum / static_cast<float>(samples);
    }
  }
}

float CameraRenderer::add_spheres(std::size_t first, std::size_t count) {
  int shown = 0;
  for (std::size_t i = first; i < first + count; ++i) {
    LightSample& sample = samples_[i];
    for (const UnlitSphere& sphere : spheres_) {
      const float distance = sphere.distance(batch_[i]);
      if (!(distance < sample.distance)) continue;
      sample.distance = distance;
      sample.light = sphere.colour;
      sample.part = -1;
      ++shown;
      break;  // all have one colour
    }
  }
  return static_cast<float>(shown) / static_cast<float>(count);
}

void CameraRenderer::supersample_static(const World& world, const PixelRays& rays,
                                        std::span<const Pixel> pixels, int samples,
                                        StaticSampleCache& cache) {
  const auto per_pixel = static_cast<std::size_t>(samples);
  const float footprint = rays.footprint() / std::sqrt(static_cast<float>(samples));
  const std::size_t at_once = std::max<std::size_t>(1, kBatch / per_pixel);
  for (std::size_t first = 0; first < pixels.size(); first += at_once) {
    const auto group = pixels.subspan(first, std::min(at_once, pixels.size() - first));
    make_batch(rays, group, samples);
    find_static(world, group, footprint, nullptr);
    for (std::size_t p = 0; p < group.size(); ++p) {
      Vector3f sum = Vector3f::Zero();
      for (std::size_t i = 0; i < per_pixel; ++i) {
        const StaticSample& sample = *static_[p * per_pixel + i];
        sum += (sample.unlit + sample.lamp).cwiseMin(world.geometry().scene().max_light);
      }
      cache.supersampled_[group[p].index] = sum / static_cast<float>(samples);
    }
  }
}

// Collects edge pixels: those next to a moving part in pixels_, the others in static_pixels_.
void CameraRenderer::find_edges(const LinearImage& image, const PixelRays& rays) {
  const auto width = static_cast<std::size_t>(image.width);
  const auto height = static_cast<std::size_t>(image.height);
  edge_.assign(image.light.size(), 0);
  const auto compare = [&](std::size_t a, std::size_t b) {
    if (differ(image.centre[a], image.centre[b])) edge_[a] = edge_[b] = 1;
  };
  for (std::size_t row = 0; row < height; ++row) {
    for (std::size_t column = 0; column < width; ++column) {
      const std::size_t at = row * width + column;
      if (column + 1 < width) compare(at, at + 1);
      if (row + 1 < height) compare(at, at + width);
    }
  }
  const auto moved = [&](std::size_t row, std::size_t column) {
    const std::size_t at = row * width + column;
    return is_dynamic_[at] != 0 || (column > 0 && is_dynamic_[at - 1] != 0) ||
           (column + 1 < width && is_dynamic_[at + 1] != 0) ||
           (row > 0 && is_dynamic_[at - width] != 0) ||
           (row + 1 < height && is_dynamic_[at + width] != 0);
  };
  pixels_.clear();
  static_pixels_.clear();
  // In small tiles, so that rays traced together are close to each other.
  constexpr std::size_t kBlock = 8;
  for (std::size_t top = 0; top < height; top += kBlock) {
    for (std::size_t left = 0; left < width; left += kBlock) {
      for (std::size_t row = top; row < std::min(top + kBlock, height); ++row) {
        for (std::size_t column = left; column < std::min(left + kBlock, width); ++column) {
          const std::size_t at = row * width + column;
          const Pixel pixel{static_cast<int>(column), static_cast<int>(row), at};
          if (edge_[at] == 0 || !rays.has_ray(pixel.column, pixel.row)) continue;
          (moved(row, column) ? pixels_ : static_pixels_).push_back(pixel);
        }
      }
    }
  }
}

void CameraRenderer::supersample_edges(const World& world, const PixelRays& rays, int edge_samples,
                                       StaticSampleCache& cache, LinearImage& image) {
  if (cache.block_of_.empty()) {
    constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();
    cache.block_of_.assign(image.light.size(), -1);
    cache.supersampled_.assign(image.light.size(), Vector3f::Constant(kUnknown));
  }
  find_edges(image, rays);
  const std::vector<Pixel> known = static_pixels_;
  std::erase_if(static_pixels_, [&](const Pixel& pixel) {
    return !std::isnan(cache.supersampled_[pixel.index].x());
  });
  supersample_static(world, rays, static_pixels_, edge_samples, cache);
  for (const Pixel& pixel : known) image.light[pixel.index] = cache.supersampled_[pixel.index];
}

void CameraRenderer::render(const World& world, const PixelRays& rays, int edge_samples,
                            StaticSampleCache& cache, LinearImage& image) {
  render_centres(world, rays, cache, image);
  if (edge_samples <= 1) return;
  supersample_edges(world, rays, edge_samples, cache, image);
  supersample(world, rays, pixels_, edge_samples, &cache, image);
}

void CameraRenderer::render(World& world, const Exposure& exposure, const PixelRays& rays,
                            int edge_samples, StaticSampleCache& cache, LinearImage& image) {
  if (exposure.is_global()) {
    world.set_time(exposure.seconds);
    render(world, rays, edge_samples, cache, image);
    return;
  }
  render_rows(world, exposure, rays, cache, image);
  if (edge_samples <= 1) return;
  supersample_edges(world, rays, edge_samples, cache, image);
  std::ranges::stable_sort(pixels_, {}, &Pixel::row);
  for (auto row = pixels_.begin(); row != pixels_.end();) {
    const auto end =
        std::ranges::find_if(row, pixels_.end(), [&](const Pixel& p) { return p.row != row->row; });
    world.set_time(exposure.seconds_of_row(row->row, image.height));
    supersample(world, rays, std::span(row, end), edge_samples, &cache, image);
    row = end;
  }
}

void CameraRenderer::render_supersampled(const World& world, const PixelRays& rays, int samples,
                                         LinearImage& image, std::span<const UnlitSphere> spheres) {
  StaticSampleCache once;
  render_centres(world, rays, once, image);
  spheres_ = spheres;
  image.sphere_share.assign(spheres.empty() ? 0 : image.light.size(), 0.0F);
  image.surfaces.assign(image.light.size(), {});
  pixels_.clear();
  for (std::size_t index = 0; index < image.light.size(); ++index) {
    const int column = static_cast<int>(index % static_cast<std::size_t>(image.width));
    const int row = static_cast<int>(index / static_cast<std::size_t>(image.width));
    if (rays.has_ray(column, row)) pixels_.push_back({column, row, index});
  }
  supersample(world, rays, pixels_, samples, nullptr, image);
  spheres_ = {};
}

}  // namespace raystage::simulate
