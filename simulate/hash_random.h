// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <numbers>

namespace raystage {

/// Random numbers as a function of what they are for (seed, camera, frame, ...): no generator is
/// shared, so the order in which threads ask does not matter. The mixing is splitmix64's.
inline std::uint64_t splitmix64(std::uint64_t x) {
  x += 0x9E3779B97F4A7C15U;
  x = (x ^ (x >> 30U)) * 0xBF58476D1CE4E5B9U;
  x = (x ^ (x >> 27U)) * 0x94D049BB133111EBU;
  return x ^ (x >> 31U);
}

/// A hash of numbers that name a purpose.
inline std::uint64_t hash_keys(std::initializer_list<std::uint64_t> names) {
  std::uint64_t hash = 0;
  for (const std::uint64_t name : names) hash = splitmix64(hash ^ name);
  return hash;
}

/// A stream of numbers for one purpose.
class HashRandom {
 public:
  HashRandom(std::initializer_list<std::uint64_t> names) : state_(hash_keys(names)) {}

  std::uint64_t bits() { return splitmix64(state_++); }
  /// [0, 1)
  double uniform() { return static_cast<double>(bits() >> 11U) * 0x1p-53; }
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  /// Mean 0, standard deviation 1 (Box and Muller).
  double normal() {
    const double radius = std::sqrt(-2 * std::log(1 - uniform()));
    return radius * std::cos(2 * std::numbers::pi * uniform());
  }

 private:
  std::uint64_t state_;
};

}  // namespace raystage
