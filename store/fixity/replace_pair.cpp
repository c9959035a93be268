// SPDX-License-Identifier: Apache-2.0
#include "store/fixity/replace_pair.h"

#include <system_error>

#include "base/atomic_file.h"
#include "base/error.h"
#include "base/mapped_file.h"

namespace raystage::store {
namespace {

namespace fs = std::filesystem;

// Returns "r0c0.mkv.damaged", or after earlier repairs "r0c0.mkv.damaged-2" and so on.
fs::path damaged_name(const fs::path& file) {
  fs::path name = file;
  name += ".damaged";
  for (int i = 2; is_name_taken(name); ++i) {
    name = file;
    name += ".damaged-" + std::to_string(i);
  }
  return name;
}

// Verifies the new pair before the originals lose their names.
void check_new_pair(ArchivePair pair, std::int64_t frames, const PairFiles& written) {
  const MappedFile archive_file(written.archive), journal_file(written.journal);
  pair.archive = archive_file.bytes();
  pair.journal = journal_file.bytes();
  const ArchiveFixityReport report =
      read_mapped([&] { return verify_archive(pair, {}); }, archive_file, journal_file);
  if (report.is_intact() && report.frames == frames) return;
  throw Error::failed("the repaired " + pair.archive_name + " differs from what was written" +
                          (report.is_intact() ? "" : ": " + report.problems.front().what),
                      written.archive.string(), "Check the disk; the damaged files are unchanged");
}

}  // namespace

// Adds a second name by a hard link, so that the file always has a name.
std::string keep_original(const fs::path& file) {
  const fs::path name = damaged_name(file);
  std::error_code error;
  fs::create_hard_link(file, name, error);
  if (error) fs::rename(file, name, error);  // a file system without hard links
  if (error) {
    throw Error::failed("the damaged file cannot be set aside: " + error.message(), file.string(),
                        "Check the folder and its permissions");
  }
  return name.filename().string();
}

std::vector<std::string> replace_pair(
    ArchivePair expected, const PairFiles& files, std::int64_t frames, bool keep_originals,
    const std::function<void(const fs::path& archive, const fs::path& journal)>& write) {
  constexpr auto kByWriter = TemporaryFile::Creation::kByWriter;
  TemporaryFile new_archive(files.archive, kByWriter), new_journal(files.journal, kByWriter);
  write(new_archive.path(), new_journal.path());
  check_new_pair(std::move(expected), frames, {new_archive.path(), new_journal.path()});
  std::vector<std::string> kept;
  if (keep_originals) {
    for (const fs::path& file : {files.archive, files.journal}) {
      if (is_name_taken(file)) kept.push_back(keep_original(file));
    }
  }
  // Rename the archive first: after a crash in between, the old journal still has every hash, and
  // the next repair finds the frames by them.
  new_archive.commit();
  new_journal.commit();
  return kept;
}

}  // namespace raystage::store
