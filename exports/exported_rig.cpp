// SPDX-License-Identifier: Apache-2.0
#include "exports/exported_rig.h"

#include <string>
#include <vector>

namespace raystage::exports {

schemas::RigDocument exported_rig(const store::Take& take, const FrameChoice& choice) {
  const schemas::RigDocument all = schemas::read_rig(take.file("rig.json"));
  schemas::RigDocument rig;
  rig.name = all.name;
  rig.topology = all.topology;
  for (const CameraFrames& camera : choice.cameras) {
    rig.cameras.push_back(all.cameras.at(static_cast<std::size_t>(camera.camera)));
  }
  return rig;
}

schemas::ImportManifest exported_manifest(const store::Take& take, const FrameChoice& choice,
                                          const std::vector<FrameRow>& rows,
                                          const std::string& color_space) {
  const schemas::TakeDocument& document = take.document();
  schemas::ImportManifest manifest;
  manifest.name = document.name;
  manifest.epoch_utc = document.epoch_utc;
  manifest.nominal_fps = document.nominal_fps > 0 ? document.nominal_fps : choice.fps;
  manifest.color_space = color_space;
  manifest.arbitrary_scale = document.arbitrary_scale;
  manifest.depth_range = document.depth_range;
  const schemas::RigDocument rig = exported_rig(take, choice);
  std::size_t row = 0;
  for (const schemas::RigDocument::Camera& of_rig : rig.cameras) {
    schemas::ImportManifest::Camera camera;
    camera.geometry = of_rig.geometry;
    for (; row < rows.size() && rows[row].camera == of_rig.geometry.id; ++row) {
      const ChosenFrame& frame = rows[row].frame;
      const bool is_new = camera.frames.empty() || frame.source_ns > camera.frames.back().time_ns;
      if (frame.is_held || frame.source < 0 || !is_new) continue;
      camera.frames.push_back({rows[row].file, frame.source_ns});
    }
    if (!camera.frames.empty()) manifest.cameras.push_back(std::move(camera));
  }
  return manifest;
}

}  // namespace raystage::exports
