// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <span>
#include <string_view>

#include "render/instant.h"
#include "render/view.h"

namespace raystage {

/// What a method is asked for: a view of one instant.
struct ViewRequest {
  const VirtualCamera& view;
  const Instant& instant;
  /// Where rays are looked up: a x + b y + c z + d = 0 in the world.
  Eigen::Vector4d focal_plane;
  bool count_needed_pixels = false;  ///< fill RenderStatistics::pixels_needed (costs time)
};

/// A way to reconstruct views, chosen by name. Whatever is done per pixel is done inside.
struct Method {
  std::string_view name;
  std::string_view summary;  ///< for people, a line
  /// For views without lens distortion.
  RenderedView (*render)(const ViewRequest& request);
  /// The slow, obvious one, for any view.
  RenderedView (*render_reference)(const ViewRequest& request);
};

/// All there are, by name.
std::span<const Method> methods();

/// Throws Error (bad input) naming the methods there are, unless `name` is one.
const Method& method_named(std::string_view name);

}  // namespace raystage
