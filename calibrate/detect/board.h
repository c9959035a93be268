// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <string>
#include <string_view>
#include <vector>

#include "store/jpeg/rgb_image.h"

namespace raystage::calibrate {

/// A flat calibration board with squares.
struct Board {
  int columns = 0, rows = 0;  ///< number of squares
  double square = 0;          ///< side of a square, metres
  /// ChArUco: dictionary of the markers in the squares ("4x4_50", "april_36h11" ...); empty: a
  /// plain checkerboard, which must be entirely visible.
  std::string dictionary;
  double marker = 0.75;   ///< ChArUco: side of a marker relative to that of a square
  bool inverted = false;  ///< black and white exchanged

  int corners() const { return (columns - 1) * (rows - 1); }
  /// Returns the position of an inner corner on the board, metres; x right, y down. Corners are
  /// numbered row by row.
  Eigen::Vector2d corner(int index) const;
  std::vector<Eigen::Vector2d> all_corners() const;
};

/// Returns the names of the supported marker dictionaries.
std::vector<std::string> marker_dictionary_names();

/// Throws Error (bad input) for a board that cannot be detected: fewer than 3x3 squares, a marker
/// as large as its square, an unknown dictionary. With `unique_corners` also for a checkerboard
/// with an even number of columns plus rows: it is symmetric under a half turn, so its corners are
/// ambiguous between cameras.
void check_board(const Board& board, bool unique_corners);

/// A corner of a board in a picture.
struct BoardCornerDetection {
  int index = 0;          ///< see Board::corner()
  Eigen::Vector2d pixel;  ///< centres at +0.5, y down
};

/// Detects boards in pictures.
class BoardDetector {
 public:
  explicit BoardDetector(Board board);
  const Board& board() const { return board_; }
  /// Returns the corners of the board; none if it is not detected, or if a checkerboard is not
  /// entirely visible.
  std::vector<BoardCornerDetection> find(const store::RgbImage& picture) const;

 private:
  Board board_;
};

}  // namespace raystage::calibrate
