// SPDX-License-Identifier: Apache-2.0
// Checks many takes, one after the other, and records in the catalogue what was found and how far
// it has come. Progress counts intact frames from the first one of each camera: a run that goes on
// reads the journals again, but no frame twice. Cost: the bytes of the takes that are due; memory:
// the catalogue, and what verify_take() needs for one take.
#include "store/catalogue/check_takes.h"

#include <fmt/format.h>

#include <algorithm>
#include <exception>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <new>
#include <optional>
#include <set>
#include <system_error>
#include <utility>

#include "base/atomic_file.h"
#include "base/contained_path.h"
#include "base/error.h"
#include "base/posix_file.h"
#include "base/stopwatch.h"
#include "schemas/take_document.h"
#include "schemas/utf8_text.h"
#include "store/catalogue/catalogue_lock.h"
#include "store/catalogue/find_takes.h"
#include "store/catalogue/read_pace.h"
#include "store/fixity/verify.h"

namespace raystage::store {
namespace {

namespace fs = std::filesystem;
using schemas::FixityCatalogue;
using Result = FixityCatalogue::Result;

constexpr std::size_t kProblemsKept = 20;

/// Returns 0 if it cannot be read, or is a link or behind one.
std::uint64_t size_of(const ContainedPath& file) {
  try {
    return InputFile(file).size();
  } catch (const Error&) {
    return 0;
  }
}

/// Returns the size of a take's archives and journals, and its name; the latter is empty if
/// take.json cannot be read.
std::pair<std::uint64_t, std::string> size_and_name(const fs::path& folder) {
  try {
    const schemas::TakeDocument document = schemas::read_take(ContainedPath{folder, "take.json"});
    std::uint64_t bytes = 0;
    for (const auto& camera : document.cameras) {
      for (const std::string& file : {camera.archive, camera.journal}) {
        bytes += size_of(ContainedPath{folder, file});
      }
    }
    return {bytes, document.name};
  } catch (const Error&) {
    return {0, ""};
  }
}

Result result_of(const TakeFixityReport& report) {
  if (!report.is_readable()) return Result::kUnreadable;
  if (report.is_intact()) return Result::kIntact;
  bool only_open = report.problems.empty();
  for (const auto& camera : report.cameras) {
    only_open =
        only_open && std::ranges::all_of(camera.report.problems, &FixityProblem::not_closed);
  }
  return only_open ? Result::kNotClosed : Result::kDamaged;
}

void add_problem(FixityCatalogue::Check& check, const std::string& text) {
  constexpr std::size_t kMost = 10'000;  // of the schema
  ++check.problem_count;
  if (check.problems.size() == kProblemsKept) return;
  check.problems.push_back(schemas::utf8_text(text, kMost));
}

void add_problems(FixityCatalogue::Check& check, const std::vector<FixityProblem>& problems) {
  for (const FixityProblem& problem : problems) {
    add_problem(check, fmt::format("{} @{}: {}", problem.file, problem.offset, problem.what));
  }
}

class Checker {
 public:
  Checker(const fs::path& folder, const CatalogueOptions& options)
      : folder_(folder),
        options_(options),
        file_(options.file.empty() ? folder / kCatalogueFile : options.file),
        pace_(options.bytes_per_second) {
    std::error_code error;
    if (!fs::is_directory(folder, error)) {
      throw Error::bad_input("this is no folder that can be read", folder.string(),
                             "Name the folder that holds the takes");
    }
    if (!options.only_reports) {
      if (file_exists(fs::absolute(file_).parent_path() / "take.json")) {
        throw Error::bad_input("the catalogue would be written into a take", file_.string(),
                               "Name the folder that holds the takes, or a file elsewhere for the "
                               "catalogue")
            .concerning({"catalogue_file"});
      }
      lock_ = std::make_unique<CatalogueLock>(fs::absolute(file_));
      remove_abandoned_temporary_files(file_, lock_->is_held() ? Owners::kAll : Owners::kEnded);
    }
    if (file_exists(file_)) catalogue_ = schemas::read_fixity_catalogue(file_);
  }

  CatalogueReport run() {
    const Stopwatch watch;
    find();
    const std::vector<std::size_t> due = due_takes();
    for (const std::size_t i : due) bytes_due_ += sizes_[i];
    if (!options_.only_reports) {
      save();
      for (const std::size_t i : due) {
        if (options_.stop.stop_requested()) break;
        check(i);
      }
    }
    const bool is_stopped = options_.stop.stop_requested();
    report_.status = is_stopped ? RunStatus::kStopped : RunStatus::kFinished;
    if (options_.progress && !is_stopped) options_.progress(1);
    finish_entries();
    report_.file = file_;
    report_.bytes = bytes_done_;
    report_.seconds = watch.seconds();
    return std::move(report_);
  }

 private:
  FixityCatalogue::Take& take(std::size_t i) { return catalogue_.takes[i]; }
  fs::path folder_of(std::size_t i) { return folder_ / take(i).path; }

  /// Compares the folder with the catalogue.
  void find() {
    const FoundTakes found = find_takes(folder_);
    for (const auto& problem : found.problems) {
      report_.problems.push_back(problem.path + ": " + problem.what);
    }
    std::map<std::string, FixityCatalogue::Take> known;
    for (FixityCatalogue::Take& entry : catalogue_.takes) known[entry.path] = std::move(entry);
    const bool forgets = options_.forgets_missing && may_forget(found, !known.empty());
    std::map<std::string, bool> is_new;
    for (const std::string& path : found.paths) {
      auto [entry, was_added] = known.try_emplace(path);
      if (was_added) {
        entry->second.path = path;
        entry->second.first_seen_utc = options_.now_utc;
      }
      is_new[path] = was_added;
      entry->second.missing_since_utc.reset();
    }
    catalogue_.takes.clear();
    std::set<std::string> absent_disks;
    for (auto& [path, entry] : known) {
      if (!is_new.contains(path) && !is_hidden_by_problem(path, found)) {
        const std::string disk = forgets ? empty_folder_of(path, found) : "";
        if (forgets && disk.empty()) continue;
        if (!disk.empty()) absent_disks.insert(disk);
        if (!entry.missing_since_utc) entry.missing_since_utc = options_.now_utc;
      }
      catalogue_.takes.push_back(std::move(entry));
    }
    if (catalogue_.takes.empty()) {
      report_.problems.push_back(folder_.string() +
                                 ": no take was found, as if a disk were not mounted. Mount the "
                                 "disk, or give the folder of the takes");
    }
    for (const std::string& disk : absent_disks) {
      report_.problems.push_back(disk +
                                 ": the folder is empty, as if a disk were not mounted; no take "
                                 "below was forgotten. Mount the disk, or remove the folder");
    }
    for (std::size_t i = 0; i < catalogue_.takes.size(); ++i) {
      const auto entry = is_new.find(take(i).path);
      report_.takes.emplace_back().is_new = entry != is_new.end() && entry->second;
      states_.emplace_back();
      sizes_.push_back(0);
      if (entry != is_new.end()) read(i);
      report_.takes[i].is_unreachable = !take(i).missing_since_utc && !states_[i];
      if (take(i).progress && is_outdated(*take(i).progress)) take(i).progress.reset();
    }
  }

  /// Returns whether takes that are not there may be removed; if not, adds the reason to the
  /// problems.
  bool may_forget(const FoundTakes& found, bool are_takes_known) {
    if (!found.problems.empty()) {
      report_.problems.push_back(
          "no take was forgotten, because takes may be in folders that cannot be read. Make them "
          "readable and repeat the run");
      return false;
    }
    if (found.paths.empty() && are_takes_known) {
      report_.problems.push_back("no take was forgotten, because none at all is left below " +
                                 folder_.string() +
                                 ". Mount the disk that holds them, or, if they are gone, remove "
                                 "the catalogue " +
                                 file_.string());
      return false;
    }
    return true;
  }
  static bool is_hidden_by_problem(const std::string& path, const FoundTakes& found) {
    return std::ranges::any_of(found.problems, [&](const FoundTakes::Problem& problem) {
      return is_at_or_below(path, problem.path);
    });
  }
  /// Returns the folder without entries that held the take, or an empty text.
  static std::string empty_folder_of(const std::string& path, const FoundTakes& found) {
    const auto empty = std::ranges::find_if(found.empty_folders, [&](const std::string& folder) {
      return is_at_or_below(path, folder);
    });
    return empty == found.empty_folders.end() ? "" : *empty;
  }

  /// Reads the state, the size and the name of a take that was found.
  void read(std::size_t i) {
    auto [bytes, name] = size_and_name(folder_of(i));
    sizes_[i] = bytes;
    if (!name.empty()) take(i).name = std::move(name);
    try {
      states_[i] = state_of_take(folder_of(i));
    } catch (const Error& error) {
      report_.problems.emplace_back(error.what());
    }
  }

  /// Returns the time from a check until the next one.
  Nanoseconds wait() const {
    constexpr double kSecondsPerDay = 86'400, kMostDays = 36'500;
    return static_cast<Nanoseconds>(std::clamp(options_.due_days, 0.0, kMostDays) * kSecondsPerDay *
                                    kNsPerS);
  }
  /// What was read so long ago is due itself, and says nothing about the frames now. A beginning in
  /// the future: the clock was wrong then.
  bool is_outdated(const FixityCatalogue::Progress& progress) const {
    return progress.started_utc < options_.now_utc - wait() ||
           progress.started_utc > options_.now_utc + kNanosecondsPerSecond;
  }
  Nanoseconds due_utc(std::size_t i) {
    if (!take(i).last_check) return 0;
    const Nanoseconds checked = take(i).last_check->finished_utc;
    return checked > std::numeric_limits<Nanoseconds>::max() - wait() ? checked : checked + wait();
  }
  bool is_changed(std::size_t i) {
    return states_[i] && take(i).last_check && take(i).last_check->state != *states_[i];
  }
  bool is_due(std::size_t i) {
    if (take(i).missing_since_utc) return false;
    if (!take(i).last_check || is_changed(i) || due_utc(i) <= options_.now_utc) return true;
    // A check in the future: the clock was wrong then.
    return !report_.takes[i].was_checked &&
           take(i).last_check->finished_utc > options_.now_utc + kNanosecondsPerSecond;
  }

  /// Returns those that can be read: of an interrupted run first, then by the time at which they
  /// became due.
  std::vector<std::size_t> due_takes() {
    std::vector<std::size_t> due;
    for (std::size_t i = 0; i < catalogue_.takes.size(); ++i) {
      if (is_due(i) && states_[i]) due.push_back(i);
    }
    std::ranges::stable_sort(due, {}, [&](std::size_t i) {
      return std::pair(!take(i).progress.has_value(), is_changed(i) ? 0 : due_utc(i));
    });
    return due;
  }

  /// Writes the catalogue. The caller holds `mutex_` if other threads run.
  void save() {
    schemas::write_fixity_catalogue(catalogue_, file_);
    since_save_ = Stopwatch();
  }

  void check(std::size_t i) {
    const Stopwatch watch;
    FixityCatalogue::Check result;
    result.state = *states_[i];
    result.bytes = static_cast<std::int64_t>(sizes_[i]);
    try {
      const TakeFixityReport report = verify(i);
      if (save_failure_) std::rethrow_exception(save_failure_);
      if (report.status != RunStatus::kFinished) {
        save();
        return;
      }
      result.result = result_of(report);
      add_problems(result, report.problems);
      for (const auto& camera : report.cameras) {
        if (!camera.error.empty()) add_problem(result, camera.error);
        add_problems(result, camera.report.problems);
        result.problem_count += static_cast<std::int64_t>(camera.report.omitted_problems);
      }
    } catch (const std::bad_alloc&) {  // says nothing about the take
      throw;
    } catch (const std::exception& error) {  // also of faults of ours: the other takes are checked
      if (save_failure_) throw;
      result.result = Result::kUnreadable;
      add_problem(result, error.what());
    }
    result.seconds = watch.seconds();
    // By the clock of the machine, but not before the run began: tests state that time.
    result.finished_utc = options_.now_utc + static_cast<Nanoseconds>(since_start_.seconds() * 1e9);
    if (result.result == Result::kIntact) take(i).last_intact_utc = result.finished_utc;
    take(i).last_check = std::move(result);
    take(i).progress.reset();
    save();
    bytes_done_ += sizes_[i];
    report_.takes[i].was_checked = true;
    if (options_.on_checked) options_.on_checked(take(i));
  }

  TakeFixityReport verify(std::size_t i) {
    TakeVerifyOptions options;
    options.stop = options_.stop;
    options.spares_page_cache = true;
    options.before_read = [&](std::uint64_t bytes) { pace_.before(bytes); };
    options.progress = [&, i](double share) {
      if (!options_.progress || bytes_due_ == 0) return;
      options_.progress(
          (static_cast<double>(bytes_done_) + share * static_cast<double>(sizes_[i])) /
          static_cast<double>(bytes_due_));
    };
    std::optional<FixityCatalogue::Progress>& progress = take(i).progress;
    const schemas::TakeDocument document =
        schemas::read_take(ContainedPath{folder_of(i), "take.json"});
    std::vector<FixityCatalogue::Camera> cameras;
    for (const auto& camera : document.cameras) cameras.push_back({camera.id, 0, false});
    if (progress && progress->state == *states_[i]) {
      for (FixityCatalogue::Camera& camera : cameras) {
        const auto known =
            std::ranges::find(progress->cameras, camera.id, &FixityCatalogue::Camera::id);
        if (known != progress->cameras.end()) camera = *known;
      }
    } else {
      progress = FixityCatalogue::Progress{options_.now_utc, *states_[i], {}};
    }
    for (const FixityCatalogue::Camera& camera : cameras) {
      options.checked.push_back({camera.frames, camera.is_complete});
    }
    progress->cameras = std::move(cameras);
    options.on_checked = [&, i](int camera, const CheckedFrames& checked) {
      const std::scoped_lock lock(mutex_);
      FixityCatalogue::Camera& entry = take(i).progress->cameras[static_cast<std::size_t>(camera)];
      entry.frames = checked.frames;
      entry.is_complete = checked.is_complete;
      if (since_save_.seconds() < options_.save_seconds) return;
      try {
        save();
      } catch (const Error&) {  // not here, where it would be a problem of the take
        save_failure_ = std::current_exception();
        since_save_ = Stopwatch();
      }
    };
    return verify_take(folder_of(i), options);
  }

  void finish_entries() {
    for (std::size_t i = 0; i < catalogue_.takes.size(); ++i) {
      CatalogueEntry& entry = report_.takes[i];
      entry.take = take(i);
      entry.due_utc = due_utc(i);
      entry.is_changed = is_changed(i);
      entry.is_due = is_due(i);
    }
  }

  const fs::path folder_;
  const CatalogueOptions& options_;
  const fs::path file_;
  std::unique_ptr<CatalogueLock> lock_;  // none if it only reports
  FixityCatalogue catalogue_;
  std::vector<std::optional<std::string>> states_;  // of each take now, if it can be read
  std::vector<std::uint64_t> sizes_;                // of each take, bytes
  std::uint64_t bytes_due_ = 0, bytes_done_ = 0;
  ReadPace pace_;
  std::mutex mutex_;
  Stopwatch since_save_, since_start_;
  std::exception_ptr save_failure_;
  CatalogueReport report_;
};

}  // namespace

bool CatalogueEntry::is_good() const {
  return !is_missing() && !is_unreachable && take.last_check &&
         take.last_check->result == Result::kIntact;
}

bool CatalogueReport::is_good() const {
  return problems.empty() && status == RunStatus::kFinished &&
         std::ranges::all_of(takes, [](const CatalogueEntry& entry) {
           return !entry.is_missing() && (!entry.take.last_check || entry.is_good());
         });
}

CatalogueReport check_takes_below(const fs::path& folder, const CatalogueOptions& options) {
  return Checker(folder, options).run();
}

}  // namespace raystage::store
