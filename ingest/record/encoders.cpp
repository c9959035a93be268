// SPDX-License-Identifier: Apache-2.0
#include "ingest/record/encoders.h"

#include <utility>

#include "schemas/error.h"

namespace raystage {

Encoders::Encoders(const JpegEncodeSettings& settings, int threads)
    // TBB counts the calling thread too, but sources never encode themselves: one worker more, and
    // no slot kept for callers.
    : settings_(settings),
      parallelism_(tbb::global_control::max_allowed_parallelism,
                   static_cast<std::size_t>(threads) + 1),
      arena_(threads, 0) {}

Encoders::~Encoders() { wait(); }

void Encoders::encode_one_of(FrameQueue& queue) {
  // Else tasks for frames that were given up would pile up where encoding never catches up.
  if (!queue.call_encoder()) return;
  handed_over_.fetch_add(1, std::memory_order_release);
  arena_.enqueue(group_.defer([this, &queue] {
    handed_over_.load(std::memory_order_acquire);
    work_on(queue);
    handed_back_.fetch_add(1, std::memory_order_release);
  }));
}

void Encoders::wait() {
  group_.wait();
  handed_back_.load(std::memory_order_acquire);
}

std::unique_ptr<RawJpegEncoder> Encoders::borrow() {
  {
    const std::scoped_lock lock(mutex_);
    if (!idle_.empty()) {
      auto encoder = std::move(idle_.back());
      idle_.pop_back();
      return encoder;
    }
  }
  return std::make_unique<RawJpegEncoder>(settings_);
}

void Encoders::work_on(FrameQueue& queue) {
  const FrameQueue::Frame frame = queue.start_encoding();
  if (!frame) return;  // given up meanwhile
  std::optional<std::vector<std::byte>> result;
  // Nothing may leave a TBB task; whatever goes wrong, the frame is recorded as missing.
  try {
    auto encoder = borrow();
    encoder->encode(frame->raw, result.emplace());
    const std::scoped_lock lock(mutex_);
    idle_.push_back(std::move(encoder));
  } catch (const std::exception&) {
    result.reset();
  }
  queue.finish_encoding(frame, std::move(result));
}

}  // namespace raystage
