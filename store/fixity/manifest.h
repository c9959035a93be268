// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <stop_token>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "base/time.h"
#include "store/take.h"

namespace raystage::store {

/// Name of the manifest in a take's folder.
inline constexpr const char* kManifestFile = "manifest.sha256";
/// Name of its signature.
inline constexpr const char* kSignatureFile = "manifest.sha256.sig";

/// The SHA-256 of every file of a take (docs/formats/manifest.md).
struct Manifest {
  struct File {
    std::string path;    ///< relative to the take
    std::string sha256;  ///< 64 lower-case hexadecimal digits
    bool operator==(const File&) const = default;
  };
  std::string take;           ///< its name
  Nanoseconds epoch_utc = 0;  ///< since 1970
  int cameras = 0;
  std::vector<File> files;  ///< sorted by path
  bool operator==(const Manifest&) const = default;
};

/// The text of a manifest: `sha256sum --check` reads it.
std::string manifest_as_text(const Manifest& manifest);
/// Throws Error (bad input) with the line if the text is no manifest, or if a path leaves the take
/// or is listed twice. `name`: for errors.
Manifest parse_manifest(std::string_view text, const std::string& name);

/// Returns the paths of all files of a take, sorted: all regular files below its folder but hidden
/// ones, the manifest, its signature, the event log, and depth/, which is derived. Throws Error
/// (bad input) if something there is neither folder nor regular file, or if a name holds control
/// characters.
std::vector<std::string> files_of_take(const std::filesystem::path& folder);

/// What files_of_take() returns, and what it refuses.
struct FilesOfTake {
  std::vector<std::string> paths;  ///< sorted
  std::vector<Error> refused;      ///< links, special files, names, folders that cannot be read
};
FilesOfTake find_files_of_take(const std::filesystem::path& folder);

struct ManifestOptions {
  std::function<void(double)> progress;  ///< called with the share done, 0 to 1, from any thread
  std::stop_token stop;
};

/// Hashes all files of a take, several at once. Throws Error as files_of_take() and
/// sha256_of_file(), and Error (failed) if it was stopped.
Manifest make_manifest(const Take& take, const ManifestOptions& options);

/// How the files of a take differ from its manifest.
struct ManifestReport {
  Manifest manifest;
  std::vector<std::string> changed, missing;  ///< paths that are listed
  std::vector<std::string> unlisted;          ///< paths that the manifest does not know
  bool is_intact() const { return changed.empty() && missing.empty() && unlisted.empty(); }
};

/// Returns the text of a take's manifest. Throws Error (bad input) if there is none, or if it is
/// behind a link or larger than 64 MiB.
std::string read_manifest(const std::filesystem::path& folder);

/// Compares a take with a manifest, the text of read_manifest(). Files that cannot be read count as
/// changed. Throws Error (bad input) if the text is no manifest, and as files_of_take(); Error
/// (failed) if it was stopped.
ManifestReport check_manifest(const std::filesystem::path& folder, std::string_view text,
                              const ManifestOptions& options);

}  // namespace raystage::store
