// SPDX-License-Identifier: Apache-2.0
// Damaged pairs of archive and journal: they are verified at every depth, what can be saved is
// saved, and what that gives is whole.
#include <cstdint>
#include <cstdlib>

#include "base/error.h"
#include "damaged_archive.h"
#include "store/fixity/salvage.h"

namespace {

using namespace raystage;

void check_salvage(const FuzzArchive& damaged) {
  const SalvageResult saved = salvage(damaged.pair());
  FuzzArchive repaired;
  repaired.begin(2);
  std::int64_t frames = 0;
  for (const FrameRecord& record : saved.records) {
    std::span<const std::byte> jpeg;
    if (record.status == FrameStatus::kStored) {
      if (record.offset > damaged.archive.size() ||
          record.size > damaged.archive.size() - record.offset) {
        std::abort();
      }
      jpeg = std::span(damaged.archive).subspan(record.offset, record.size);
      ++frames;
    }
    repaired.add(record, jpeg, 2);
  }
  repaired.close();
  const ArchiveFixityReport report = verify_archive(repaired.pair(), {});
  if (!report.whole() || report.frames != frames || frames != saved.frames) std::abort();
  // Nothing lost means that nothing is missing.
  if (saved.losses.empty() &&
      saved.lost_bytes + static_cast<std::uint64_t>(saved.corrupt_frames) > 0) {
    std::abort();
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const FuzzArchive damaged = make_damaged_archive(std::as_bytes(std::span(data, size)));
  try {
    for (const VerifyDepth depth :
         {VerifyDepth::kSizes, VerifyDepth::kJournal, VerifyDepth::kHashes}) {
      VerifyOptions options;
      options.depth = depth;
      verify_archive(damaged.pair(), options);
    }
  } catch (const Error&) {
  }
  FuzzArchive copy = damaged;
  try {
    check_salvage(copy);
  } catch (const Error&) {
  }
  return 0;
}
