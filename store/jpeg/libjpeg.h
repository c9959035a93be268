// SPDX-License-Identifier: Apache-2.0
#pragma once

// jpeglib.h needs these headers before it.
// clang-format off
#include <cstddef>
#include <cstdio>
#include <jpeglib.h>
// clang-format on

#include <csetjmp>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

namespace raystage::store::libjpeg {

/// Carries libjpeg's errors out of its C frames by longjmp; throw_error() throws them as Error.
/// Corrupt-data warnings count as errors; warnings about known harmless headers do not.
struct ErrorManager {
  jpeg_error_mgr base;  // first: libjpeg returns a pointer to it
  std::jmp_buf return_point;
  const JOCTET* input = nullptr;  ///< start of the compressed data
  bool damaged = false;
  bool out_of_memory = false;
  char text[JMSG_LENGTH_MAX] = {};

  ErrorManager();
  ErrorManager(const ErrorManager&) = delete;
  ErrorManager& operator=(const ErrorManager&) = delete;
};

/// Runs `body` and returns false if libjpeg reported an error. `body` must not own anything across
/// libjpeg calls: longjmp runs no destructors.
template <typename Body>
bool guarded(ErrorManager& errors, const Body& body) {
  errors.damaged = false;
  errors.text[0] = '\0';
  if (setjmp(errors.return_point) != 0) return false;
  body();
  return true;
}

[[noreturn]] void throw_error(const ErrorManager& errors, std::string_view name);

class Decompressor {
 public:
  Decompressor();
  ~Decompressor();
  Decompressor(const Decompressor&) = delete;
  Decompressor& operator=(const Decompressor&) = delete;

  /// Sets the data to decode, which must outlive the decompression. Call within guarded().
  void set_input(std::span<const std::byte> jpeg);

  jpeg_decompress_struct info;
  ErrorManager errors;
};

class Compressor {
 public:
  Compressor();
  ~Compressor();
  Compressor(const Compressor&) = delete;
  Compressor& operator=(const Compressor&) = delete;

  jpeg_compress_struct info;
  ErrorManager errors;
};

/// Makes `info` write into a buffer, which must outlive the compression and grows as needed. Its
/// bytes are not cleared between files: pass the same buffer again.
class VectorDestination {
 public:
  VectorDestination(jpeg_compress_struct& info, std::vector<std::byte>& room);
  /// Returns the file after the compression has finished.
  std::span<const std::byte> file() const { return std::span(room_).first(size_); }

 private:
  static void init(j_compress_ptr info);
  static boolean grow(j_compress_ptr info);
  static void finish(j_compress_ptr info);

  jpeg_destination_mgr base_;  // first: libjpeg hands back a pointer to it
  std::vector<std::byte>& room_;
  std::size_t size_ = 0;
};

/// Returns whether the `count` bytes before `end` are filler (0x00 or 0xFF). Some cameras pad the
/// end of a scan to a fixed size.
bool is_filler(const std::uint8_t* begin, const std::uint8_t* end, std::size_t count);

}  // namespace raystage::store::libjpeg
