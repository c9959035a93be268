// SPDX-License-Identifier: Apache-2.0
#include "compose/camera/gltf_timing.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "base/error.h"

namespace raystage::compose {
namespace {

double distance_to_frame(double frame) { return std::abs(frame - std::round(frame)); }

/// Returns whether the rounding of exporters and floats explains the distance from the nearest
/// frame.
bool is_at_frame(double frame) {
  constexpr double kExported = 0.01, kFloatRounding = 1.2e-7;  // in frames; of the frame number
  return distance_to_frame(frame) <= kExported + std::abs(frame) * kFloatRounding;
}

/// Returns the largest distance of a key from a frame, in frames.
double distance_to_frames(std::span<const double> key_seconds, double fps) {
  double most = 0;
  for (const double time : key_seconds) most = std::max(most, distance_to_frame(time * fps));
  return most;
}

/// Returns the rate of a file that states none, as documented for gltf_frames().
FrameRate unstated_rate(FrameRate shot, std::span<const double> key_seconds,
                        const std::filesystem::path& file, const std::string& where,
                        const std::string& what_to_do) {
  // Frame 1001 at 24 fps is frame 1000 at 24000/1001, and those after it differ by 0.001 each.
  constexpr double kExact = 2e-4;
  const FrameRate nominal{shot.numerator / 1000, 1};
  const double of_shot = distance_to_frames(key_seconds, shot.fps());
  if (shot.denominator == 1001 && of_shot > kExact && are_at_frames(key_seconds, nominal.fps()) &&
      distance_to_frames(key_seconds, nominal.fps()) < of_shot / 2) {
    return nominal;
  }
  if (are_at_frames(key_seconds, shot.fps())) return shot;
  constexpr std::array kUsual{FrameRate{24, 1}, FrameRate{25, 1},       FrameRate{24000, 1001},
                              FrameRate{30, 1}, FrameRate{30000, 1001}, FrameRate{48, 1},
                              FrameRate{50, 1}, FrameRate{60, 1},       FrameRate{60000, 1001},
                              FrameRate{90, 1}, FrameRate{120, 1}};
  const auto* const fits = std::ranges::find_if(
      kUsual, [&](FrameRate rate) { return are_at_frames(key_seconds, rate.fps()); });
  const std::string found = fits == kUsual.end() ? std::string("of no usual rate")
                            : fits->denominator == 1
                                ? fmt::format("at {} fps", fits->numerator)
                                : fmt::format("at {}/{} fps", fits->numerator, fits->denominator);
  throw Error::bad_input(
      fmt::format("the keys of {} are not at frames of {:.10g} fps, the shot's rate; they are "
                  "frames {}",
                  file.string(), shot.fps(), found),
      where, what_to_do);
}

}  // namespace

bool are_at_frames(std::span<const double> seconds, double fps) {
  return std::ranges::all_of(seconds, [fps](double time) { return is_at_frame(time * fps); });
}

double GltfFrames::frame(double seconds) const {
  const double frame = seconds * fps + zero;
  return is_at_frame(frame) ? std::round(frame) : frame;
}

GltfFrames gltf_frames(const GltfTiming& timing, std::span<const double> key_seconds,
                       const std::filesystem::path& file, const std::string& where,
                       const std::string& what_to_do) {
  GltfFrames frames;
  frames.fps = (timing.is_rate_stated
                    ? timing.frame_rate
                    : unstated_rate(timing.frame_rate, key_seconds, file, where, what_to_do))
                   .fps();
  if (timing.first_frame && !key_seconds.empty()) {
    frames.zero = *timing.first_frame - std::round(key_seconds.front() * frames.fps);
  }
  return frames;
}

}  // namespace raystage::compose
