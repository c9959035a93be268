// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/contained_path.h"
#include "schemas/farm_job_document.h"
#include "schemas/farm_records.h"

namespace raystage::farm {

/// The folder of one job (docs/formats/farm.md) with its document, scripts and records. It is the
/// only state of a job: the scheduler's memory is never needed to determine what was done.
class JobFolder {
 public:
  /// Stores the path; reads nothing.
  explicit JobFolder(std::filesystem::path folder) : path_(std::move(folder)) {}

  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path job_file() const { return path_ / "job.json"; }
  std::filesystem::path shot_file() const { return path_ / "shot.json"; }
  std::filesystem::path attempts() const { return path_ / "attempts"; }
  std::filesystem::path logs() const { return path_ / "logs"; }
  std::filesystem::path progress() const { return path_ / "progress"; }
  std::filesystem::path excluded() const { return path_ / "excluded"; }
  std::filesystem::path slurm_ids() const { return path_ / "slurm"; }
  std::filesystem::path round_file(int round) const;
  std::filesystem::path end_file() const { return path_ / "ended.json"; }
  /// Returns the file that exists once the job was cancelled.
  std::filesystem::path cancel_file() const { return path_ / "cancelled"; }
  /// Returns the file with the job folder that this job waits for; it exists only if there is one.
  std::filesystem::path after_file() const { return path_ / "after"; }

  /// Returns the path of a file of the job, to be opened without following links: a job folder may
  /// be of strangers.
  ContainedPath contained(const std::filesystem::path& file) const {
    return {path_, file.lexically_relative(path_)};
  }

  /// Returns the job with paths as the nodes see them. Throws Error (bad input) if there is no job
  /// or its document is damaged.
  schemas::FarmJobDocument job() const;
  /// Returns the job with paths as this host sees them, whether submitting host or node.
  schemas::FarmJobDocument local_job() const;
  /// Returns the written rounds, sorted by number.
  std::vector<schemas::FarmRound> rounds() const;
  /// Returns how the job ended, or nothing while it is not over.
  std::optional<schemas::FarmEnd> end() const;
  void write_end(const schemas::FarmEnd& end) const;
  /// Moves the end to ended.N.json, so that the job can continue.
  void reopen() const;

  /// Returns the nodes that the job no longer uses, each with its reason.
  std::vector<std::pair<std::string, std::string>> excluded_nodes() const;
  bool is_excluded(std::string_view node) const;
  void exclude(std::string_view node, std::string_view reason) const;

 private:
  std::filesystem::path path_;
};

/// A lock in JOB/excluded that one task of the job on a node can hold at a time. It is released
/// with the process at the latest. The constructor continues without a lock if the file system has
/// no locks, or if another task holds it for more than 10 s.
class NodeLock {
 public:
  NodeLock(const JobFolder& folder, std::string_view node);
  ~NodeLock();
  NodeLock(const NodeLock&) = delete;
  NodeLock& operator=(const NodeLock&) = delete;

 private:
  int descriptor_ = -1;
};

/// Returns OUT/NAME.farm, the folder of an output's jobs.
std::filesystem::path farm_folder(const std::string& output);

/// Returns the jobs in the folder by number, including one that is being created.
std::vector<JobFolder> list_jobs(const std::filesystem::path& farm_folder);

/// Returns the newest job of this output that is not over, or nothing if all are.
/// With `before`, considers only jobs with a lower number than that folder's.
std::optional<JobFolder> find_live_job(const std::string& output,
                                       const std::filesystem::path& before = {});

/// Creates the next folder OUT/NAME.farm/job-NNNN with its subfolders. Two processes never get the
/// same folder. Throws Error (failed) if the folder cannot be created.
JobFolder create_job_folder(const std::string& output);

/// Returns the job that a user names by its folder or its job.json. The folder of an output's jobs,
/// or the output's pattern, names the newest job. Throws Error (bad input) if there is none.
JobFolder find_job(const std::filesystem::path& named);

inline constexpr std::size_t kLargestRecord = std::size_t{16} << 20;  // bytes

/// Reads a text file of a job folder, through no link below it. Returns nothing if the file is
/// missing, no regular file, or larger than `most` bytes.
std::optional<std::string> read_record(const ContainedPath& file,
                                       std::size_t most = kLargestRecord);

/// Returns the entries of a folder of a job folder; none if it cannot be read or is a link.
std::vector<ContainedPath> entries_of(const ContainedPath& folder);

/// Returns the name of the node within a Slurm task (SLURMD_NODENAME), otherwise the host's name.
std::string node_name();
Nanoseconds utc_now();

}  // namespace raystage::farm
