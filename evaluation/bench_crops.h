// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "evaluation/crop_places.h"
#include "store/jpeg/rgb_image.h"

namespace raystage::evaluation {

/// Parts of views in which the rows of a bench are compared: the truth and each row's pixels.
/// Stores candidates while rows are measured, because the places where they differ are known only
/// after the last one. At most kMaxBytes; if not all windows of a view fit, those are stored in
/// which the first row errs most, and if not all views do, evenly spaced ones.
class BenchCrops {
 public:
  static constexpr int kSide = 96;  ///< of a crop, pixels
  static constexpr std::size_t kMaxBytes = std::size_t{64} << 20;
  static constexpr std::size_t kMaxPageBytes = std::size_t{8} << 20;  ///< of chosen()

  struct Picture {
    std::size_t row;  ///< index in BenchResult::rows
    store::RgbImage image;
    WindowErrors errors;
  };
  struct Crop {
    std::string view;  ///< id
    Window window;
    store::RgbImage truth;
    std::vector<Picture> pictures;  ///< in the order of the rows
  };
  /// Valid until the next change of the object.
  struct ChosenCrop {
    const Crop& crop;
    CropReason reason;
  };

  BenchCrops() = default;  ///< stores nothing
  /// `rows`: how many rows will add pictures; `wanted`: how many crops are chosen at most.
  BenchCrops(std::size_t rows, std::size_t wanted) : rows_(rows), wanted_(wanted) {}

  void add(std::size_t row, const EvaluatedView& view);
  void remove(std::size_t row);  ///< removes the pictures of a failed row

  /// Returns the crops to show (choose_crop_places()). All have pictures of the same rows.
  std::vector<ChosenCrop> chosen() const;
  std::size_t bytes() const;  ///< of the stored pixels

 private:
  void add_windows_of(const EvaluatedView& view);

  std::size_t rows_ = 0, wanted_ = 0;
  std::vector<std::string> views_;  ///< that were added
  std::vector<Crop> crops_;
};

}  // namespace raystage::evaluation
