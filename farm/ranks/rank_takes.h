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

/// The costs of frames that were fetched from other ranks.
struct FetchCounts {
  std::int64_t requests = 0, bytes = 0;
};

/// The archives of a take as a rank sees them: its own ones, and the owners of the others.
class RankArchives : public store::RemoteArchives {
 public:
  RankArchives(MpiWorld& world, int take_number) : world_(world), take_number_(take_number) {}

  /// Sets the rank that has each camera's archive; -1: none. Call it before the take is used.
  /// `cameras`: the frames of cameras of other ranks, or empty if this rank does not need them.
  void set_camera_owners(std::vector<int> camera_owners, std::vector<TakeTable::Camera> cameras);
  /// Sets which cameras have their archives in this rank's folder.
  void set_local_cameras(std::vector<bool> is_local) { is_local_ = std::move(is_local); }

  const std::vector<int>& camera_owners() const { return camera_owners_; }
  std::optional<store::ArchiveReader> open(int camera) const override;
  bool is_missing(int camera) const override;
  FetchCounts fetched() const { return {requests_, bytes_}; }

  /// Requests a frame from the owner of its camera. Throws Error (bad input) if the owner cannot
  /// read the frame.
  FrameReply fetch(int camera, FrameRequest request) const;

 private:
  MpiWorld& world_;
  int take_number_;
  std::vector<bool> is_local_;
  std::vector<int> camera_owners_;
  std::vector<TakeTable::Camera> cameras_;
  /// Decodes the pictures of all cameras on other ranks.
  std::shared_ptr<store::UnpackedFrames> unpacked_ = std::make_shared<store::UnpackedFrames>();
  mutable std::atomic<std::int64_t> requests_ = 0, bytes_ = 0;
};

/// A take that a rank has opened.
struct RankTake {
  std::shared_ptr<RankArchives> archives;
  std::unique_ptr<store::Take> take;  ///< null: this rank cannot open it
  TakeTable table;                    ///< the parts that this rank has
};

/// Opens this rank's folder of a take. On failure the table's error has the reason.
RankTake open_rank_take(MpiWorld& world, int number, const std::filesystem::path& folder);

/// Returns this rank's path of a folder that rank 0 names `folder`. Applies the first matching
/// rule, then replaces {rank} and {host} by this rank's number and host name.
std::filesystem::path local_take_folder(const std::string& folder,
                                        std::span<const PathMappingRule> rules, int rank);

/// Answers other ranks' requests for frames on its own thread, until it is destroyed.
class FrameService {
 public:
  explicit FrameService(MpiWorld& world);
  ~FrameService();

  /// Serves frames of the take with this number from now on. `take` must outlive the service.
  void add(int number, const store::Take& take);

 private:
  void run(const std::stop_token& stop);
  FrameReply answer(const FrameRequest& request);

  MpiWorld& world_;
  std::mutex mutex_;  // guards takes_
  std::vector<const store::Take*> takes_;
  std::jthread thread_;
};

}  // namespace raystage::farm
