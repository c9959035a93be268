// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

namespace raystage::farm {

/// The bytes of a message, of any length.
using MessageBytes = std::vector<std::byte>;

/// The costs of a rank's messages.
struct MessageCosts {
  std::int64_t bytes_sent = 0;
  /// CPU time of polls that found nothing and of the sleeps between them, in seconds.
  double waiting_cpu_seconds = 0;
};

/// The ranks of an MPI job, and messages between them. Thread-safe: many threads may send and
/// receive at once, but only one at a time is within MPI (MPI_THREAD_SERIALIZED). No member blocks
/// within MPI: a waiting thread polls and sleeps in between, which leaves the processor to ranks
/// that work.
class MpiWorld {
 public:
  /// Calls MPI_Init_thread. Only one object per process. Throws Error (failed) if the MPI library
  /// has no thread support.
  MpiWorld(int* argc, char*** argv);
  /// Calls MPI_Finalize, which waits for all ranks.
  ~MpiWorld();
  MpiWorld(const MpiWorld&) = delete;
  MpiWorld& operator=(const MpiWorld&) = delete;

  int rank() const;
  int size() const;

  /// Sends a message and returns when its bytes may be changed. Messages from one rank to another
  /// with the same tag arrive in order. `tag`: 0 to 2^30 - 1.
  void send(int to, int tag, std::span<const std::byte> message);
  /// Waits for the next message of a rank with this tag and returns it.
  MessageBytes receive(int from, int tag);

  /// Sends one message to each of `ranks`, which include this rank, and returns the message of each
  /// with this tag, in the order of `ranks`. The message to itself is returned unchanged.
  std::vector<MessageBytes> exchange(int tag, std::span<const int> ranks,
                                     std::vector<MessageBytes> messages);

  struct Received {
    int from = 0;
    MessageBytes message;
  };
  /// Waits for the next message of any rank with this tag and returns it, or nothing once `stop` is
  /// requested.
  std::optional<Received> receive_any(int tag, const std::stop_token& stop);

  /// Ends all ranks of the job, and writes the reason, if there is one, to stderr as MPI does. For
  /// errors that no other rank would notice.
  [[noreturn]] void abort(int exit_code, const std::string& reason = {});

  MessageCosts costs() const;

 private:
  struct State;
  struct Sending;
  struct Receiving;
  std::unique_ptr<State> state_;
};

}  // namespace raystage::farm
