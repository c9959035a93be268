// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "schemas/farm_job_document.h"
#include "schemas/farm_records.h"

namespace raystage::farm {

/// The folder of one job (docs/formats/farm.md): what it is, its scripts, its records. The only
/// state of a job; the scheduler's memory is never needed to know what was done.
class JobFolder {
 public:
  /// Nothing is read yet.
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
  /// Exists once somebody has cancelled the job.
  std::filesystem::path cancel_file() const { return path_ / "cancelled"; }
  /// Names the job folder that this job waits for; exists only where it waits for one.
  std::filesystem::path after_file() const { return path_ / "after"; }

  /// The job with paths as the nodes see them. Throws Error (bad input) where there is no job, or
  /// its document is damaged.
  FarmJobDocument job() const;
  /// The same with paths as this host sees them, which may be the submitting host or a node.
  FarmJobDocument local_job() const;
  /// The rounds that were written, by number.
  std::vector<FarmRound> rounds() const;
  /// None: the job is not over.
  std::optional<FarmEnd> end() const;
  void write_end(const FarmEnd& end) const;
  /// The end moves to ended.N.json, so that the job may go on.
  void reopen() const;

  /// Nodes that the job does not use any more, with the reason of each.
  std::vector<std::pair<std::string, std::string>> excluded_nodes() const;
  bool is_excluded(std::string_view node) const;
  void exclude(std::string_view node, std::string_view reason) const;

 private:
  std::filesystem::path path_;
};

/// While it lives no other task of the job that runs on this node has one: a lock in JOB/excluded,
/// which goes with the process. Where the file system has no locks, or one is held for too long
/// (10 s), it is none.
class NodeLock {
 public:
  NodeLock(const JobFolder& folder, std::string_view node);
  ~NodeLock();
  NodeLock(const NodeLock&) = delete;
  NodeLock& operator=(const NodeLock&) = delete;

 private:
  int descriptor_ = -1;
};

/// OUT/NAME.farm: the folder of an output's jobs.
std::filesystem::path farm_folder(const std::string& output);

/// The jobs in it by number; also one that is just being created.
std::vector<JobFolder> list_jobs(const std::filesystem::path& farm_folder);

/// The newest job of this output that is not over; none where every one is.
/// `before`: only jobs with a lower number than this folder's.
std::optional<JobFolder> find_live_job(const std::string& output,
                                       const std::filesystem::path& before = {});

/// Creates the next folder OUT/NAME.farm/job-NNNN with its subfolders. Two processes never get the
/// same one. Throws Error (failed) for the disk.
JobFolder create_job_folder(const std::string& output);

/// The job that a user names: its folder, job.json, the folder of an output's jobs (the newest) or
/// the output's pattern (the newest). Throws Error (bad input) where there is none.
JobFolder find_job(const std::filesystem::path& named);

/// Reads a small text file of a job folder; follows no link. Empty: it is missing or larger than 16
/// MiB.
std::optional<std::string> read_record(const std::filesystem::path& file);

/// The host's name; of Slurm's task the node's (SLURMD_NODENAME).
std::string node_name();
Nanoseconds utc_now();

}  // namespace raystage::farm
