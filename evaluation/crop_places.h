// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <limits>
#include <span>
#include <vector>

namespace raystage::evaluation {

struct EvaluatedView;

/// A rectangle of a view, pixels.
struct Window {
  int x = 0, y = 0, width = 0, height = 0;
};

/// The errors of a picture in a window, in 8-bit codes.
struct WindowErrors {
  /// Root mean square over the covered pixels; NaN if they are less than half of the window.
  double rms = std::numeric_limits<double>::quiet_NaN();
  /// Sums of squared errors of covered pixels in the edge band and at thin structures, per pixel of
  /// the window; 0 if the true depths are unknown.
  double edge = 0, thin = 0;
};

/// `window` must be within the view.
WindowErrors window_errors(const EvaluatedView& view, const Window& window);

/// Returns the windows of a side (pixels, smaller if the view is) every half side of a view, row by
/// row; the last ones end at its borders.
std::vector<Window> windows_of_view(int width, int height, int side);

/// A window that may be shown.
struct CropCandidate {
  std::size_t view = 0;  ///< equal for windows of the same view
  Window window;
  std::vector<WindowErrors> errors;  ///< of each picture that is compared
};

/// Why a window is shown.
enum class CropReason {
  kDifference,  ///< largest minus smallest RMS error of the pictures
  kError,       ///< the smallest RMS error: where even the best picture is wrong
  kEdge,        ///< mean over the pictures of the errors at edges of depth
  kThin         ///< the same at thin structures
};

struct CropPlace {
  std::size_t candidate;  ///< index
  CropReason reason;
};

/// Returns at most `count` candidates, those with the largest values of each reason in turn. They
/// do not overlap within a view. Views of a take show similar things at similar pixels: for windows
/// of other views the value falls by 90 % of the part that a chosen one has, too. Ties go to the
/// first candidate.
std::vector<CropPlace> choose_crop_places(std::span<const CropCandidate> candidates,
                                          std::size_t count);

}  // namespace raystage::evaluation
