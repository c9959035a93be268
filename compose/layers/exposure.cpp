// SPDX-License-Identifier: Apache-2.0
// Averages images over the exposure of a frame. With h = 1 / 2^level, the trapezoidal rule over
// [0, 1] is h ((f(0) + f(1)) / 2 + the sum of f at the other multiples of h), so that each level
// uses all images of those before. Images are added in a fixed order: the result does not depend on
// the number of threads. Cost: one pass over the pixels for each image.
#include "compose/layers/exposure.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <functional>
#include <utility>

#include "base/parallel.h"

namespace raystage::compose {
namespace {

constexpr std::size_t kGrain = 4096;
/// Objects of a pixel whose coverage is summed: more than are named in the end, so that those that
/// come late are not lost.
constexpr std::size_t kIdSlots = 2 * kIdRanks;

bool is_averaged(const Aov& aov) {
  return aov.is_colour || (aov.layer == "lf" && aov.channels.front() == "coverage");
}

const Aov* find_aov(const LayerImage& image, const Aov& wanted) {
  const auto found = std::ranges::find_if(image.aovs, [&](const Aov& aov) {
    return aov.layer == wanted.layer && aov.channels == wanted.channels;
  });
  return found == image.aovs.end() ? nullptr : &*found;
}

void for_ranges(std::size_t count, const auto& body) {
  const std::size_t ranges = (count + kGrain - 1) / kGrain;
  parallel_for(std::size_t{0}, ranges, [&](std::size_t range) {
    body(range * kGrain, std::min(count, (range + 1) * kGrain));
  });
}

void add_weighted(const render::PixelValues& values, float weight, render::PixelValues& sums) {
  for_ranges(values.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) sums[i] += weight * values[i];
  });
}

/// Adds to the coverage of an object of a pixel. If there are kIdSlots others, the least one is
/// left out.
void add_coverage(float id, float coverage, float* ids) {
  if (!(coverage > 0)) return;
  std::size_t least = 0;
  for (std::size_t rank = 0; rank < kIdSlots; ++rank) {
    const float* known = ids + 2 * rank;
    if (known[1] <= 0 || known[0] == id) {
      ids[2 * rank] = id;
      ids[2 * rank + 1] += coverage;
      return;
    }
    if (known[1] < ids[2 * least + 1]) least = rank;
  }
  if (coverage <= ids[2 * least + 1]) return;
  ids[2 * least] = id;
  ids[2 * least + 1] = coverage;
}

void sort_by_coverage(float* ids) {
  std::array<std::pair<float, float>, kIdSlots> pairs;
  for (std::size_t rank = 0; rank < kIdSlots; ++rank) {
    pairs[rank] = {ids[2 * rank], ids[2 * rank + 1]};
  }
  std::ranges::stable_sort(pairs, std::greater(), &std::pair<float, float>::second);
  for (std::size_t rank = 0; rank < kIdSlots; ++rank) {
    ids[2 * rank] = pairs[rank].first;
    ids[2 * rank + 1] = pairs[rank].second;
  }
}

}  // namespace

std::size_t ExposureAverage::bytes_per_pixel(std::size_t averaged_aov_channels, bool has_ids) {
  constexpr std::size_t kSums = 2, kColours = 4;
  return sizeof(float) *
         (kSums * (kColours + averaged_aov_channels) + (has_ids ? 2 * kIdSlots : 0));
}

ExposureAverage::ExposureAverage(LayerImage middle) : middle_(std::move(middle)) {
  for (Sums* sums : {&before_, &level_}) sums->rgba.assign(middle_.rgba.size(), 0.0F);
  for (std::size_t i = 0; i < middle_.aovs.size(); ++i) prepare_aov(i);
  add(middle_, 1);
}

void ExposureAverage::prepare_aov(std::size_t index) {
  const Aov& aov = middle_.aovs[index];
  if (!is_averaged(aov)) return;
  averaged_.push_back(index);
  for (Sums* sums : {&before_, &level_}) sums->aovs.emplace_back(aov.values.size(), 0.0F);
}

void ExposureAverage::add_aovs_of(const LayerImage& image) {
  for (const Aov& aov : image.aovs) {
    if (find_aov(middle_, aov) != nullptr) continue;
    middle_.aovs.push_back({aov.layer, aov.channels, aov.is_colour, aov.empty_value, {}});
    middle_.aovs.back().values.assign(aov.values.size(), aov.empty_value);
    prepare_aov(middle_.aovs.size() - 1);
  }
  if (id_coverage_.empty()) id_coverage_.assign(image.ids.size() / kIdRanks * kIdSlots, 0.0F);
}

void ExposureAverage::fill_empty_pixels(const LayerImage& image) {
  std::vector<const Aov*> of_image;
  for (const Aov& aov : middle_.aovs) {
    of_image.push_back(is_averaged(aov) ? nullptr : find_aov(image, aov));
  }
  for_ranges(image.pixels(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t pixel = begin; pixel < end; ++pixel) {
      const bool is_empty = std::isinf(middle_.z[pixel]) && middle_.rgba[4 * pixel + 3] <= 0;
      if (!is_empty || std::isinf(image.z[pixel])) continue;
      middle_.z[pixel] = image.z[pixel];
      for (std::size_t i = 0; i < of_image.size(); ++i) {
        if (of_image[i] == nullptr) continue;
        const std::size_t channels = middle_.aovs[i].channels.size();
        std::copy_n(&of_image[i]->values[channels * pixel], channels,
                    &middle_.aovs[i].values[channels * pixel]);
      }
    }
  });
}

void ExposureAverage::add(const LayerImage& image, float weight) {
  add_aovs_of(image);
  fill_empty_pixels(image);
  add_weighted(image.rgba, weight, level_.rgba);
  for (std::size_t i = 0; i < averaged_.size(); ++i) {
    // Without the AOV nothing is there: its values are 0.
    const Aov* aov = find_aov(image, middle_.aovs[averaged_[i]]);
    if (aov != nullptr) add_weighted(aov->values, weight, level_.aovs[i]);
  }
  if (image.ids.empty()) return;
  for_ranges(image.pixels(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t pixel = begin; pixel < end; ++pixel) {
      const float alpha = image.rgba[4 * pixel + 3];
      const float* ids = &image.ids[2 * kIdRanks * pixel];
      for (std::size_t rank = 0; rank < kIdRanks; ++rank) {
        add_coverage(ids[2 * rank], weight * alpha * ids[2 * rank + 1],
                     &id_coverage_[2 * kIdSlots * pixel]);
      }
    }
  });
}

std::optional<float> ExposureAverage::end_level() {
  ++levels_;
  std::optional<float> change;
  if (levels_ > 1) {
    // (before + level) h - before 2 h
    const auto step = static_cast<float>(std::ldexp(1.0, -levels_));
    std::atomic<float> largest = 0;
    for_ranges(level_.rgba.size(), [&](std::size_t begin, std::size_t end) {
      float of_range = 0;
      for (std::size_t i = begin; i < end; ++i) {
        const float now = (before_.rgba[i] + level_.rgba[i]) * step;
        const float changed = std::abs((level_.rgba[i] - before_.rgba[i]) * step);
        of_range = std::max(of_range, changed / std::max(1.0F, std::abs(now)));
      }
      float known = largest;
      while (of_range > known && !largest.compare_exchange_weak(known, of_range)) {
      }
    });
    change = largest;
  }
  add_weighted(level_.rgba, 1, before_.rgba);
  std::ranges::fill(level_.rgba, 0.0F);
  for (std::size_t i = 0; i < averaged_.size(); ++i) {
    add_weighted(level_.aovs[i], 1, before_.aovs[i]);
    std::ranges::fill(level_.aovs[i], 0.0F);
  }
  return change;
}

LayerImage ExposureAverage::finish() && {
  const auto step = static_cast<float>(std::ldexp(1.0, -levels_));
  const auto average = [&](const render::PixelValues& sums, render::PixelValues& values) {
    for_ranges(sums.size(), [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) values[i] = sums[i] * step;
    });
  };
  average(before_.rgba, middle_.rgba);
  for (std::size_t i = 0; i < averaged_.size(); ++i) {
    average(before_.aovs[i], middle_.aovs[averaged_[i]].values);
  }
  if (!id_coverage_.empty()) middle_.ids.assign(middle_.pixels() * 2 * kIdRanks, 0.0F);
  for (std::size_t pixel = 0; !id_coverage_.empty() && pixel < middle_.pixels(); ++pixel) {
    float* ids = &id_coverage_[2 * kIdSlots * pixel];
    sort_by_coverage(ids);
    const float alpha = middle_.rgba[4 * pixel + 3];
    for (std::size_t rank = 0; rank < kIdRanks; ++rank) {
      if (!(ids[2 * rank + 1] > 0)) continue;
      middle_.ids[2 * (kIdRanks * pixel + rank)] = ids[2 * rank];
      middle_.ids[2 * (kIdRanks * pixel + rank) + 1] = ids[2 * rank + 1] * step / alpha;
    }
  }
  return std::move(middle_);
}

}  // namespace raystage::compose
