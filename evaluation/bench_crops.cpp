// SPDX-License-Identifier: Apache-2.0
#include "evaluation/bench_crops.h"

#include <algorithm>
#include <cstdint>
#include <iterator>

#include "evaluation/bench_images.h"
#include "evaluation/evaluation.h"

namespace raystage::evaluation {
namespace {

store::RgbImage cropped(const store::RgbImage& image, const Window& window) {
  store::RgbImage crop{window.width, window.height, std::vector<std::uint8_t>()};
  crop.values.reserve(static_cast<std::size_t>(window.width) * window.height * 3);
  for (int y = window.y; y < window.y + window.height; ++y) {
    const auto row =
        image.values.begin() + (static_cast<std::ptrdiff_t>(y) * image.width + window.x) * 3;
    crop.values.insert(crop.values.end(), row, row + std::ptrdiff_t{3} * window.width);
  }
  return crop;
}

std::size_t bytes_of(const Window& window) {
  return static_cast<std::size_t>(window.width) * window.height * 3;
}

}  // namespace

void BenchCrops::add_windows_of(const EvaluatedView& view) {
  views_.push_back(view.id);
  const std::vector<Window> windows = windows_of_view(view.image.width, view.image.height, kSide);
  const std::size_t fitting = kMaxBytes / (bytes_of(windows.front()) * (rows_ + 1));
  if (!is_evenly_chosen(view.index, view.count, fitting)) return;
  const std::size_t of_view = std::max<std::size_t>(1, fitting / view.count);
  const auto add_window = [&](const Window& window) {
    crops_.push_back({view.id, window, cropped(view.truth, window), {}});
  };
  if (windows.size() <= of_view) {
    std::ranges::for_each(windows, add_window);
    return;
  }
  std::vector<CropCandidate> candidates;
  for (const Window& window : windows) {
    candidates.push_back({0, window, {window_errors(view, window)}});
  }
  for (const CropPlace& place : choose_crop_places(candidates, of_view)) {
    add_window(windows[place.candidate]);
  }
}

void BenchCrops::add(std::size_t row, const EvaluatedView& view) {
  if (rows_ == 0 || wanted_ == 0) return;
  if (std::ranges::find(views_, view.id) == views_.end()) add_windows_of(view);
  for (Crop& crop : crops_) {
    if (crop.view != view.id) continue;
    crop.pictures.push_back(
        {row, cropped(view.image, crop.window), window_errors(view, crop.window)});
  }
}

void BenchCrops::remove(std::size_t row) {
  for (Crop& crop : crops_) {
    std::erase_if(crop.pictures, [&](const Picture& picture) { return picture.row == row; });
  }
}

std::size_t BenchCrops::bytes() const {
  std::size_t bytes = 0;
  for (const Crop& crop : crops_) bytes += bytes_of(crop.window) * (1 + crop.pictures.size());
  return bytes;
}

std::vector<BenchCrops::ChosenCrop> BenchCrops::chosen() const {
  std::size_t pictures = 0;
  for (const Crop& crop : crops_) pictures = std::max(pictures, crop.pictures.size());
  if (pictures == 0) return {};
  std::vector<const Crop*> complete;
  std::vector<CropCandidate> candidates;
  std::size_t bytes = 1;
  for (const Crop& crop : crops_) {
    if (crop.pictures.size() != pictures) continue;
    const auto view = std::ranges::find(views_, crop.view);
    CropCandidate candidate{
        static_cast<std::size_t>(std::distance(views_.begin(), view)), crop.window, {}};
    for (const Picture& picture : crop.pictures) candidate.errors.push_back(picture.errors);
    complete.push_back(&crop);
    candidates.push_back(std::move(candidate));
    bytes = std::max(bytes, bytes_of(crop.window));
  }
  const std::size_t fitting = kMaxPageBytes / (bytes * (pictures + 1));
  std::vector<ChosenCrop> chosen;
  for (const CropPlace& place : choose_crop_places(candidates, std::min(wanted_, fitting))) {
    chosen.push_back({*complete[place.candidate], place.reason});
  }
  return chosen;
}

}  // namespace raystage::evaluation
