// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace raystage::testing {

/// A kind of file that a stranger could send, and a command that reads it.
struct AttackedFormat {
  std::string name;
  std::string file;  ///< relative to the scene; it is replaced by mutations of itself
  bool is_text = true;
  std::string command;                  ///< run in the scene; its pictures are out/*.exr
  int seed_exit_code = 0;               ///< of the command with the file as it is
  bool keeps_earlier_pictures = false;  ///< the command may keep a picture that it did not render
};

/// Returns a shell command that runs all of them and ends with the largest of their exit codes.
std::string all_of(const std::vector<std::string>& commands);

/// Runs a shell command in a folder. Throws std::runtime_error unless its exit code is 0.
void run_or_throw(const std::filesystem::path& folder, const std::string& command);

/// Writes a small take, shots, meshes, pictures and documents into `folder`, by Raystage's
/// commands. Throws std::runtime_error if a command fails.
void write_attack_scene(const std::filesystem::path& folder);

/// Returns the formats of the scene; `folder` as above, after it was written.
std::vector<AttackedFormat> attacked_formats(const std::filesystem::path& folder);

}  // namespace raystage::testing
