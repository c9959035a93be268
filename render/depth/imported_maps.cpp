// SPDX-License-Identifier: Apache-2.0
// Reads and writes the files of depth maps that were made elsewhere and imported into a take
// (docs/formats/depth.md). Cost: that of depth_file.cpp.
#include "render/depth/imported_maps.h"

#include <fmt/format.h>
#include <xxhash.h>

#include <charconv>
#include <cstdint>
#include <filesystem>
#include <span>

#include "base/atomic_file.h"
#include "base/contained_path.h"
#include "base/error.h"
#include "base/mapped_file.h"
#include "render/depth/depth_file.h"

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

InverseDepthMap read_imported_map(const store::Take& take, int camera,
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
  // Earlier versions named a frame of video by its own bytes.
  if (imported_frame_xxh3(take, camera, map.frame) != map.frame_xxh3 &&
      number_from_hex(map.frame_xxh3) != take.archive(camera).jpeg_xxh3(map.frame)) {
    throw Error::bad_input(
        fmt::format("the imported depth map belongs to another picture than frame {} of camera "
                    "\"{}\"",
                    map.frame, take.document().cameras[camera].id),
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
