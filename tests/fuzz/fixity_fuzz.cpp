// SPDX-License-Identifier: Apache-2.0
// Verifies damaged pairs of archive and journal at every depth and repairs them; the result must be
// complete.
#include <cstdint>
#include <cstdlib>

#include "base/error.h"
#include "damaged_archive.h"
#include "store/fixity/salvage.h"

namespace {

using namespace raystage;

void check_salvage(const FuzzArchive& damaged) {
  const store::SalvageResult saved = store::salvage_archive(damaged.pair());
  FuzzArchive repaired;
  repaired.begin(2);
  std::int64_t frames = 0;
  for (const store::FrameRecord& record : saved.records) {
    std::span<const std::byte> jpeg;
    if (record.status == store::FrameStatus::kStored) {
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
  const store::ArchiveFixityReport report = store::verify_archive(repaired.pair(), {});
  if (!report.is_intact() || report.frames != frames || frames != saved.frames) std::abort();
  // If nothing was lost, all frames exist.
  if (saved.losses.empty() &&
      saved.lost_bytes + static_cast<std::uint64_t>(saved.corrupt_frames) > 0) {
    std::abort();
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  FuzzArchive damaged = make_damaged_archive(std::as_bytes(std::span(data, size)));
  try {
    for (const store::VerifyDepth depth :
         {store::VerifyDepth::kSizes, store::VerifyDepth::kJournal, store::VerifyDepth::kHashes}) {
      store::VerifyOptions options;
      options.depth = depth;
      store::verify_archive(damaged.pair(), options);
    }
  } catch (const Error&) {
  }
  try {
    check_salvage(damaged);
  } catch (const Error&) {
  }
  return 0;
}
