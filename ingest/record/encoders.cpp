// SPDX-License-Identifier: Apache-2.0
#include "ingest/record/encoders.h"

#include <exception>
#include <optional>
#include <utility>

namespace raystage {
namespace {

void encode_one(FrameQueue& queue, RawJpegEncoder& encoder) {
  const FrameQueue::Frame frame = queue.start_encoding();
  if (!frame) return;  // given up meanwhile
  std::optional<std::vector<std::byte>> jpeg(std::in_place);
  // Nothing may end the thread; whatever goes wrong, the frame is recorded as missing.
  try {
    encoder.encode(frame->raw, *jpeg);
  } catch (const std::exception&) {
    jpeg.reset();
  }
  queue.finish_encoding(frame, std::move(jpeg));
}

}  // namespace

Encoders::Encoders(const JpegEncodeSettings& settings, int threads) {
  for (int i = 0; i < threads; ++i) encoders_.emplace_back(settings);
  for (RawJpegEncoder& encoder : encoders_) {
    threads_.emplace_back([this, &encoder](const std::stop_token& stop) { work(stop, encoder); });
  }
}

void Encoders::encode_one_of(FrameQueue& queue) {
  {
    const std::scoped_lock lock(mutex_);
    asked_.push_back(&queue);
    if (idle_ == 0) return;
  }
  asked_for_.notify_one();
}

void Encoders::wait() {
  std::unique_lock lock(mutex_);
  done_.wait(lock, [this] { return asked_.empty() && busy_ == 0; });
}

/// The queue whose turn it is; null at a stop.
FrameQueue* Encoders::next(const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  while (!stop.stop_requested()) {
    if (!asked_.empty()) {
      FrameQueue* queue = asked_.front();
      asked_.pop_front();
      ++busy_;
      return queue;
    }
    ++idle_;
    asked_for_.wait(lock, stop, [this] { return !asked_.empty(); });
    --idle_;
  }
  return nullptr;
}

void Encoders::work(const std::stop_token& stop, RawJpegEncoder& encoder) {
  while (FrameQueue* queue = next(stop)) {
    encode_one(*queue, encoder);
    const std::scoped_lock lock(mutex_);
    --busy_;
    if (asked_.empty() && busy_ == 0) done_.notify_all();
  }
}

}  // namespace raystage
