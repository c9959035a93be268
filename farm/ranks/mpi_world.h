// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <vector>

namespace raystage::farm {

/// Message bytes, of any length.
using MessageBytes = std::vector<std::byte>;

/// What the messages of a rank took.
struct MessageCosts {
  std::int64_t messages_sent = 0, bytes_sent = 0;
  /// Processor time of polls that found nothing and of the sleeps between them: what waiting costs,
  /// seconds.
  double waiting_cpu_seconds = 0;
};

/// The ranks of an MPI job, and messages between them. Thread-safe: many threads may send and
/// receive at once, of which one at a time is within MPI (MPI_THREAD_SERIALIZED). No member blocks
/// within MPI: waiting threads poll and sleep in between, so that a rank that waits leaves the
/// processor to those that work.
class MpiWorld {
 public:
  /// MPI_Init_thread. One object per process. Throws Error (failed) where MPI offers no threads.
  MpiWorld(int* argc, char*** argv);
  /// MPI_Finalize, which waits for all ranks.
  ~MpiWorld();
  MpiWorld(const MpiWorld&) = delete;
  MpiWorld& operator=(const MpiWorld&) = delete;

  int rank() const;
  int size() const;

  /// Returns when the message may be changed. Messages from one rank to another with one tag arrive
  /// in order. `tag`: 0 to 2^30 - 1.
  void send(int to, int tag, std::span<const std::byte> message);
  /// Waits for the next message of a rank with this tag.
  MessageBytes receive(int from, int tag);

  /// Sends a message to each of `ranks`, of which this one is one, and returns those of each with
  /// this tag, in their order; the one to itself is returned as it is.
  std::vector<MessageBytes> exchange(int tag, std::span<const int> ranks,
                                     std::vector<MessageBytes> messages);

  struct Received {
    int from = 0;
    MessageBytes message;
  };
  /// Waits for the next message of any rank with this tag; nothing once `stop` is requested.
  std::optional<Received> receive_any(int tag, const std::stop_token& stop);

  /// Ends the job: every rank. For errors that no other rank would notice.
  [[noreturn]] void abort(int exit_code);

  MessageCosts costs() const;

 private:
  struct State;
  struct Sending;
  struct Receiving;
  std::unique_ptr<State> state_;
};

}  // namespace raystage::farm
