// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>  // mkdtemp is POSIX

#include <chrono>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>

#include "testing/test_paths.h"
#include "tests/end_to_end/run_command.h"

namespace raystage::testing {

/// A folder with a small take, shots of it, and a copy of the programs that a test may replace.
class FarmJobTest : public ::testing::Test {
 protected:
  void SetUp() override {
    // A short path, because paths of UNIX sockets are limited.
    std::string name = (std::filesystem::temp_directory_path() / "farm-XXXXXX").string();
    ASSERT_NE(mkdtemp(name.data()), nullptr);
    folder_ = name;
    std::filesystem::permissions(folder_, std::filesystem::perms(0755));
    std::filesystem::create_directories(folder_ / "show dir");
    const CommandResult made = here(
        "raystage simulate stage -q --rows 2 --columns 2 --width 96 --height 72 --fps 10 "
        "--spacing-mm 60 --seconds 3.6 --truth-views 0 -o 'show dir/take' && raystage sync -q "
        "'show "
        "dir/take'");
    ASSERT_EQ(made.exit_code, 0) << made.err;
    write_shot("shot", 48, 1, "focal_plane");
  }
  void TearDown() override {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }

  /// Writes a shot. `speed` 0 freezes the take.
  void write_shot(const std::string& name, int frames, double speed, const std::string& method,
                  const std::string& options = "{}") const {
    write_text(
        folder_ / "show dir" / (name + ".json"),
        R"({"schema": "raystage/shot/2", "name": ")" + name +
            R"(", "width": 160, "height": 120, "fps": 24, "first_frame": 1, "last_frame": )" +
            std::to_string(frames) + R"(, "camera": {"keys": [
  {"frame": 1, "position": [-0.03, 0, 0.1], "target": [0, 0, -5], "horizontal_fov_deg": 40},
  {"frame": 48, "position": [0.03, 0, 0.1], "target": [0, 0, -5], "horizontal_fov_deg": 40}]},
  "layers": [{"name": "field", "take": "take", "method": ")" +
            method + R"(", "options": )" + options +
            R"(, "focal_plane": {"depth_m": 5}, "start_seconds": 0.5, "speed": )" +
            std::to_string(speed) + "}]}");
  }

  CommandResult here(const std::string& command) const {
    return run("cd '" + folder_.string() + "' && export PATH='" + (folder_ / "bin").string() +
               "':\"$PATH\" && " + command);
  }

  /// Copies the programs to folder_/bin, where `script` replaces raystage-render and can run the
  /// original as "$TRUE_RENDER".
  void replace_render_program(const std::string& script) const {
    const auto bin = folder_ / "bin";
    std::filesystem::create_directories(bin);
    for (const auto& file : std::filesystem::directory_iterator(testing::commands_folder())) {
      const std::string program = file.path().filename().string();
      if (!program.starts_with("raystage") || program.ends_with("_test")) continue;
      // Hard links: a program finds the others next to its own name.
      std::error_code other_disk;
      std::filesystem::create_hard_link(file.path(), bin / program, other_disk);
      if (other_disk) std::filesystem::copy_file(file.path(), bin / program);
    }
    // Programs find those of lib/raystage beside the folder that they stand in.
    std::filesystem::create_directory_symlink(testing::commands_folder().parent_path() / "lib",
                                              folder_ / "lib");
    std::filesystem::remove(bin / "raystage-render");
    write_text(bin / "raystage-render",
               "#!/bin/bash\nTRUE_RENDER='" + testing::commands_folder().string() +
                   "/raystage-render'\n" + script + "\nexec \"$TRUE_RENDER\" \"$@\"\n");
    std::filesystem::permissions(bin / "raystage-render", std::filesystem::perms::all);
  }

  nlohmann::json status(const std::string& output) const {
    return nlohmann::json::parse(here("raystage farm status --json '" + output + "'").out);
  }

  /// Returns the bytes of frames by file name.
  static std::map<std::string, std::string> frames_in(const std::filesystem::path& folder) {
    std::map<std::string, std::string> frames;
    for (const auto& file : std::filesystem::directory_iterator(folder)) {
      if (file.path().extension() != ".exr" || file.path().filename().string().starts_with('.'))
        continue;
      frames[file.path().filename().string()] = read_text(file.path());
    }
    return frames;
  }

  static bool wait_for(double seconds, const std::function<bool()>& done) {
    const auto until = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
    while (std::chrono::steady_clock::now() < until) {
      if (done()) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(200));
    }
    return false;
  }

  std::filesystem::path folder_;
};

}  // namespace raystage::testing
