// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "store/jpeg/rgb_image.h"

namespace raystage {

struct EvaluatedView;

/// Small pictures for a page, as JPEG: truth, and of each row what was rendered and how it differs.
/// Never more than kMaxBytes in all.
class BenchImages {
 public:
  static constexpr std::size_t kMaxBytes = std::size_t{12} << 20;
  static constexpr int kMaxWidth = 960;      ///< pixels
  static constexpr int kDifferenceGain = 4;  ///< differences are shown so many times as large

  struct View {
    std::string id;
    std::vector<std::byte> truth;
  };
  struct Picture {
    std::size_t row, view;  ///< of BenchResult::rows, views()
    std::vector<std::byte> image, difference;
  };

  /// Takes a picture of the row over, if it is one of `wanted` views spread evenly over all.
  void add(std::size_t row, const EvaluatedView& picture, int wanted);
  /// Makes room: the row came to nothing.
  void remove(std::size_t row);

  std::span<const View> views() const { return views_; }
  std::span<const Picture> pictures() const { return pictures_; }
  int omitted_count() const { return left_out_; }  ///< pictures that had no room

 private:
  bool has_room_for(std::size_t bytes) const { return bytes_ + bytes <= kMaxBytes; }

  std::vector<View> views_;
  std::vector<Picture> pictures_;
  std::size_t bytes_ = 0;
  int left_out_ = 0;
};

/// Averages of whole pixels' areas, the sides kept in proportion; as it is where it is no wider.
RgbImage scaled_to_width(const RgbImage& image, int most_width);

/// `gain` times the absolute difference per channel, over covered pixels; grey 48 elsewhere. Both
/// of one size.
RgbImage difference_image(const RgbImage& image, const RgbImage& truth,
                          std::span<const std::uint8_t> covered, int gain);

}  // namespace raystage
