// SPDX-License-Identifier: Apache-2.0
// The only file that calls MPI. MPI counts have 32 bits, so long messages are sent in pieces: a
// piece of exactly kPiece bytes is followed by another one with the same tag.
#include "farm/ranks/mpi_world.h"

#define OMPI_SKIP_MPICXX 1  // only the C interface
#include <mpi.h>
#include <time.h>

#include <algorithm>
#include <cassert>
#include <chrono>
#include <cstdio>
#include <mutex>
#include <thread>

#include "base/error.h"

namespace raystage::farm {
namespace {

/// Sleeps for 20 microseconds, then twice as long each time, up to 500.
class PollPause {
 public:
  void sleep() {
    std::this_thread::sleep_for(pause_);
    pause_ = std::min(2 * pause_, kLongest);
  }

 private:
  static constexpr std::chrono::microseconds kLongest{500};
  std::chrono::microseconds pause_{20};
};

constexpr std::size_t kPiece = std::size_t{1} << 30;

/// The result of a poll.
enum class Progress : std::uint8_t { kNone, kSome, kDone };

bool is_complete(MPI_Request& request) {
  int done = 0;
  MPI_Test(&request, &done, MPI_STATUS_IGNORE);
  return done != 0;
}

/// Starts to receive a message that MPI_Improbe has found.
MPI_Request start_to_receive(MPI_Message& found, const MPI_Status& status,
                             std::vector<std::byte>& piece) {
  int count = 0;
  MPI_Request request = MPI_REQUEST_NULL;
  MPI_Get_count(&status, MPI_BYTE, &count);
  piece.resize(count);
  MPI_Imrecv(piece.data(), count, MPI_BYTE, &found, &request);
  return request;
}

double thread_cpu_seconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * now.tv_nsec;
}

}  // namespace

struct MpiWorld::State {
  mutable std::mutex mutex;  // held while a thread is within MPI; also guards costs
  int rank = 0, size = 1;
  MessageCosts costs;

  /// Calls poll() with the mutex held until it returns kDone.
  template <class Poll>
  void wait_for_all(const Poll& poll) {
    PollPause pause;
    double waited = 0;  // CPU seconds of polls that found nothing and the sleeps after them
    while (true) {
      const double start = thread_cpu_seconds();
      {
        const std::scoped_lock lock(mutex);
        const Progress progress = poll();
        if (progress == Progress::kDone) {
          costs.waiting_cpu_seconds += waited;
          return;
        }
        if (progress == Progress::kSome) {
          pause = {};
          continue;
        }
      }
      pause.sleep();
      waited += thread_cpu_seconds() - start;
    }
  }

  /// Calls poll() with the mutex held until it returns true.
  template <class Poll>
  void wait_until(const Poll& poll) {
    wait_for_all([&] { return poll() ? Progress::kDone : Progress::kNone; });
  }

  MPI_Request start_to_send(int to, int tag, std::span<const std::byte> piece) {
    MPI_Request request = MPI_REQUEST_NULL;
    MPI_Isend(piece.data(), static_cast<int>(piece.size()), MPI_BYTE, to, tag, MPI_COMM_WORLD,
              &request);
    costs.bytes_sent += static_cast<std::int64_t>(piece.size());
    return request;
  }

  void wait_for(MPI_Request& request) {
    wait_until([&] { return is_complete(request); });
  }

  /// Receives a message that MPI_Improbe has found, without blocking within MPI.
  std::vector<std::byte> receive_piece(MPI_Message found, const MPI_Status& status) {
    MPI_Request request = MPI_REQUEST_NULL;
    std::vector<std::byte> piece;
    {
      const std::scoped_lock lock(mutex);
      request = start_to_receive(found, status, piece);
    }
    wait_for(request);
    return piece;
  }

  /// Receives the pieces after the first one and returns the whole message.
  MessageBytes receive_rest(int from, int tag, MessageBytes message) {
    bool is_last = message.size() < kPiece;
    while (!is_last) {
      MPI_Message found = MPI_MESSAGE_NULL;
      MPI_Status status{};
      wait_until([&] { return is_there(from, tag, found, status); });
      const auto piece = receive_piece(found, status);
      is_last = piece.size() < kPiece;
      message.insert(message.end(), piece.begin(), piece.end());
    }
    return message;
  }

  static bool is_there(int from, int tag, MPI_Message& found, MPI_Status& status) {
    int any = 0;
    MPI_Improbe(from, tag, MPI_COMM_WORLD, &any, &found, &status);
    return any != 0;
  }
};

/// A message that is being sent to a rank, piece by piece.
struct MpiWorld::Sending {
  int to = 0;
  std::span<const std::byte> rest;
  MPI_Request request = MPI_REQUEST_NULL;
  bool is_last = false;  ///< whether the last piece is being sent
  bool is_done = false;

  /// Returns whether anything was done.
  bool advance(State& state, int tag) {
    if (is_done || (request != MPI_REQUEST_NULL && !is_complete(request))) return false;
    is_done = is_last;
    if (is_done) return true;
    const auto piece = rest.first(std::min(rest.size(), kPiece));
    rest = rest.subspan(piece.size());
    is_last = piece.size() < kPiece;
    request = state.start_to_send(to, tag, piece);
    return true;
  }
};

/// A message that is being received from a rank.
struct MpiWorld::Receiving {
  int from = 0;
  MessageBytes message;
  std::vector<std::byte> piece;  ///< the piece that is being received
  MPI_Request request = MPI_REQUEST_NULL;
  bool is_done = false;

  /// Returns whether anything was done.
  bool advance(int tag) {
    if (is_done) return false;
    if (request == MPI_REQUEST_NULL) {
      MPI_Message found = MPI_MESSAGE_NULL;
      MPI_Status status{};
      if (!State::is_there(from, tag, found, status)) return false;
      request = start_to_receive(found, status, piece);
      return true;
    }
    if (!is_complete(request)) return false;
    is_done = piece.size() < kPiece;
    if (message.empty()) {
      message = std::move(piece);
    } else {
      message.insert(message.end(), piece.begin(), piece.end());
    }
    return true;
  }
};

MpiWorld::MpiWorld(int* argc, char*** argv) : state_(std::make_unique<State>()) {
  int provided = MPI_THREAD_SINGLE;
  MPI_Init_thread(argc, argv, MPI_THREAD_SERIALIZED, &provided);
  if (provided < MPI_THREAD_SERIALIZED) {
    throw Error::failed("the MPI library does not support threads", "MPI",
                        "Use the OpenMPI package of Debian 12");
  }
  MPI_Comm_rank(MPI_COMM_WORLD, &state_->rank);
  MPI_Comm_size(MPI_COMM_WORLD, &state_->size);
}

MpiWorld::~MpiWorld() { MPI_Finalize(); }

int MpiWorld::rank() const { return state_->rank; }
int MpiWorld::size() const { return state_->size; }

void MpiWorld::send(int to, int tag, std::span<const std::byte> message) {
  for (bool is_last = false; !is_last;) {
    const auto piece = message.first(std::min(message.size(), kPiece));
    message = message.subspan(piece.size());
    is_last = piece.size() < kPiece;
    MPI_Request request = MPI_REQUEST_NULL;
    {
      const std::scoped_lock lock(state_->mutex);
      request = state_->start_to_send(to, tag, piece);
    }
    state_->wait_for(request);
  }
}

MessageBytes MpiWorld::receive(int from, int tag) {
  MPI_Message found = MPI_MESSAGE_NULL;
  MPI_Status status{};
  state_->wait_until([&] { return State::is_there(from, tag, found, status); });
  return state_->receive_rest(from, tag, state_->receive_piece(found, status));
}

std::vector<MessageBytes> MpiWorld::exchange(int tag, std::span<const int> ranks,
                                             std::vector<MessageBytes> messages) {
  const auto self = static_cast<std::size_t>(std::ranges::find(ranks, rank()) - ranks.begin());
  assert(self < ranks.size() && messages.size() == ranks.size());
  std::vector<Sending> to;
  std::vector<Receiving> from(messages.size());
  for (std::size_t step = 1; step < ranks.size(); ++step) {  // all ranks begin with different ones
    const std::size_t other = (self + step) % ranks.size();
    to.push_back({ranks[other], messages[other]});
  }
  for (std::size_t i = 0; i < from.size(); ++i) from[i].from = ranks[i];
  from[self].is_done = true;
  state_->wait_for_all([&] {
    bool has_advanced = false;
    for (Sending& sending : to) has_advanced |= sending.advance(*state_, tag);
    for (Receiving& receiving : from) has_advanced |= receiving.advance(tag);
    if (std::ranges::all_of(to, &Sending::is_done) &&
        std::ranges::all_of(from, &Receiving::is_done)) {
      return Progress::kDone;
    }
    return has_advanced ? Progress::kSome : Progress::kNone;
  });
  std::vector<MessageBytes> received;
  for (Receiving& receiving : from) received.push_back(std::move(receiving.message));
  received[self] = std::move(messages[self]);
  return received;
}

std::optional<MpiWorld::Received> MpiWorld::receive_any(int tag, const std::stop_token& stop) {
  MPI_Message found = MPI_MESSAGE_NULL;
  MPI_Status status{};
  bool is_found = false;
  state_->wait_until([&] {
    is_found = !stop.stop_requested() && State::is_there(MPI_ANY_SOURCE, tag, found, status);
    return is_found || stop.stop_requested();
  });
  if (!is_found) return std::nullopt;
  const int from = status.MPI_SOURCE;
  return Received{from, state_->receive_rest(from, tag, state_->receive_piece(found, status))};
}

void MpiWorld::abort(int exit_code, const std::string& reason) {
  if (!reason.empty()) std::fprintf(stderr, "raystage: %s\n", reason.c_str());
  MPI_Abort(MPI_COMM_WORLD, exit_code);
  std::abort();
}

MessageCosts MpiWorld::costs() const {
  const std::scoped_lock lock(state_->mutex);
  return state_->costs;
}

}  // namespace raystage::farm
