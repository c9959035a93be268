// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "farm/path_map.h"
#include "farm/ranks/messages.h"
#include "farm/ranks/mpi_world.h"
#include "store/take.h"

namespace raystage::farm {

/// What frames cost that were fetched from other ranks.
struct FetchCounts {
  std::int64_t requests = 0, bytes = 0;
};

/// A rank's side of a take: its own archives, and who holds the others.
class RankArchives : public RemoteArchives {
 public:
  RankArchives(MpiWorld& world, int take_number) : world_(world), take_number_(take_number) {}

  /// Before the take is used; rank of each camera, -1: none. `frames`: of cameras that this rank
  /// does not hold, where it needs to know them; else empty.
  void set_camera_owners(std::vector<int> camera_owners, std::vector<TakeTable::Camera> cameras);
  /// Cameras whose archives are in this rank's folder.
  void set_local_cameras(std::vector<bool> is_own) { is_local_ = std::move(is_own); }

  const std::vector<int>& camera_owners() const { return camera_owners_; }
  std::optional<ArchiveReader> open(int camera) const override;
  bool is_missing(int camera) const override;
  FetchCounts fetched() const { return {requests_, bytes_}; }

  /// Asks the holder of a camera. Throws Error (failed) where it cannot read the frame.
  FrameReply fetch(int camera, FrameRequest request) const;

 private:
  MpiWorld& world_;
  int take_number_;
  std::vector<bool> is_local_;
  std::vector<int> camera_owners_;
  std::vector<TakeTable::Camera> cameras_;
  mutable std::atomic<std::int64_t> requests_ = 0, bytes_ = 0;
};

/// A take as a rank has opened it.
struct RankTake {
  std::shared_ptr<RankArchives> archives;
  std::unique_ptr<Take> take;  ///< null: it cannot be opened here
  TakeTable table;             ///< what this rank holds of it
};

/// Opens this rank's folder of a take; what is wrong with it is in the table's error.
RankTake open_rank_take(MpiWorld& world, int number, const std::filesystem::path& folder);

/// Where this rank keeps a folder that rank 0 calls `folder`: by the first rule that fits, in which
/// {rank} and {host} stand for this rank's number and host name.
std::filesystem::path local_take_folder(const std::string& folder,
                                        std::span<const PathMappingRule> rules, int rank);

/// Answers other ranks' requests for frames, on a thread of its own, as long as it lives.
class FrameService {
 public:
  explicit FrameService(MpiWorld& world);
  ~FrameService();

  /// Frames of a take that has this number are given from now on. `take` must outlive the service.
  void add(int number, const Take& take);

 private:
  void run(const std::stop_token& stop);
  FrameReply answer(const FrameRequest& request);

  MpiWorld& world_;
  std::mutex mutex_;  // of the takes
  std::vector<const Take*> takes_;
  std::jthread thread_;
};

}  // namespace raystage::farm
