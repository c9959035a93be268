// SPDX-License-Identifier: Apache-2.0
// Outputs that appear when they are complete.
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>

#include "base/error.h"
#include "base/temporary_folder.h"
#include "store/take.h"

namespace raystage::exports {

/// A new folder that is filled under a temporary name next to its final one, and renamed when it is
/// complete. A process that is killed leaves the hidden folder .NAME.HOST.PID.RANDOM.tmp, which the
/// next one of this target removes.
class OutputFolder {
 public:
  /// Throws Error (bad input) if `folder` exists, and Error (failed) if it cannot be created.
  explicit OutputFolder(const std::filesystem::path& folder);

  const std::filesystem::path& working() const { return folder_.path(); }
  /// Returns what `work` returns, and throws the Error that it throws with the folder's final name
  /// in place of the temporary one.
  template <class Work>
  auto fill(const Work& work) const {
    try {
      return work();
    } catch (const Error& error) {
      throw with_final_name(error);
    }
  }
  /// Writes all files to the disk, then renames the folder. Throws Error (failed).
  void commit();

 private:
  Error with_final_name(const Error& error) const;

  TemporaryFolder folder_;
};

/// Writes a file in the working folder, without waiting for the disk: commit() does. Throws Error
/// (failed).
void write_new_file(const std::filesystem::path& file, std::span<const std::byte> bytes);

/// What happens to files that exist.
enum class ExistingFiles { kError, kOverwrite };

/// Throws Error (bad input) if the file exists and must not be replaced, or is in the take; Error
/// (failed) if it cannot be written.
void check_output_file(const std::filesystem::path& file, ExistingFiles existing,
                       const store::Take& take);
/// Throws Error (bad input) if a folder would be in the take.
void check_output_outside(const std::filesystem::path& output, const store::Take& take);

/// Throws Error (failed) if the disk of a file or folder, which need not exist, has less than
/// `bytes` free.
void check_free_space(const std::filesystem::path& output, double bytes);

}  // namespace raystage::exports
