// SPDX-License-Identifier: Apache-2.0
#include "store/unlisted_frames.h"

#include <cstdint>

#include "base/error.h"
#include "base/posix_file.h"
#include "store/archive.h"
#include "store/matroska.h"

namespace raystage::store {

std::size_t count_listed_records(const std::filesystem::path& archive,
                                 const std::filesystem::path& journal) {
  const ArchiveReader reader(archive, journal);
  return reader.records().size() - static_cast<std::size_t>(reader.recovered_frames());
}

void discard_unlisted_frames(const std::filesystem::path& archive,
                             const std::filesystem::path& journal) {
  std::uint64_t end = 0;
  {
    const ArchiveReader reader(archive, journal);
    const auto frames = reader.frames();
    for (auto frame = frames.rbegin(); frame != frames.rend() && frame->xxh3 == 0; ++frame) {
      end = frame->offset - matroska::kClusterHeaderBytes;
    }
  }
  if (end == 0) return;
  OutputFile file(archive, OutputFile::Open::kExisting);
  if (file.truncate(end)) return;
  throw Error::from_errno("the archive cannot be truncated", archive.string(),
                          "Check the disk and its permissions");
}

}  // namespace raystage::store
