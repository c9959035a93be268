// SPDX-License-Identifier: Apache-2.0
#include "exports/output_folder.h"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <limits>
#include <string>
#include <system_error>

#include "base/atomic_file.h"
#include "base/error.h"
#include "base/posix_file.h"

namespace raystage::exports {
namespace {

namespace fs = std::filesystem;

Error exists_error(const fs::path& path) {
  return Error::bad_input("a file or folder of this name exists", path.string(),
                          "Choose another name, or remove it");
}

/// Throws Error (bad input) if there is a file or folder of this name.
fs::path require_no_folder(const fs::path& given) {
  fs::path folder = path_with_name(given);
  if (is_name_taken(folder)) throw exists_error(folder);
  return folder;
}

}  // namespace

OutputFolder::OutputFolder(const fs::path& folder) : folder_(require_no_folder(folder)) {}

Error OutputFolder::with_final_name(const Error& error) const {
  const auto renamed = [&](std::string text) {
    const std::string from = folder_.path().string(), to = folder_.target().string();
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
  if (folder_.commit()) return;
  if (errno == EEXIST || errno == ENOTEMPTY) throw exists_error(folder_.target());
  throw Error::from_errno("the folder cannot be renamed to its final name",
                          folder_.target().string(), "Check the permissions of its parent folder");
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
  if (existing == ExistingFiles::kError && is_name_taken(file)) {
    throw Error::bad_input("the file exists", file.string(),
                           "Choose another name, or to overwrite it")
        .concerning({"existing"});
  }
  check_writable(file);
}

void check_free_space(const fs::path& output, double bytes) {
  fs::path folder = path_with_name(output).parent_path();
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
