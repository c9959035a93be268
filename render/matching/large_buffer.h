// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/mman.h>

#include <cstddef>
#include <cstdlib>
#include <memory>
#include <new>
#include <type_traits>

namespace raystage {

/// Uninitialised numbers by the tens of megabytes. In pages of 2 MB where the system has them: with
/// small ones a fifth of a matching's time goes to the first touch of each.
template <class T>
class LargeBuffer {
  static_assert(std::is_trivial_v<T>);

 public:
  LargeBuffer() = default;
  /// Throws std::bad_alloc.
  explicit LargeBuffer(std::size_t count) {
    const std::size_t bytes = (count * sizeof(T) + kPage - 1) / kPage * kPage;
    data_.reset(static_cast<T*>(std::aligned_alloc(kPage, bytes)));
    if (!data_) throw std::bad_alloc();
    madvise(data_.get(), bytes, MADV_HUGEPAGE);  // an advice: as good if nobody takes it
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
