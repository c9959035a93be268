// SPDX-License-Identifier: Apache-2.0
// Puts imported depth maps (imported_maps.h) in place of estimated ones. Cost: reading a map per
// camera, and resampling it to the camera without distortion (recorded_depths.h).
#include "render/depth/imported_depths.h"

#include <algorithm>

#include "base/parallel.h"
#include "render/depth/recorded_depths.h"
#include "store/imported_depths.h"

namespace raystage::render {

namespace {
using Document = schemas::ImportedDepthsDocument;
}  // namespace

ImportedDepths::ImportedDepths(const store::Take& take)
    : document_(store::read_imported_depths(take)) {
  for (const Document::Camera& camera : document_.cameras) {
    constexpr std::size_t kTextBytes = 300;  // of a map, roughly
    bytes_ += camera.maps.size() * (sizeof(Document::Map) + kTextBytes);
  }
}

std::shared_ptr<const ImportedDepths> ImportedDepths::of(const store::Take& take,
                                                         ResultCache& result_cache) {
  return result_cache.get<ImportedDepths>("imported depths", [&](std::size_t& bytes) {
    auto made = std::make_shared<const ImportedDepths>(take);
    constexpr std::size_t kLeast = 1;  // results of 0 bytes are never dropped
    bytes = made->bytes_ + kLeast;
    return made;
  });
}

const Document::Map* ImportedDepths::find(const LightFieldFrame& instant, int camera) const {
  const int frame = instant.frame_of_camera[camera];
  if (document_.cameras.empty() || frame < 0) return nullptr;
  if (instant.cache->sources_of(frame)) return nullptr;  // interpolated between two frames
  const int of_take = instant.camera_of_take.empty() ? camera : instant.camera_of_take[camera];
  return find_imported_map(document_, *instant.take, of_take, frame);
}

bool ImportedDepths::covers(const LightFieldFrame& instant,
                            const EstimationRegions& regions) const {
  if (document_.cameras.empty()) return false;
  return std::ranges::all_of(instant.present_cameras(), [&](int camera) {
    return !has_region(regions, camera) || find(instant, camera) != nullptr;
  });
}

bool ImportedDepths::replace(const LightFieldFrame& instant, const DepthEstimationOptions& options,
                             CameraDepths& depths) const {
  std::vector<int> cameras;
  for (const int camera : instant.present_cameras()) {
    if (has_region(options.regions, camera) && instant.is_local(camera) &&
        find(instant, camera) != nullptr) {
      cameras.push_back(camera);
    }
  }
  const auto same_surface =
      static_cast<float>(options.tolerance_px * depths.inverse_depth_per_pixel);
  raystage::parallel_for(std::size_t{0}, cameras.size(), [&](std::size_t i) {
    const int camera = cameras[i];
    const int of_take = instant.camera_of_take.empty() ? camera : instant.camera_of_take[camera];
    const Document::Map& map = *find(instant, camera);
    const DepthQuantity quantity = map.quantity == Document::Quantity::kInverseDistance
                                       ? DepthQuantity::kDistance
                                       : DepthQuantity::kPlanar;
    depths.maps[camera] = undistorted_depths(
        read_imported_map(*instant.take, of_take, instant.frame_of_camera[camera], map), quantity,
        instant.rig->cameras[camera].model, depths.pinholes[camera], same_surface);
  });
  return !cameras.empty();
}

}  // namespace raystage::render
