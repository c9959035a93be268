// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace raystage::store {

/// Packs and unpacks frames. libjxl runs in processes of its own (sandbox/), as many as threads
/// call at once; they start with the first call. Thread-safe.
class FramePacker {
 public:
  /// Of a camera, pixels. Larger pictures are not accepted.
  struct Size {
    int width = 0, height = 0;
  };

  FramePacker();
  /// With this limit in place of time_limit(), for tests.
  explicit FramePacker(std::chrono::seconds limit);
  ~FramePacker();
  FramePacker(FramePacker&&) noexcept;
  FramePacker& operator=(FramePacker&&) noexcept;

  /// Returns how much of the processor's time libjxl may take for a frame. It depends on the
  /// effort: 9 takes 18 times as long as 7 (docs/benchmarks.md). `effort`: 1 to 9, when packing.
  static std::chrono::seconds time_limit(std::uint64_t pixels, int effort);

  /// A packed frame, or why the JPEG stays as it is.
  struct Packed {
    std::vector<std::byte> bytes;  ///< empty if refused
    std::string refusal;           ///< empty if packed
  };
  /// Returns the packed form of a JPEG after it was unpacked again and compared. `effort`: 1 to 9.
  /// A JPEG that libjxl does not accept, that does not return bit for bit, that does not become
  /// smaller, or that takes more than time_limit() is refused. `file`: for errors. Throws Error
  /// (failed) if libjxl cannot be run or does not get to run.
  Packed pack(std::span<const std::byte> jpeg, Size size, int effort,
              const std::filesystem::path& file) const;

  /// Returns the JPEG of a packed frame, which has the stated size and XXH3. Throws Error (bad
  /// input) if libjxl cannot unpack it or the JPEG differs, and Error (failed) if libjxl cannot be
  /// run or does not get to run, as where its process is stopped: that says nothing about the
  /// frame.
  std::vector<std::byte> unpack(std::span<const std::byte> packed, Size size,
                                const std::filesystem::path& file) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace raystage::store
