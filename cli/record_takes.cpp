// SPDX-License-Identifier: Apache-2.0
// Opens the take that raystage record writes, and its mirror.
#include "cli/record_takes.h"

#include <sys/stat.h>

#include <algorithm>

#include "base/atomic_file.h"
#include "base/error.h"
#include "cli/printing.h"
#include "ingest/record/record_setup.h"

namespace raystage::cli {
namespace {

namespace fs = std::filesystem;

ingest::RecordingTake create_take(const TakeSetup& setup, const fs::path& folder) {
  return ingest::RecordingTake::create(
      folder, setup.document,
      ingest::make_recording_rig(setup.config, setup.config_folder, setup.cameras), setup.node);
}

ingest::RecordingTake resume_take(const TakeSetup& setup, const fs::path& folder,
                                  const fs::path& other) {
  return ingest::resume_take(folder, setup.cameras, setup.node, setup.start_utc, setup.duration_s,
                             other);
}

bool is_take(const fs::path& folder) {
  return !folder.empty() && file_exists(folder / "take.json");
}

/// Returns whether a folder, which need not exist, is another one or below it.
bool is_inside(const fs::path& inner, const fs::path& outer) {
  std::error_code error;
  const fs::path a = fs::weakly_canonical(inner, error), b = fs::weakly_canonical(outer, error);
  return !b.empty() && std::mismatch(b.begin(), b.end(), a.begin(), a.end()).first == b.end();
}

}  // namespace

fs::path mirror_of(const fs::path& take, const fs::path& parent) {
  if (parent.empty()) return {};
  std::error_code error;
  if (!fs::is_directory(parent, error)) {
    throw Error::bad_input("the folder for the mirror does not exist", parent.string(),
                           "Mount its disk, or create the folder")
        .concerning({"mirror"});
  }
  fs::path folder = fs::absolute(take).lexically_normal();
  if (!folder.has_filename()) folder = folder.parent_path();
  const fs::path mirror = parent / folder.filename();
  const auto refuse = [&](const char* what) {
    throw Error::bad_input(what, mirror.string(), "Use another folder, best on another disk")
        .concerning({"mirror"});
  };
  if (fs::equivalent(parent, folder.parent_path(), error)) {
    refuse("the mirror would be the take itself");
  }
  if (is_inside(parent, folder)) refuse("the mirror would be inside of the take");
  if (is_inside(folder, mirror)) refuse("the take would be inside of its mirror");
  struct stat of_mirror {
  }, of_take{};
  if (stat(parent.c_str(), &of_mirror) == 0 && stat(folder.parent_path().c_str(), &of_take) == 0 &&
      of_mirror.st_dev == of_take.st_dev) {
    print_error(
        "raystage record: the mirror is on the same file system as the take: it does not help "
        "when that disk fails\n");
  }
  return mirror;
}

ingest::RecordingTake open_take(const TakeSetup& setup, const fs::path& folder,
                                const fs::path& mirror) {
  if (!setup.resume) return create_take(setup, folder);
  return resume_take(setup, folder, is_take(mirror) ? mirror : fs::path());
}

std::optional<ingest::RecordingTake> open_mirror(const TakeSetup& setup, const fs::path& folder,
                                                 ingest::RecordingTake& take) {
  if (folder.empty()) return std::nullopt;
  if (!setup.resume) return create_take(setup, folder);
  std::optional<ingest::RecordingTake> mirror =
      is_take(folder) ? resume_take(setup, folder, take.folder())
                      : ingest::RecordingTake::create_copy(folder, take);
  const std::size_t to_mirror = mirror->complete_from(take), to_take = take.complete_from(*mirror);
  if (to_mirror + to_take > 0) {
    print_error("raystage record: {} records were copied to the mirror and {} from it\n", to_mirror,
                to_take);
  }
  return mirror;
}

}  // namespace raystage::cli
