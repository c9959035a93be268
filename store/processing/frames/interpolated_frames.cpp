// SPDX-License-Identifier: Apache-2.0
#include "store/processing/frames/interpolated_frames.h"

#include <limits>
#include <stdexcept>

namespace raystage::store {

int InterpolatedFrames::number_of(const Sources& sources) {
  const std::scoped_lock lock(mutex_);
  const auto [found, is_new] = known_.try_emplace(sources);
  if (!is_new) {
    by_use_.splice(by_use_.begin(), by_use_, found->second.position);
    return found->second.number;
  }
  // After 2^30 frames numbers are used again, when those that had them are long forgotten.
  found->second.number = next_;
  next_ = next_ == std::numeric_limits<int>::max() ? kFirst : next_ + 1;
  by_use_.push_front(sources);
  found->second.position = by_use_.begin();
  by_number_[found->second.number] = sources;
  const int number = found->second.number;
  if (known_.size() > kMaxFrames) {
    const auto oldest = known_.find(by_use_.back());
    by_number_.erase(oldest->second.number);
    known_.erase(oldest);
    by_use_.pop_back();
  }
  return number;
}

InterpolatedFrames::Sources InterpolatedFrames::sources_of(int frame) const {
  const std::scoped_lock lock(mutex_);
  const auto found = by_number_.find(frame);
  if (found == by_number_.end()) throw std::logic_error("an interpolated frame is not known");
  return found->second;
}

}  // namespace raystage::store
