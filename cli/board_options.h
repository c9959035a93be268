// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <string>

#include "base/error.h"
#include "calibrate/detect/board.h"

namespace raystage {

/// Options that describe a calibration board.
struct BoardOptions {
  std::string squares, dictionary;  ///< "10x7"; empty: none
  double square_mm = 0, marker = 0.75;
  bool inverted = false;
};

inline void add_board_options(CLI::App& app, BoardOptions& o) {
  const char* group = "Board";
  auto* board = app.add_option("--board", o.squares,
                               "Number of all squares of the board, across and down, e.g. 10x7")
                    ->type_name("COLUMNSxROWS")
                    ->group(group);
  app.add_option("--square-mm", o.square_mm, "Side of a square, millimetres")
      ->check(CLI::Range(0.1, 1e5).description(""))
      ->needs(board)
      ->group(group);
  app.add_option("--charuco", o.dictionary,
                 "The board has markers (ChArUco) of this dictionary: 4x4_50, 4x4_250, 4x4_1000, "
                 "5x5_100, 6x6_250, 7x7_250, april_36h11 ... (default: a plain checkerboard)")
      ->type_name("DICTIONARY")
      ->needs(board)
      ->group(group);
  app.add_option("--marker", o.marker, "Side of a ChArUco marker relative to its square, 0-1")
      ->capture_default_str()
      ->needs(board)
      ->group(group);
  app.add_flag("--inverted", o.inverted, "Black and white are exchanged on the board")
      ->needs(board)
      ->group(group);
}

/// Throws Error (bad input) for an invalid board; see check_board().
inline Board make_board(const BoardOptions& options, bool unique_corners) {
  Board board;
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
                           "State the number of all squares, across and down");
  }
  board.square = options.square_mm / 1000;
  board.dictionary = options.dictionary;
  board.marker = options.marker;
  board.inverted = options.inverted;
  check_board(board, unique_corners);
  return board;
}

}  // namespace raystage
