// SPDX-License-Identifier: Apache-2.0
// Representation information of a take: the formats of its files, where they are described, and
// their identifiers in PRONOM, the registry of The National Archives (UK).
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace raystage::store {

struct FileFormat {
  std::string_view files;    ///< which files of a take have it
  std::string_view name;     ///< e.g. "Matroska"
  std::string_view version;  ///< of the format; empty: stated in the files
  std::string_view pronom;   ///< e.g. "fmt/569"; empty: none registered
  std::string_view page;     ///< where it is described, below representation/; empty: nowhere
};

/// Returns the format of a file, by its path relative to the take.
const FileFormat& format_of_file(std::string_view path);

/// Returns all formats of takes and of the frames in their archives, as CSV (RFC 4180) with a
/// header: files, format, version, PRONOM identifier or "none registered", page.
std::string file_formats_as_csv();

/// Returns a field of a CSV file, in quotes where needed (RFC 4180).
std::string csv_field(std::string_view text);

/// Copies the pages of docs/formats, the schemas and the reader, which are installed as formats/,
/// schemas/ and reader/ below `from`, to the same folders below `to`. Returns the paths below `to`.
/// Throws Error (failed) if one of them is missing, or the disk fails.
std::vector<std::string> copy_representation(const std::filesystem::path& from,
                                             const std::filesystem::path& to);

}  // namespace raystage::store
