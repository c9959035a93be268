// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>

namespace raystage {

/// Watches pages that are mapped from a file for reading, during its lifetime. The kernel answers
/// access to a page that it cannot read (truncated file, disk error) with SIGBUS; a handler then
/// replaces the pages from there to the end of the range by zeros, and the access succeeds. Signals
/// for other addresses go to the handler that was there before, or end the process.
class MappedRange {
 public:
  /// `bytes`: as mmap() returned them; may be empty. Throws Error (failed) if more than 4096
  /// ranges are watched.
  explicit MappedRange(std::span<const std::byte> bytes);
  ~MappedRange();
  MappedRange(const MappedRange&) = delete;
  MappedRange& operator=(const MappedRange&) = delete;

  /// Returns whether pages were replaced by zeros.
  bool has_unread_pages() const;

 private:
  std::size_t slot_;
};

}  // namespace raystage
