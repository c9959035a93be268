// SPDX-License-Identifier: Apache-2.0
#include "depths/fit_maps.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "render/depth/imported_maps.h"

namespace raystage::depths {

std::size_t fit_maps_to_frames(schemas::ImportedDepthsDocument& document, const store::Take& take) {
  using Map = schemas::ImportedDepthsDocument::Map;
  std::size_t lost = 0;
  for (schemas::ImportedDepthsDocument::Camera& of_camera : document.cameras) {
    const int camera = take.camera_index(of_camera.id);
    if (camera < 0) continue;
    const auto count = static_cast<int>(take.archive(camera).frames().size());
    const auto fits = [&](const Map& map) {
      return map.frame < count &&
             render::find_imported_map(document, take, camera, map.frame) == &map;
    };
    if (std::ranges::all_of(of_camera.maps, fits)) continue;
    std::vector<Map> maps;
    for (int frame = 0; frame < count; ++frame) {
      const Map* const map = render::find_imported_map(document, take, camera, frame);
      if (map == nullptr) continue;
      maps.push_back(*map);
      maps.back().frame = frame;
    }
    lost += of_camera.maps.size() - std::min(maps.size(), of_camera.maps.size());
    of_camera.maps = std::move(maps);
  }
  return lost;
}

}  // namespace raystage::depths
