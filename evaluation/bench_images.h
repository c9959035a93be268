// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "store/jpeg/rgb_image.h"

namespace raystage::evaluation {

struct EvaluatedView;

/// Small JPEG pictures: the truth, and per row the rendered view and its difference. At most
/// kMaxBytes.
class BenchImages {
 public:
  static constexpr std::size_t kMaxBytes = std::size_t{12} << 20;
  static constexpr int kMaxWidth = 960;      ///< pixels
  static constexpr int kDifferenceGain = 4;  ///< factor of displayed differences

  struct View {
    std::string id;
    std::vector<std::byte> truth;
  };
  struct Picture {
    std::size_t row, view;  ///< indices in BenchResult::rows and views()
    std::vector<std::byte> image, difference;
  };

  /// Stores a picture of the row if it is one of `wanted` views spread evenly over all.
  void add(std::size_t row, const EvaluatedView& picture, int wanted);
  void remove(std::size_t row);  ///< removes the pictures of a failed row

  std::span<const View> views() const { return views_; }
  std::span<const Picture> pictures() const { return pictures_; }
  int omitted_count() const { return omitted_; }  ///< pictures that exceeded kMaxBytes

 private:
  bool has_room_for(std::size_t bytes) const { return bytes_ + bytes <= kMaxBytes; }

  std::vector<View> views_;
  std::vector<Picture> pictures_;
  std::size_t bytes_ = 0;
  int omitted_ = 0;
};

/// Returns whether the index is one of `wanted` spread evenly over `count`, each in the middle of
/// its share.
bool is_evenly_chosen(std::size_t index, std::size_t count, std::size_t wanted);

/// Returns the image scaled down to `max_width` by area averaging with its aspect ratio kept;
/// unchanged if it is no wider.
store::RgbImage scaled_to_width(const store::RgbImage& image, int max_width);

/// Returns `gain` times the absolute difference per channel for covered pixels, grey 48 elsewhere.
/// Both images have the same size.
store::RgbImage difference_image(const store::RgbImage& image, const store::RgbImage& truth,
                                 std::span<const std::uint8_t> covered, int gain);

}  // namespace raystage::evaluation
