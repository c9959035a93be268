// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <string_view>
#include <vector>

#include "farm/path_map.h"
#include "farm/ranks/mpi_world.h"
#include "farm/ranks/rank_takes.h"
#include "farm/ranks/rank_views.h"
#include "render/common/fragment_encoding.h"
#include "render/distributed_rendering.h"

namespace raystage::farm {

/// The treatment of cameras whose archives no rank has.
enum class MissingArchives {
  kError,  ///< throw before anything is rendered
  kAbsent  ///< render without them; the files record the absent cameras
};

struct RankOptions {
  std::vector<PathMappingRule> takes;  ///< folders of takes on the ranks: see local_take_folder()
  MissingArchives missing = MissingArchives::kError;
  render::FragmentEncodingOptions encoding;
  std::function<void(std::string_view)> on_message = [](std::string_view) {};
};

/// The data that the ranks exchanged, and its costs.
struct RankTraffic {
  render::FragmentCounts fragments;  ///< summed over all messages
  std::int64_t view_pixels = 0;      ///< summed over all views
  std::int64_t views = 0;
  ReduceTimes times;   ///< of rank 0, over all views
  FetchCounts frames;  ///< fetched by rank 0
  RankCosts costs;     ///< of all ranks
};

/// Rank 0: opens takes on all ranks, and requests their contributions to views.
class RootRank : public render::DistributedTakes {
 public:
  RootRank(MpiWorld& world, RankOptions options);
  /// Calls finish() if it was not called.
  ~RootRank() override;
  RootRank(const RootRank&) = delete;
  RootRank& operator=(const RootRank&) = delete;

  store::Take open(const std::filesystem::path& folder) override;
  void share(const store::Take& take, render::RendererOptions& settings) override;
  /// Sends the stop request to all ranks and returns their costs. Call it once.
  RankTraffic finish();

 private:
  class LightField;
  struct OpenTake {
    std::string named;             ///< the folder, as the shot names it
    std::filesystem::path folder;  ///< on this host
    std::shared_ptr<RankArchives> archives;
    std::unique_ptr<store::Take> served;  ///< source of frames for other ranks
    std::vector<int> ranks;               ///< ranks that have opened it
  };
  void send_to_all(const Request& request);
  /// Throws Error (bad input) for a rule that no take needs. Call it when all takes are open.
  void check_rules() const;
  bool is_finished_ = false;
  std::vector<int> find_camera_owners(const store::Take& take,
                                      const std::vector<TakeTable>& tables) const;

  MpiWorld& world_;
  std::mutex send_mutex_;  ///< keeps requests in one order on all ranks
  RankOptions options_;
  std::vector<OpenTake> takes_;
  int light_fields_ = 0;
  std::atomic<std::uint32_t> views_ = 0;
  mutable std::mutex in_step_;  // held while a view in lockstep is rendered
  mutable std::mutex mutex_;    // guards traffic_
  RankTraffic traffic_;
  std::unique_ptr<FrameService> frames_;  ///< must be destroyed before takes_
};

}  // namespace raystage::farm
