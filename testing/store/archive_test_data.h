// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <fstream>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "base/atomic_file.h"
#include "store/archive.h"
#include "testing/test_folder.h"

namespace raystage::testing {

/// Returns bytes in place of a JPEG for tests (archives do not parse it), the same for the same
/// seed. They contain Matroska's cluster identifier, as JPEG data may by chance.
inline std::vector<std::byte> fake_jpeg(unsigned seed, std::size_t size = 60) {
  std::mt19937 random(seed);
  std::vector<std::byte> bytes(size);
  for (std::byte& byte : bytes) byte = static_cast<std::byte>(random() & 0xFF);
  constexpr unsigned char kCluster[] = {0x1F, 0x43, 0xB6, 0x75, 0x80};
  for (std::size_t i = 0; i < sizeof(kCluster) && i + 10 < size; ++i) {
    bytes[i + 10] = static_cast<std::byte>(kCluster[i]);
  }
  return bytes;
}

inline std::vector<std::byte> bytes_of(const std::filesystem::path& file) {
  const std::string text = read_file(file);
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

/// Writes as write_file_atomically does, but does not wait for the disk.
inline void overwrite(const std::filesystem::path& file, std::span<const std::byte> bytes) {
  std::ofstream stream(file, std::ios::binary | std::ios::trunc);
  stream.write(reinterpret_cast<const char*>(bytes.data()),
               static_cast<std::streamsize>(bytes.size()));
}

inline store::ArchiveWriter::Description description() {
  return {"r0c0", 640, 480, 1'767'225'600'123'456'789};
}

/// For tests: an archive and its journal, in a folder of their own.
struct ArchiveFiles {
  store::ArchiveWriter writer() const { return {mkv, journal, description()}; }
  store::ArchiveReader reader() const { return {mkv, journal}; }

  TestFolder folder;
  std::filesystem::path mkv = folder.path() / "r0c0.mkv";
  std::filesystem::path journal = folder.path() / "r0c0.journal";
};

}  // namespace raystage::testing
