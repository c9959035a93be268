// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "schemas/document.h"
#include "schemas/photometric_response.h"

namespace raystage {
namespace {

using nlohmann::ordered_json;

std::vector<double> curve_from(const JsonNode& codes) {
  auto curve = codes.get<std::vector<double>>();
  const auto fall = std::ranges::adjacent_find(curve, std::ranges::greater_equal{});
  if (fall != curve.end()) {
    throw codes.at(static_cast<std::size_t>(fall - curve.begin()) + 1)
        .input_error(
            fmt::format("the curve does not rise: {:.6g} comes after {:.6g}", fall[1], fall[0]),
            "Give values that increase with the code");
  }
  return curve;
}

Vignetting vignetting_from(const JsonNode& object, const CameraGeometry& camera) {
  Vignetting lens{object.at("cx").get<double>(), object.at("cy").get<double>(),
                  object.at("a").get<std::array<double, 3>>()};
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
  return lens;
}

GainMap gain_map_from(const JsonNode& object) {
  GainMap map{object.at("columns").get<int>(), object.at("rows").get<int>(),
              object.at("gain").get<std::vector<Rgb>>()};
  const auto nodes = static_cast<std::size_t>(map.columns) * static_cast<std::size_t>(map.rows);
  if (map.gain.size() != nodes) {
    throw object.at("gain").input_error(
        fmt::format("found {} nodes, allowed: columns * rows = {}", map.gain.size(), nodes),
        "Give R, G, B of every node, row by row");
  }
  return map;
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
      throw list.at(i).input_error("the pixel does not come after the one before it",
                                   "List each pixel once, sorted by row and then by column");
    }
    pixels.push_back(pixel);
  }
  return pixels;
}

}  // namespace

PhotometricResponse photometric_from(const JsonNode& object, const CameraGeometry& camera) {
  PhotometricResponse response;
  response.contrast = object.at("contrast").get<Rgb>();
  response.brightness = object.at("brightness").get<Rgb>();
  if (object.has("curve")) {
    const JsonNode curve = object.at("curve");
    for (std::size_t c = 0; c < 3; ++c) response.curve[c] = curve_from(curve.at(c));
  }
  if (object.has("vignetting")) {
    response.vignetting = vignetting_from(object.at("vignetting"), camera);
  }
  if (object.has("gain_map")) response.gain_map = gain_map_from(object.at("gain_map"));
  response.matrix = object.get("matrix", kIdentityColorMatrix);
  if (object.has("hot_pixels")) {
    response.hot_pixels = dark_pixels_from(object.at("hot_pixels"), camera);
  }
  return response;
}

ordered_json json_from(const PhotometricResponse& response) {
  ordered_json object{{"contrast", response.contrast}, {"brightness", response.brightness}};
  if (!response.curve[0].empty()) object["curve"] = response.curve;
  if (response.vignetting) {
    const Vignetting& lens = *response.vignetting;
    object["vignetting"] = {{"cx", lens.cx}, {"cy", lens.cy}, {"a", lens.a}};
  }
  if (response.gain_map) {
    const GainMap& map = *response.gain_map;
    object["gain_map"] = {{"columns", map.columns}, {"rows", map.rows}, {"gain", map.gain}};
  }
  if (response.matrix != kIdentityColorMatrix) object["matrix"] = response.matrix;
  if (!response.hot_pixels.empty()) {
    ordered_json& list = object["hot_pixels"] = ordered_json::array();
    for (const HotPixel& pixel : response.hot_pixels) {
      list.push_back({pixel.x, pixel.y, pixel.light[0], pixel.light[1], pixel.light[2]});
    }
  }
  return object;
}

}  // namespace raystage
