// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "render/common/light_field_frame.h"
#include "render/common/result_cache.h"
#include "render/depth/camera_depths.h"
#include "render/depth/imported_maps.h"
#include "schemas/imported_depths_document.h"
#include "store/take.h"

namespace raystage::render {

/// The note of views that imported depths were used for.
inline constexpr const char* kImportedDepthsNote =
    "cameras with imported depth maps use them; their depths were not estimated";

/// The imported depth maps of a take, for rendering. They are used as they are in place of
/// estimated ones: nothing is estimated for a camera that has one, and unknown depths stay unknown.
class ImportedDepths {
 public:
  /// Throws Error (bad input) as store::read_imported_depths().
  explicit ImportedDepths(const store::Take& take);
  /// Returns the same, cached.
  static std::shared_ptr<const ImportedDepths> of(const store::Take& take,
                                                  ResultCache& result_cache);

  /// Returns whether a camera has an imported map of its frame.
  bool has_map(const LightFieldFrame& instant, int camera) const {
    return find(instant, camera) != nullptr;
  }
  /// Returns whether all cameras of the light field frame whose depths are wanted have maps.
  bool covers(const LightFieldFrame& instant, const EstimationRegions& regions) const;
  /// Replaces the maps of cameras that have imported ones, of this host's cameras. Returns whether
  /// there are any. Throws Error (bad input) as read_imported_map().
  bool replace(const LightFieldFrame& instant, const DepthEstimationOptions& options,
               CameraDepths& depths) const;

 private:
  const schemas::ImportedDepthsDocument::Map* find(const LightFieldFrame& instant,
                                                   int camera) const;

  schemas::ImportedDepthsDocument document_;
  std::size_t bytes_ = 0;  ///< of the document
};

}  // namespace raystage::render
