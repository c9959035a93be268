// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stop_token>
#include <utility>

namespace raystage {

/// Thrown where work stops because its result is no longer wanted. No std::exception, so that code
/// which reports failures and continues does not mistake it for one.
struct Cancelled {};

/// Makes parallel loops (base/parallel.h) in its scope, and the loops nested in their bodies on any
/// thread, throw Cancelled as soon as a stop is requested. A viewer renders within such a scope and
/// ends it when the user has moved on.
///
/// The scope is bound to the thread, as TBB binds nested loops to their task group: the methods of
/// reconstruction need no parameter for it. TBB's own cancellation is not used, because loops that
/// it cancels return incomplete results without an error (see ParallelLoop).
class CancellationScope {
 public:
  explicit CancellationScope(std::stop_token token);
  ~CancellationScope();
  CancellationScope(const CancellationScope&) = delete;
  CancellationScope& operator=(const CancellationScope&) = delete;

 private:
  std::stop_token token_;
  const std::stop_token* outer_;
};

/// Returns the token of the innermost scope of this thread; without a scope, one that is never
/// stopped.
std::stop_token current_cancellation();

/// Throws Cancelled if a stop is requested in the innermost scope of this thread.
void throw_if_cancelled();

}  // namespace raystage
