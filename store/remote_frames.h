// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "store/jpeg/decode.h"
#include "store/jpeg/layout.h"

namespace raystage::store {

/// The encoded bytes of a frame, owned or kept in memory by their owner.
class FrameBytes {
 public:
  FrameBytes() = default;
  /// Refers to bytes that are owned elsewhere and outlive this object.
  explicit FrameBytes(std::span<const std::byte> bytes) : bytes_(bytes) {}
  explicit FrameBytes(const std::shared_ptr<const std::vector<std::byte>>& owned)
      : owned_(owned, owned->data()), bytes_(*owned) {}
  /// Refers to the first `size` bytes of memory that it keeps alive.
  FrameBytes(const std::shared_ptr<const std::byte[]>& owned, std::size_t size)
      : owned_(owned, owned.get()), bytes_(owned.get(), size) {}

  std::span<const std::byte> bytes() const { return bytes_; }
  // Implicit: the class represents a span.
  operator std::span<const std::byte>() const { return bytes_; }  // NOLINT(*-explicit-*)
  auto begin() const { return bytes_.begin(); }
  auto end() const { return bytes_.end(); }
  const std::byte* data() const { return bytes_.data(); }
  std::size_t size() const { return bytes_.size(); }

 private:
  std::shared_ptr<const void> owned_;
  std::span<const std::byte> bytes_;
};

/// Reads the frames of a camera whose archive is on another host. Thread-safe. Members throw Error
/// (failed or bad input) if the host does not answer or cannot read the frame.
class RemoteFrames {
 public:
  virtual ~RemoteFrames() = default;
  /// Returns all of an encoded frame: its JPEG, or the file of a picture of more than 8 bits.
  virtual FrameBytes jpeg(int frame) const = 0;
  /// Returns the structure of a JPEG, without its bytes.
  virtual JpegLayout layout(int frame) const = 0;
  /// Returns a JPEG with only the bytes before the scan and the segments that hold `wanted` MCUs;
  /// all other bytes are 0. `layout`: of the frame.
  virtual FrameBytes jpeg_part(int frame, const JpegLayout& layout,
                               const McuMask& wanted) const = 0;
  /// Returns ArchiveReader::recorded_xxh3() of a frame that is encoded as video there; 0 of others.
  virtual std::uint64_t recorded_xxh3(int /*frame*/) const { return 0; }
};

}  // namespace raystage::store
