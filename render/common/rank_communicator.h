// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

namespace raystage {

/// The hosts that contribute to a view together, as one of them sees them, for methods that need
/// what other hosts found (DistributionMode::kLockstep): all hosts take the same steps in the same
/// order.
class RankCommunicator {
 public:
  using Message = std::vector<std::byte>;

  virtual ~RankCommunicator() = default;
  /// This host's number; host 0 puts the view together.
  virtual int host() const = 0;
  virtual int hosts() const = 0;
  /// What exchange() may append to a message: long ones leave room for it, to spare a copy.
  static constexpr std::size_t kTrailerBytes = 1;
  /// Sends a message to each host, by number, and returns those that each sent to this one; the one
  /// to itself is returned as it is. Returns when all have come. Throws Error (failed) where a host
  /// has left the view.
  virtual std::vector<Message> exchange(std::vector<Message> messages) const = 0;
};

}  // namespace raystage
