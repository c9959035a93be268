// SPDX-License-Identifier: Apache-2.0
// Photometric correction of a camera and its inverse, per pixel (thesis eq. 4.1 and section 4.3):
//   light = matrix * (gain at the pixel * (brightness + contrast * (shown - dark)))
// The gain is the product of a vignetting polynomial in r^2 and a bilinear gain map. Inputs and
// outputs: R, G, B of linear light, full scale 1. Cost: constant per pixel.
#include "rig/photometric_model.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "base/error.h"

namespace raystage {
namespace {

double vignetting_gain(const Vignetting& lens, PictureSize size, double x, double y) {
  const double half_diagonal = std::hypot(size.width, size.height) / 2;
  const double across = (x - lens.cx) / half_diagonal, down = (y - lens.cy) / half_diagonal;
  const double r2 = across * across + down * down;
  return 1 + r2 * (lens.a[0] + r2 * (lens.a[1] + r2 * lens.a[2]));
}

/// The interval of evenly spaced nodes that contains a position: its first node and the linear
/// interpolation weight of the second.
struct Between {
  int first = 0;
  double share = 0;
};
Between between(double x, double length, int nodes) {
  const double place = x / length * (nodes - 1);
  const int first = std::clamp(static_cast<int>(place), 0, nodes - 2);
  return {first, place - first};
}

Rgb map_gain(const GainMap& map, PictureSize size, double x, double y) {
  const Between column = between(x, size.width, map.columns);
  const Between row = between(y, size.height, map.rows);
  const auto node = [&](int i, int j) -> const Rgb& {
    return map.gain[static_cast<std::size_t>(j) * static_cast<std::size_t>(map.columns) +
                    static_cast<std::size_t>(i)];
  };
  Rgb gain{};
  for (std::size_t c = 0; c < 3; ++c) {
    const double above = std::lerp(node(column.first, row.first)[c],
                                   node(column.first + 1, row.first)[c], column.share);
    const double below = std::lerp(node(column.first, row.first + 1)[c],
                                   node(column.first + 1, row.first + 1)[c], column.share);
    gain[c] = std::lerp(above, below, row.share);
  }
  return gain;
}

}  // namespace

double evaluate_response_curve(const std::vector<double>& curve, double code) {
  if (curve.empty()) return code;
  const Between at = between(code, 1, static_cast<int>(curve.size()));
  const auto first = static_cast<std::size_t>(at.first);
  return std::lerp(curve[first], curve[first + 1], at.share);
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

Rgb gain_at(const PhotometricResponse& response, PictureSize size, double x, double y) {
  Rgb gain{1, 1, 1};
  if (response.gain_map) gain = map_gain(*response.gain_map, size, x, y);
  if (response.vignetting) {
    const double lens = vignetting_gain(*response.vignetting, size, x, y);
    for (double& channel : gain) channel *= lens;
  }
  return gain;
}

Rgb multiply(const ColorMatrix& matrix, const Rgb& color) {
  Rgb result{};
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t c = 0; c < 3; ++c) result[row] += matrix[row][c] * color[c];
  }
  return result;
}

ColorMatrix inverse(const ColorMatrix& matrix) {
  Eigen::Matrix3d m;
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t c = 0; c < 3; ++c) {
      m(static_cast<Eigen::Index>(row), static_cast<Eigen::Index>(c)) = matrix[row][c];
    }
  }
  const Eigen::FullPivLU<Eigen::Matrix3d> solver(m);
  if (!solver.isInvertible()) {
    throw Error::bad_input("the colour matrix has no inverse", "photometric/matrix",
                           "Give an invertible 3x3 matrix");
  }
  const Eigen::Matrix3d i = solver.inverse();
  ColorMatrix result{};
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t c = 0; c < 3; ++c) {
      result[row][c] = i(static_cast<Eigen::Index>(row), static_cast<Eigen::Index>(c));
    }
  }
  return result;
}

Rgb apply_photometric_correction(const PhotometricResponse& response, PictureSize size, int x,
                                 int y, const Rgb& shown, const Rgb& dark) {
  const Rgb gain = gain_at(response, size, x + 0.5, y + 0.5);
  Rgb light{};
  for (std::size_t c = 0; c < 3; ++c) {
    light[c] = gain[c] * (response.brightness[c] + response.contrast[c] * (shown[c] - dark[c]));
  }
  return multiply(response.matrix, light);
}

Rgb invert_photometric_correction(const PhotometricResponse& response, PictureSize size, int x,
                                  int y, const Rgb& light, const Rgb& dark) {
  const Rgb gain = gain_at(response, size, x + 0.5, y + 0.5);
  const Rgb unmixed = multiply(inverse(response.matrix), light);
  Rgb shown{};
  for (std::size_t c = 0; c < 3; ++c) {
    shown[c] = (unmixed[c] / gain[c] - response.brightness[c]) / response.contrast[c] + dark[c];
  }
  return shown;
}

}  // namespace raystage
