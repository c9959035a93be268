// SPDX-License-Identifier: Apache-2.0
// Two lanes of jobs, each with a thread and a TBB arena. A lane serves its clients in turns: after
// a job, its client goes to the end of the queue. The waiting jobs of a client are bounded:
// kMaxFiles of each kind that writes files, one of each other kind.
#include "replay/render_scheduler.h"

#include <tbb/task_arena.h>

#include <array>
#include <condition_variable>
#include <list>
#include <map>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

#include "base/cancellation.h"

namespace raystage::replay {
namespace {

constexpr std::size_t kLanes = 2;
constexpr std::size_t kMaxFiles = 16;

std::size_t lane_of(JobKind kind) {
  return kind == JobKind::kRefinement || kind == JobKind::kSnapshot || kind == JobKind::kRanges ? 1
                                                                                                : 0;
}

bool writes_files(JobKind kind) { return kind == JobKind::kFile || kind == JobKind::kSnapshot; }

tbb::task_arena::priority priority_of_lane(std::size_t lane) {
  return lane == 0 ? tbb::task_arena::priority::high : tbb::task_arena::priority::low;
}

struct WaitingJob {
  RenderScheduler::Job run;
  std::function<void()> dropped;
};

/// Waiting and running jobs of one client in one lane.
struct ClientJobs {
  std::multimap<JobKind, WaitingJob> waiting;  ///< in the order of their runs
  std::optional<JobKind> running;
  std::stop_source stop;    ///< of the running job
  bool is_removed = false;  ///< forgotten when the running job ends
};

struct Lane {
  std::map<RenderScheduler::ClientId, ClientJobs> clients;
  std::list<RenderScheduler::ClientId> turns;  ///< each client that has jobs, the next one first
  std::condition_variable_any has_job;
};

}  // namespace

struct RenderScheduler::State {
  std::mutex mutex;
  std::array<Lane, kLanes> lanes;
  std::array<std::jthread, kLanes> threads;  // the last members: they end first

  /// Drops the waiting jobs and stops the running job of a client that `is_ended(kind)` names.
  template <class IsEnded>
  void end_jobs(ClientId client, std::size_t lane, IsEnded is_ended) {
    const auto found = lanes[lane].clients.find(client);
    if (found == lanes[lane].clients.end()) return;
    std::erase_if(found->second.waiting, [&](const auto& job) {
      if (is_ended(job.first)) drop(job.second);
      return is_ended(job.first);
    });
    if (found->second.running && is_ended(*found->second.running)) {
      found->second.stop.request_stop();
    }
  }

  static void drop(const WaitingJob& job) {
    if (job.dropped) job.dropped();
  }

  static void forget(Lane& lane, ClientId client) {
    lane.clients.erase(client);
    lane.turns.remove(client);
  }

  /// Returns the client whose turn it is, or nullopt if none has a waiting job.
  static std::optional<ClientId> next_client(Lane& lane) {
    for (auto turn = lane.turns.begin(); turn != lane.turns.end(); ++turn) {
      if (lane.clients.at(*turn).waiting.empty()) continue;
      lane.turns.splice(lane.turns.end(), lane.turns, turn);
      return lane.turns.back();
    }
    return std::nullopt;
  }

  void run(const std::stop_token& end, std::size_t index, int concurrency) {
    tbb::task_arena arena(concurrency, 1, priority_of_lane(index));
    Lane& lane = lanes[index];
    std::unique_lock lock(mutex);
    for (;;) {
      std::optional<ClientId> client;
      if (!lane.has_job.wait(lock, end, [&] { return (client = next_client(lane)).has_value(); })) {
        return;
      }
      ClientJobs& jobs = lane.clients.at(*client);
      const auto first = jobs.waiting.begin();
      jobs.running = first->first;
      const Job job = std::move(first->second.run);
      jobs.waiting.erase(first);
      jobs.stop = std::stop_source();
      const std::stop_token stop = jobs.stop.get_token();
      lock.unlock();
      {
        const std::stop_callback on_end(end,
                                        [source = jobs.stop]() mutable { source.request_stop(); });
        try {
          arena.execute([&] { job(stop); });
        } catch (const Cancelled&) {
        }
      }
      lock.lock();
      jobs.running.reset();
      if (jobs.is_removed) forget(lane, *client);
    }
  }
};

RenderScheduler::RenderScheduler(int threads) : state_(std::make_unique<State>()) {
  const int concurrency = threads > 0 ? threads : tbb::task_arena::automatic;
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    state_->threads[lane] =
        std::jthread([state = state_.get(), lane, concurrency](const std::stop_token& end) {
          state->run(end, lane, concurrency);
        });
  }
}

RenderScheduler::~RenderScheduler() = default;

void RenderScheduler::submit(ClientId client, JobKind kind, Job job,
                             std::function<void()> dropped) {
  Lane& lane = state_->lanes[lane_of(kind)];
  const std::scoped_lock lock(state_->mutex);
  if (kind == JobKind::kDocument) {
    const auto is_ended = [](JobKind other) { return !writes_files(other); };
    for (std::size_t i = 0; i < kLanes; ++i) state_->end_jobs(client, i, is_ended);
  }
  if (kind == JobKind::kMotion || kind == JobKind::kRefinement) {
    state_->end_jobs(client, lane_of(JobKind::kRefinement), [](JobKind other) {
      return other == JobKind::kRefinement || other == JobKind::kRanges;
    });
  }
  if (kind == JobKind::kRefinement || kind == JobKind::kSnapshot) {
    for (auto& [other, running] : lane.clients) {
      if (running.running == JobKind::kRanges) running.stop.request_stop();
    }
  }
  const auto [jobs, is_new] = lane.clients.try_emplace(client);
  if (is_new) lane.turns.push_back(client);
  WaitingJob added{std::move(job), std::move(dropped)};
  auto& waiting = jobs->second.waiting;
  if (writes_files(kind)) {
    if (waiting.count(kind) >= kMaxFiles) return State::drop(added);
  } else if (const auto older = waiting.find(kind); older != waiting.end()) {
    State::drop(older->second);
    waiting.erase(older);
  }
  waiting.emplace(kind, std::move(added));
  lane.has_job.notify_one();
}

void RenderScheduler::end() {
  for (std::jthread& thread : state_->threads) thread.request_stop();
  for (std::jthread& thread : state_->threads) {
    if (thread.joinable()) thread.join();
  }
}

void RenderScheduler::remove(ClientId client) {
  const std::scoped_lock lock(state_->mutex);
  for (std::size_t i = 0; i < kLanes; ++i) {
    Lane& lane = state_->lanes[i];
    state_->end_jobs(client, i, [](JobKind) { return true; });
    const auto found = lane.clients.find(client);
    if (found == lane.clients.end()) continue;
    if (found->second.running) {
      found->second.is_removed = true;
    } else {
      State::forget(lane, client);
    }
  }
}

}  // namespace raystage::replay
