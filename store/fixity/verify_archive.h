// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "store/archive.h"

namespace raystage {

/// How closely a take is looked at; each depth holds the ones before it.
enum class VerifyDepth {
  kSizes,    ///< the files are there and as long as they say
  kJournal,  ///< every byte but the frames' own: the journal against the archive
  kHashes    ///< every byte
};

/// A frame that a problem touches.
struct AffectedFrame {
  std::int64_t number = 0;             ///< among the camera's stored frames, from 0
  Nanoseconds time_ns = kUnknownTime;  ///< where it is known
  bool operator==(const AffectedFrame&) const = default;
};

/// One thing that is not as it was recorded.
struct Problem {
  std::string file;          ///< as the caller named it
  std::uint64_t offset = 0;  ///< of the first byte concerned
  std::string what;          ///< what it means, without a full stop
  std::vector<AffectedFrame> frames;
  /// The recording ended without being closed: nothing is rotten, `raystage repair` closes it.
  bool not_closed = false;
};

/// An archive and its journal as bytes, and what they should be.
struct ArchivePair {
  std::span<const std::byte> archive;
  std::optional<std::span<const std::byte>> journal;  ///< nullopt where there is none
  std::string archive_name, journal_name;
  ArchiveWriter::Description description;
};

struct VerifyOptions {
  VerifyDepth depth = VerifyDepth::kHashes;
  bool decode = false;  ///< also decode every JPEG and look at its size
  /// Called with the number of bytes done since the last call.
  std::function<void(std::uint64_t)> progress;
  /// Asked before bytes of the archive are touched; false: the disk cannot read them.
  std::function<bool(std::span<const std::byte>)> can_read;
  std::stop_token stop;
};

struct ArchiveReport {
  std::vector<Problem> problems;    ///< the first kMostProblems
  std::uint64_t more_problems = 0;  ///< beyond those
  std::int64_t frames = 0;          ///< stored, as far as they were found; 0 at depth kSizes
  bool whole() const { return problems.empty(); }
};
inline constexpr std::size_t kMostProblems = 1000;

/// Our writer is deterministic: everything but the JPEG bytes is made again from the journal and
/// compared, the JPEG bytes have their hash, and records have a check. So at depth kHashes no
/// single flipped bit passes, wherever it is. Reads any bytes. Throws Error (bad input) for a
/// journal of a future version.
ArchiveReport verify_archive(const ArchivePair& pair, const VerifyOptions& options);

/// Version of a journal's records: what an intact header says, else that by which most of them
/// pass their check. Throws as journal::decode_header.
std::uint32_t journal_version(std::span<const std::byte> journal, std::string_view name);

}  // namespace raystage
