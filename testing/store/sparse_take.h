// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <xxhash.h>

#include <filesystem>
#include <stdexcept>
#include <vector>

#include "base/posix_file.h"
#include "store/journal.h"
#include "store/matroska.h"
#include "testing/store/take_test_data.h"

namespace raystage::testing {

/// Writes a take of one camera whose frames are zeros that take no space on the disk: as large as
/// wished. Its archive is closed, and its journal states the XXH3 of the zeros.
inline void write_sparse_take(const std::filesystem::path& folder, int frames,
                              std::uint32_t frame_bytes) {
  store::TakeWriter(folder, take_document(1), rig_document(1)).commit();
  const store::Take take(folder);
  const store::ArchiveWriter::Description description = take.archive(0).description();
  raystage::OutputFile archive(folder / take.document().cameras[0].archive,
                               raystage::OutputFile::Open::kExisting);
  raystage::OutputFile journal(folder / take.document().cameras[0].journal,
                               raystage::OutputFile::Open::kExisting);
  const auto put = [](raystage::OutputFile& file, std::uint64_t at, const auto& bytes) {
    if (!file.write_at(at, std::as_bytes(std::span(bytes)))) throw std::runtime_error("disk full");
  };
  const store::matroska::Header header = store::matroska::make_header(description);
  const std::vector<std::byte> zeros(frame_bytes);
  const std::uint64_t hash = XXH3_64bits(zeros.data(), zeros.size());
  if (!archive.truncate(0) || !journal.truncate(0)) throw std::runtime_error("cannot truncate");
  put(archive, 0, header.bytes);
  put(journal, 0, store::journal::encode_header(description));
  std::vector<store::matroska::CuePoint> cues;
  std::uint64_t end = header.bytes.size(), records = store::journal::kHeaderBytes;
  for (int i = 0; i < frames; ++i) {
    const Nanoseconds time = Nanoseconds{i} * 50'000'000;
    cues.push_back({time, end});
    put(archive, end, store::matroska::make_cluster_header(time, frame_bytes));
    end += store::matroska::kClusterHeaderBytes;
    put(journal, records,
        store::journal::encode_record(
            {time, end, frame_bytes, store::FrameStatus::kStored, hash, time, 0, false}));
    records += store::journal::kRecordBytes;
    end += frame_bytes;
  }
  const auto trailer = store::matroska::make_trailer(cues, header, end);
  if (!archive.truncate(end)) throw std::runtime_error("cannot truncate");
  put(archive, end, trailer.cues);
  put(archive, header.duration_offset, trailer.duration);
  put(archive, header.seek_head_offset, trailer.seek_head);
  put(archive, header.segment_size_offset, trailer.segment_size);
  if (!trailer.rate.empty()) put(archive, header.rate_offset, trailer.rate);
}

}  // namespace raystage::testing
