// SPDX-License-Identifier: Apache-2.0
#include "exports/output_folder.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdio>
#include <limits>
#include <string>
#include <system_error>

#include "base/atomic_file.h"
#include "base/error.h"
#include "base/posix_file.h"
#include "base/resources.h"

namespace raystage::exports {
namespace {

namespace fs = std::filesystem;

Error exists_error(const fs::path& path) {
  return Error::bad_input("a file or folder of this name exists", path.string(),
                          "Choose another name, or remove it");
}

/// Returns "out/dir/" as "/.../out/dir": with a name and a parent.
fs::path with_name(const fs::path& folder) {
  fs::path path = fs::absolute(folder).lexically_normal();
  return path.has_filename() ? path : path.parent_path();
}

/// Renames, but never onto an existing file or folder.
int rename_folder(const fs::path& from, const fs::path& to) {
  if (renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), RENAME_NOREPLACE) == 0) return 0;
  if (errno != EINVAL && errno != ENOSYS) return -1;
  if (fs::exists(fs::symlink_status(to))) {  // some file systems do not support the flag
    errno = EEXIST;
    return -1;
  }
  return std::rename(from.c_str(), to.c_str());
}

}  // namespace

OutputFolder::OutputFolder(const fs::path& folder) : target_(with_name(folder)) {
  if (fs::exists(fs::symlink_status(target_))) throw exists_error(target_);
  static std::atomic<unsigned> counter{0};  // unique within the process
  std::string suffix = fmt::format(".{}.{}.{}.tmp", host_name(), getpid(), counter++);
  std::ranges::replace(suffix, '/', '_');
  working_ = target_.parent_path() / fmt::format(".{}{}", target_.filename().string(), suffix);
  create_folder(working_);
}

OutputFolder::~OutputFolder() {
  if (committed_) return;
  std::error_code ignored;
  fs::remove_all(working_, ignored);
}

Error OutputFolder::with_final_name(const Error& error) const {
  const auto renamed = [&](std::string text) {
    const std::string from = working_.string(), to = target_.string();
    for (std::size_t at = text.find(from); at != std::string::npos; at = text.find(from, at)) {
      text.replace(at, from.size(), to);
      at += to.size();
    }
    return text;
  };
  const auto make = error.exit_code() == ExitCode::kBadInput ? &Error::bad_input : &Error::failed;
  return make(renamed(error.what_happened()), renamed(error.where()), error.what_to_do())
      .concerning(error.settings());
}

void OutputFolder::commit() {
  sync_files_below(working_);
  if (rename_folder(working_, target_) != 0) {
    if (errno == EEXIST || errno == ENOTEMPTY) throw exists_error(target_);
    throw Error::from_errno("the folder cannot be renamed to its final name", target_.string(),
                            "Check the permissions of its parent folder");
  }
  committed_ = true;
  sync_folder(target_.parent_path());
}

void write_new_file(const fs::path& file, std::span<const std::byte> bytes) {
  OutputFile out(file);
  if (out.write_at(0, bytes)) return;
  throw Error::from_errno("the file cannot be written", file.string(),
                          "Check the folder and the free disk space");
}

void check_output_outside(const fs::path& output, const store::Take& take) {
  std::error_code unknown;  // creating the file reports it then
  const fs::path way = fs::weakly_canonical(output, unknown)
                           .lexically_relative(fs::weakly_canonical(take.folder(), unknown));
  if (way.empty() || (way != "." && *way.begin() == "..")) return;
  throw Error::bad_input("the output would be in the take " + take.folder().string(),
                         output.string(), "Choose a place outside of that take");
}

void check_output_file(const fs::path& file, ExistingFiles existing, const store::Take& take) {
  check_output_outside(file, take);
  if (existing == ExistingFiles::kError && fs::exists(fs::symlink_status(file))) {
    throw Error::bad_input("the file exists", file.string(),
                           "Choose another name, or to overwrite it")
        .concerning({"existing"});
  }
  check_writable(file);
}

void check_free_space(const fs::path& output, double bytes) {
  fs::path folder = with_name(output).parent_path();
  std::error_code error;
  while (!fs::exists(folder, error) && folder.has_relative_path()) folder = folder.parent_path();
  const fs::space_info space = fs::space(folder, error);
  if (error || space.available == std::numeric_limits<std::uintmax_t>::max()) return;
  if (static_cast<double>(space.available) >= bytes) return;
  constexpr double kMegabyte = 1e6;
  throw Error::failed(
      fmt::format("the disk has {:.1f} MB free, the export needs about {:.1f} MB",
                  static_cast<double>(space.available) / kMegabyte, bytes / kMegabyte),
      folder.string(), "Free disk space or choose another folder");
}

}  // namespace raystage::exports
