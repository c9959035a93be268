// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "rig/planning/array_design.h"
#include "schemas/array_specification.h"
#include "schemas/rig_document.h"

namespace raystage::planning {

/// An array that could be built.
struct ArrayAlternative {
  std::string camera;  ///< id in the catalogue
  double focal_length_mm = 0;
  double horizontal_fov = 0;  ///< of the cameras, full angle, radians
  bool is_rotated = false;    ///< towards the subject; otherwise parallel (wall-eyed)
  int width_px = 0, height_px = 0;
  int columns = 1, rows = 1;                          ///< of each side
  int sides = 1;                                      ///< of a cube, with such an array each
  Eigen::Vector2d spacing = Eigen::Vector2d::Zero();  ///< between columns and rows, metres
  bool is_limited_by_bodies = false;                  ///< cameras touch each other along an axis
  double ghosting_px = 0;  ///< on the best focal plane, pixels of the view (thesis eq. 2.1)
  /// Distinct pixels of the narrowest view (never oversampled) relative to those wanted, at most 1.
  double resolution = 1;
  double megapixels_per_s = 0, megabytes_per_s = 0;
  int nodes = 0, disks = 0;
  double price = 0;
  bool is_sufficient = false;  ///< ghosting and resolution are as specified
  bool is_on_front = false;    ///< no other one is as good for less

  int cameras() const { return sides * columns * rows; }
};

/// An array with the same total rate and other numbers of cameras (thesis 8.2).
struct RateTrade {
  int columns = 1, rows = 1;           ///< of each side
  double width_px = 0, height_px = 0;  ///< of a camera
  double spacing_m = 0;                ///< the larger one
  double ghosting_px = 0, resolution = 1;
};

/// A camera of the catalogue that cannot be used, and why.
struct UnusableCamera {
  std::string camera, because;
};

/// Arrays that meet a specification (thesis 6.1).
struct ArrayPlan {
  schemas::ArraySpecification specification;
  rig::ArrayRequirements needed;
  double largest_spacing = 0;  ///< metres, by thesis eq. 6.5; infinite for a flat scene
  double view_pitch = 0;       ///< size of a pixel of the narrowest view at focal length 1
  std::vector<ArrayAlternative> alternatives;  ///< by price, then by ghosting
  std::optional<std::size_t> best;  ///< the cheapest sufficient one, or that with least ghosting
  std::vector<UnusableCamera> unusable;
  double trade_megapixels_per_s = 0;
  std::vector<RateTrade> trade;  ///< of the best alternative, by number of cameras
};

/// Plans arrays. `name` is the specification for errors. Throws Error (bad input) where views look
/// back at the array, or no camera can be used.
ArrayPlan plan_array(const schemas::ArraySpecification& specification, const std::string& name);

/// Returns the rig of an alternative: the centre of its first side is that of the specified extent,
/// and looks along -z. Of six sides, the others look to the left, back, right, up and down.
schemas::RigDocument rig_of_alternative(const ArrayPlan& plan, const ArrayAlternative& of);

}  // namespace raystage::planning
