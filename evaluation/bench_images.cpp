// SPDX-License-Identifier: Apache-2.0
#include "evaluation/bench_images.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>

#include "evaluation/evaluation.h"
#include "store/jpeg/encode.h"

namespace raystage::evaluation {
namespace {

constexpr store::JpegEncodeOptions kJpeg{85, store::JpegEncodeOptions::Chroma::k420, 0};

std::vector<std::byte> small_jpeg(const store::RgbImage& image) {
  return store::encode_jpeg(scaled_to_width(image, BenchImages::kMaxWidth), kJpeg);
}

}  // namespace

void BenchImages::add(std::size_t row, const EvaluatedView& picture, int wanted) {
  if (!is_evenly_chosen(picture.index, picture.count,
                        static_cast<std::size_t>(std::max(wanted, 0)))) {
    return;
  }
  Picture taken{
      row, 0, small_jpeg(picture.image),
      small_jpeg(difference_image(picture.image, picture.truth, picture.covered, kDifferenceGain))};
  std::size_t bytes = taken.image.size() + taken.difference.size();
  auto view = std::ranges::find(views_, picture.id, &View::id);
  std::vector<std::byte> truth;
  if (view == views_.end()) bytes += (truth = small_jpeg(picture.truth)).size();
  if (!has_room_for(bytes)) {
    ++omitted_;
    return;
  }
  bytes_ += bytes;
  if (view == views_.end()) view = views_.insert(views_.end(), {picture.id, std::move(truth)});
  taken.view = static_cast<std::size_t>(std::distance(views_.begin(), view));
  pictures_.push_back(std::move(taken));
}

void BenchImages::remove(std::size_t row) {
  std::erase_if(pictures_, [&](const Picture& picture) {
    if (picture.row != row) return false;
    bytes_ -= picture.image.size() + picture.difference.size();
    return true;
  });
}

bool is_evenly_chosen(std::size_t index, std::size_t count, std::size_t wanted) {
  const std::size_t number = std::min(count, wanted);
  for (std::size_t k = 0; k < number; ++k) {
    if (index == (2 * k + 1) * count / (2 * number)) return true;
  }
  return false;
}

store::RgbImage scaled_to_width(const store::RgbImage& image, int max_width) {
  if (image.width <= max_width) return image;
  const double scale = static_cast<double>(image.width) / max_width;
  store::RgbImage small{max_width, std::max(1, static_cast<int>(std::lround(image.height / scale))),
                        std::vector<std::uint8_t>()};
  small.values.reserve(static_cast<std::size_t>(small.width) * small.height * 3);
  const double down = static_cast<double>(image.height) / small.height;
  for (int y = 0; y < small.height; ++y) {
    const int y0 = static_cast<int>(y * down);
    const int y1 = std::clamp(static_cast<int>((y + 1) * down), y0 + 1, image.height);
    for (int x = 0; x < small.width; ++x) {
      const int x0 = static_cast<int>(x * scale);
      const int x1 = std::clamp(static_cast<int>((x + 1) * scale), x0 + 1, image.width);
      for (int channel = 0; channel < 3; ++channel) {
        int sum = 0;
        for (int v = y0; v < y1; ++v) {
          for (int u = x0; u < x1; ++u) {
            sum += image.values[(static_cast<std::size_t>(v) * image.width + u) * 3 +
                                static_cast<std::size_t>(channel)];
          }
        }
        const int count = (y1 - y0) * (x1 - x0);
        small.values.push_back(static_cast<std::uint8_t>((sum + count / 2) / count));
      }
    }
  }
  return small;
}

store::RgbImage difference_image(const store::RgbImage& image, const store::RgbImage& truth,
                                 std::span<const std::uint8_t> covered, int gain) {
  constexpr std::uint8_t kNotCovered = 48;
  store::RgbImage difference(image.width, image.height, kNotCovered);
  for (std::size_t i = 0; i < image.values.size(); ++i) {
    if (covered[i / 3] == 0) continue;
    const int error = std::abs(static_cast<int>(image.values[i]) - truth.values[i]);
    difference.values[i] = static_cast<std::uint8_t>(std::min(255, gain * error));
  }
  return difference;
}

}  // namespace raystage::evaluation
