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

namespace raystage::render {

/// A view that several ranks render together: what a rank needs to contribute to it.
struct DistributedViewRequest {
  VirtualCamera view;            ///< as ViewRequest::view
  store::FrameSelection frames;  ///< of the timeline; without frames of excluded cameras
  std::vector<std::vector<int>> adjacent_frames;  ///< as LightFieldFrame
  std::vector<VirtualCamera> shown_views;         ///< as LightFieldFrame
  std::string method;
  schemas::OptionValues options;  ///< of the method
  Eigen::Vector4d focal_plane{0, 0, 0, 1};
  int supersampling = 1, first_row = 0, full_height = 0;  ///< as ViewRequest
  bool is_lockstep = false;  ///< DistributionMode::kLockstep: ranks render one such view at a time
};

/// The ranks that have the cameras of a take, for the rank that assembles views. Thread-safe.
class DistributedRenderer {
 public:
  virtual ~DistributedRenderer() = default;
  /// Computes this rank's contribution; `group`: for lockstep views, otherwise null.
  using ContributeFunction = std::function<Contribution(const RankCommunicator* group)>;
  /// Returns the sum of all ranks' contributions. Throws Error where a rank cannot contribute.
  virtual Contribution sum(const DistributedViewRequest& view,
                           const ContributeFunction& own) const = 0;
  /// Returns whether the sums lack the weights (the last of four values), which the caller must
  /// compute.
  virtual bool omits_weights(const DistributedViewRequest& view) const = 0;
};

struct RendererOptions;

/// Ranks that have archives of takes and render their views together (thesis 4.1).
class DistributedTakes {
 public:
  virtual ~DistributedTakes() = default;
  /// Opens a take whose folder contains, on each rank, the documents and some cameras' archives.
  /// Throws Error (bad input) as Take does, and where an archive is missing on all ranks unless
  /// that is accepted.
  virtual store::Take open(const std::filesystem::path& folder) = 0;
  /// Prepares all ranks to contribute to views of a take that open() returned, and sets `settings`
  /// accordingly (hosts, rank_of_camera, this_rank).
  virtual void share(const store::Take& take, RendererOptions& settings) = 0;
};

}  // namespace raystage::render
