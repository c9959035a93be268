// SPDX-License-Identifier: Apache-2.0
// Reads and writes the files of depth maps that were made elsewhere and imported into a take
// (docs/formats/depth.md). Cost: that of depth_file.cpp.
#include "render/depth/imported_maps.h"

#include <fmt/format.h>
#include <xxhash.h>

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <span>

#include "base/atomic_file.h"
#include "base/contained_path.h"
#include "base/error.h"
#include "base/mapped_file.h"
#include "render/depth/depth_file.h"
#include "store/rotten_frame.h"

namespace raystage::render {
namespace {

namespace fs = std::filesystem;
using ImportedDocument = schemas::ImportedDepthsDocument;

constexpr const char* kImportAgain =
    "Restore the file or import the depth maps again. Without the folder imported_depth the depths "
    "are estimated";

std::uint64_t number_from_hex(std::string_view digits) {
  std::uint64_t number = 0;
  constexpr int kBase = 16;
  std::from_chars(digits.data(), digits.data() + digits.size(), number, kBase);
  return number;
}

/// The hashes by which maps name a frame.
struct FrameHashes {
  FrameHashes(const store::Take& take, int camera, int frame)
      : recorded(imported_frame_xxh3(take, camera, frame)),
        stored(take.archive(camera).jpeg_xxh3(frame)) {}
  bool are_stated_by(const ImportedDocument::Map& map) const {
    return map.frame_xxh3 == recorded || number_from_hex(map.frame_xxh3) == stored;
  }
  std::string recorded;
  std::uint64_t stored;  ///< earlier versions named a frame of video by its own bytes
};

}  // namespace

std::string imported_frame_xxh3(const store::Take& take, int camera, int frame) {
  const store::ArchiveReader& archive = take.archive(camera);
  std::uint64_t hash = archive.recorded_xxh3(frame);
  if (hash == 0) {
    const auto jpeg = archive.jpeg(frame);
    hash = XXH3_64bits(jpeg.data(), jpeg.size());
  }
  return fmt::format("{:016x}", hash);
}

std::vector<std::byte> encode_imported_map(const InverseDepthMap& map,
                                           const std::string& frame_xxh3) {
  std::vector<std::byte> bytes;
  encode_depth_maps(std::span(&map, 1), number_from_hex(frame_xxh3),
                    [&](std::span<const std::byte> block) {
                      bytes.insert(bytes.end(), block.begin(), block.end());
                    });
  return bytes;
}

const ImportedDocument::Map* find_imported_map(const ImportedDocument& document,
                                               const store::Take& take, int camera, int frame) {
  const std::string& id = take.document().cameras[static_cast<std::size_t>(camera)].id;
  const auto of_camera = std::ranges::find(document.cameras, id, &ImportedDocument::Camera::id);
  if (of_camera == document.cameras.end()) return nullptr;
  const ImportedDocument::Map* const same_number = document.find(id, frame);
  const store::ArchiveReader& archive = take.archive(camera);
  // Reading a map compares it with its frame again.
  if (archive.is_remote()) return same_number;
  try {
    const FrameHashes hashes(take, camera, frame);
    if (same_number != nullptr && hashes.are_stated_by(*same_number)) return same_number;
    const ImportedDocument::Map* nearest = nullptr;  // equal pictures have equal hashes
    for (const ImportedDocument::Map& map : of_camera->maps) {
      if (!hashes.are_stated_by(map)) continue;
      if (nearest == nullptr || std::abs(map.frame - frame) < std::abs(nearest->frame - frame)) {
        nearest = &map;
      }
    }
    if (nearest != nullptr) return nearest;
  } catch (const store::RottenFrame&) {
    return same_number;
  }
  const auto records = archive.records();
  const bool lost_frames = std::ranges::find(records, store::FrameStatus::kTorn,
                                             &store::FrameRecord::status) != records.end();
  return lost_frames ? nullptr : same_number;
}

InverseDepthMap read_imported_map(const store::Take& take, int camera, int frame,
                                  const ImportedDocument::Map& map) {
  const ContainedPath file = take.file(fs::path(ImportedDocument::kFolder) / map.file);
  const std::string name = file.path().string();
  if (static_cast<std::size_t>(map.width) * static_cast<std::size_t>(map.height) >
      kMaxImportedPixels) {
    throw Error::bad_input(
        fmt::format("the imported depth map states {}x{} pixels, more than {} million", map.width,
                    map.height, kMaxImportedPixels >> 20U),
        name, kImportAgain);
  }
  if (!FrameHashes(take, camera, frame).are_stated_by(map)) {
    throw Error::bad_input(
        fmt::format("the imported depth map belongs to another picture than frame {} of camera "
                    "\"{}\"",
                    frame, take.document().cameras[camera].id),
        name, kImportAgain);
  }
  VirtualCamera size;
  size.width = map.width;
  size.height = map.height;
  const MappedFile mapped(file);
  std::vector<InverseDepthMap> maps;
  try {
    maps = read_mapped(
        [&] {
          return decode_depth_maps(mapped.bytes(), number_from_hex(map.frame_xxh3),
                                   std::span(&size, 1), name);
        },
        mapped);
  } catch (const Error& error) {
    if (error.exit_code() != ExitCode::kBadInput) throw;
    throw Error::bad_input(error.what_happened(), name, kImportAgain);
  }
  if (maps[0].values.empty()) {
    throw Error::bad_input("the depth file is damaged", name, kImportAgain);
  }
  return std::move(maps[0]);
}

}  // namespace raystage::render
