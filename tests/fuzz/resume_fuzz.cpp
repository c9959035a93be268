// SPDX-License-Identifier: Apache-2.0
// Resumes recording to damaged pairs of archive and journal. It is refused, or all frames in the
// archive and a new one can be read, and the archive can be closed. Frames that the archive lost
// with its end are missing then.
#include <cstdint>
#include <cstdlib>
#include <fstream>

#include "base/error.h"
#include "damaged_archive.h"
#include "testing/test_folder.h"

namespace {

using namespace raystage;

void write(const std::filesystem::path& file, std::span<const std::byte> bytes) {
  std::ofstream stream(file, std::ios::binary | std::ios::trunc);
  stream.write(reinterpret_cast<const char*>(bytes.data()),
               static_cast<std::streamsize>(bytes.size()));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const testing::TestFolder folder;
  const auto archive = folder.path() / "a.mkv", journal = folder.path() / "a.journal";
  const FuzzArchive damaged = make_damaged_archive(std::as_bytes(std::span(data, size)));
  write(archive, damaged.archive);
  std::filesystem::remove(journal);
  if (damaged.has_journal) write(journal, damaged.journal);
  std::vector<store::FrameRecord> before;
  Nanoseconds time = 0;
  const std::vector<std::byte> jpeg(30, std::byte{9});
  try {
    {
      const store::ArchiveReader in(archive, journal);
      before.assign(in.frames().begin(), in.frames().end());
      std::erase_if(before, [end = in.bytes()](const store::FrameRecord& frame) {
        return frame.offset > end || frame.size > end - frame.offset;
      });
    }
    store::ArchiveWriter out =
        store::ArchiveWriter::resume(archive, journal, FuzzArchive::description());
    time = out.last_time() + 1;
    if (time > store::matroska::kMaxTime) return 0;
    out.append(jpeg, time, {1, 2});
    out.close();
  } catch (const Error&) {
    return 0;
  }
  // An Error below is a fault and is not caught.
  const store::ArchiveReader in(archive, journal);
  if (!in.was_closed() || in.damaged_records() != 0) std::abort();
  if (in.frames().size() != before.size() + 1) std::abort();
  for (std::size_t i = 0; i < before.size(); ++i) {
    if (in.frames()[i].time_ns != before[i].time_ns || in.frames()[i].offset != before[i].offset ||
        in.frames()[i].size != before[i].size) {
      std::abort();
    }
  }
  const int last = static_cast<int>(before.size());
  if (in.frames()[before.size()].time_ns != time || !in.verify_frame(last) ||
      !std::ranges::equal(in.jpeg(last), jpeg)) {
    std::abort();
  }
  return 0;
}
