// SPDX-License-Identifier: Apache-2.0
#include "compose/geometry/textures.h"

#include <dlfcn.h>

#include "base/error.h"

namespace raystage::compose {
namespace {

/// Loads the module, which stays loaded because it owns its objects.
OpenTextureLookup* load_module() {
  std::error_code error;
  const auto program = std::filesystem::read_symlink("/proc/self/exe", error);
  const std::filesystem::path file =
      (program.parent_path() / RAYSTAGE_MODULE_DIRECTORY / kTextureModule).lexically_normal();
  void* const module = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
  void* const entry = module == nullptr ? nullptr : dlsym(module, kOpenTextureLookup);
  if (entry == nullptr) {
    const char* const why = dlerror();
    throw Error::failed(std::string("textures cannot be read: ") + (why != nullptr ? why : ""),
                        file.string(), "Reinstall raystage");
  }
  return reinterpret_cast<OpenTextureLookup*>(entry);
}

}  // namespace

Textures::Handle Textures::open(const std::filesystem::path& file) {
  if (!std::filesystem::exists(file)) {
    throw Error::bad_input("the texture file does not exist", file.string(),
                           "Correct the path; a mesh file's textures are relative to it");
  }
  if (!lookup_) lookup_.reset(load_module()(cache_bytes_));
  return lookup_->open(file);
}

}  // namespace raystage::compose
