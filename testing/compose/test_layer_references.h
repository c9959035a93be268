// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <span>
#include <vector>

#include "compose/layers/deep_image.h"
#include "compose/layers/merge.h"

namespace raystage::testing {

/// Returns the reference of merge(): sorts and composites the samples of each pixel in a list.
inline compose::LayerImage merge_reference(std::span<const compose::MergedLayer> layers,
                                           compose::MergeOrder order) {
  struct Sample {
    double z, alpha;
    const compose::LayerImage* image;
  };
  compose::LayerImage result = merge(layers, order);  // its size and AOVs
  std::ranges::fill(result.rgba, 0.0F);
  std::ranges::fill(result.z, std::numeric_limits<float>::infinity());
  std::ranges::fill(result.ids, 0.0F);
  for (compose::Aov& aov : result.aovs) std::ranges::fill(aov.values, aov.empty_value);
  for (std::size_t pixel = 0; pixel < result.pixels(); ++pixel) {
    std::vector<compose::MergedLayer> rear_first(layers.begin(), layers.end());
    if (order == compose::MergeOrder::kDepth) {
      std::stable_sort(rear_first.begin(), rear_first.end(),
                       [&](const compose::MergedLayer& a, const compose::MergedLayer& b) {
                         return a.image->z[pixel] > b.image->z[pixel];
                       });
    }
    std::array<double, 4> sum{};
    std::vector<Sample> samples;
    for (const compose::MergedLayer& layer : rear_first) {
      const float* rgba = layer.image->rgba.data() + 4 * pixel;
      const double through = 1 - static_cast<double>(rgba[3]);
      for (std::size_t c = 0; c < 4; ++c) {
        sum[c] = sum[c] * through + (layer.is_holdout ? 0 : static_cast<double>(rgba[c]));
      }
      for (Sample& behind : samples) behind.alpha *= through;
      if (!layer.is_holdout) samples.push_back({layer.image->z[pixel], rgba[3], layer.image});
    }
    for (std::size_t c = 0; c < 4; ++c) result.rgba[4 * pixel + c] = static_cast<float>(sum[c]);
    if (!result.ids.empty()) {
      std::map<float, double> shares;  // by object id
      for (const Sample& sample : samples) {
        for (std::size_t rank = 0; rank < compose::kIdRanks; ++rank) {
          const float* id = sample.image->ids.data() + 2 * (compose::kIdRanks * pixel + rank);
          if (sample.alpha * double{id[1]} > 0) shares[id[0]] += sample.alpha * double{id[1]};
        }
      }
      double whole = 0;
      for (const Sample& sample : samples) whole += sample.alpha;
      for (std::size_t rank = 0; rank < compose::kIdRanks && !shares.empty(); ++rank) {
        const auto most =
            std::ranges::max_element(shares, {}, [](const auto& share) { return share.second; });
        result.ids[2 * (compose::kIdRanks * pixel + rank)] = most->first;
        result.ids[2 * (compose::kIdRanks * pixel + rank) + 1] =
            static_cast<float>(most->second / whole);
        shares.erase(most);
      }
    }
    double reached = 0;
    for (auto sample = samples.rbegin(); sample != samples.rend(); ++sample) {
      reached += sample->alpha;
      if (!(reached > 0 && 2 * reached >= sum[3])) continue;
      result.z[pixel] = static_cast<float>(sample->z);
      for (compose::Aov& aov : result.aovs) {
        for (const compose::Aov& own : sample->image->aovs) {
          if (own.layer != aov.layer || own.channels != aov.channels) continue;
          const std::size_t width = own.channels.size();
          std::copy_n(own.values.data() + pixel * width, width, aov.values.data() + pixel * width);
        }
      }
      break;
    }
  }
  return result;
}

/// Returns the composite ("over") of all samples: R, G, B, A per pixel.
inline std::vector<float> flatten(const compose::DeepImage& image) {
  std::vector<float> rgba((image.begin.size() - 1) * 4);
  for (std::size_t pixel = 0; pixel + 1 < image.begin.size(); ++pixel) {
    float through = 1;
    for (std::uint32_t i = image.begin[pixel]; i < image.begin[pixel + 1]; ++i) {
      const float* sample = image.samples[i].rgba;
      for (std::size_t c = 0; c < 4; ++c) rgba[4 * pixel + c] += through * sample[c];
      through *= 1 - sample[3];
    }
  }
  return rgba;
}

}  // namespace raystage::testing
