// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "base/transfer_function.h"
#include "compose/exr/exr_file.h"
#include "compose/sequence.h"
#include "compose/sequence_name.h"
#include "schemas/shot_document.h"
#include "store/jpeg/encode.h"
#include "store/take.h"
#include "store/timeline.h"
#include "testing/compose/test_camera_key.h"
#include "testing/test_folder.h"

namespace raystage::testing {

constexpr int kCameras = 4, kTicks = 6, kWidth = 64, kHeight = 48;
constexpr Nanoseconds kInterval = kNanosecondsPerSecond / 10;
constexpr int kFirstGrey = 60, kStep = 20;

/// Writes a take of 2 x 2 cameras 10 cm apart that look along -z at a wall, whose grey code
/// increases by `kStep` per tick. The last camera drops the frame of tick 2.
inline void write_wall_take(const std::filesystem::path& folder, int width = kWidth,
                            int height = kHeight) {
  schemas::TakeDocument take;
  take.name = "wall";
  take.created_by = "test";
  take.epoch_utc = 1'700'000'000 * kNanosecondsPerSecond;
  take.nominal_fps = 10;
  take.color_space = "srgb_texture";
  take.depth_range = schemas::DepthRange{2, 6};
  schemas::RigDocument rig;
  rig.name = "four";
  for (int i = 0; i < kCameras; ++i) {
    schemas::RigDocument::Camera camera;
    schemas::CameraGeometry& g = camera.geometry;
    g.id = "c" + std::to_string(i);
    g.width = width;
    g.height = height;
    g.intrinsics = {0.9375 * width, 0.9375 * width, width / 2.0, height / 2.0, {}};
    const int row = i / 2, column = i % 2;
    g.world_from_camera[3] = 0.1 * column;
    g.world_from_camera[7] = -0.1 * row;
    rig.cameras.push_back(camera);
    take.cameras.push_back({g.id, "", "", ""});
  }
  store::TakeWriter writer(folder, take, rig);
  for (int i = 0; i < kCameras; ++i) {
    for (int tick = 0; tick < kTicks; ++tick) {
      if (i == 3 && tick == 2) continue;
      store::RgbImage image{width, height, std::vector<std::uint8_t>()};
      image.values.assign(static_cast<std::size_t>(width) * static_cast<std::size_t>(height) * 3,
                          static_cast<std::uint8_t>(kFirstGrey + kStep * tick));
      writer.archive(i).append(store::encode_jpeg(image, {}),
                               kInterval + tick * kInterval + i * 1000);
    }
  }
  writer.commit();
  store::write_timeline(store::build_timeline(store::Take(folder), 10, 0), folder);
}

/// Returns a shot with one frame per tick, starting at 101.
inline schemas::ShotDocument wall_shot() {
  schemas::ShotDocument shot;
  shot.name = "sh";
  shot.width = 40;
  shot.height = 30;
  shot.fps = shot.fps_numerator = 10;
  shot.first_frame = 101;
  shot.last_frame = 106;
  shot.camera.keys.push_back(testing::camera_key(101, {0.03, -0.03, 0}, 40));
  shot.camera.keys.push_back(testing::camera_key(106, {0.04, -0.03, 0}, 40));
  schemas::ShotDocument::Layer layer;
  layer.take = "take";
  shot.layers.push_back(layer);
  return shot;
}

/// Renders wall_shot() of a wall take.
class SequenceTest : public ::testing::Test {
 protected:
  void SetUp() override {
    write_wall_take(folder_.path() / "take");
    options_.output = (folder_.path() / "out" / "a.####.exr").string();
    options_.program_version = "0.1.0";
    options_.on_message = [this](std::string_view line) {
      const std::scoped_lock lock(mutex_);
      messages_.emplace_back(line);
    };
    options_.progress = [this](double done) {
      const std::scoped_lock lock(mutex_);
      progress_ = std::max(progress_, done);
    };
  }

  compose::SequenceReport run(std::stop_token stop = {}) {
    schemas::write_shot(shot_, shot_file());
    return compose::render_sequence(shot_file(), options_, std::move(stop));
  }
  /// Returns the text of the Error that the run throws.
  std::string refusal(ExitCode code = ExitCode::kBadInput) {
    try {
      run();
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), code) << error.what();
      return error.what();
    }
    return "no error";
  }
  std::filesystem::path shot_file() const { return folder_.path() / "shot.json"; }
  std::filesystem::path file(int frame) const {
    return compose::SequenceName(options_.output).path(frame);
  }
  int files() const {
    int count = 0;
    std::error_code none;
    for (auto& entry : std::filesystem::directory_iterator(folder_.path() / "out", none)) {
      count += entry.is_regular_file() ? 1 : 0;
    }
    return count;
  }
  /// Returns the linear value and alpha at the centre of a frame.
  std::pair<float, float> middle(int frame) const {
    const compose::ExrImage image = compose::read_exr(file(frame));
    const std::size_t at = (15 * 40 + 20) * 4;
    return {image.rgba.at(at), image.rgba.at(at + 3)};
  }
  static float grey(int tick) {
    return static_cast<float>(linear_from_srgb((kFirstGrey + kStep * tick) / 255.0));
  }

  TestFolder folder_;
  schemas::ShotDocument shot_ = wall_shot();
  compose::SequenceOptions options_;
  std::mutex mutex_;
  std::vector<std::string> messages_;
  double progress_ = 0;
};

}  // namespace raystage::testing
