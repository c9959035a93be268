// SPDX-License-Identifier: Apache-2.0
// Draws the photometric errors of a simulated camera at random: contrast, brightness, vignetting,
// crosstalk, response curve and hot pixels. Returns the response that corrects them
// (rig/photometric_model.h). The random numbers are hashes of the seed and the camera's index
// (hash_random.h).
#include "simulate/simulated_response.h"

#include <cmath>
#include <map>

#include "simulate/hash_random.h"

namespace raystage::simulate {
namespace {

constexpr std::uint64_t kColourSalt = 3, kErrorSalt = 31, kHotSalt = 32;

void add_contrast(const ColorErrors& errors, HashRandom& random,
                  schemas::PhotometricResponse& response) {
  const double gain = 1 + errors.gain * random.uniform(-1, 1);
  for (std::size_t c = 0; c < 3; ++c) {
    const double balance = 1 + errors.white_balance * random.uniform(-1, 1);
    const double offset = errors.offset * random.uniform(0, 1);
    // shown = gain * light + offset
    response.contrast[c] /= gain * (c == 1 ? 1 : balance);
    response.brightness[c] -= offset * response.contrast[c];
  }
}

schemas::Vignetting random_vignetting(const SimulationOptions& s, HashRandom& random) {
  const double lost = s.color_errors.vignetting * random.uniform(0.7, 1);  // in the corner
  const double gain = 1 / (1 - lost) - 1;
  constexpr double kOffCentre = 0.02, kSquareShare = 0.7;
  return {s.width * (0.5 + random.uniform(-kOffCentre, kOffCentre)),
          s.height * (0.5 + random.uniform(-kOffCentre, kOffCentre)),
          {kSquareShare * gain, (1 - kSquareShare) * gain, 0}};
}

/// Returns the matrix that corrects the crosstalk of a random sensor; white stays white.
schemas::ColorMatrix random_matrix(double mix, HashRandom& random) {
  schemas::ColorMatrix sensor = schemas::kIdentityColorMatrix;
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t c = 0; c < 3; ++c) {
      if (row == c) continue;
      sensor[row][c] = random.uniform(0, mix);
      sensor[row][row] -= sensor[row][c];
    }
  }
  return rig::inverse(sensor);
}

std::vector<double> random_curve(double deviation, HashRandom& random) {
  const double exponent = 1 + random.uniform(-deviation, deviation);
  std::vector<double> curve;
  constexpr int kSteps = 64;
  for (int i = 0; i <= kSteps; ++i) {
    curve.push_back(std::pow(static_cast<double>(i) / kSteps, exponent));
  }
  return curve;
}

std::vector<schemas::HotPixel> random_hot_pixels(const SimulationOptions& s, std::uint64_t index) {
  HashRandom random{s.seed, kHotSalt, index};
  std::map<std::pair<int, int>, schemas::Rgb> by_place;  // row, column
  for (int i = 0; i < s.color_errors.hot_pixels; ++i) {
    const auto x = static_cast<int>(random.uniform(0, s.width));
    const auto y = static_cast<int>(random.uniform(0, s.height));
    const double light = random.uniform(0.02, 0.8);
    by_place[{y, x}] = {light, light * random.uniform(0.7, 1), light * random.uniform(0.7, 1)};
  }
  std::vector<schemas::HotPixel> pixels;
  for (const auto& [place, light] : by_place) pixels.push_back({place.second, place.first, light});
  return pixels;
}

}  // namespace

schemas::PhotometricResponse simulated_response(const SimulationOptions& s, std::uint64_t index) {
  schemas::PhotometricResponse response;
  HashRandom colour{s.seed, kColourSalt, index};
  for (std::size_t c = 0; c < 3; ++c) {
    response.contrast[c] = std::exp(s.photometric_deviation * colour.normal());
    response.brightness[c] = s.photometric_deviation / 20 * colour.normal();
  }
  const ColorErrors& errors = s.color_errors;
  HashRandom random{s.seed, kErrorSalt, index};
  add_contrast(errors, random, response);
  if (errors.vignetting > 0) response.vignetting = random_vignetting(s, random);
  if (errors.crosstalk > 0) response.matrix = random_matrix(errors.crosstalk, random);
  if (errors.curve > 0) {
    for (std::vector<double>& curve : response.curve) curve = random_curve(errors.curve, random);
  }
  response.hot_pixels = random_hot_pixels(s, index);
  return response;
}

}  // namespace raystage::simulate
