// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/time.h"

namespace raystage {

/// Sudden light in one camera: it began after `after` and not after `until` (times of the last dark
/// and of the first bright frame, whatever part of an exposure they mark).
struct LightJump {
  Nanoseconds after = 0, until = 0;
  double strength = 0;  ///< rise of the mean luminance, codes of 255
};

/// Where the luminance of a camera rises above that of the frames before, by more than eight times
/// what it usually changes and by at least three codes. `times` as resynchronised; frames at
/// kNoTime or of luminance NaN count as not there. `after` is moved back by the part of a frame
/// time in which a flash could stay below the threshold.
std::vector<LightJump> find_light_jumps(std::span<const Nanoseconds> times,
                                        std::span<const double> luminance);

/// What a flash says of one clock.
struct FlashOffset {
  std::string group;                       ///< node or camera
  Nanoseconds offset = 0;                  ///< ahead of the reference's clock
  std::optional<Nanoseconds> uncertainty;  ///< +-; nothing where it saw no flash
  int cameras = 0, flashes = 0;            ///< that it stands on
};

struct FlashOffsets {
  std::vector<FlashOffset> groups;   ///< the first is the reference: offset 0
  std::vector<Nanoseconds> flashes;  ///< about when, on the reference's clock
};

/// Clock offsets from flashes that all cameras see. Each camera leaves one frame time in which the
/// light began; free-running cameras of one clock divide it among them: it began where most of
/// their intervals meet. The difference of two clocks lies within the sum of what is left for both,
/// for every flash. `jumps[c]` and `group[c]` are of camera c. A flash counts if at least half of
/// the cameras saw it; those of one flash lie within one second, so clocks may be that far apart
/// and flashes must be further. Throws Error (bad input) where there was none.
FlashOffsets offsets_from_flashes(std::span<const std::vector<LightJump>> jumps,
                                  std::span<const std::string> group, std::string_view name);

}  // namespace raystage
