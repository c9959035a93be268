// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "planning/epipolar/epipolar_image.h"
#include "planning/epipolar/slope_search.h"
#include "rig/rig.h"
#include "schemas/geometry.h"
#include "store/take.h"
#include "store/timeline.h"

namespace raystage::planning {

/// Measures the depths of a take at one instant, in two passes. The first searches all slopes,
/// from infinity to points that neighbouring cameras hardly have in common, in small pictures. The
/// second searches the range that was found, with more cameras in larger pictures. Cost: O(pixels
/// x hypotheses x neighbours) for each camera and pass.
class InstantMeasurement {
 public:
  /// Decodes the frames of an instant, which some camera must have. At most `camera_count` cameras
  /// are measured, spread over the array. Keeps a reference to the take. Throws Error (bad input)
  /// for a damaged frame.
  InstantMeasurement(const store::Take& take, const store::FrameSelection& instant,
                     std::size_t camera_count);

  /// Returns the number of cameras that are measured.
  int cameras() const { return static_cast<int>(references_.size()); }

  /// Search all slopes, or a range of depths in front of the array more finely. Return inverse
  /// distances in front of the array, 1/m. `done`: called after each camera, from any thread.
  std::vector<double> first_pass(const std::function<void()>& done) const;
  std::vector<double> second_pass(schemas::DepthRange scene,
                                  const std::function<void()>& done) const;

  /// Returns the inverse depth, 1/m, that moves a point by a pixel between the nearest neighbours:
  /// the median over the cameras; 0 if none has a neighbour.
  double inverse_depth_per_pixel() const;

  /// Returns the epipolar-plane images of a row and of a column of cameras in the middle of the
  /// array, those of them that have at least two cameras.
  std::vector<EpipolarImage> epipolar_images() const;

 private:
  /// Of a camera whose pictures are reduced; nullopt: it sees nothing of the range.
  using Hypotheses = std::function<std::optional<SlopeHypotheses>(int camera, int factor,
                                                                  double inverse_depth_per_pixel)>;

  /// Returns the cameras of the same row and column, as epipolar_neighbours().
  EpipolarNeighbours cameras_in_line(int camera) const;
  int longer_side() const;
  int factor_for(int pixels) const;
  /// Returns the inverse depth that moves a point by a pixel of pictures that are reduced by
  /// `factor`, from a camera to the neighbour `index` of a side, or the last one there, on the side
  /// where it moves most; infinite without neighbours.
  double inverse_depth_step(const EpipolarNeighbours& neighbours, int camera, int factor,
                            std::size_t index) const;
  std::optional<SlopeHypotheses> second_hypotheses(int camera, schemas::DepthRange scene,
                                                   int factor, double per_pixel) const;
  /// Returns the pixels of a camera's reduced picture.
  double pixels_of(int camera, int factor) const;
  double values_of_second_pass(schemas::DepthRange scene, int factor) const;
  std::vector<double> search(int factor, std::size_t neighbour_count, const Hypotheses& hypotheses,
                             const std::function<void()>& done) const;
  /// Nullopt: the point is behind the array, or in its plane.
  std::optional<double> in_front_of_array(const render::VirtualCamera& camera,
                                          const MeasuredPixel& pixel) const;

  const rig::Rig& rig_;
  std::vector<render::VirtualCamera> pinholes_;  ///< by camera, without distortion
  std::vector<std::vector<std::uint8_t>> luma_;  ///< 8-bit codes; empty where absent
  std::vector<int> present_;
  std::vector<int> references_;  ///< the cameras that are measured
};

}  // namespace raystage::planning
