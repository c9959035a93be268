// SPDX-License-Identifier: Apache-2.0
// For tests of exports: takes with known frames and times, and other programs that read the output.
#pragma once

#include <gtest/gtest.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "base/atomic_file.h"
#include "base/child_process.h"
#include "schemas/rig_document.h"
#include "store/jpeg/encode.h"
#include "store/take.h"
#include "store/timeline.h"
#include "testing/store/take_test_data.h"
#include "testing/store/test_images.h"
#include "testing/test_folder.h"

namespace raystage::testing {

/// Returns what a program prints on both streams; fails the test if it cannot run or fails.
inline std::string output_of_program(const std::vector<std::string>& command) {
  ChildOptions options;
  options.timeout_seconds = 300;
  options.max_output_bytes = std::size_t{64} << 20;
  const ChildResult result = run_child(command, options);
  EXPECT_EQ(result.exit_code, 0) << command.front() << ": " << result.out;
  return result.out;
}

/// Returns the lines of a text, without empty ones.
inline std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) {
    if (!line.empty()) lines.push_back(line);
  }
  return lines;
}

/// Returns the numbers of a column of a CSV text, by the names in its first line.
inline std::vector<std::string> csv_column(const std::string& text, const std::string& name) {
  std::vector<std::string> column;
  int index = -1;
  for (const std::string& line : lines_of(text)) {
    std::vector<std::string> fields;
    std::istringstream stream(line + ",");
    for (std::string field; std::getline(stream, field, ',');) fields.push_back(field);
    if (index < 0) {
      for (std::size_t i = 0; i < fields.size(); ++i) {
        if (fields[i] == name) index = static_cast<int>(i);
      }
      EXPECT_GE(index, 0) << "no column " << name;
      if (index < 0) return {};
    } else {
      column.push_back(fields.at(static_cast<std::size_t>(index)));
    }
  }
  return column;
}

/// A take of three cameras with 15 frames/s, irregular times, a lost frame and a gap.
///
/// c0 has the frames 0 to 7; c1 lacks frame 3 (recorded as dropped); c2 lacks frames 4 and 5.
struct ExportTake {
  static constexpr int kCameras = 3, kFrames = 8, kWidth = 48, kHeight = 32;
  static constexpr Nanoseconds kPeriod = 66'666'667;

  static Nanoseconds time_of(int camera, int frame) {
    return 1'000'000'001 + frame * kPeriod + 1'234'567 * camera + 7919 * ((frame * 37) % 11);
  }
  static bool has_frame(int camera, int frame) {
    return !(camera == 1 && frame == 3) && !(camera == 2 && (frame == 4 || frame == 5));
  }
  static store::RgbImage picture(int camera, int frame) {
    return make(Kind::kMixed, kWidth, kHeight,
                static_cast<std::uint32_t>(100 * camera + frame + 1));
  }
  static std::vector<std::byte> jpeg(int camera, int frame) {
    store::JpegEncodeOptions options;
    options.quality = 90;
    return store::encode_jpeg(picture(camera, frame), options);
  }

  explicit ExportTake(bool is_synchronised = true, schemas::RigDocument rig = default_rig()) {
    store::TakeWriter writer(path(), take_document(kCameras), std::move(rig));
    for (int camera = 0; camera < kCameras; ++camera) {
      for (int frame = 0; frame < kFrames; ++frame) {
        if (has_frame(camera, frame)) {
          writer.archive(camera).append(jpeg(camera, frame), time_of(camera, frame));
        } else if (camera == 1) {
          writer.archive(camera).append_missing(store::FrameStatus::kDroppedBySource,
                                                time_of(camera, frame));
        }
      }
    }
    writer.commit();
    if (!is_synchronised) return;
    const store::Take take(path());
    store::write_timeline(store::build_timeline(take, 15, 0), take);
  }
  static schemas::RigDocument default_rig() {
    schemas::RigDocument rig = rig_document(kCameras);
    for (schemas::RigDocument::Camera& camera : rig.cameras) {
      camera.geometry.width = kWidth;
      camera.geometry.height = kHeight;
      camera.geometry.intrinsics = {40, 40, 24.5, 15.5, {}};
    }
    return rig;
  }

  std::filesystem::path path() const { return folder.path() / "take"; }
  std::filesystem::path out(const std::string& name) const { return folder.path() / name; }
  store::Take take() const { return store::Take(path()); }
  /// Changes a byte of a stored frame, as a failing disk does.
  void rot(int camera, int source) const {
    const store::Take opened(path());
    const store::FrameRecord record =
        opened.archive(camera).frames()[static_cast<std::size_t>(source)];
    const std::filesystem::path file = path() / opened.document().cameras[camera].archive;
    std::fstream stream(file, std::ios::binary | std::ios::in | std::ios::out);
    const auto at = static_cast<std::streamoff>(record.offset + record.size / 2);
    stream.seekg(at);
    const int byte = stream.get();
    stream.seekp(at);
    stream.put(static_cast<char>(byte ^ 0x10));
  }
  /// Returns the names in the folder of the take, with hidden ones.
  std::vector<std::string> names() const {
    std::vector<std::string> result;
    for (const auto& entry : std::filesystem::directory_iterator(folder.path())) {
      result.push_back(entry.path().filename().string());
    }
    std::ranges::sort(result);
    return result;
  }

  TestFolder folder;
};

}  // namespace raystage::testing
