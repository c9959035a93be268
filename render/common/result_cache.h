// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <string>

namespace raystage {

/// What methods work out once and use for many views (depth maps, slabs, scenes), within a bound of
/// memory: least recently used out first. Thread-safe; a result is worked out once however many
/// threads ask for it at the same time: those that come meanwhile help with its parallel loops.
class ResultCache {
 public:
  explicit ResultCache(std::size_t budget_bytes);
  ~ResultCache();

  /// The result kept under `key`, or what `make` returns, kept from then on. The key names the
  /// result's type and all that it depends on. `make` says how much memory the result holds
  /// (`bytes`; one of 0 bytes is never thrown out); when it throws, nothing is kept, and every
  /// thread that waited throws too.
  template <class T>
  std::shared_ptr<const T> get(
      const std::string& key,
      const std::function<std::shared_ptr<const T>(std::size_t& bytes)>& make) {
    return std::static_pointer_cast<const T>(get_any(
        key, [&make](std::size_t& bytes) { return std::shared_ptr<const void>(make(bytes)); }));
  }

  std::size_t bytes_held() const;

 private:
  using Make = std::function<std::shared_ptr<const void>(std::size_t& bytes)>;
  std::shared_ptr<const void> get_any(const std::string& key, const Make& make);

  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace raystage
