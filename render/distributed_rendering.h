// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "render/common/contribution.h"
#include "render/common/rank_communicator.h"
#include "render/common/view.h"
#include "schemas/option_values.h"
#include "store/take.h"
#include "store/timeline.h"

namespace raystage {

/// A view that several hosts render together: what a host must know to contribute to it.
struct DistributedViewRequest {
  VirtualCamera view;     ///< as ViewRequest::view
  FrameSelection frames;  ///< of the timeline; no frame of cameras that are left out
  std::vector<std::vector<int>> adjacent_frames;  ///< as LightFieldFrame
  std::string method;
  OptionValues options;  ///< of the method
  Eigen::Vector4d focal_plane{0, 0, 0, 1};
  int supersampling = 1, first_row = 0, full_height = 0;  ///< as ViewRequest
  bool is_lockstep = false;  ///< DistributionMode::kLockstep: hosts make one such view at a time
};

/// The hosts that hold the cameras of a take, as the one that puts views together sees them. Many
/// threads may call at once.
class DistributedRenderer {
 public:
  virtual ~DistributedRenderer() = default;
  /// Makes this host's contribution; `group`: of views in step, else null.
  using ContributeFunction = std::function<Contribution(const RankCommunicator* group)>;
  /// Returns the contributions of all hosts, added up. Throws Error where a host cannot contribute.
  virtual Contribution sum(const DistributedViewRequest& view,
                           const ContributeFunction& own) const = 0;
  /// Whether the sums lack the weights (the last of four values), which the caller must find.
  virtual bool omits_weights(const DistributedViewRequest& view) const = 0;
};

struct RendererSettings;

/// Hosts that hold archives of takes, and render their views together (thesis 4.1).
class DistributedTakes {
 public:
  virtual ~DistributedTakes() = default;
  /// Opens a take, whose folder holds on each host the documents and the archives of some cameras.
  /// Throws Error (bad input) as Take does, and where an archive is missing everywhere unless that
  /// is accepted.
  virtual Take open(const std::filesystem::path& folder) = 0;
  /// Makes all hosts ready to contribute to views of a take that open() returned, and says so in
  /// `settings` (hosts, rank_of_camera, this_rank).
  virtual void share(const Take& take, RendererSettings& settings) = 0;
};

}  // namespace raystage
