// SPDX-License-Identifier: Apache-2.0
#include "store/processing/sync/flash.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "base/error.h"
#include "store/processing/sync/lattice.h"
#include "store/timeline.h"

namespace raystage {
namespace {

constexpr std::size_t kBefore = 5;  // frames that say how dark it was
constexpr double kUsual = 8, kMadToSigma = 1.4826, kLeastRise = 3;
constexpr Nanoseconds kOneFlash = kNanosecondsPerSecond;

struct Interval {
  Nanoseconds low = 0, high = 0;
  Nanoseconds middle() const { return low + (high - low) / 2; }
};

struct Meeting {
  Interval interval;
  int count = 0;
};

// Where most intervals meet; the widest such place.
Meeting meeting_of(std::span<const Interval> intervals) {
  struct Edge {
    Nanoseconds at;
    int change;
  };
  std::vector<Edge> edges;
  for (const Interval& interval : intervals) {
    edges.push_back({interval.low, 1});
    edges.push_back({interval.high, -1});
  }
  // Intervals that touch meet.
  std::ranges::sort(edges, [](const Edge& a, const Edge& b) {
    return a.at != b.at ? a.at < b.at : a.change > b.change;
  });
  Meeting best;
  int count = 0;
  for (std::size_t i = 0; i + 1 < edges.size(); ++i) {
    count += edges[i].change;
    const Interval here{edges[i].at, edges[i + 1].at};
    const bool wider = here.high - here.low > best.interval.high - best.interval.low;
    if (count > best.count || (count == best.count && wider)) best = {here, count};
  }
  return best;
}

struct Seen {
  std::size_t camera = 0;
  FlashOnset jump;
};

// Jumps of all cameras, one flash after the other; of one camera the strongest.
std::vector<std::vector<Seen>> flashes_of(std::span<const std::vector<FlashOnset>> jumps) {
  std::vector<Seen> all;
  for (std::size_t c = 0; c < jumps.size(); ++c) {
    for (const FlashOnset& jump : jumps[c]) all.push_back({c, jump});
  }
  std::ranges::stable_sort(all, {}, [](const Seen& seen) { return seen.jump.until; });
  std::vector<std::vector<Seen>> flashes;
  for (const Seen& seen : all) {
    if (flashes.empty() || seen.jump.until - flashes.back().front().jump.until > kOneFlash) {
      flashes.emplace_back();
    }
    auto& flash = flashes.back();
    const auto same = std::ranges::find(flash, seen.camera, &Seen::camera);
    if (same == flash.end()) {
      flash.push_back(seen);
    } else if (same->jump.strength < seen.jump.strength) {
      same->jump = seen.jump;
    }
  }
  std::erase_if(flashes, [&](const auto& flash) { return 2 * flash.size() < jumps.size(); });
  return flashes;
}

}  // namespace

std::vector<FlashOnset> find_flash_onsets(std::span<const Nanoseconds> times,
                                          std::span<const double> luminance) {
  std::vector<std::size_t> frames;
  for (std::size_t i = 0; i < times.size(); ++i) {
    if (times[i] != kExcludedTime && std::isfinite(luminance[i])) frames.push_back(i);
  }
  std::vector<double> rises;
  for (std::size_t k = 1; k < frames.size(); ++k) {
    std::vector<double> before;
    for (std::size_t b = k - std::min(k, kBefore); b < k; ++b) {
      before.push_back(luminance[frames[b]]);
    }
    rises.push_back(luminance[frames[k]] - quantile(before, 0.5));
  }
  std::vector<double> sizes;
  for (const double rise : rises) sizes.push_back(std::abs(rise));
  const double threshold = std::max(kLeastRise, kUsual * kMadToSigma * quantile(sizes, 0.5));

  std::vector<FlashOnset> jumps;
  for (std::size_t r = 0; r < rises.size(); ++r) {
    if (rises[r] < threshold) continue;
    FlashOnset jump;
    jump.after = times[frames[r]];
    jump.until = times[frames[r + 1]];
    const std::size_t first = r;
    while (r < rises.size() && rises[r] >= threshold) {
      if (r - first < kBefore) jump.strength = std::max(jump.strength, rises[r]);
      ++r;
    }
    const double unseen = threshold / jump.strength;
    jump.after -= std::llround(unseen * static_cast<double>(jump.until - jump.after));
    jumps.push_back(jump);
  }
  return jumps;
}

FlashOffsets offsets_from_flashes(std::span<const std::vector<FlashOnset>> jumps,
                                  std::span<const std::string> group, std::string_view name) {
  const auto flashes = flashes_of(jumps);
  if (flashes.empty()) {
    throw Error::bad_input(
        "no flash was seen by at least half of the cameras", std::string(name),
        "Narrow the time window to the flash, or give the clock offsets of the nodes")
        .concerning({"flash_window", "node_offsets"});
  }
  FlashOffsets result;
  for (const std::string& member : group) {
    if (std::ranges::find(result.groups, member, &FlashOffset::group) == result.groups.end()) {
      result.groups.push_back({.group = member, .uncertainty = std::nullopt});
    }
  }
  // Per flash and group, when the light began by the group's clock.
  std::vector<std::map<std::string, Meeting>> began;
  for (const auto& flash : flashes) {
    std::map<std::string, std::vector<Interval>> intervals;
    for (const Seen& seen : flash) {
      intervals[group[seen.camera]].push_back({seen.jump.after, seen.jump.until});
    }
    auto& meetings = began.emplace_back();
    for (const auto& [member, list] : intervals) {
      const Meeting meeting = meeting_of(list);
      // Cameras that do not agree say nothing.
      if (5 * static_cast<std::size_t>(meeting.count) >= 3 * list.size())
        meetings[member] = meeting;
    }
  }
  const std::string& reference = result.groups.front().group;
  for (FlashOffset& offset : result.groups) {
    std::vector<Interval> differences;
    for (const auto& meetings : began) {
      const auto own = meetings.find(offset.group), other = meetings.find(reference);
      if (own == meetings.end() || other == meetings.end()) continue;
      differences.push_back({own->second.interval.low - other->second.interval.high,
                             own->second.interval.high - other->second.interval.low});
      offset.cameras = std::max(offset.cameras, own->second.count);
    }
    if (differences.empty()) continue;
    const Meeting meeting = meeting_of(differences);
    offset.flashes = meeting.count;
    if (offset.group == reference) {
      offset.uncertainty = 0;
      continue;
    }
    offset.offset = meeting.interval.middle();
    offset.uncertainty = (meeting.interval.high - meeting.interval.low + 1) / 2;
  }
  for (const auto& meetings : began) {
    const auto found = meetings.find(reference);
    if (found != meetings.end()) result.flashes.push_back(found->second.interval.middle());
  }
  if (result.flashes.empty()) {
    throw Error::bad_input("no flash was seen by the cameras of " +
                               (reference.empty() ? std::string("the first node") : reference),
                           std::string(name),
                           "Its clock is the reference: give the clock offsets of the nodes")
        .concerning({"node_offsets"});
  }
  return result;
}

}  // namespace raystage
