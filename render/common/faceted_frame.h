// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "render/common/method.h"
#include "rig/pinhole_facets.h"

namespace raystage::render {

/// A light field frame for methods that need pinholes: wide fisheyes are replaced by their facets,
/// which share the decoded frames. Frames of other rigs stay as they are and cost nothing.
class FacetedFrame {
 public:
  /// Keeps a reference to `whole`.
  explicit FacetedFrame(const LightFieldFrame& whole);
  FacetedFrame(const FacetedFrame&) = delete;
  FacetedFrame& operator=(const FacetedFrame&) = delete;

  const LightFieldFrame& frame() const { return facets_ ? faceted_ : whole_; }

 private:
  const LightFieldFrame& whole_;
  std::optional<rig::FacetedRig> facets_;
  std::optional<store::FrameCache> cache_, opaque_;
  LightFieldFrame faceted_;
};

/// Returns a surface that keeps the rig alive of which it was made.
RaySurface kept_with(std::shared_ptr<const FacetedFrame> facets, RaySurface surface);

/// Returns the same request for another light field frame.
ViewRequest request_for(const LightFieldFrame& frame, const ViewRequest& request);

}  // namespace raystage::render
