// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "store/take.h"
#include "testing/store/archive_test_data.h"

namespace raystage::testing {

/// Returns the document of a row of cameras 60 mm apart, for tests.
inline schemas::TakeDocument take_document(int cameras, double nominal_fps = 15) {
  schemas::TakeDocument take;
  take.name = "test";
  take.created_by = "test";
  take.epoch_utc = 1'767'225'600 * kNanosecondsPerSecond;
  take.nominal_fps = nominal_fps;
  take.color_space = "srgb_texture";
  take.clock = "simulated";
  take.timestamp_event = "exposure_middle";
  for (int i = 0; i < cameras; ++i) {
    schemas::TakeDocument::Camera camera;
    camera.id = "c" + std::to_string(i);
    take.cameras.push_back(camera);
  }
  return take;
}

inline schemas::RigDocument rig_document(int cameras) {
  schemas::RigDocument rig;
  rig.name = "row";
  for (int i = 0; i < cameras; ++i) {
    schemas::RigDocument::Camera camera;
    camera.geometry.id = "c" + std::to_string(i);
    camera.geometry.width = 320;
    camera.geometry.height = 240;
    camera.geometry.intrinsics = {266.29, 266.29, 160, 120, {}};
    camera.geometry.world_from_camera[3] = 0.06 * i;
    rig.cameras.push_back(camera);
  }
  return rig;
}

/// Writes a take whose camera i has (fake) frames at times[i].
inline void write_take(const std::filesystem::path& folder,
                       const std::vector<std::vector<Nanoseconds>>& times,
                       double nominal_fps = 15) {
  const int cameras = static_cast<int>(times.size());
  store::TakeWriter writer(folder, take_document(cameras, nominal_fps), rig_document(cameras));
  for (int i = 0; i < cameras; ++i) {
    for (const Nanoseconds time : times[i]) {
      writer.archive(i).append(fake_jpeg(static_cast<unsigned>(i), 30), time);
    }
  }
  writer.commit();
}

}  // namespace raystage::testing
