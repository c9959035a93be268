// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "render/view/contribution.h"
#include "render/view/host_group.h"
#include "render/view/view.h"
#include "schemas/option_values.h"
#include "store/take.h"
#include "store/timeline.h"

namespace raystage {

/// A view that several hosts render together: what a host must know to contribute to it.
struct HostView {
  VirtualCamera view;     ///< as ViewRequest::view
  FrameSelection frames;  ///< of the timeline; no frame of cameras that are left out
  std::vector<std::vector<int>> frames_beside;  ///< as Instant
  std::string method;
  OptionValues options;  ///< of the method
  Eigen::Vector4d focal_plane{0, 0, 0, 1};
  int supersampling = 1, first_row = 0, whole_height = 0;  ///< as ViewRequest
  bool in_step = false;  ///< Distribution::kInStep: hosts make one such view at a time
};

/// The hosts that hold the cameras of a take, as the one that puts views together sees them. Many
/// threads may call at once.
class ViewHosts {
 public:
  virtual ~ViewHosts() = default;
  /// Makes this host's contribution; `group`: of views in step, else null.
  using Contribute = std::function<Contribution(const HostGroup* group)>;
  /// Returns the contributions of all hosts, added up. Throws Error where a host cannot contribute.
  virtual Contribution sum(const HostView& view, const Contribute& own) const = 0;
  /// Whether the sums lack the weights (the last of four values), which the caller must find.
  virtual bool lacks_weights(const HostView& view) const = 0;
};

struct RendererSettings;

/// Hosts that hold archives of takes, and render their views together (thesis 4.1).
class TakeHosts {
 public:
  virtual ~TakeHosts() = default;
  /// Opens a take, whose folder holds on each host the documents and the archives of some cameras.
  /// Throws Error (bad input) as Take does, and where an archive is missing everywhere unless that
  /// is accepted.
  virtual Take open(const std::filesystem::path& folder) = 0;
  /// Makes all hosts ready to contribute to views of a take that open() returned, and says so in
  /// `settings` (hosts, host_of_camera, this_host).
  virtual void share(const Take& take, RendererSettings& settings) = 0;
};

}  // namespace raystage
