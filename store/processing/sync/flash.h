// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/time.h"

namespace raystage::store {

/// A flash in one camera, which began after `after` and not after `until`. These are the times of
/// the last dark and of the first bright frame, for any event of an exposure that they mark.
struct FlashOnset {
  Nanoseconds after = 0, until = 0;
  double strength = 0;  ///< rise of the mean luminance, codes of 255
};

/// Returns the onsets. There the luminance exceeds the median of up to five frames before by more
/// than eight times its usual change (robust sigma) and by at least three codes. `times`:
/// corrected; frames with kExcludedTime or luminance NaN are ignored. `after` is moved back by the
/// part of a frame time in which a flash would stay below the threshold. `read_out`: from the
/// exposure of the first row to that of the last one; `times` are then those of the middle row, and
/// the light may have begun with any row.
std::vector<FlashOnset> find_flash_onsets(std::span<const Nanoseconds> times,
                                          std::span<const double> luminance,
                                          Nanoseconds read_out = 0);

/// The offset of one clock, measured by flashes.
struct FlashOffset {
  std::string group;                       ///< node or camera
  Nanoseconds offset = 0;                  ///< positive: ahead of the reference's clock
  std::optional<Nanoseconds> uncertainty;  ///< +-; none if no flash was detected
  int cameras = 0, flashes = 0;            ///< that the offset is measured from
};

struct FlashOffsets {
  std::vector<FlashOffset> groups;   ///< the first is the reference: offset 0
  std::vector<Nanoseconds> flashes;  ///< approximate times on the reference's clock
};

/// Returns the clock offsets of groups from flashes that the cameras observe. Each camera bounds
/// the onset to one frame time. Free-running cameras on one clock narrow it to the interval that
/// most of their bounds share. The difference of two clocks is within the sum of both intervals,
/// for every flash. `onsets[c]`: onsets of camera c; `group[c]`: its node or camera. A flash counts
/// if at least half of the cameras see it. Onsets within one second belong to one flash, so clocks
/// may differ by less than that, and flashes must be further apart. `name`: the take in errors.
/// Throws Error (bad input) if there is no flash.
FlashOffsets offsets_from_flashes(std::span<const std::vector<FlashOnset>> onsets,
                                  std::span<const std::string> group, std::string_view name);

}  // namespace raystage::store
