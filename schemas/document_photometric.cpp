// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "schemas/fields.h"
#include "schemas/photometric_response.h"

namespace raystage::schemas {
namespace {

using nlohmann::ordered_json;

void check_curve(const JsonNode& codes, const std::vector<double>& curve) {
  const auto fall = std::ranges::adjacent_find(curve, std::ranges::greater_equal{});
  if (fall != curve.end()) {
    throw codes.at(static_cast<std::size_t>(fall - curve.begin()) + 1)
        .input_error(
            fmt::format("the curve does not increase: {:.6g} comes after {:.6g}", fall[1], fall[0]),
            "Give values that increase with the code");
  }
}

void check_curves(const JsonNode& object, const PhotometricResponse& response) {
  if (!object.has("curve")) return;
  for (std::size_t c = 0; c < 3; ++c) check_curve(object.at("curve").at(c), response.curve[c]);
}

bool has_curve(const PhotometricResponse& response) { return !response.curve[0].empty(); }

void check_vignetting(const JsonNode& object, const Vignetting& lens,
                      const CameraGeometry& camera) {
  // Checked up to the picture's farthest corner.
  const double half_diagonal = std::hypot(camera.width, camera.height) / 2;
  const double farthest =
      std::hypot(std::max(std::abs(lens.cx), std::abs(camera.width - lens.cx)),
                 std::max(std::abs(lens.cy), std::abs(camera.height - lens.cy)));
  constexpr int kSteps = 64;
  for (int i = 1; i <= kSteps; ++i) {
    const double r2 = std::pow(farthest / half_diagonal * i / kSteps, 2);
    const double gain = 1 + r2 * (lens.a[0] + r2 * (lens.a[1] + r2 * lens.a[2]));
    if (!(gain > 0)) {
      throw object.input_error(
          fmt::format("the gain is {:.3g} at {:.2f} half diagonals, allowed: greater than 0", gain,
                      std::sqrt(r2)),
          "Give a gain that stays above 0 in the whole picture");
    }
  }
}

void check_gain_map(const JsonNode& object, const GainMap& map) {
  const auto nodes = static_cast<std::size_t>(map.columns) * static_cast<std::size_t>(map.rows);
  if (map.gain.size() != nodes) {
    throw object.at("gain").input_error(
        fmt::format("found {} nodes, allowed: columns * rows = {}", map.gain.size(), nodes),
        "Give R, G, B of every node, row by row");
  }
}

std::vector<HotPixel> dark_pixels_from(const JsonNode& list, const CameraGeometry& camera) {
  std::vector<HotPixel> pixels;
  pixels.reserve(list.size());
  for (std::size_t i = 0; i < list.size(); ++i) {
    const auto n = list.at(i).get<std::array<double, 5>>();
    const bool is_inside = n[0] >= 0 && n[1] >= 0 && n[0] < camera.width && n[1] < camera.height;
    if (!is_inside || n[0] != std::floor(n[0]) || n[1] != std::floor(n[1])) {
      throw list.at(i).input_error(
          fmt::format("found the pixel ({:.6g}, {:.6g}), allowed: whole numbers in the picture, "
                      "{}x{}",
                      n[0], n[1], camera.width, camera.height),
          "Give x from the left and y from the top, counted from 0");
    }
    HotPixel pixel{static_cast<int>(n[0]), static_cast<int>(n[1]), {n[2], n[3], n[4]}};
    if (!pixels.empty() &&
        std::pair(pixel.y, pixel.x) <= std::pair(pixels.back().y, pixels.back().x)) {
      throw list.at(i).input_error("the pixel is not sorted after the one before it",
                                   "List each pixel once, sorted by row and then by column");
    }
    pixels.push_back(pixel);
  }
  return pixels;
}

constexpr Fields kVignetting(required("cx", &Vignetting::cx), required("cy", &Vignetting::cy),
                             required("a", &Vignetting::a));

constexpr Fields kGainMap(required("columns", &GainMap::columns), required("rows", &GainMap::rows),
                          required("gain", &GainMap::gain), check(check_gain_map));

/// Without the hot pixels.
constexpr Fields kResponse(required("contrast", &PhotometricResponse::contrast),
                           required("brightness", &PhotometricResponse::brightness),
                           written_if(has_curve, defaulted("curve", &PhotometricResponse::curve)),
                           check(check_curves),
                           optional("vignetting", &PhotometricResponse::vignetting, kVignetting),
                           optional("gain_map", &PhotometricResponse::gain_map, kGainMap),
                           optional("matrix", &PhotometricResponse::matrix));

}  // namespace

PhotometricResponse photometric_from(const JsonNode& object, const CameraGeometry& camera) {
  auto response = kResponse.make<PhotometricResponse>(object);
  if (response.vignetting) {
    check_vignetting(object.at("vignetting"), *response.vignetting, camera);
  }
  if (object.has("hot_pixels")) {
    response.hot_pixels = dark_pixels_from(object.at("hot_pixels"), camera);
  }
  return response;
}

ordered_json json_from(const PhotometricResponse& response) {
  ordered_json object = kResponse.write(response);
  for (const HotPixel& pixel : response.hot_pixels) {
    object["hot_pixels"].push_back(
        {pixel.x, pixel.y, pixel.light[0], pixel.light[1], pixel.light[2]});
  }
  return object;
}

}  // namespace raystage::schemas
