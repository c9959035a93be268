// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <string>
#include <vector>

#include "base/atomic_file.h"
#include "schemas/shot_document.h"
#include "store/timeline.h"
#include "testing/cli/test_command.h"
#include "testing/compose/test_camera_key.h"
#include "testing/render/synthetic_take.h"
#include "testing/test_folder.h"

namespace raystage::testing {

/// Returns the contents of the files below a folder by their relative paths.
inline std::map<std::string, std::string> files_under(const std::filesystem::path& folder) {
  std::map<std::string, std::string> files;
  std::error_code none;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder, none)) {
    if (!entry.is_regular_file()) continue;
    files[entry.path().lexically_relative(folder).string()] = read_file(entry.path());
  }
  return files;
}

/// Returns the names of files that are only in one of two folders or differ, but those in depth/
/// and the event log.
inline std::vector<std::string> different_files(const std::filesystem::path& a,
                                                const std::filesystem::path& b) {
  const auto first = files_under(a), second = files_under(b);
  std::vector<std::string> names;
  const auto add = [&](const std::string& name) {
    if (!name.starts_with("depth/") && name != "events.jsonl") names.push_back(name);
  };
  for (const auto& [name, bytes] : first) {
    const auto other = second.find(name);
    if (other == second.end() || other->second != bytes) add(name);
  }
  for (const auto& [name, bytes] : second) {
    if (!first.contains(name)) add(name);
  }
  return names;
}

/// A shot of two frames from a take with nine cameras and two ticks that shows a textured plane.
class RenderCommandTest : public ::testing::Test {
 protected:
  static constexpr int kFrames = 2;

  void SetUp() override {
    testing::SyntheticTake take;
    take.cameras = testing::camera_grid(3, 3, 0.1, 96, 72);
    take.depth_range = schemas::DepthRange{3, 5};
    take.frames = kFrames;
    write_synthetic_take(take, path("take"));
    store::write_timeline(store::build_timeline(store::Take(path("take")), 15, 0), path("take"));
    shot_.width = 64;
    shot_.height = 48;
    shot_.fps = shot_.fps_numerator = 15;
    shot_.first_frame = 1;
    shot_.last_frame = kFrames;
    shot_.camera.keys.push_back(testing::camera_key(1, {0.02, 0.01, 0}, 40));
    schemas::ShotDocument::Layer layer;
    layer.take = "take";
    layer.method = "depth";
    shot_.layers.push_back(layer);
  }
  std::filesystem::path path(const std::string& name) const { return folder_.path() / name; }
  std::string quoted(const std::string& name) const { return "'" + path(name).string() + "'"; }
  /// Renders the shot to the folder `out`.
  CommandResult render(const std::string& out, const std::string& options = "") const {
    schemas::write_shot(shot_, path("shot.json"));
    return run_raystage("render " + quoted("shot.json") + " --progress none -o '" +
                        (path(out) / "f.####.exr").string() + "' " + options);
  }

  TestFolder folder_;
  schemas::ShotDocument shot_;
};

}  // namespace raystage::testing
