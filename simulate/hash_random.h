// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <numbers>

namespace raystage::simulate {

/// Mixes 64 bits as splitmix64 does. Random numbers are hashes of their purpose (seed, camera,
/// frame, ...), so that they do not depend on the order of threads.
inline std::uint64_t splitmix64(std::uint64_t x) {
  x += 0x9E3779B97F4A7C15U;
  x = (x ^ (x >> 30U)) * 0xBF58476D1CE4E5B9U;
  x = (x ^ (x >> 27U)) * 0x94D049BB133111EBU;
  return x ^ (x >> 31U);
}

/// Returns the hash of a sequence of keys, for example seed, purpose and camera.
inline std::uint64_t hash_keys(std::initializer_list<std::uint64_t> keys) {
  std::uint64_t hash = 0;
  for (const std::uint64_t key : keys) hash = splitmix64(hash ^ key);
  return hash;
}

/// A stream of random numbers for one purpose, which the keys name.
class HashRandom {
 public:
  HashRandom(std::initializer_list<std::uint64_t> keys) : state_(hash_keys(keys)) {}

  std::uint64_t bits() { return splitmix64(state_++); }
  /// Returns a number in [0, 1), evenly distributed.
  double uniform() { return static_cast<double>(bits() >> 11U) * 0x1p-53; }
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  /// Returns a normally distributed number of mean 0 and standard deviation 1 (Box and Muller).
  double normal() {
    const double radius = std::sqrt(-2 * std::log(1 - uniform()));
    return radius * std::cos(2 * std::numbers::pi * uniform());
  }

 private:
  std::uint64_t state_;
};

}  // namespace raystage::simulate
