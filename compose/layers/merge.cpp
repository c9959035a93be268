// SPDX-License-Identifier: Apache-2.0
// Composites layers with "over" of premultiplied colours (Porter and Duff, SIGGRAPH 1984), in layer
// order or per pixel by depth. Input: layer images of one size, scene-linear; output: one image
// with merged ids. Its depth and AOVs are those of the sample at half of the pixel's alpha. The
// result of merge() must match merge_reference() of the tests up to rounding. Cost: pixels x layers
// (squared by depth, at worst).
#include "compose/layers/merge.h"

#include <algorithm>
#include <array>
#include <limits>
#include <numeric>
#include <utility>
#include <vector>

#include "base/parallel.h"

namespace raystage::compose {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

/// Returns the AOVs of all layers, each once, with their empty values.
std::vector<Aov> all_aovs(std::span<const MergedLayer> layers, std::size_t pixels) {
  std::vector<Aov> all;
  for (const MergedLayer& layer : layers) {
    for (const Aov& aov : layer.image->aovs) {
      const auto same = [&](const Aov& known) {
        return known.layer == aov.layer && known.channels == aov.channels;
      };
      if (std::ranges::any_of(all, same)) continue;
      all.push_back({aov.layer, aov.channels, aov.is_colour, aov.empty_value, {}});
      all.back().values.assign(pixels * aov.channels.size(), aov.empty_value);
    }
  }
  return all;
}

/// Returns the layer's AOV for each merged one; null if it has none.
std::vector<const Aov*> aovs_of(const LayerImage& image, const std::vector<Aov>& all) {
  std::vector<const Aov*> found;
  for (const Aov& wanted : all) {
    const auto own = std::ranges::find_if(image.aovs, [&](const Aov& aov) {
      return aov.layer == wanted.layer && aov.channels == wanted.channels;
    });
    found.push_back(own == image.aovs.end() ? nullptr : &*own);
  }
  return found;
}

/// State of one merge that all pixels share.
struct Merge {
  std::span<const MergedLayer> layers;
  MergeOrder order;
  std::vector<std::vector<const Aov*>> aovs;  ///< of each layer
  LayerImage& result;

  /// Writes the layers at a pixel from front to back to `front_first`.
  void sort(std::size_t pixel, std::vector<int>& front_first) const {
    front_first.resize(layers.size());
    std::iota(front_first.rbegin(), front_first.rend(), 0);
    if (order == MergeOrder::kLayerOrder) return;
    // Insertion sort: few layers, usually in order already, no allocation.
    const auto z = [&](int layer) { return layers[layer].image->z[pixel]; };
    for (std::size_t i = 1; i < front_first.size(); ++i) {
      for (std::size_t k = i; k > 0 && z(front_first[k]) < z(front_first[k - 1]); --k) {
        std::swap(front_first[k], front_first[k - 1]);
      }
    }
  }

  /// Writes the colours of a pixel. Returns the layer at which half of its alpha is reached, or -1.
  int blend(std::size_t pixel, const std::vector<int>& front_first,
            std::vector<float>& alphas) const {
    std::array<float, 4> sum{};
    float through = 1;  // transmittance of the layers so far
    alphas.assign(layers.size(), 0.0F);
    for (const int i : front_first) {
      if (through <= 0) break;
      const MergedLayer& layer = layers[i];
      const float* rgba = layer.image->rgba.data() + 4 * pixel;
      if (!layer.is_holdout) {
        for (std::size_t c = 0; c < 4; ++c) sum[c] += through * rgba[c];
        alphas[i] = through * rgba[3];
      }
      through *= 1 - rgba[3];
    }
    std::copy(sum.begin(), sum.end(), result.rgba.data() + 4 * pixel);
    float reached = 0;
    for (const int i : front_first) {
      reached += alphas[i];
      if (reached > 0 && 2 * reached >= sum[3]) return i;
    }
    return -1;
  }

  /// Writes the visible shares of objects. `alphas`: contributions of layers, from blend().
  void add_ids(std::size_t pixel, const std::vector<float>& alphas,
               std::vector<std::array<float, 2>>& seen) const {
    if (result.ids.empty()) return;
    seen.clear();
    float whole = 0;
    for (std::size_t i = 0; i < layers.size(); ++i) {
      if (!(alphas[i] > 0)) continue;
      whole += alphas[i];
      const float* ids = layers[i].image->ids.data() + 2 * kIdRanks * pixel;
      for (std::size_t rank = 0; rank < kIdRanks && ids[2 * rank + 1] > 0; ++rank) {
        const float id = ids[2 * rank], share = alphas[i] * ids[2 * rank + 1];
        const auto same = std::ranges::find_if(seen, [&](const auto& s) { return s[0] == id; });
        if (same == seen.end()) {
          seen.push_back({id, share});
        } else {
          (*same)[1] += share;
        }
      }
    }
    std::ranges::stable_sort(seen, [](const auto& a, const auto& b) { return a[1] > b[1]; });
    float* ids = result.ids.data() + 2 * kIdRanks * pixel;
    for (std::size_t rank = 0; rank < std::min(kIdRanks, seen.size()); ++rank) {
      ids[2 * rank] = seen[rank][0];
      ids[2 * rank + 1] = seen[rank][1] / whole;
    }
  }

  void copy_data(std::size_t pixel, int layer) const {
    result.z[pixel] = layer < 0 ? kInfinity : layers[layer].image->z[pixel];
    if (layer < 0) return;
    for (std::size_t a = 0; a < result.aovs.size(); ++a) {
      const Aov* from = aovs[layer][a];
      if (from == nullptr) continue;
      // A loop is faster than std::copy for one to three values.
      const std::size_t width = from->channels.size();
      const float* values = from->values.data() + pixel * width;
      float* merged = result.aovs[a].values.data() + pixel * width;
      for (std::size_t c = 0; c < width; ++c) merged[c] = values[c];
    }
  }
};

LayerImage empty_result(std::span<const MergedLayer> layers) {
  const LayerImage& first = *layers.front().image;
  LayerImage result = transparent_layer_image(first.width, first.height);
  result.aovs = all_aovs(layers, result.pixels());
  if (!first.ids.empty()) result.ids.assign(result.pixels() * 2 * kIdRanks, 0.0F);
  for (const MergedLayer& layer : layers) render::add_notes(layer.image->notes, result.notes);
  return result;
}

}  // namespace

LayerImage merge(std::span<const MergedLayer> layers, MergeOrder order) {
  LayerImage result = empty_result(layers);
  Merge merge{layers, order, {}, result};
  for (const MergedLayer& layer : layers) merge.aovs.push_back(aovs_of(*layer.image, result.aovs));
  constexpr int kRowsPerTask = 8;
  const auto width = static_cast<std::size_t>(result.width);
  parallel_for(tbb::blocked_range<int>(0, result.height, kRowsPerTask),
               [&](const tbb::blocked_range<int>& rows) {
                 std::vector<int> front_first;
                 std::vector<float> alphas;
                 std::vector<std::array<float, 2>> seen;
                 merge.sort(0, front_first);
                 for (std::size_t pixel = static_cast<std::size_t>(rows.begin()) * width;
                      pixel < static_cast<std::size_t>(rows.end()) * width; ++pixel) {
                   if (order == MergeOrder::kDepth) merge.sort(pixel, front_first);
                   merge.copy_data(pixel, merge.blend(pixel, front_first, alphas));
                   merge.add_ids(pixel, alphas, seen);
                 }
               });
  return result;
}

}  // namespace raystage::compose
