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

/// Writes a small take, shots, meshes, pictures and documents into `folder`, by Raystage's
/// commands. Throws std::runtime_error if a command fails.
void write_attack_scene(const std::filesystem::path& folder);

/// Returns the formats of the scene; `folder` as above, after it was written.
std::vector<AttackedFormat> attacked_formats(const std::filesystem::path& folder);

}  // namespace raystage::testing
