// SPDX-License-Identifier: Apache-2.0
#include "store/processing/mattes/screen_light.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "store/processing/frames/frame_cache.h"

namespace raystage {
namespace {

constexpr int kTerms = 6;
using Terms = Eigen::Matrix<double, kTerms, 1>;

Terms terms_at(int x, int y, int width, int height) {
  const double u = (2 * x + 1.0) / width - 1, v = (2 * y + 1.0) / height - 1;
  return (Terms() << 1, u, v, u * u, u * v, v * v).finished();
}

struct ScreenPixel {
  Terms terms;
  std::array<double, 3> light;
};

/// The value that a share of them are below; 0 where there are none.
float quantile(std::vector<float> values, double share) {
  if (values.empty()) return 0;
  const auto at =
      values.begin() + static_cast<std::ptrdiff_t>(static_cast<double>(values.size() - 1) * share);
  std::ranges::nth_element(values, at);
  return *at;
}

/// Of every third pixel each way, those nearly as pure as the screen where it is bright.
std::vector<ScreenPixel> pixels_of_screen(std::span<const float> rgb, int width, int height,
                                          const ScreenKey& key, std::size_t& looked_at) {
  constexpr int kStep = 3;
  const auto for_each_pixel = [&](const auto& look) {
    for (int y = 0; y < height; y += kStep) {
      for (int x = 0; x < width; x += kStep) {
        const float* p = &rgb[3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                                   static_cast<std::size_t>(x))];
        look(x, y, LinearColour{p[0], p[1], p[2]});
      }
    }
  };
  std::vector<float> excess, purity;
  for_each_pixel(
      [&](int, int, const LinearColour& colour) { excess.push_back(key.excess(colour)); });
  looked_at = excess.size();
  const float bright = std::max(0.01F, quantile(excess, 0.95));
  for_each_pixel([&](int, int, const LinearColour& colour) {
    if (key.excess(colour) > bright / 2) purity.push_back(key.purity(colour));
  });
  const float pure = 0.8F * quantile(purity, 0.5);
  std::vector<ScreenPixel> pixels;
  for_each_pixel([&](int x, int y, const LinearColour& colour) {
    if (key.excess(colour) < bright / 8 || key.purity(colour) < pure) return;
    pixels.push_back({terms_at(x, y, width, height), {colour[0], colour[1], colour[2]}});
  });
  return pixels;
}

Terms least_squares(const std::vector<ScreenPixel>& pixels, std::size_t channel) {
  Eigen::Matrix<double, kTerms, kTerms> normal = decltype(normal)::Identity() * 1e-6;
  Terms right = Terms::Zero();
  for (const ScreenPixel& pixel : pixels) {
    normal += pixel.terms * pixel.terms.transpose();
    right += pixel.terms * pixel.light[channel];
  }
  return normal.ldlt().solve(right);
}

}  // namespace

EmptySet EmptySet::fitted(std::span<const float> rgb, int width, int height, const ScreenKey& key,
                          const std::string& name) {
  std::size_t looked_at = 0;
  std::vector<ScreenPixel> pixels = pixels_of_screen(rgb, width, height, key, looked_at);
  std::array<Terms, 3> fits;
  // Edges of what stands before the screen go after a first fit.
  for (int round = 0; round < 3; ++round) {
    if (pixels.size() * 50 < looked_at || pixels.size() < 2 * kTerms) {
      throw Error::bad_input(
          fmt::format("{:.1f} % of the picture show a screen, too little to tell its light",
                      100.0 * static_cast<double>(pixels.size()) / static_cast<double>(looked_at)),
          name, "Give the layer's matte a screen_color or an empty_take");
    }
    for (std::size_t c = 0; c < 3; ++c) fits[c] = least_squares(pixels, c);
    double squares = 0;
    const auto off = [&](const ScreenPixel& pixel) {
      double sum = 0;
      for (std::size_t c = 0; c < 3; ++c) {
        sum += std::pow(pixel.light[c] - fits[c].dot(pixel.terms), 2);
      }
      return sum;
    };
    for (const ScreenPixel& pixel : pixels) squares += off(pixel);
    const double most = 6 * squares / static_cast<double>(pixels.size());
    std::erase_if(pixels, [&](const ScreenPixel& pixel) { return off(pixel) > most; });
  }
  Polynomial result;
  result.width = width;
  result.height = height;
  result.least.fill(1e30F);
  result.most.fill(0);
  for (std::size_t c = 0; c < 3; ++c) {
    for (std::size_t i = 0; i < kTerms; ++i) {
      result.of_channel[c][i] = static_cast<float>(fits[c][static_cast<Eigen::Index>(i)]);
    }
    for (const ScreenPixel& pixel : pixels) {
      const auto light = static_cast<float>(pixel.light[c]);
      result.least[c] = std::min(result.least[c], light);
      result.most[c] = std::max(result.most[c], light);
    }
    // Brighter behind the actor, perhaps, or darker in a corner, but not by much.
    result.least[c] *= 0.8F;
    result.most[c] *= 1.2F;
  }
  return EmptySet(std::variant<LinearColour, Polynomial, Picture>(result));
}

EmptySet EmptySet::recorded(const Take& clean_plate_take, int camera) {
  const int count = static_cast<int>(clean_plate_take.archive(camera).frames().size());
  if (count == 0) {
    throw Error::bad_input("the empty take has no frame of this camera",
                           clean_plate_take.document().cameras[static_cast<std::size_t>(camera)].id,
                           "Record it again, or leave the camera out");
  }
  const int used = std::min(count, kMostEmptyFrames);
  std::vector<float> mean;
  for (int frame = 0; frame < used; ++frame) {
    const std::vector<float> light = linear_frame(clean_plate_take, camera, frame);
    mean.resize(light.size());
    for (std::size_t i = 0; i < light.size(); ++i) mean[i] += light[i] / static_cast<float>(used);
  }
  const float most = std::max(1e-6F, *std::ranges::max_element(mean));
  Picture picture;
  picture.width = clean_plate_take.rig().cameras[static_cast<std::size_t>(camera)].model.width();
  picture.per_code = most / 65535;
  picture.codes.resize(mean.size());
  std::ranges::transform(mean, picture.codes.begin(), [&](float light) {
    return static_cast<std::uint16_t>(light / picture.per_code + 0.5F);
  });
  return EmptySet(std::variant<LinearColour, Polynomial, Picture>(std::move(picture)));
}

LinearColour EmptySet::at(int x, int y) const {
  if (const auto* colour = std::get_if<LinearColour>(&light_)) return *colour;
  LinearColour result{};
  if (const auto* picture = std::get_if<Picture>(&light_)) {
    const std::size_t first =
        3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(picture->width) +
             static_cast<std::size_t>(x));
    for (std::size_t c = 0; c < 3; ++c) {
      result[c] = picture->per_code * static_cast<float>(picture->codes[first + c]);
    }
    return result;
  }
  const auto& polynomial = std::get<Polynomial>(light_);
  const float u = static_cast<float>(2 * x + 1) / static_cast<float>(polynomial.width) - 1;
  const float v = static_cast<float>(2 * y + 1) / static_cast<float>(polynomial.height) - 1;
  for (std::size_t c = 0; c < 3; ++c) {
    const auto& k = polynomial.of_channel[c];
    const float light = k[0] + u * (k[1] + u * k[3] + v * k[4]) + v * (k[2] + v * k[5]);
    result[c] = std::clamp(light, polynomial.least[c], polynomial.most[c]);
  }
  return result;
}

std::vector<float> linear_frame(const Take& take, int camera, int frame) {
  FrameCache cache(take, 1, BlendSpace::kLinear);
  std::int64_t decoded = 0;
  const auto held = cache.fetch(camera, frame, {}, decoded);
  const auto pixels =
      static_cast<std::size_t>(held->width) * static_cast<std::size_t>(held->height);
  const auto per_code = static_cast<float>(cache.full_scale() / 65535);
  std::vector<float> rgb(3 * pixels);
  for (std::size_t i = 0; i < pixels; ++i) {
    for (std::size_t c = 0; c < 3; ++c) {
      rgb[3 * i + c] = per_code * static_cast<float>(held->rgba[4 * i + c]);
    }
  }
  return rgb;
}

}  // namespace raystage
