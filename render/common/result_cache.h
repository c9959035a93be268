// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <string>

#include "store/processing/frames/interpolated_frames.h"

namespace raystage::render {

/// Caches results that methods compute once and use for many views (depth maps, slabs, scenes),
/// within a memory budget. The least recently used results are evicted first. Thread-safe: a result
/// is computed once, however many threads request it at the same time; waiting threads help with
/// its parallel loops.
class ResultCache {
 public:
  explicit ResultCache(std::size_t budget_bytes);
  ~ResultCache();

  /// Returns the result cached under `key`, or the result of `make`, which is then cached. The key
  /// names the result's type and all that it depends on. `make` sets `bytes`, the memory that the
  /// result holds; a result of 0 bytes is never evicted. If `make` throws, nothing is cached, and
  /// every waiting thread throws too. If `make` was cancelled (Cancelled), waiting threads that
  /// were not make the result themselves.
  template <class T>
  std::shared_ptr<const T> get(
      const std::string& key,
      const std::function<std::shared_ptr<const T>(std::size_t& bytes)>& make) {
    return std::static_pointer_cast<const T>(get_any(
        key, [&make](std::size_t& bytes) { return std::shared_ptr<const void>(make(bytes)); }));
  }

  std::size_t bytes_held() const;
  /// Returns the numbers of interpolated frames, which keys contain: renderers that share the cache
  /// share them.
  const std::shared_ptr<store::InterpolatedFrames>& interpolated_frames() const {
    return interpolated_frames_;
  }

 private:
  using Make = std::function<std::shared_ptr<const void>(std::size_t& bytes)>;
  std::shared_ptr<const void> get_any(const std::string& key, const Make& make);
  std::shared_ptr<const void> get_or_make(const std::string& key, const Make& make);

  struct State;
  std::unique_ptr<State> state_;
  std::shared_ptr<store::InterpolatedFrames> interpolated_frames_ =
      std::make_shared<store::InterpolatedFrames>();
};

}  // namespace raystage::render
