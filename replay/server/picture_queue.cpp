// SPDX-License-Identifier: Apache-2.0
#include "replay/server/picture_queue.h"

#include <utility>

namespace raystage::replay {

void PictureQueue::push(int stream, std::int64_t request, std::vector<std::byte> message) {
  const auto [newest, is_first] = newest_.try_emplace(stream, request);
  if (request < newest->second) {
    ++dropped_;
    return;
  }
  newest->second = request;
  if (!waiting_.insert_or_assign(stream, std::move(message)).second) ++dropped_;
}

std::optional<std::vector<std::byte>> PictureQueue::pop() {
  if (waiting_.empty()) return std::nullopt;
  return std::move(waiting_.extract(waiting_.begin()).mapped());
}

}  // namespace raystage::replay
