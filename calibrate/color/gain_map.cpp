// SPDX-License-Identifier: Apache-2.0
// Fits gains at the nodes of a grid over the picture, bilinear in between, to the cells of an
// evenly lit target. Linear least squares per channel with a smoothness term on second differences
// (normal equations, dense). Input: cell means, linear light. Output: gains, 1 in the centre. Cost:
// cells plus nodes cubed.
#include "calibrate/color/gain_map.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "base/error.h"

namespace raystage::calibrate {
namespace {

// Nodes are two cells apart: a finer grid would fit their noise.
constexpr int kColumns = 17, kRows = 13, kNodes = kColumns * kRows;
constexpr double kStiffness = 0.05;  // weight of a second difference relative to a cell

/// The nodes around a position and their bilinear weights.
struct Around {
  std::array<int, 4> node{};
  std::array<double, 4> share{};
};
Around around(double x, double y, rig::PictureSize size) {
  const double u = x / size.width * (kColumns - 1), v = y / size.height * (kRows - 1);
  const int column = std::clamp(static_cast<int>(u), 0, kColumns - 2);
  const int row = std::clamp(static_cast<int>(v), 0, kRows - 2);
  const double right = u - column, down = v - row;
  const int first = row * kColumns + column;
  return {{first, first + 1, first + kColumns, first + kColumns + 1},
          {(1 - right) * (1 - down), right * (1 - down), (1 - right) * down, right * down}};
}

/// Returns the smoothness part of the normal equations: nodes lie on a line.
Eigen::MatrixXd smoothness() {
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(kNodes, kNodes);
  const auto add = [&](int before, int node, int after) {
    const std::array<std::pair<int, double>, 3> bend{{{before, 1}, {node, -2}, {after, 1}}};
    for (const auto& [i, a] : bend) {
      for (const auto& [j, b] : bend) normal(i, j) += kStiffness * a * b;
    }
  };
  for (int row = 0; row < kRows; ++row) {
    for (int column = 0; column < kColumns; ++column) {
      const int node = row * kColumns + column;
      if (column > 0 && column + 1 < kColumns) add(node - 1, node, node + 1);
      if (row > 0 && row + 1 < kRows) add(node - kColumns, node, node + kColumns);
    }
  }
  return normal;
}

}  // namespace

schemas::GainMap fit_gain_map(std::span<const FlatFieldCell> cells, rig::PictureSize size,
                              const schemas::PhotometricResponse& response,
                              const std::string& camera) {
  Eigen::MatrixXd normal = smoothness();
  Eigen::MatrixXd right = Eigen::MatrixXd::Zero(kNodes, 3);
  schemas::Rgb level{};
  double in_middle = 0;
  std::vector<schemas::Rgb> lights;
  for (const FlatFieldCell& cell : cells) {
    const schemas::Rgb gain = rig::gain_at(response, size, cell.x, cell.y);
    schemas::Rgb& light = lights.emplace_back();
    for (std::size_t c = 0; c < 3; ++c) {
      light[c] = gain[c] * (response.brightness[c] + response.contrast[c] * cell.mean[c]);
    }
    const bool is_middle =
        std::abs(cell.x / size.width - 0.5) < 0.25 && std::abs(cell.y / size.height - 0.5) < 0.25;
    if (!is_middle) continue;
    for (std::size_t c = 0; c < 3; ++c) level[c] += light[c];
    in_middle += 1;
  }
  for (double& channel : level) channel /= std::max(1.0, in_middle);
  constexpr double kMin = 0.05;  // of the light in the centre
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const Around at = around(cells[i].x, cells[i].y, size);
    for (std::size_t c = 0; c < 3; ++c) {
      if (!(lights[i][c] > kMin * level[c])) {
        throw Error::bad_input("part of the picture of camera \"" + camera + "\" has no light",
                               "flat field",
                               "Fill the picture of every camera with the brightest target")
            .concerning({"flat_field"});
      }
    }
    for (std::size_t a = 0; a < 4; ++a) {
      for (std::size_t b = 0; b < 4; ++b)
        normal(at.node[a], at.node[b]) += at.share[a] * at.share[b];
      for (std::size_t c = 0; c < 3; ++c) {
        right(at.node[a], c) += at.share[a] * level[c] / lights[i][c];
      }
    }
  }
  const Eigen::MatrixXd nodes = normal.ldlt().solve(right);
  schemas::GainMap map{kColumns, kRows, {}};
  constexpr int kMiddle = kRows / 2 * kColumns + kColumns / 2;
  for (int node = 0; node < kNodes; ++node) {
    schemas::Rgb& gain = map.gain.emplace_back();
    for (int c = 0; c < 3; ++c) gain[c] = nodes(node, c) / nodes(kMiddle, c);
    constexpr double kMax = 20;
    if (!(std::ranges::min(gain) > 1 / kMax && std::ranges::max(gain) < kMax)) {
      throw Error::bad_input("camera \"" + camera + "\" shows no evenly lit target", "flat field",
                             "Fill the picture of every camera with the brightest target")
          .concerning({"flat_field"});
    }
  }
  return map;
}

}  // namespace raystage::calibrate
