// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <charconv>
#include <string>

#include "base/error.h"
#include "calibrate/detect/board.h"
#include "cli/command_line.h"

namespace raystage::cli {

/// Options that describe a calibration board.
struct BoardOptions {
  std::string squares, dictionary;  ///< "10x7"; empty: none
  double square_mm = 0, marker = 0.75;
  bool inverted = false;
};

inline void add_board_options(CommandLine& command, BoardOptions& o, bool is_required) {
  CommandLine board = command.group("Board");
  board.option("--board COLUMNSxROWS", o.squares, "Squares of the board across and down, e.g. 10x7")
      .required(is_required);
  board.option("--square-mm", o.square_mm, "Side of a square, millimetres")
      .limits(0.1, 1e5)
      .needs("--board")
      .required(is_required);
  board
      .option("--charuco DICTIONARY", o.dictionary,
              "The board has markers (ChArUco) of this dictionary: 4x4_50, 4x4_250, 4x4_1000, "
              "5x5_100, 6x6_250, 7x7_250, april_36h11 ... (default: a plain checkerboard)")
      .needs("--board");
  board.option("--marker", o.marker, "Side of a ChArUco marker relative to its square, 0-1")
      .show_default()
      .needs("--board");
  board.flag("--inverted", o.inverted, "The board has black and white exchanged").needs("--board");
}

/// Throws Error (bad input) for an invalid board; see check_board().
inline calibrate::Board make_board(const BoardOptions& options, bool unique_corners) {
  calibrate::Board board;
  const std::string& text = options.squares;
  const std::size_t cross = text.find('x');
  const char* end = text.data() + text.size();
  bool is_read = false;
  if (cross != std::string::npos) {
    const auto columns = std::from_chars(text.data(), text.data() + cross, board.columns);
    const auto rows = std::from_chars(text.data() + cross + 1, end, board.rows);
    is_read = columns.ec == std::errc() && columns.ptr == text.data() + cross &&
              rows.ec == std::errc() && rows.ptr == end;
  }
  if (!is_read) {
    throw Error::bad_input("found \"" + text + "\", allowed: COLUMNSxROWS, e.g. 10x7", "--board",
                           "Use the number of squares across and down");
  }
  board.square = options.square_mm / 1000;
  board.dictionary = options.dictionary;
  board.marker = options.marker;
  board.inverted = options.inverted;
  calibrate::check_board(board, unique_corners);
  return board;
}

}  // namespace raystage::cli
