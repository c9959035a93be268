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

#include "base/run_status.h"
#include "store/archive.h"
#include "store/matroska.h"

namespace raystage::store {

/// How much of a take is checked; each depth includes the ones before it.
enum class VerifyDepth {
  kSizes,    ///< files exist and have their stated sizes
  kJournal,  ///< all but the JPEG bytes: the journal against the archive
  kHashes    ///< every byte
};

/// A frame that a problem affects.
struct AffectedFrame {
  std::int64_t number = 0;             ///< among the camera's stored frames, from 0
  Nanoseconds time_ns = kUnknownTime;  ///< kUnknownTime if unknown
  bool operator==(const AffectedFrame&) const = default;
};

/// One deviation from what was recorded.
struct FixityProblem {
  std::string file;          ///< as the caller named it
  std::uint64_t offset = 0;  ///< of the first affected byte
  std::string what;          ///< description, without a full stop
  std::vector<AffectedFrame> frames;
  /// The recording was not closed: no data are damaged, `raystage repair` closes it.
  bool not_closed = false;
  bool loses_frames = false;  ///< the bytes of `frames` are damaged or lost
};

/// The bytes of an archive and its journal, and what they should describe.
struct ArchivePair {
  std::span<const std::byte> archive;
  std::optional<std::span<const std::byte>> journal;  ///< nullopt if there is none
  std::string archive_name, journal_name;
  ArchiveWriter::Description description;
};

struct VerifyOptions {
  VerifyDepth depth = VerifyDepth::kHashes;
  bool decode = false;  ///< also decode every JPEG and check its size
  /// Frames at the beginning that an earlier check of the same bytes found intact, with all before
  /// them: they are not read again, unless a problem precedes them.
  std::int64_t checked_frames = 0;
  /// Called when the first frames, as many as stated, and all before them are intact.
  std::function<void(std::int64_t)> on_intact_frames;
  /// Called before and after JPEG bytes are read, in parts of at most kReadPart bytes.
  std::function<void(std::span<const std::byte>)> before_read, after_read;
  /// Called with the number of bytes verified since the last call.
  std::function<void(std::uint64_t)> progress;
  /// Called before bytes of the archive are accessed; returns false if the disk cannot read them.
  std::function<bool(std::span<const std::byte>)> can_read;
  std::stop_token stop;
};

struct ArchiveFixityReport {
  RunStatus status = RunStatus::kNotRun;
  std::vector<FixityProblem> problems;  ///< the first kMaxProblems
  std::uint64_t omitted_problems = 0;   ///< number beyond those
  std::int64_t frames = 0;              ///< stored frames found; 0 at depth kSizes
  std::int64_t unverified_frames = 0;   ///< of these, see FrameRecord::is_unverified; no problem
  /// Frames of video are lost, as after a repair: others may refer to them.
  bool has_gaps_in_video = false;
  bool is_intact() const { return status == RunStatus::kFinished && problems.empty(); }
};
inline constexpr std::size_t kMaxProblems = 1000;
inline constexpr std::size_t kReadPart = std::size_t{4} << 20;

/// Compares an archive with its journal; accepts any bytes. Our writer is deterministic: all but
/// the JPEG bytes is generated again from the journal and compared. JPEG bytes have their hash, and
/// records have a check. So depth kHashes detects every single flipped bit. Throws Error (bad
/// input) if the journal is of a future version.
ArchiveFixityReport verify_archive(const ArchivePair& pair, const VerifyOptions& options);

/// Returns the header that the archive had (matroska::header_of_file()), by the archive and by its
/// journal, which may be damaged. Throws as journal::decode_header.
matroska::Header header_of_pair(const ArchivePair& pair);

/// Returns the version of a journal's records: as in an intact header, otherwise the one by which
/// most records pass their check. Throws as journal::decode_header.
std::uint32_t journal_version(std::span<const std::byte> journal, std::string_view name);

}  // namespace raystage::store
