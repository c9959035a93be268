// SPDX-License-Identifier: Apache-2.0
// Reads any text as a manifest. What is accepted comes back as it was, and lists no path outside of
// the take.
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <string_view>

#include "base/error.h"
#include "store/fixity/manifest.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace raystage;
  try {
    const store::Manifest manifest =
        store::parse_manifest({reinterpret_cast<const char*>(data), size}, "fuzz");
    for (const store::Manifest::File& file : manifest.files) {
      const std::filesystem::path path(file.path);
      if (path.is_absolute() || *path.begin() == "..") std::abort();
    }
    if (store::parse_manifest(store::manifest_as_text(manifest), "fuzz") != manifest) std::abort();
  } catch (const Error&) {
  }
  return 0;
}
