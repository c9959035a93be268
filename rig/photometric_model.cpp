// SPDX-License-Identifier: Apache-2.0
// Applies the photometric correction of a camera, or its inverse, per pixel (thesis eq. 4.1 and
// section 4.3):
//   light = matrix * (gain at the pixel * (brightness + contrast * (shown - dark))).
// The gain is the product of a vignetting polynomial in r^2 and a bilinear gain map. Inputs and
// outputs: R, G, B of linear light, full scale 1. Cost: constant per pixel.
#include "rig/photometric_model.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "base/error.h"

namespace raystage::rig {
namespace {

double vignetting_gain(const schemas::Vignetting& lens, PictureSize size, double x, double y) {
  const double half_diagonal = std::hypot(size.width, size.height) / 2;
  const double across = (x - lens.cx) / half_diagonal, down = (y - lens.cy) / half_diagonal;
  const double r2 = across * across + down * down;
  return 1 + r2 * (lens.a[0] + r2 * (lens.a[1] + r2 * lens.a[2]));
}

/// The interval of evenly spaced nodes that contains a position.
struct Interval {
  int first = 0;      ///< its first node
  double weight = 0;  ///< linear interpolation weight of the second node
};
Interval interval_at(double x, double length, int nodes) {
  const double position = x / length * (nodes - 1);
  const int first = std::clamp(static_cast<int>(position), 0, nodes - 2);
  return {first, position - first};
}

schemas::Rgb map_gain(const schemas::GainMap& map, PictureSize size, double x, double y) {
  const Interval column = interval_at(x, size.width, map.columns);
  const Interval row = interval_at(y, size.height, map.rows);
  const auto node = [&](int i, int j) -> const schemas::Rgb& {
    return map.gain[static_cast<std::size_t>(j) * static_cast<std::size_t>(map.columns) +
                    static_cast<std::size_t>(i)];
  };
  schemas::Rgb gain{};
  for (std::size_t c = 0; c < 3; ++c) {
    const double above = std::lerp(node(column.first, row.first)[c],
                                   node(column.first + 1, row.first)[c], column.weight);
    const double below = std::lerp(node(column.first, row.first + 1)[c],
                                   node(column.first + 1, row.first + 1)[c], column.weight);
    gain[c] = std::lerp(above, below, row.weight);
  }
  return gain;
}

}  // namespace

double evaluate_response_curve(const std::vector<double>& curve, double code) {
  if (curve.empty()) return code;
  const Interval at = interval_at(code, 1, static_cast<int>(curve.size()));
  const auto first = static_cast<std::size_t>(at.first);
  return std::lerp(curve[first], curve[first + 1], at.weight);
}

double invert_response_curve(const std::vector<double>& curve, double corrected) {
  if (curve.empty()) return std::clamp(corrected, 0.0, 1.0);
  if (corrected <= curve.front()) return 0;
  if (corrected >= curve.back()) return 1;
  const auto above = std::ranges::upper_bound(curve, corrected);
  const double low = above[-1], high = above[0];
  return (static_cast<double>(above - curve.begin() - 1) + (corrected - low) / (high - low)) /
         static_cast<double>(curve.size() - 1);
}

schemas::Rgb gain_at(const schemas::PhotometricResponse& response, PictureSize size, double x,
                     double y) {
  schemas::Rgb gain{1, 1, 1};
  if (response.gain_map) gain = map_gain(*response.gain_map, size, x, y);
  if (response.vignetting) {
    const double lens = vignetting_gain(*response.vignetting, size, x, y);
    for (double& channel : gain) channel *= lens;
  }
  return gain;
}

schemas::Rgb multiply(const schemas::ColorMatrix& matrix, const schemas::Rgb& color) {
  schemas::Rgb result{};
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t c = 0; c < 3; ++c) result[row] += matrix[row][c] * color[c];
  }
  return result;
}

schemas::ColorMatrix inverse(const schemas::ColorMatrix& matrix) {
  using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  const Eigen::Matrix3d m = Eigen::Map<const RowMajor>(matrix.front().data());
  const Eigen::FullPivLU<Eigen::Matrix3d> solver(m);
  if (!solver.isInvertible()) {
    throw Error::bad_input("the colour matrix has no inverse", "photometric/matrix",
                           "Give an invertible 3x3 matrix");
  }
  schemas::ColorMatrix result{};
  Eigen::Map<RowMajor>(result.front().data()) = solver.inverse();
  return result;
}

schemas::Rgb apply_photometric_correction(const schemas::PhotometricResponse& response,
                                          PictureSize size, int x, int y, const schemas::Rgb& shown,
                                          const schemas::Rgb& dark) {
  const schemas::Rgb gain = gain_at(response, size, x + 0.5, y + 0.5);
  schemas::Rgb light{};
  for (std::size_t c = 0; c < 3; ++c) {
    light[c] = gain[c] * (response.brightness[c] + response.contrast[c] * (shown[c] - dark[c]));
  }
  return multiply(response.matrix, light);
}

schemas::Rgb invert_photometric_correction(const schemas::PhotometricResponse& response,
                                           PictureSize size, int x, int y,
                                           const schemas::Rgb& light, const schemas::Rgb& dark) {
  const schemas::Rgb gain = gain_at(response, size, x + 0.5, y + 0.5);
  const schemas::Rgb unmixed = multiply(inverse(response.matrix), light);
  schemas::Rgb shown{};
  for (std::size_t c = 0; c < 3; ++c) {
    shown[c] = (unmixed[c] / gain[c] - response.brightness[c]) / response.contrast[c] + dark[c];
  }
  return shown;
}

}  // namespace raystage::rig
