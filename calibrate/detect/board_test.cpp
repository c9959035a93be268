// SPDX-License-Identifier: Apache-2.0
#include "calibrate/detect/board.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/aruco/charuco.hpp>
#include <opencv2/imgproc.hpp>

#include "base/error.h"
#include "calibrate/detect/board_detection.h"
#include "ingest/import_take.h"
#include "testing/test_data.h"
#include "testing/test_folder.h"

namespace raystage::calibrate {
namespace {

constexpr int kDrawn = 60;   // pixels of a square as drawn
constexpr int kMargin = 60;  // white border, pixels

/// Returns the printed board as a grey image.
cv::Mat printed(const Board& board) {
  const cv::Size size(board.columns * kDrawn, board.rows * kDrawn);
  cv::Mat squares(size, CV_8U);
  if (board.dictionary.empty()) {
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < size.width; ++x) {
        squares.at<unsigned char>(y, x) = (x / kDrawn + y / kDrawn) % 2 == 0 ? 20 : 235;
      }
    }
  } else {
    const auto dictionary = cv::aruco::getPredefinedDictionary(cv::aruco::DICT_5X5_100);
    cv::aruco::CharucoBoard::create(board.columns, board.rows, 1.0F,
                                    static_cast<float>(board.marker), dictionary)
        ->draw(size, squares, 0, 1);
  }
  cv::Mat sheet;
  cv::copyMakeBorder(squares, sheet, kMargin, kMargin, kMargin, kMargin, cv::BORDER_CONSTANT, 235);
  if (board.inverted) cv::bitwise_not(sheet, sheet);
  return sheet;
}

/// An oblique picture of the board, and its corners in pixels (centres at +0.5).
struct Picture {
  store::RgbImage image;
  std::vector<Eigen::Vector2d> corners;
};

Picture pictured(const Board& board) {
  const cv::Mat sheet = printed(board);
  const cv::Matx33d view(0.82, 0.10, 40, -0.06, 0.86, 70, 1.2e-4, 0.9e-4, 1);
  cv::Mat seen;
  cv::warpPerspective(sheet, seen, view, {800, 640}, cv::INTER_AREA, cv::BORDER_CONSTANT, 90);
  Picture picture{{800, 640, std::vector<std::uint8_t>()}, {}};
  for (int y = 0; y < 640; ++y) {
    for (int x = 0; x < 800; ++x) {
      for (int c = 0; c < 3; ++c) picture.image.values.push_back(seen.at<unsigned char>(y, x));
    }
  }
  for (int i = 0; i < board.corners(); ++i) {
    const int row = i / (board.columns - 1), column = i % (board.columns - 1);
    const double x = kMargin + kDrawn * (1 + column) - 0.5, y = kMargin + kDrawn * (1 + row) - 0.5;
    const cv::Vec3d at = view * cv::Vec3d(x, y, 1);
    picture.corners.emplace_back(at[0] / at[2] + 0.5, at[1] / at[2] + 0.5);
  }
  return picture;
}

class Boards : public ::testing::TestWithParam<Board> {};

TEST_P(Boards, AreFoundWithEveryCornerInItsPlace) {
  const Board& board = GetParam();
  const Picture picture = pictured(board);
  const std::vector<BoardCornerDetection> found = BoardDetector(board).find(picture.image);
  ASSERT_EQ(found.size(), static_cast<std::size_t>(board.corners()));
  for (const BoardCornerDetection& corner : found) {
    EXPECT_LE((corner.pixel - picture.corners[corner.index]).norm(), 0.3) << corner.index;
  }
}

INSTANTIATE_TEST_SUITE_P(Kinds, Boards,
                         ::testing::Values(Board{10, 7, 0.03, "", 0.75, false},
                                           Board{7, 6, 0.03, "", 0.75, false},
                                           Board{7, 5, 0.03, "5x5_100", 0.7, false},
                                           Board{6, 5, 0.03, "5x5_100", 0.75, true}));

TEST(Boards, ThatNobodyCanFindAreRefused) {
  EXPECT_NO_THROW(check_board({10, 7, 0.03, "", 0.75, false}, true));
  EXPECT_NO_THROW(check_board({8, 6, 0.03, "", 0.75, false}, false));
  EXPECT_THROW(check_board({8, 6, 0.03, "", 0.75, false}, true), Error);  // symmetric
  EXPECT_NO_THROW(check_board({8, 6, 0.03, "4x4_50", 0.75, false}, true));
  EXPECT_THROW(check_board({2, 7, 0.03, "", 0.75, false}, false), Error);
  EXPECT_THROW(check_board({10, 7, 0, "", 0.75, false}, false), Error);
  EXPECT_THROW(check_board({10, 7, 0.03, "9x9_9", 0.75, false}, false), Error);
  EXPECT_THROW(check_board({10, 7, 0.03, "4x4_50", 1.5, false}, false), Error);
}

TEST(Boards, ThatAreNotThereAreNotFound) {
  store::RgbImage empty{320, 240, std::vector<std::uint8_t>(320 * 240 * 3, 128)};
  EXPECT_TRUE(BoardDetector({10, 7, 0.03, "", 0.75, false}).find(empty).empty());
  EXPECT_TRUE(BoardDetector({7, 5, 0.03, "5x5_100", 0.75, false}).find(empty).empty());
}

/// Four webcams with published intrinsics from other recordings. These boards are small in the
/// pictures; the estimated focal lengths must differ from the published ones by at most 2 % or two
/// standard deviations.
TEST(CapturedBoards, TellTheLensesOfWebcams) {
  const auto manifest = testing::test_data() / "four_webcams" / "import.json";
  if (!std::filesystem::exists(manifest)) GTEST_SKIP() << "no captured boards at " << manifest;
  const testing::TestFolder folder;
  ingest::import_take(schemas::read_import_manifest(manifest), manifest.parent_path(),
                      folder.path() / "take", {});
  const store::Take take(folder.path() / "take");
  const BoardDetector finder({4, 5, 0.054, "4x4_1000", 0.75, true});
  int within_two_percent = 0;
  std::vector<CameraBoardViews> seen;
  for (int camera = 0; camera < 4; ++camera) {
    const auto& truth = take.rig().cameras[camera].model;
    const auto views = detect_board_views(take, camera, finder, 60, [](double) {}, {});
    seen.push_back({"webcam", truth.width(), truth.height(), views});
    const LensCalibration found = calibrate_lens(seen.back(), {});
    const double off = std::abs(found.lens.fx / truth.intrinsics().fx - 1);
    SCOPED_TRACE(fmt::format("camera {}: {:.1f} +- {:.1f} px, theirs {:.1f}", camera, found.lens.fx,
                             found.deviations[0], truth.intrinsics().fx));
    EXPECT_LE(found.rms_px, 0.5);
    EXPECT_LE(off, std::max(0.02, 2 * found.deviations[0] / found.lens.fx));
    within_two_percent += off <= 0.02 ? 1 : 0;
  }
  EXPECT_GE(within_two_percent, 3);
  // The third and fourth cameras are of one model: a shared prior makes both more accurate.
  const auto pair = calibrate_lenses_with_shared_prior(std::span(seen).subspan(2), {});
  for (std::size_t k = 0; k < pair.size(); ++k) {
    const double theirs = take.rig().cameras[k + 2].model.intrinsics().fx;
    EXPECT_NEAR(pair[k].lens.fx, theirs, 0.02 * theirs) << k + 2;
  }
}

}  // namespace
}  // namespace raystage::calibrate
