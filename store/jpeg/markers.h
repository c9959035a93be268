// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>

namespace raystage::store {

inline constexpr int kMarkerDht = 0xC4, kMarkerSoi = 0xD8, kMarkerEoi = 0xD9, kMarkerSos = 0xDA,
                     kMarkerDqt = 0xDB, kMarkerDri = 0xDD, kMarkerApp0 = 0xE0, kMarkerApp14 = 0xEE;

/// One marker of a JPEG file with its parameters. ITU-T T.81 B.1.
struct Marker {
  int code = 0;                     ///< second byte
  std::size_t offset = 0;           ///< of its 0xFF
  std::size_t end = 0;              ///< one past its parameters
  std::span<const std::byte> body;  ///< the parameters after the length; empty without
};

/// Iterates over the markers of a JPEG file. Throws Error (bad input) with the byte offset if one
/// is invalid.
class MarkerReader {
 public:
  MarkerReader(std::span<const std::byte> jpeg, std::string_view name) : jpeg_(jpeg), name_(name) {}

  /// Reads SOI, the first marker of a JPEG.
  void read_soi();
  /// Returns the next marker. Fill bytes before it are skipped; other bytes are an error.
  Marker next();
  void seek(std::size_t offset) { at_ = offset; }
  /// Moves from the first entropy-coded byte to the first marker other than a restart marker.
  void skip_scan();

  [[noreturn]] void fail(std::size_t offset, std::string what_happened) const;

 private:
  std::span<const std::byte> jpeg_;
  std::string_view name_;
  std::size_t at_ = 0;
};

}  // namespace raystage::store
