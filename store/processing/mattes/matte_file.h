// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <vector>

#include "base/contained_path.h"
#include "sandbox/decoder_pool.h"
#include "store/take.h"

namespace raystage::store {

/// Returns the file TAKE/mattes/CAMERA/FRAME.png (docs/formats/mattes.md). `frame`: index into the
/// camera's archive.
ContainedPath matte_file(const Take& take, int camera, int frame);

/// Reads matte files in confined processes, which stay until the reader ends. Thread-safe.
class MatteReader {
 public:
  /// Returns the codes of a matte file, one byte per pixel. Throws Error (bad input) if the file is
  /// not a PNG of this size, and Error (failed) as sandbox::DecoderProcess does.
  std::vector<std::uint8_t> read(const ContainedPath& file, int width, int height) const;

 private:
  const sandbox::DecoderPool& decoders_for(int width, int height) const;

  // By the pixels that they accept, rounded up to a power of two.
  mutable std::map<std::uint64_t, sandbox::DecoderPool> decoders_;
  mutable std::mutex mutex_;
};

}  // namespace raystage::store
