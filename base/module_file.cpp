// SPDX-License-Identifier: Apache-2.0
#include "base/module_file.h"

#include <dlfcn.h>

#include <system_error>

#include "base/error.h"

namespace raystage {

namespace fs = std::filesystem;

fs::path module_path(const std::string& name) {
  std::error_code error;
  const fs::path command = fs::read_symlink("/proc/self/exe", error).parent_path();
  const fs::path expected = (command / RAYSTAGE_MODULE_DIRECTORY / name).lexically_normal();
  if (fs::exists(expected, error)) return expected;
  Dl_info info{};
  if (::dladdr(reinterpret_cast<const void*>(&module_path), &info) == 0) return expected;
  const fs::path library = fs::canonical(info.dli_fname, error).parent_path();
  for (const fs::path folder : {"raystage", "../raystage", RAYSTAGE_MODULE_DIRECTORY}) {
    const fs::path found = (library / folder / name).lexically_normal();
    if (fs::exists(found, error)) return found;
  }
  return expected;
}

void* load_module(const std::string& name, const char* entry, const std::string& purpose) {
  const fs::path file = module_path(name);
  void* const module = ::dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
  void* const address = module == nullptr ? nullptr : ::dlsym(module, entry);
  if (address == nullptr) {
    const char* const why = ::dlerror();
    throw Error::failed(purpose + ": " + (why != nullptr ? why : ""), file.string(),
                        "Reinstall raystage");
  }
  return address;
}

}  // namespace raystage
