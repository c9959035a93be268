// SPDX-License-Identifier: Apache-2.0
// An object of the Oxford Common File Layout, version 1.1 (https://ocfl.io/1.1/spec/), with one
// version.
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <string_view>

namespace raystage::store {

/// Where the files of the first version are, below the object.
inline constexpr const char* kOcflContent = "v1/content";

struct OcflFile {
  std::string path;            ///< logical path, which is also that below kOcflContent
  std::string sha512, sha256;  ///< lower-case hexadecimal digits; sha256 may be empty
};

struct OcflVersion {
  std::string id;           ///< of the object, a URI
  std::string created_utc;  ///< RFC 3339, e.g. 2026-01-01T00:00:00Z
  std::string message;
  std::string user, user_address;  ///< who made it; an address is a URI
};

/// Writes declaration, inventories and sidecars of an object whose files are below
/// `object`/v1/content already. Throws Error (failed) if the disk fails.
void write_ocfl_object(const std::filesystem::path& object, const OcflVersion& version,
                       std::span<const OcflFile> files);

}  // namespace raystage::store
