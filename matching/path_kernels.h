// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace raystage::matching {

/// The accumulated costs of a path are a line of u16 that is updated in place. It has one element
/// per plane from element 0 on, then kInvalidCost up to and beyond the stride. The padding allows
/// neighbours of planes to be read without bounds checks.
inline constexpr std::uint16_t kInvalidCost = 0x3FFF;
inline constexpr int kLinePadding = 32;  ///< elements of kInvalidCost before and behind each line

inline constexpr int kPathsPerPass = 4;    ///< paths processed at once: half of the eight
inline constexpr int kMaxPathPixels = 64;  ///< pixels of a run

/// A run of pixels of one row, in the order of the paths' sweep (which may be right to left).
struct PathRun {
  int count = 0, planes = 0;
  const std::uint8_t* cost = nullptr;  ///< costs of the first pixel
  std::uint16_t* sums = nullptr;       ///< sums over the paths; same layout as the costs
  std::ptrdiff_t pixel_step = 0;  ///< elements from a pixel's costs and sums to the next pixel's
  /// Per path: the line through the first pixel, its minimum, and the steps to the next pixel's.
  std::array<std::uint16_t*, kPathsPerPass> line{}, least{};
  std::array<std::ptrdiff_t, kPathsPerPass> line_step{}, least_step{};
  int p1 = 0;
  const std::uint16_t* p2 = nullptr;  ///< kPathsPerPass values per pixel
};

/// Advances the paths through the run and stores the sum of the four.
void start_path_sums(const PathRun& run);
/// Advances the paths, adds them to the sums and sets `best` to each pixel's plane with the least
/// sum, the first at a tie. Must match semi_global_match_reference(), as start_path_sums().
void complete_path_sums(const PathRun& run, int* best);

/// Computes sums[i] += add[i] - take[i].
void update_running_sums(std::uint16_t* sums, const std::uint8_t* add, const std::uint8_t* take,
                         std::size_t count);
/// Computes window[i] += add[i] - take[i].
void update_running_window(std::uint16_t* window, const std::uint16_t* add,
                           const std::uint16_t* take, std::size_t count);
/// Returns the index of the minimum, the first at a tie. Elements up to the next multiple of 32 are
/// read.
int index_of_min(const std::uint16_t* sums, int planes);

/// Returns the name of the instruction set in use.
const char* matching_target();

}  // namespace raystage::matching
