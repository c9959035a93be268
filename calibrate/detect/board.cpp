// SPDX-License-Identifier: Apache-2.0
// Detects the corners of a checkerboard (OpenCV's sector-based detector) or of a ChArUco board
// (markers, then corners) and refines them to subpixels. Output: corner indices and pixels, centres
// at +0.5, y down. Cost: pixels of the picture.
#include "calibrate/detect/board.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <numeric>
#include <opencv2/aruco/charuco.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "base/error.h"

namespace raystage::calibrate {
namespace {

struct Dictionary {
  std::string_view name;
  cv::aruco::PREDEFINED_DICTIONARY_NAME opencv;
};

constexpr std::array kDictionaries{Dictionary{"4x4_50", cv::aruco::DICT_4X4_50},
                                   Dictionary{"4x4_100", cv::aruco::DICT_4X4_100},
                                   Dictionary{"4x4_250", cv::aruco::DICT_4X4_250},
                                   Dictionary{"4x4_1000", cv::aruco::DICT_4X4_1000},
                                   Dictionary{"5x5_50", cv::aruco::DICT_5X5_50},
                                   Dictionary{"5x5_100", cv::aruco::DICT_5X5_100},
                                   Dictionary{"5x5_250", cv::aruco::DICT_5X5_250},
                                   Dictionary{"5x5_1000", cv::aruco::DICT_5X5_1000},
                                   Dictionary{"6x6_50", cv::aruco::DICT_6X6_50},
                                   Dictionary{"6x6_250", cv::aruco::DICT_6X6_250},
                                   Dictionary{"6x6_1000", cv::aruco::DICT_6X6_1000},
                                   Dictionary{"7x7_50", cv::aruco::DICT_7X7_50},
                                   Dictionary{"7x7_250", cv::aruco::DICT_7X7_250},
                                   Dictionary{"aruco_original", cv::aruco::DICT_ARUCO_ORIGINAL},
                                   Dictionary{"april_16h5", cv::aruco::DICT_APRILTAG_16h5},
                                   Dictionary{"april_25h9", cv::aruco::DICT_APRILTAG_25h9},
                                   Dictionary{"april_36h11", cv::aruco::DICT_APRILTAG_36h11}};

const Dictionary* dictionary_named(std::string_view name) {
  const auto found = std::ranges::find(kDictionaries, name, &Dictionary::name);
  return found == kDictionaries.end() ? nullptr : &*found;
}

cv::Mat grey_of(const store::RgbImage& picture, bool inverted) {
  // OpenCV only reads the pixels.
  const cv::Mat rgb(picture.height, picture.width, CV_8UC3,
                    const_cast<std::uint8_t*>(picture.values.data()));  // NOLINT
  cv::Mat grey;
  cv::cvtColor(rgb, grey, cv::COLOR_RGB2GRAY);
  if (inverted) cv::bitwise_not(grey, grey);
  return grey;
}

/// Refines corners to subpixels. `window`: half the side of the window around each, pixels.
std::vector<BoardCornerDetection> refined(const cv::Mat& grey, std::vector<cv::Point2f> places,
                                          const std::vector<int>& indices, int window) {
  cv::cornerSubPix(grey, places, {window, window}, {-1, -1},
                   {cv::TermCriteria::EPS | cv::TermCriteria::COUNT, 50, 1e-3});
  std::vector<BoardCornerDetection> corners;
  for (std::size_t i = 0; i < places.size(); ++i) {
    // OpenCV's pixel centres are at integers.
    corners.push_back({indices[i], {places[i].x + 0.5, places[i].y + 0.5}});
  }
  return corners;
}

/// Returns half the side of the window for corner refinement, pixels: it must not contain another
/// corner.
int refining_window(const std::vector<cv::Point2f>& places, int across) {
  double least = 1e9;
  for (std::size_t i = 1; i < places.size(); ++i) {
    if (static_cast<int>(i) % across == 0) continue;
    least = std::min(least, cv::norm(places[i] - places[i - 1]));
  }
  for (auto i = static_cast<std::size_t>(across); i < places.size(); ++i) {
    least = std::min(least, cv::norm(places[i] - places[i - static_cast<std::size_t>(across)]));
  }
  constexpr int kMax = 9;
  return std::clamp(static_cast<int>(least / 2) - 1, 2, kMax);
}

std::vector<BoardCornerDetection> checkerboard_in(const cv::Mat& grey, const Board& board) {
  std::vector<cv::Point2f> places;
  const cv::Size inner(board.columns - 1, board.rows - 1);
  if (!cv::findChessboardCorners(
          grey, inner, places,
          cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_FAST_CHECK)) {
    return {};
  }
  std::vector<int> indices(places.size());
  std::iota(indices.begin(), indices.end(), 0);
  return refined(grey, places, indices, refining_window(places, inner.width));
}

std::vector<BoardCornerDetection> charuco_in(const cv::Mat& grey, const Board& board) {
  const auto dictionary =
      cv::aruco::getPredefinedDictionary(dictionary_named(board.dictionary)->opencv);
  const auto charuco =
      cv::aruco::CharucoBoard::create(board.columns, board.rows, static_cast<float>(board.square),
                                      static_cast<float>(board.square * board.marker), dictionary);
  const auto parameters = cv::aruco::DetectorParameters::create();
  // required by OpenCV for ChArUco
  parameters->cornerRefinementMethod = cv::aruco::CORNER_REFINE_NONE;
  std::vector<std::vector<cv::Point2f>> markers;
  std::vector<int> ids;
  cv::aruco::detectMarkers(grey, dictionary, markers, ids, parameters);
  if (ids.empty()) return {};
  std::vector<cv::Point2f> places;
  std::vector<int> indices;
  cv::aruco::interpolateCornersCharuco(markers, ids, grey, charuco, places, indices);
  if (places.empty()) return {};
  // OpenCV returns corners shifted by half a pixel. A window must not reach the markers around.
  double side = 1e9;
  for (const auto& marker : markers) {
    side = std::min(side, cv::norm(marker[1] - marker[0]) / board.marker);
  }
  const int window = std::clamp(static_cast<int>(side * (1 - board.marker) / 2), 2, 9);
  return refined(grey, places, indices, window);
}

}  // namespace

Eigen::Vector2d Board::corner(int index) const {
  const int across = columns - 1;
  const int column = index % across, row = index / across;
  return {square * column, square * row};
}

std::vector<Eigen::Vector2d> Board::all_corners() const {
  std::vector<Eigen::Vector2d> all;
  for (int i = 0; i < corners(); ++i) all.push_back(corner(i));
  return all;
}

std::vector<std::string> marker_dictionary_names() {
  std::vector<std::string> names;
  for (const Dictionary& dictionary : kDictionaries) names.emplace_back(dictionary.name);
  return names;
}

void check_board(const Board& board, bool unique_corners) {
  if (board.columns < 3 || board.rows < 3 || board.columns > 100 || board.rows > 100) {
    throw Error::bad_input(
        fmt::format("found {}x{} squares, allowed: 3x3 to 100x100", board.columns, board.rows),
        "board", "State the number of all squares, across and down")
        .concerning({"board"});
  }
  if (!(board.square > 0)) {
    throw Error::bad_input("the side of a square must be greater than 0", "side of a square",
                           "Measure it and state it in millimetres")
        .concerning({"square_mm"});
  }
  if (!board.dictionary.empty()) {
    if (dictionary_named(board.dictionary) == nullptr) {
      throw Error::bad_input("the dictionary \"" + board.dictionary + "\" is unknown",
                             "ChArUco dictionary", "State the dictionary of the printed board")
          .concerning({"charuco"});
    }
    if (!(board.marker > 0 && board.marker < 1)) {
      throw Error::bad_input("a marker must be smaller than its square", "side of a marker",
                             "State its side relative to that of the square, above 0 and below 1")
          .concerning({"marker"});
    }
  } else if (unique_corners && (board.columns + board.rows) % 2 == 0) {
    throw Error::bad_input(
        "a checkerboard with an even number of columns plus rows is symmetric under a half turn",
        "board",
        "Use a board with one row more or less, or a ChArUco board, so that cameras can identify "
        "its corners")
        .concerning({"board"});
  }
}

BoardDetector::BoardDetector(Board board) : board_(std::move(board)) {}

std::vector<BoardCornerDetection> BoardDetector::find(const store::RgbImage& picture) const {
  const cv::Mat grey = grey_of(picture, board_.inverted);
  return board_.dictionary.empty() ? checkerboard_in(grey, board_) : charuco_in(grey, board_);
}

}  // namespace raystage::calibrate
