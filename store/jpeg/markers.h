// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>

namespace raystage {

inline constexpr int kMarkerDht = 0xC4, kMarkerSoi = 0xD8, kMarkerEoi = 0xD9, kMarkerSos = 0xDA,
                     kMarkerDqt = 0xDB, kMarkerDri = 0xDD, kMarkerApp0 = 0xE0, kMarkerApp14 = 0xEE;

/// One marker of a JPEG file with its parameters. ITU-T T.81 B.1.
struct Marker {
  int code = 0;                     ///< second byte
  std::size_t offset = 0;           ///< of its 0xFF
  std::size_t end = 0;              ///< one past its parameters
  std::span<const std::byte> body;  ///< the parameters after the length; empty without
};

/// Walks from marker to marker. Throws Error (bad input) at the byte where that fails.
class MarkerReader {
 public:
  MarkerReader(std::span<const std::byte> jpeg, std::string_view name) : jpeg_(jpeg), name_(name) {}

  /// Past SOI, which a JPEG begins with.
  void expect_start();
  /// The next marker; other bytes before it are an error, fill bytes are not.
  Marker next();
  void seek(std::size_t offset) { at_ = offset; }
  /// From the first entropy-coded byte to the marker after the last, restart markers aside.
  void skip_scan();

  [[noreturn]] void fail(std::size_t offset, std::string what_happened) const;

 private:
  std::span<const std::byte> jpeg_;
  std::string_view name_;
  std::size_t at_ = 0;
};

}  // namespace raystage
