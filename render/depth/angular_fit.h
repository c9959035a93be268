// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <span>
#include <vector>

#include "render/depth/angular_fit_kernels.h"
#include "render/depth/depth.h"

namespace raystage::render::depth {

/// How far the fits of a view replace the means: a strength per cell of kCell x kCell pixels,
/// between which it is linear.
class AngularStrengths {
 public:
  static constexpr int kCell = 16;    ///< pixels; cells lie within tiles
  static constexpr int kRowStep = 8;  ///< one row of these is measured

  AngularStrengths(int width, int height);

  static bool is_measured(int y) { return y % kRowStep == kRowStep / 2; }
  /// Adds a pixel to its cell. Threads may add to different cells at once.
  void measure(int x, int y, double difference, double noise);
  /// Computes the strengths from all measurements: 0 to 1.
  void decide();
  /// Returns the strength at a pixel, after decide().
  float at(int x, int y) const;
  /// Returns whether it is above 0 anywhere in a tile.
  bool reaches(const BlendingField::Tile& tile) const;
  std::span<float> by_cell() { return strengths_; }
  /// Returns whether the measurements of a tile suggest, before decide(), that it will be above 0
  /// there.
  bool may_reach(const BlendingField::Tile& tile) const;

 private:
  struct Sums {
    double difference = 0, noise = 0;
  };
  int columns_, rows_;
  std::vector<Sums> sums_;
  std::vector<float> strengths_;
};

/// Replaces the mean of the cameras by a fit over their positions, where one depth does not explain
/// them (angular_fit.cpp): behind glass, in reflections, on glossy surfaces.
class AngularFit {
 public:
  using Tile = BlendingField::Tile;

  AngularFit(const ViewRequest& request, const DepthViewPlan& plan);

  /// Returns whether the tile may be fitted: there are enough cameras, and frames without matte.
  bool may_fit(const Tile& tile) const;
  /// Returns the offsets of the tile's cameras.
  std::vector<AngularOffset> offsets(const Tile& tile) const;

  /// Samples of cameras in a row of a tile, from its left edge on.
  struct Row {
    int y = 0;
    std::span<const float*const> samples, weights, visible;  ///< as AngularRun
    std::span<const AngularOffset> offsets;
  };
  /// Fits the pixels of a row.
  void solve(const Tile& tile, const Row& row, AngularFitResult& result) const;
  /// Measures the pixels of a row, away from edges of depth.
  void measure(const Tile& tile, int y, const AngularFitResult& result);
  AngularStrengths& strengths() { return strengths_; }
  const AngularStrengths& strengths() const { return strengths_; }
  /// Returns whether a row of a tile has a pixel to correct. Writes the strength of each: 0 at
  /// edges of depth.
  bool strengths_of_row(const Tile& tile, int y, std::span<float> strengths) const;

 private:
  const ViewRequest& request_;
  const DepthViewPlan& plan_;
  float separation_;  ///< of depths at an edge, 1/m
  AngularStrengths strengths_;
};

/// Writes, for each pixel, R, G, B of AngularFitResult::rgba times strength, and the strength times
/// 65535; 0 where there is no fit.
void weigh_angular_fit(std::span<const float> rgba, std::span<const float> strengths,
                       std::span<float> sums);
/// Mixes premultiplied light of a tile's row with these sums.
void mix_angular_fit(const store::FrameCache& cache, std::span<const float> sums,
                     std::span<float> rgba);

/// Returns the offsets of cameras of a tile, in the order of the tile's: double, for the reference.
struct AngularPosition {
  double right = 0, up = 0, ahead = 0, ahead_m = 0;
};
std::vector<AngularPosition> angular_positions(const ViewRequest& request,
                                               const DepthViewPlan& plan,
                                               const BlendingField::Tile& tile);
/// Returns the distance of depths, 1/m, from which on neighbouring pixels are at an edge.
float angular_edge_separation(const DepthViewPlan& plan);

}  // namespace raystage::render::depth
