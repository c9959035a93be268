// SPDX-License-Identifier: Apache-2.0
#include "store/bagit/file_formats.h"

#include <fmt/format.h>

#include <algorithm>
#include <system_error>

#include "base/atomic_file.h"
#include "base/error.h"

namespace raystage::store {
namespace {

namespace fs = std::filesystem;

constexpr FileFormat kArchiveFormat{"archive/*.mkv", "Matroska (RFC 9559)", "4", "fmt/569",
                                    "formats/archive.md"};
constexpr FileFormat kJournalFormat{"archive/*.journal",
                                    "Raystage journal; bytes 8 to 11 state the version", "", "",
                                    "formats/journal.md"};
constexpr FileFormat kTimelineFormat{"timeline.zst", "Raystage timeline, compressed by Zstandard",
                                     "", "", "formats/timeline.md"};
constexpr FileFormat kEventsFormat{"events.jsonl", "Raystage event log: a line of JSON per event",
                                   "1", "", "formats/events.md"};
constexpr FileFormat kManifestFormat{"manifest.sha256", "Raystage manifest: UTF-8 text", "1",
                                     "x-fmt/111", "formats/manifest.md"};
constexpr FileFormat kSignatureFormat{"manifest.sha256.sig", "SSH signature (SSHSIG)", "1", "",
                                      "formats/manifest.md"};
constexpr FileFormat kJsonFormat{"*.json", "JSON (RFC 8259); \"schema\" states schema and version",
                                 "", "fmt/817", "formats/documents.md"};
constexpr FileFormat kPngFormat{"*.png", "Portable Network Graphics", "1.2", "fmt/13",
                                "formats/mattes.md"};
constexpr FileFormat kDepthFormat{"imported_depth/*/*.zst",
                                  "Raystage depth map, compressed by Zstandard", "1", "",
                                  "formats/depth.md"};
constexpr FileFormat kOtherFormat{"all other files", "unknown", "", "", ""};
// In archives.
constexpr FileFormat kJpegFormat{"frames in archive/*.mkv, codec V_MJPEG",
                                 "JPEG (ISO/IEC 10918-1); fmt/43 of frames that Raystage encoded, "
                                 "of others the kind that their camera made",
                                 "", "fmt/43", "formats/jpeg.md"};
constexpr FileFormat kJpegXlFormat{"frames in archive/*.mkv, codec V_JPEGXL",
                                   "JPEG XL container (ISO/IEC 18181-2)", "", "fmt/1485",
                                   "formats/archive.md"};
constexpr FileFormat kPictureFormat{"frames in archive/*.mkv, codec V_JPEGXL/PICTURE",
                                    "JPEG XL container (ISO/IEC 18181-2)", "", "fmt/1485",
                                    "formats/archive.md"};
constexpr FileFormat kHevcFormat{"frames in archive/*.mkv, codec V_MPEGH/ISO/HEVC",
                                 "HEVC byte stream (ITU-T H.265, Annex B)", "", "",
                                 "formats/archive.md"};
constexpr FileFormat kAv1Format{"frames in archive/*.mkv, codec V_AV1",
                                "AV1 open bitstream units (AV1 Bitstream and Decoding Process)", "",
                                "", "formats/archive.md"};

}  // namespace

std::string csv_field(std::string_view text) {
  if (text.find_first_of("\",\r\n") == std::string_view::npos) return std::string(text);
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"') quoted += '"';
    quoted += c;
  }
  return quoted + '"';
}

const FileFormat& format_of_file(std::string_view path) {
  const fs::path parsed(path);
  const std::string name = parsed.filename().string(), extension = parsed.extension().string();
  if (name == "manifest.sha256") return kManifestFormat;
  if (name == "manifest.sha256.sig") return kSignatureFormat;
  if (path == "events.jsonl") return kEventsFormat;
  if (path == "timeline.zst") return kTimelineFormat;
  if (extension == ".mkv") return kArchiveFormat;
  if (extension == ".journal") return kJournalFormat;
  if (extension == ".json") return kJsonFormat;
  if (extension == ".png") return kPngFormat;
  if (extension == ".zst" && path.starts_with("imported_depth/")) return kDepthFormat;
  return kOtherFormat;
}

std::string file_formats_as_csv() {
  std::string csv = "files,format,version,PRONOM,page\r\n";
  for (const FileFormat* format :
       {&kArchiveFormat, &kJpegFormat, &kJpegXlFormat, &kPictureFormat, &kHevcFormat, &kAv1Format,
        &kJournalFormat, &kJsonFormat, &kTimelineFormat, &kDepthFormat, &kEventsFormat,
        &kManifestFormat, &kSignatureFormat, &kPngFormat, &kOtherFormat}) {
    csv += fmt::format("{},{},{},{},{}\r\n", csv_field(format->files), csv_field(format->name),
                       csv_field(format->version),
                       csv_field(format->pronom.empty() ? "none registered" : format->pronom),
                       csv_field(format->page));
  }
  return csv;
}

std::vector<std::string> copy_representation(const fs::path& from, const fs::path& to) {
  std::vector<std::string> paths;
  for (const char* part : {"formats", "schemas", "reader"}) {
    std::error_code error;
    std::vector<std::string> names;
    for (fs::directory_iterator entry(from / part, error), last; !error && entry != last;
         entry.increment(error)) {
      const std::string extension = entry->path().extension().string();
      const std::string name = entry->path().filename().string();
      const bool is_wanted = extension == ".md" || extension == ".json" || extension == ".py";
      if (is_wanted && name != "README.md") names.push_back(name);
    }
    if (error || names.empty()) {
      throw Error::failed("the descriptions of the formats, which belong into the bag, are missing",
                          (from / part).string(), "Install Raystage again");
    }
    std::ranges::sort(names);
    create_folder(to / part);
    for (const std::string& name : names) {
      write_file_atomically(to / part / name, read_file(from / part / name));
      paths.push_back(std::string(part) + "/" + name);
    }
  }
  return paths;
}

}  // namespace raystage::store
