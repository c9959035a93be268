// SPDX-License-Identifier: Apache-2.0
#include "meshes/scene_decoder.h"

#include <algorithm>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "base/atomic_file.h"
#include "base/error.h"
#include "base/resources.h"
#include "meshes/scene_encoding.h"
#include "sandbox/byte_encoding.h"

namespace raystage::meshes {
namespace {

namespace fs = std::filesystem;

/// Assimp's data structures are many times as large as the file.
std::size_t memory_for(std::uint64_t file_bytes) {
  constexpr std::uint64_t kOther = 64'000'000, kPerByte = 60;
  return static_cast<std::size_t>(
      std::min<std::uint64_t>(kOther + kPerByte * file_bytes, available_memory()));
}

std::chrono::seconds time_for(std::uint64_t file_bytes) {
  constexpr std::uint64_t kAtLeast = 2, kAtMost = 120, kBytesPerSecond = 2'000'000;
  return std::chrono::seconds(std::min(kAtLeast + file_bytes / kBytesPerSecond, kAtMost));
}

/// Returns the size of all files that the decoder may read, bytes. The buffers of a glTF file may
/// have any name below its folder.
std::uint64_t readable_bytes(const fs::path& mesh) {
  constexpr int kMaxFiles = 10000;  // of a folder that holds other things, too
  std::error_code error;
  std::uint64_t sum = fs::file_size(mesh, error);
  if (error) return 0;
  int files = 0;
  const fs::path folder = mesh.parent_path().empty() ? "." : mesh.parent_path();
  for (fs::recursive_directory_iterator
           entry(folder, fs::directory_options::skip_permission_denied, error),
       end;
       !error && entry != end && files < kMaxFiles && sum < kMaxSceneBytes;
       entry.increment(error), ++files) {
    std::error_code of_entry;
    const bool is_file = entry->symlink_status(of_entry).type() == fs::file_type::regular;
    const std::uint64_t size = is_file ? entry->file_size(of_entry) : 0;
    if (!of_entry) sum += size;
  }
  return std::min(sum, kMaxSceneBytes);
}

}  // namespace

DecodedScene decode_scene(const fs::path& file, const DecodeOptions& options) {
  if (!file_exists(file)) {
    throw Error::bad_input("the mesh file does not exist", file.string(),
                           "Correct the layer's path; it is relative to the shot's folder");
  }
  if (std::error_code error; fs::status(file, error).type() != fs::file_type::regular) {
    throw Error::bad_input("the mesh is no file, but a folder, a pipe or a device", file.string(),
                           "Correct the layer's path");
  }
  const std::uint64_t size = readable_bytes(file);
  sandbox::DecoderOptions process;
  process.program = "raystage-decode-mesh";
  process.kind = "mesh";
  process.memory_bytes = memory_for(size);
  process.result_bytes = process.memory_bytes;
  process.time = time_for(size);
  process.confinement = options.confinement;
  sandbox::ByteWriter request;
  request.write(std::uint8_t{options.applies_unit});
  request.write_plain(file.string());
  const std::vector<std::byte> bytes = sandbox::run_decoder(
      process, request.take(), file, sandbox::files_below_folder_of(file, kMaxSceneBytes));
  try {
    return decode_scene_bytes(bytes);
  } catch (const std::runtime_error& error) {
    std::string reason = error.what();
    while (reason.ends_with('.')) reason.pop_back();
    throw Error::bad_input("the mesh cannot be read: " + reason, file.string(), "Export it again");
  }
}

}  // namespace raystage::meshes
