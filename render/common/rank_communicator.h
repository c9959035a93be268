// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

namespace raystage::render {

/// Exchanges messages among the ranks that contribute to a view, for methods that need intermediate
/// results of other ranks (DistributionMode::kLockstep). All ranks take the same steps in the same
/// order.
class RankCommunicator {
 public:
  using Message = std::vector<std::byte>;

  virtual ~RankCommunicator() = default;
  /// Returns the number of this rank; rank 0 assembles the view.
  virtual int rank() const = 0;
  virtual int size() const = 0;
  /// Bytes that exchange() may append to a message. Long messages should reserve them, to avoid a
  /// copy.
  static constexpr std::size_t kTrailerBytes = 1;
  /// Sends one message to each rank, by number, and returns the messages that the ranks sent to
  /// this one. The message to itself is returned unchanged. Blocks until all have arrived. Throws
  /// Error (failed) where a rank has left the view.
  virtual std::vector<Message> exchange(std::vector<Message> messages) const = 0;
};

}  // namespace raystage::render
