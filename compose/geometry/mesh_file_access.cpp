// SPDX-License-Identifier: Apache-2.0
#include "compose/geometry/mesh_file_access.h"

#include <assimp/MemoryIOWrapper.h>

#include <algorithm>
#include <cstdint>
#include <memory>
#include <string>
#include <system_error>

#include "base/atomic_file.h"
#include "base/contained_path.h"
#include "base/error.h"

namespace raystage::compose {

bool MeshFileAccess::may_read(const std::filesystem::path& file) const {
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error)) return false;
  if (file.lexically_normal() == mesh_.lexically_normal()) return true;
  const std::filesystem::path folder = mesh_.parent_path();
  return is_contained({folder, file.lexically_normal().lexically_relative(
                                   folder.empty() ? "." : folder.lexically_normal())});
}

bool MeshFileAccess::Exists(const char* file) const { return may_read(file); }

Assimp::IOStream* MeshFileAccess::Open(const char* file, const char* mode) {
  if (std::string_view(mode).find_first_of("wa+") != std::string_view::npos || !may_read(file)) {
    return nullptr;
  }
  try {
    const std::string bytes = read_file(file, kMaxSceneBytes);
    auto copy = std::make_unique<std::uint8_t[]>(std::max<std::size_t>(bytes.size(), 1));
    std::ranges::copy(bytes, copy.get());
    constexpr bool kOwns = true;
    return new Assimp::MemoryIOStream(copy.release(), bytes.size(),
                                      kOwns);  // NOLINT: its interface
  } catch (const Error&) {
    return nullptr;
  }
}

void MeshFileAccess::Close(Assimp::IOStream* stream) { delete stream; }  // NOLINT: its interface

}  // namespace raystage::compose
