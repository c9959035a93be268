// SPDX-License-Identifier: Apache-2.0
// Clean plates: the light of the set behind the subject. A screen's light is a polynomial of second
// degree per channel, fitted by least squares to the pixels that show the screen, with outliers
// removed twice. Other plates are a constant colour or the mean of up to 8 frames of an empty take.
// Input: linear light, R, G, B per pixel. Output: linear light at each pixel. Cost of a fit: every
// ninth pixel, three rounds; of an empty take: O(pixels) per frame.
#include "store/processing/mattes/clean_plate.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "store/processing/frames/frame_cache.h"

namespace raystage::store {
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

/// Returns the quantile of the values at `share` in [0, 1], or 0 without values.
float quantile(std::vector<float> values, double share) {
  if (values.empty()) return 0;
  const auto at =
      values.begin() + static_cast<std::ptrdiff_t>(static_cast<double>(values.size() - 1) * share);
  std::ranges::nth_element(values, at);
  return *at;
}

/// Returns the pixels that show the screen, of every third column and row: those whose relative
/// excess is at least 0.8 of the median of bright screen pixels. `examined`: pixels tested.
std::vector<ScreenPixel> pixels_of_screen(const Image<float, 3>& rgb,
                                          const ColorDifferenceKeyer& key, std::size_t& examined) {
  constexpr int kStep = 3;
  const auto for_each_pixel = [&](const auto& look) {
    for (int y = 0; y < rgb.height; y += kStep) {
      for (int x = 0; x < rgb.width; x += kStep) {
        const auto p = rgb.pixel(x, y);
        look(x, y, LinearColour{p[0], p[1], p[2]});
      }
    }
  };
  std::vector<float> excess, relative_excess;
  for_each_pixel(
      [&](int, int, const LinearColour& colour) { excess.push_back(key.excess(colour)); });
  examined = excess.size();
  const float bright = std::max(0.01F, quantile(excess, 0.95));
  for_each_pixel([&](int, int, const LinearColour& colour) {
    if (key.excess(colour) > bright / 2) relative_excess.push_back(key.relative_excess(colour));
  });
  const float pure = 0.8F * quantile(relative_excess, 0.5);
  std::vector<ScreenPixel> pixels;
  for_each_pixel([&](int x, int y, const LinearColour& colour) {
    if (key.excess(colour) < bright / 8 || key.relative_excess(colour) < pure) return;
    pixels.push_back({terms_at(x, y, rgb.width, rgb.height), {colour[0], colour[1], colour[2]}});
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

CleanPlate CleanPlate::fitted(const Image<float, 3>& rgb, const ColorDifferenceKeyer& key,
                              const std::string& name) {
  std::size_t examined = 0;
  std::vector<ScreenPixel> pixels = pixels_of_screen(rgb, key, examined);
  std::array<Terms, 3> fits;
  // Outliers, such as edges of the subject, are removed after each fit.
  for (int round = 0; round < 3; ++round) {
    if (pixels.size() * 50 < examined || pixels.size() < 2 * kTerms) {
      throw Error::bad_input(
          fmt::format("only {:.1f} % of the picture show a screen, too little to measure its light",
                      100.0 * static_cast<double>(pixels.size()) / static_cast<double>(examined)),
          name, "Set screen_color or clean_plate_take in the layer's matte");
    }
    for (std::size_t c = 0; c < 3; ++c) fits[c] = least_squares(pixels, c);
    double squares = 0;
    const auto squared_error = [&](const ScreenPixel& pixel) {
      double sum = 0;
      for (std::size_t c = 0; c < 3; ++c) {
        sum += std::pow(pixel.light[c] - fits[c].dot(pixel.terms), 2);
      }
      return sum;
    };
    for (const ScreenPixel& pixel : pixels) squares += squared_error(pixel);
    const double limit = 6 * squares / static_cast<double>(pixels.size());
    std::erase_if(pixels, [&](const ScreenPixel& pixel) { return squared_error(pixel) > limit; });
  }
  Polynomial result;
  result.width = rgb.width;
  result.height = rgb.height;
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
    // The screen may be somewhat brighter behind the subject, or darker in a corner.
    result.least[c] *= 0.8F;
    result.most[c] *= 1.2F;
  }
  return CleanPlate(std::variant<LinearColour, Polynomial, Picture>(result));
}

CleanPlate CleanPlate::recorded(const Take& clean_plate_take, int camera) {
  const ArchiveReader& archive = clean_plate_take.archive(camera);
  std::vector<int> used;
  for (int frame = 0; frame < static_cast<int>(archive.frames().size()); ++frame) {
    if (!archive.is_rotten(frame)) used.push_back(frame);
    if (used.size() == kMaxCleanPlateFrames) break;
  }
  if (used.empty()) {
    throw Error::bad_input("the empty take has no intact frame of this camera",
                           clean_plate_take.document().cameras[camera].id,
                           "Record the empty take again, or exclude the camera");
  }
  Image<float, 3> mean;
  for (const int frame : used) {
    const Image<float, 3> light = linear_frame(clean_plate_take, camera, frame);
    if (frame == used.front()) mean = Image<float, 3>(light.width, light.height);
    for (std::size_t i = 0; i < mean.values.size(); ++i) {
      mean.values[i] += light.values[i] / static_cast<float>(used.size());
    }
  }
  const float most = std::max(1e-6F, *std::ranges::max_element(mean.values));
  Picture picture{most / 65535, {mean.width, mean.height}};
  std::ranges::transform(mean.values, picture.codes.values.begin(), [&](float light) {
    return static_cast<std::uint16_t>(light / picture.per_code + 0.5F);
  });
  return CleanPlate(std::variant<LinearColour, Polynomial, Picture>(std::move(picture)));
}

LinearColour CleanPlate::at(int x, int y) const {
  if (const auto* colour = std::get_if<LinearColour>(&light_)) return *colour;
  LinearColour result{};
  if (const auto* picture = std::get_if<Picture>(&light_)) {
    const auto codes = picture->codes.pixel(x, y);
    for (std::size_t c = 0; c < 3; ++c) {
      result[c] = picture->per_code * static_cast<float>(codes[c]);
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

Image<float, 3> linear_frame(const Take& take, int camera, int frame) {
  FrameCache cache(take, 1, BlendSpace::kLinear);
  std::int64_t decoded = 0;
  const auto held = cache.fetch(camera, frame, {}, decoded);
  const auto per_code = static_cast<float>(cache.full_scale() / 65535);
  Image<float, 3> rgb(held->width, held->height);
  for (std::size_t i = 0; i < rgb.values.size() / 3; ++i) {
    for (std::size_t c = 0; c < 3; ++c) {
      rgb.values[3 * i + c] = per_code * static_cast<float>(held->rgba[4 * i + c]);
    }
  }
  return rgb;
}

}  // namespace raystage::store
