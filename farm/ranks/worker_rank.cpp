// SPDX-License-Identifier: Apache-2.0
// Serves the requests of rank 0. One thread receives them. Two threads contribute to views, one
// more to views in lockstep, which wait for all hosts. A further thread answers requests for frames
// (FrameService).
#include "farm/ranks/worker_rank.h"

#include <tbb/task_arena.h>

#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <new>
#include <thread>
#include <utility>

#include "farm/ranks/messages.h"
#include "farm/ranks/rank_takes.h"
#include "farm/ranks/rank_views.h"
#include "render/renderer.h"

namespace raystage::farm {
namespace {

/// The number of views in progress: while one waits for the ranks below, another is sampled.
constexpr int kViewsAtOnce = 2;

/// A queue of requests for views.
class ViewQueue {
 public:
  void push(Request request) {
    {
      const std::scoped_lock lock(mutex_);
      requests_.push_back(std::move(request));
    }
    changed_.notify_one();
  }
  /// Waits for a request. Returns false if the queue is closed and empty.
  bool pop(Request& request) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return is_closed_ || !requests_.empty(); });
    if (requests_.empty()) return false;
    request = std::move(requests_.front());
    requests_.pop_front();
    return true;
  }
  void close() {
    {
      const std::scoped_lock lock(mutex_);
      is_closed_ = true;
    }
    changed_.notify_all();
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Request> requests_;
  bool is_closed_ = false;
};

class WorkerRank {
 public:
  WorkerRank(MpiWorld& world, const WorkerRankOptions& options)
      : world_(world), options_(options), arena_(options.threads), frames_(world) {
    for (int i = 0; i < kViewsAtOnce; ++i) workers_.emplace_back([this] { render_views(views_); });
    workers_.emplace_back([this] { render_views(views_in_step_); });
  }

  ~WorkerRank() {
    views_.close();
    views_in_step_.close();
  }

  void run() {
    while (true) {
      Request request = decode_request(world_.receive(0, kRequestTag));
      switch (request.kind) {
        case Request::Kind::kOpen:
          open(request);
          break;
        case Request::Kind::kShare:
          share(request);
          break;
        case Request::Kind::kView:
          (request.view.is_lockstep ? views_in_step_ : views_).push(std::move(request));
          break;
        case Request::Kind::kStop:
          world_.send(0, request.reply_tag, encode(measure_rank_costs(world_)));
          return;
      }
    }
  }

 private:
  void open(const Request& request) {
    RankTake opened = open_rank_take(
        world_, request.take, local_take_folder(request.folder, options_.takes, world_.rank()));
    world_.send(0, request.reply_tag, encode(opened.table));
    if (opened.take) frames_.add(request.take, *opened.take);
    takes_.push_back(std::move(opened));
  }

  void share(const Request& request) {
    RankTake& take = takes_.at(request.take);
    take.archives->set_camera_owners(request.camera_owners, {});
    render::RendererOptions settings;
    settings.cache_bytes = request.cache_bytes;
    settings.result_cache_bytes = request.result_cache_bytes;
    settings.working_bytes = request.working_bytes;
    settings.rank_of_camera = host_indices(request.ranks, request.camera_owners);
    settings.this_rank = host_index(request.ranks, world_.rank());
    const std::scoped_lock lock(mutex_);
    members_.push_back(request.ranks);
    // A rank that cannot open the take holds none of its cameras.
    renderers_.push_back(
        take.take ? std::make_shared<const render::LightFieldRenderer>(*take.take, settings)
                  : nullptr);
  }

  void render_views(ViewQueue& queue) {
    Request request;
    while (queue.pop(request)) {
      std::shared_ptr<const render::LightFieldRenderer> renderer;
      std::vector<int> members;
      {
        const std::scoped_lock lock(mutex_);
        members = members_.at(request.light_field);
        renderer = renderers_.at(request.light_field);
      }
      const auto own = [&] {
        if (!renderer) return render::Contribution{};
        return contribute_as_rank(
            {world_, members}, request.view, request.view_number,
            [&](const render::RankCommunicator* group) {
              render::Contribution made;
              arena_.execute([&] { made = renderer->contribute(request.view, group); });
              return made;
            });
      };
      try {
        send_to_parent({world_, fragment_encoding_for(request.view, options_.encoding)},
                       request.view_number, request.light_field, request.view.view, own);
      } catch (const std::bad_alloc&) {  // this rank cannot report it to another one
        world_.abort(options_.out_of_memory_code);
      }
    }
  }

  MpiWorld& world_;
  const WorkerRankOptions& options_;
  tbb::task_arena arena_;
  std::vector<RankTake> takes_;
  std::mutex mutex_;                                                          // guards the next two
  std::vector<std::shared_ptr<const render::LightFieldRenderer>> renderers_;  // by light field
  std::vector<std::vector<int>> members_;  // ranks, by light field
  FrameService frames_;                    // destroyed before takes_
  ViewQueue views_, views_in_step_;
  std::vector<std::jthread> workers_;  // destroyed first
};

}  // namespace

void run_worker_rank(MpiWorld& world, const WorkerRankOptions& options) {
  WorkerRank(world, options).run();
}

}  // namespace raystage::farm
