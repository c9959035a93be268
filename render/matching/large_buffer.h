// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/mman.h>

#include <cstddef>
#include <cstdlib>
#include <memory>
#include <new>
#include <type_traits>

namespace raystage {

/// Uninitialised numbers by the megabyte. In pages of 2 MB where the system has them: with small
/// ones a fifth of a matching's time goes to the first touch of each.
template <class T>
class LargeBuffer {
  static_assert(std::is_trivial_v<T>);

 public:
  LargeBuffer() = default;
  /// Throws std::bad_alloc.
  explicit LargeBuffer(std::size_t count) {
    const bool is_large = bytes(count) >= 2 * kPage;
    data_.reset(static_cast<T*>(is_large ? std::aligned_alloc(kPage, bytes(count))
                                         : std::malloc(bytes(count))));  // NOLINT: owned at once
    if (!data_) throw std::bad_alloc();
    // An advice: as good if nobody takes it.
    if (is_large) madvise(data_.get(), bytes(count), MADV_HUGEPAGE);
  }
  /// Memory that so many take.
  static std::size_t bytes(std::size_t count) {
    const std::size_t needed = count * sizeof(T);
    return needed < 2 * kPage ? needed : (needed + kPage - 1) / kPage * kPage;
  }
  T* data() const { return data_.get(); }

 private:
  static constexpr std::size_t kPage = std::size_t{1} << 21;
  struct Free {
    void operator()(T* data) const { std::free(data); }  // NOLINT: from aligned_alloc
  };
  std::unique_ptr<T, Free> data_;
};

}  // namespace raystage
