// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <assimp/IOSystem.hpp>
#include <filesystem>

namespace raystage::compose {

/// The files that Assimp may read for a mesh: the mesh file itself and regular files below its
/// folder, without links, up to kMaxSceneBytes. Others do not exist for it.
class MeshFileAccess final : public Assimp::IOSystem {
 public:
  explicit MeshFileAccess(std::filesystem::path mesh) : mesh_(std::move(mesh)) {}

  bool Exists(const char* file) const override;
  char getOsSeparator() const override { return '/'; }
  Assimp::IOStream* Open(const char* file, const char* mode) override;
  void Close(Assimp::IOStream* stream) override;

 private:
  bool may_read(const std::filesystem::path& file) const;

  std::filesystem::path mesh_;
};

}  // namespace raystage::compose
