// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "render/view/kept_results.h"
#include "render/view/view.h"
#include "schemas/option_values.h"
#include "store/frames/blend_space.h"
#include "store/take.h"
#include "store/timeline.h"

namespace raystage {

/// How rays are reconstructed.
struct Reconstruction {
  std::string method = "focal_plane";  ///< see methods()
  /// a x + b y + c z + d = 0 in the world; (0, 0, 0, 1) lies at infinity. See plane_in_front_of().
  Eigen::Vector4d focal_plane{0, 0, 0, 1};
  OptionValues options = {};  ///< of the method, by name; see Method::options
};

struct RendererSettings {
  std::size_t cache_bytes = std::size_t{1} << 30;  ///< decoded source frames kept in memory
  std::size_t kept_bytes = std::size_t{1} << 30;   ///< what methods work out once for many views
  /// Where that is kept, shared with other renderers of the same take and cameras; null: in a place
  /// of its own, of `kept_bytes`.
  std::shared_ptr<KeptResults> kept = nullptr;
  std::size_t working_bytes = std::size_t{1} << 30;  ///< what a method may use for one view
  std::vector<int> left_out;  ///< cameras of the take that must not contribute
  BlendSpace blend_space = BlendSpace::kPerceptual;
  bool count_needed_pixels = false;  ///< fills RenderStatistics::pixels_needed (costs time)
  bool reference = false;            ///< the slow, obvious implementation, ray by ray
};

/// Renders views of a take. Many threads may call render() at once (frames in flight); the pixels
/// do not depend on how many threads there are. Uses the TBB arena it is called in.
class LightFieldRenderer {
 public:
  /// Throws Error (bad input) where no camera is left. Keeps a reference to `take`.
  LightFieldRenderer(const Take& take, const RendererSettings& settings);
  ~LightFieldRenderer();

  /// Throws Error (bad input) for an unknown method, options that it does not have, or frames that
  /// cannot be read.
  RenderedView render(const VirtualCamera& view, const FrameSelection& frames,
                      const Reconstruction& reconstruction) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace raystage
