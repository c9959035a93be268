// SPDX-License-Identifier: Apache-2.0
// Measures clock offsets by flashes of light (docs/resync.md). An onset is a rise of a camera's
// mean luminance above a robust threshold (MAD of the rises). Each onset bounds the start of the
// flash to one frame time; the interval that most cameras of a group share narrows it. The offset
// of two groups is the middle of the largest overlap of their differences over all flashes. Times
// in ns. Cost: O(frames) per camera, O(cameras log cameras) per flash.
#include "store/processing/sync/flash.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "base/error.h"
#include "store/processing/sync/lattice.h"
#include "store/timeline.h"

namespace raystage::store {
namespace {

constexpr std::size_t kPreviousFrames = 5;  // whose median is the luminance before
constexpr double kSigmas = 8, kMadToSigma = 1.4826, kMinRise = 3;
constexpr Nanoseconds kOneFlash = kNanosecondsPerSecond;

struct Interval {
  Nanoseconds low = 0, high = 0;
  Nanoseconds middle() const { return low + (high - low) / 2; }
};

struct Overlap {
  Interval interval;
  int count = 0;
};

// Returns the interval that most of the intervals share; of several, the widest.
Overlap largest_overlap(std::span<const Interval> intervals) {
  struct Edge {
    Nanoseconds at;
    int change;
  };
  std::vector<Edge> edges;
  for (const Interval& interval : intervals) {
    edges.push_back({interval.low, 1});
    edges.push_back({interval.high, -1});
  }
  // Intervals that touch overlap.
  std::ranges::sort(edges, [](const Edge& a, const Edge& b) {
    return a.at != b.at ? a.at < b.at : a.change > b.change;
  });
  Overlap best;
  int count = 0;
  for (std::size_t i = 0; i + 1 < edges.size(); ++i) {
    count += edges[i].change;
    const Interval here{edges[i].at, edges[i + 1].at};
    const bool wider = here.high - here.low > best.interval.high - best.interval.low;
    if (count > best.count || (count == best.count && wider)) best = {here, count};
  }
  return best;
}

struct CameraOnset {
  std::size_t camera = 0;
  FlashOnset onset;
};

// Returns the onsets of each flash; of each camera the strongest.
std::vector<std::vector<CameraOnset>> flashes_of(std::span<const std::vector<FlashOnset>> onsets) {
  std::vector<CameraOnset> all;
  for (std::size_t c = 0; c < onsets.size(); ++c) {
    for (const FlashOnset& onset : onsets[c]) all.push_back({c, onset});
  }
  std::ranges::stable_sort(all, {}, [](const CameraOnset& o) { return o.onset.until; });
  std::vector<std::vector<CameraOnset>> flashes;
  for (const CameraOnset& o : all) {
    if (flashes.empty() || o.onset.until - flashes.back().front().onset.until > kOneFlash) {
      flashes.emplace_back();
    }
    auto& flash = flashes.back();
    const auto same = std::ranges::find(flash, o.camera, &CameraOnset::camera);
    if (same == flash.end()) {
      flash.push_back(o);
    } else if (same->onset.strength < o.onset.strength) {
      same->onset = o.onset;
    }
  }
  std::erase_if(flashes, [&](const auto& flash) { return 2 * flash.size() < onsets.size(); });
  return flashes;
}

}  // namespace

std::vector<FlashOnset> find_flash_onsets(std::span<const Nanoseconds> times,
                                          std::span<const double> luminance, Nanoseconds read_out) {
  std::vector<std::size_t> frames;
  for (std::size_t i = 0; i < times.size(); ++i) {
    if (times[i] != kExcludedTime && std::isfinite(luminance[i])) frames.push_back(i);
  }
  std::vector<double> rises;
  for (std::size_t k = 1; k < frames.size(); ++k) {
    std::vector<double> before;
    for (std::size_t b = k - std::min(k, kPreviousFrames); b < k; ++b) {
      before.push_back(luminance[frames[b]]);
    }
    rises.push_back(luminance[frames[k]] - quantile(before, 0.5));
  }
  std::vector<double> sizes;
  for (const double rise : rises) sizes.push_back(std::abs(rise));
  const double threshold = std::max(kMinRise, kSigmas * kMadToSigma * quantile(sizes, 0.5));

  std::vector<FlashOnset> onsets;
  for (std::size_t r = 0; r < rises.size(); ++r) {
    if (rises[r] < threshold) continue;
    FlashOnset onset;
    onset.after = times[frames[r]];
    onset.until = times[frames[r + 1]];
    const std::size_t first = r;
    while (r < rises.size() && rises[r] >= threshold) {
      if (r - first < kPreviousFrames) onset.strength = std::max(onset.strength, rises[r]);
      ++r;
    }
    const double undetected = threshold / onset.strength;
    onset.after -= std::llround(undetected * static_cast<double>(onset.until - onset.after));
    onset.after -= read_out / 2;
    onset.until += read_out / 2;
    onsets.push_back(onset);
  }
  return onsets;
}

FlashOffsets offsets_from_flashes(std::span<const std::vector<FlashOnset>> onsets,
                                  std::span<const std::string> group, std::string_view name) {
  const auto flashes = flashes_of(onsets);
  if (flashes.empty()) {
    throw Error::bad_input(
        "no flash was detected in at least half of the cameras", std::string(name),
        "Narrow the time window to the flash, or give the clock offsets of the nodes")
        .concerning({"flash_window", "node_offsets"});
  }
  FlashOffsets result;
  for (const std::string& member : group) {
    if (std::ranges::find(result.groups, member, &FlashOffset::group) == result.groups.end()) {
      result.groups.push_back({.group = member, .uncertainty = std::nullopt});
    }
  }
  // Per flash and group: the start of the flash on the group's clock.
  std::vector<std::map<std::string, Overlap>> began;
  for (const auto& flash : flashes) {
    std::map<std::string, std::vector<Interval>> intervals;
    for (const CameraOnset& o : flash) {
      intervals[group[o.camera]].push_back({o.onset.after, o.onset.until});
    }
    auto& overlaps = began.emplace_back();
    for (const auto& [member, list] : intervals) {
      const Overlap overlap = largest_overlap(list);
      // Groups whose cameras do not agree are ignored.
      if (5 * static_cast<std::size_t>(overlap.count) >= 3 * list.size())
        overlaps[member] = overlap;
    }
  }
  const std::string& reference = result.groups.front().group;
  for (FlashOffset& offset : result.groups) {
    std::vector<Interval> differences;
    for (const auto& overlaps : began) {
      const auto own = overlaps.find(offset.group), other = overlaps.find(reference);
      if (own == overlaps.end() || other == overlaps.end()) continue;
      differences.push_back({own->second.interval.low - other->second.interval.high,
                             own->second.interval.high - other->second.interval.low});
      offset.cameras = std::max(offset.cameras, own->second.count);
    }
    if (differences.empty()) continue;
    const Overlap overlap = largest_overlap(differences);
    offset.flashes = overlap.count;
    if (offset.group == reference) {
      offset.uncertainty = 0;
      continue;
    }
    offset.offset = overlap.interval.middle();
    offset.uncertainty = (overlap.interval.high - overlap.interval.low + 1) / 2;
  }
  for (const auto& overlaps : began) {
    const auto found = overlaps.find(reference);
    if (found != overlaps.end()) result.flashes.push_back(found->second.interval.middle());
  }
  if (result.flashes.empty()) {
    throw Error::bad_input("no flash was detected in the cameras of " +
                               (reference.empty() ? std::string("the first node") : reference),
                           std::string(name),
                           "Its clock is the reference: give the clock offsets of the nodes")
        .concerning({"node_offsets"});
  }
  return result;
}

}  // namespace raystage::store
