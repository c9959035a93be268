// SPDX-License-Identifier: Apache-2.0
// The only file that calls MPI. Messages longer than kPiece travel as several: a piece of exactly
// kPiece bytes is followed by another one of the same tag (MPI counts are 32 bits wide).
#include "farm/ranks/mpi_world.h"

#define OMPI_SKIP_MPICXX 1  // the C interface alone
#include <mpi.h>
#include <time.h>

#include <algorithm>
#include <cassert>
#include <chrono>
#include <mutex>
#include <thread>

#include "schemas/error.h"

namespace raystage::farm {
namespace {

/// Sleeps longer and longer while nothing happens: from 20 microseconds to 1 millisecond.
class PollPause {
 public:
  void sleep() {
    std::this_thread::sleep_for(pause_);
    pause_ = std::min(2 * pause_, kLongest);
  }

 private:
  static constexpr std::chrono::microseconds kLongest{1000};
  std::chrono::microseconds pause_{20};
};

constexpr std::size_t kPiece = std::size_t{1} << 30;

double thread_cpu_seconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

}  // namespace

struct MpiWorld::State {
  mutable std::mutex mutex;  // held while a thread is within MPI; guards the costs, too
  int rank = 0, size = 1;
  MessageCosts costs;

  /// Polls until poll() returns true; it is called within MPI.
  template <class Poll>
  void wait_until(const Poll& poll) {
    PollPause pause;
    double waited = 0;  // of polls that found nothing and the sleeps after them
    while (true) {
      const double start = thread_cpu_seconds();
      {
        const std::scoped_lock lock(mutex);
        if (poll()) {
          costs.waiting_cpu_seconds += waited;
          return;
        }
      }
      pause.sleep();
      waited += thread_cpu_seconds() - start;
    }
  }

  void wait_for(MPI_Request& request) {
    wait_until([&] {
      int done = 0;
      MPI_Test(&request, &done, MPI_STATUS_IGNORE);
      return done != 0;
    });
  }

  /// Receives a message that MPI_Improbe has found, without a wait that would block.
  std::vector<std::byte> receive_piece(MPI_Message found, const MPI_Status& status) {
    int count = 0;
    MPI_Request request = MPI_REQUEST_NULL;
    std::vector<std::byte> piece;
    {
      const std::scoped_lock lock(mutex);
      MPI_Get_count(&status, MPI_BYTE, &count);
      piece.resize(static_cast<std::size_t>(count));
      MPI_Imrecv(piece.data(), count, MPI_BYTE, &found, &request);
    }
    wait_for(request);
    return piece;
  }

  /// The pieces after a first one.
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

MpiWorld::MpiWorld(int* argc, char*** argv) : state_(std::make_unique<State>()) {
  int provided = MPI_THREAD_SINGLE;
  MPI_Init_thread(argc, argv, MPI_THREAD_SERIALIZED, &provided);
  if (provided < MPI_THREAD_SERIALIZED) {
    throw Error::failed("this MPI library supports no threads", "MPI",
                        "Use OpenMPI as Debian 12 packages it");
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
      MPI_Isend(piece.data(), static_cast<int>(piece.size()), MPI_BYTE, to, tag, MPI_COMM_WORLD,
                &request);
      ++state_->costs.messages_sent;
      state_->costs.bytes_sent += static_cast<std::int64_t>(piece.size());
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
  // Beside receiving: two ranks that send long messages to each other would wait for ever.
  std::jthread sending([&] {
    for (std::size_t step = 1; step < ranks.size(); ++step) {  // each rank begins with another
      const std::size_t to = (self + step) % ranks.size();
      send(ranks[to], tag, messages[to]);
    }
  });
  std::vector<MessageBytes> received(messages.size());
  for (std::size_t from = 0; from < received.size(); ++from) {
    if (from != self) received[from] = receive(ranks[from], tag);
  }
  sending.join();
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

void MpiWorld::abort(int exit_code) {
  MPI_Abort(MPI_COMM_WORLD, exit_code);
  std::abort();
}

MessageCosts MpiWorld::costs() const {
  const std::scoped_lock lock(state_->mutex);
  return state_->costs;
}

}  // namespace raystage::farm
