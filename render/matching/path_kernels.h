// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace raystage {

/// What a path costs so far is kept per path in a line of u16, worked on in place: from element 0
/// on one per plane, then kInvalidCost up to and beyond the stride, so that the planes' neighbours
/// may be read without a look at where they end.
inline constexpr std::uint16_t kInvalidCost = 0x3FFF;
inline constexpr int kLinePadding = 32;  ///< elements of kInvalidCost before and behind each line

inline constexpr int kPathsPerPass = 4;    ///< worked on at once: half of the eight
inline constexpr int kMaxPathPixels = 64;  ///< in a run

/// A run of pixels of one row, in the order of the paths' sweep (which may be right to left).
struct PathRun {
  int count = 0, planes = 0;
  const std::uint8_t* cost = nullptr;  ///< of the first pixel
  std::uint16_t* sums = nullptr;       ///< of costs over the paths; laid out as the costs
  std::ptrdiff_t pixel_step = 0;       ///< elements from a pixel's costs and sums to the next's
  /// Of each path: the line through the first pixel, its least value, the way to the next pixel's.
  std::array<std::uint16_t*, kPathsPerPass> line{}, least{};
  std::array<std::ptrdiff_t, kPathsPerPass> line_step{}, least_step{};
  int p1 = 0;
  const std::uint16_t* p2 = nullptr;  ///< kPathsPerPass values a pixel
};

/// Moves the paths on through the run and stores the sum of the four.
void start_path_sums(const PathRun& run);
/// Moves the paths on, adds them to the sums, and finds each pixel's plane of least sum, the first
/// of equals.
void complete_path_sums(const PathRun& run, int* best);

/// sums[i] += add[i] - take[i].
void update_running_sums(std::uint16_t* sums, const std::uint8_t* add, const std::uint8_t* take,
                         std::size_t count);
/// sums[i] += add[i] - take[i].
void update_running_window(std::uint16_t* window, const std::uint16_t* add,
                           const std::uint16_t* take, std::size_t count);
/// Index of the least, the first of equals. Elements up to the next multiple of 32 are read.
int index_of_min(const std::uint16_t* sums, int planes);

/// The instruction set in use.
const char* matching_target();

}  // namespace raystage
