// SPDX-License-Identifier: Apache-2.0
#include "base/cancellation.h"

namespace raystage {
namespace {

thread_local const std::stop_token* innermost = nullptr;

}  // namespace

CancellationScope::CancellationScope(std::stop_token token)
    : token_(std::move(token)), outer_(std::exchange(innermost, &token_)) {}

CancellationScope::~CancellationScope() { innermost = outer_; }

std::stop_token current_cancellation() {
  return innermost != nullptr ? *innermost : std::stop_token();
}

void throw_if_cancelled() {
  if (innermost != nullptr && innermost->stop_requested()) throw Cancelled();
}

}  // namespace raystage
