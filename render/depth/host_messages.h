// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstring>
#include <span>
#include <vector>

#include "base/error.h"
#include "render/common/rank_communicator.h"

// Arrays of numbers in messages between hosts, without padding. All hosts run the same program on
// the same kind of machine.

namespace raystage::render::depth {

template <class T>
void append_values(std::span<const T> values, RankCommunicator::Message& message) {
  const auto bytes = std::as_bytes(values);
  message.insert(message.end(), bytes.begin(), bytes.end());
}

/// Moves the first `to.size()` values of `rest` to `to`. Throws Error (failed) if `rest` is too
/// short.
template <class T>
void take_values(std::span<const std::byte>& rest, std::span<T> to) {
  if (to.size() > rest.size() / sizeof(T)) {
    throw Error::failed("a message from another host is too short", "method depth",
                        "Check that all hosts run the same program");
  }
  if (!to.empty()) std::memcpy(to.data(), rest.data(), to.size_bytes());
  rest = rest.subspan(to.size_bytes());
}

template <class T>
std::vector<T> take_values(std::span<const std::byte>& rest, std::size_t count) {
  if (count > rest.size() / sizeof(T)) count = rest.size() / sizeof(T) + 1;  // throws, small
  std::vector<T> values(count);
  take_values(rest, std::span<T>(values));
  return values;
}

}  // namespace raystage::render::depth
