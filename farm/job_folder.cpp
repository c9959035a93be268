// SPDX-License-Identifier: Apache-2.0
#include "farm/job_folder.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <system_error>
#include <thread>

#include "base/atomic_file.h"
#include "base/error.h"
#include "base/number_text.h"
#include "base/resources.h"
#include "compose/frame_range.h"
#include "compose/sequence_name.h"
#include "farm/path_map.h"

namespace raystage::farm {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kJobPrefix = "job-";
constexpr std::array kSubfolders{"attempts", "logs", "progress", "excluded", "slurm", "rounds"};

std::optional<int> number_after(std::string_view prefix, std::string_view name) {
  if (!name.starts_with(prefix)) return std::nullopt;
  const auto number = parse_number<int>(name.substr(prefix.size()));
  return number && *number >= 1 ? number : std::nullopt;
}

/// Returns a file name for a node, whose name may have any characters.
std::string as_file_name(std::string_view node) {
  std::string name(node.substr(0, 200));
  for (char& c : name) {
    if (c == '/' || c == '\0') c = '_';
  }
  return name.empty() || name.front() == '.' ? "_" + name : name;
}

/// Returns whether two patterns name the same files, as "s.####.exr" and "s.%04d.exr" do.
bool is_same_sequence(const std::string& a, const std::string& b) {
  constexpr std::array kFrames{1, 12345};
  return std::ranges::all_of(kFrames, [&](int frame) {
    return compose::SequenceName(a).path(frame).filename() ==
           compose::SequenceName(b).path(frame).filename();
  });
}

/// Throws Error (bad input) if the tasks have more frames than a shot can have: a short text names
/// a million, and a job has up to a million tasks.
void check_frames(const schemas::FarmJobDocument& job, const std::string& file) {
  constexpr std::int64_t kMaxFrames = 10'000'000;  // shots have frame numbers of seven digits
  std::int64_t sum = 0;
  for (const schemas::FarmJobDocument::Chunk& chunk : job.chunks) {
    sum += compose::frame_range_size(chunk.frames);
  }
  if (sum <= kMaxFrames) return;
  throw Error::bad_input(
      fmt::format("the tasks have {} frames, allowed: {} or fewer", sum, kMaxFrames),
      file + "#/chunks", "Submit the shot again");
}

}  // namespace

std::optional<std::string> read_record(const ContainedPath& file, std::size_t most) {
  const FileDescriptor opened = open_contained(file, O_RDONLY);
  struct stat status {};
  if (!opened.open() || fstat(opened.number(), &status) != 0 || !S_ISREG(status.st_mode) ||
      static_cast<std::size_t>(status.st_size) > most) {
    return std::nullopt;
  }
  std::string text(static_cast<std::size_t>(status.st_size), '\0');
  std::size_t filled = 0;
  while (filled < text.size()) {
    const ssize_t got = read(opened.number(), text.data() + filled, text.size() - filled);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) break;
    filled += static_cast<std::size_t>(got);
  }
  text.resize(filled);
  return text;
}

fs::path JobFolder::round_file(int round) const {
  return path_ / "rounds" / fmt::format("{}.json", round);
}

schemas::FarmJobDocument JobFolder::job() const {
  const auto text = read_record(contained(job_file()));
  if (!text) {
    throw Error::bad_input("found no farm job", path_.string(),
                           "Name a job folder, the folder of an output's jobs, or the output");
  }
  schemas::FarmJobDocument job = schemas::parse_farm_job(*text, job_file().string());
  check_frames(job, job_file().string());
  return job;
}

schemas::FarmJobDocument JobFolder::local_job() const {
  schemas::FarmJobDocument here = job();
  map_paths(here, local_path_rules(here, path_));
  return here;
}

std::vector<schemas::FarmRound> JobFolder::rounds() const {
  std::vector<schemas::FarmRound> rounds;
  for (int n = 1;; ++n) {
    const auto text = read_record(contained(round_file(n)));
    if (!text) return rounds;
    rounds.push_back(schemas::parse_farm_round(*text, round_file(n).string()));
  }
}

std::optional<schemas::FarmEnd> JobFolder::end() const {
  const auto text = read_record(contained(end_file()));
  if (!text) return std::nullopt;
  schemas::FarmEnd end = schemas::parse_farm_end(*text, end_file().string());
  try {
    if (!end.missing_frames.empty()) compose::frame_range_size(end.missing_frames);
  } catch (const Error& error) {
    throw Error::bad_input("missing_frames: " + error.what_happened(), end_file().string(),
                           "Delete the file; then `raystage farm retry JOB` checks the frames");
  }
  return end;
}

void JobFolder::write_end(const schemas::FarmEnd& end) const {
  write_file_atomically(end_file(), schemas::format_farm_end(end));
}

void JobFolder::reopen() const {
  std::error_code ignored;
  int n = 1;
  while (file_exists(path_ / fmt::format("ended.{}.json", n))) ++n;
  std::error_code error;
  fs::rename(end_file(), path_ / fmt::format("ended.{}.json", n), error);
  fs::remove(cancel_file(), ignored);
  if (error && error != std::errc::no_such_file_or_directory) {
    throw Error::failed("the end of the job cannot be moved: " + error.message(),
                        end_file().string(), "Check the permissions of the job folder");
  }
}

std::vector<std::pair<std::string, std::string>> JobFolder::excluded_nodes() const {
  std::vector<std::pair<std::string, std::string>> nodes;
  for (const ContainedPath& file : entries_of(contained(excluded()))) {
    std::string name = file.relative.filename().string();
    if (name.starts_with('.')) continue;
    std::string reason = read_record(file).value_or("");
    while (!reason.empty() && reason.back() == '\n') reason.pop_back();
    nodes.emplace_back(std::move(name), std::move(reason));
  }
  std::ranges::sort(nodes);
  return nodes;
}

bool JobFolder::is_excluded(std::string_view node) const {
  return file_exists(excluded() / as_file_name(node));
}

void JobFolder::exclude(std::string_view node, std::string_view reason) const {
  const fs::path file = excluded() / as_file_name(node);
  // The file's existence excludes the node; on a full disk the reason may be missing.
  const int descriptor = open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  if (descriptor < 0) return;
  const std::string line = fmt::format("{}\n", reason);
  [[maybe_unused]] const ssize_t written = write(descriptor, line.data(), line.size());
  close(descriptor);
}

NodeLock::NodeLock(const JobFolder& folder, std::string_view node) {
  constexpr int kMaxTries = 200;
  constexpr std::chrono::milliseconds kBetweenTries{50};
  const fs::path file = folder.excluded() / ("." + as_file_name(node) + ".lock");
  descriptor_ = open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0666);
  for (int i = 0; descriptor_ >= 0 && i < kMaxTries; ++i) {
    if (flock(descriptor_, LOCK_EX | LOCK_NB) == 0 || errno != EWOULDBLOCK) return;
    std::this_thread::sleep_for(kBetweenTries);
  }
}

NodeLock::~NodeLock() {
  if (descriptor_ >= 0) close(descriptor_);
}

fs::path farm_folder(const std::string& output) {
  const compose::SequenceName name(output);
  std::string stem = fs::path(output).stem().string();
  for (const char token : {'#', '@'})
    stem.erase(std::remove(stem.begin(), stem.end(), token), stem.end());
  if (const std::size_t percent = stem.find('%'); percent != std::string::npos) {
    const std::size_t d = stem.find('d', percent);
    if (d != std::string::npos) stem.erase(percent, d + 1 - percent);
  }
  while (!stem.empty() && (stem.back() == '.' || stem.back() == '_' || stem.back() == '-')) {
    stem.pop_back();
  }
  return name.folder() / ((stem.empty() ? "frames" : stem) + ".farm");
}

std::vector<JobFolder> list_jobs(const fs::path& farm_folder) {
  std::vector<std::pair<int, fs::path>> found;
  std::error_code error;
  for (fs::directory_iterator entry(farm_folder, error), end; !error && entry != end;
       entry.increment(error)) {
    std::error_code of_entry;
    const auto number = number_after(kJobPrefix, entry->path().filename().string());
    if (number && entry->is_directory(of_entry)) found.emplace_back(*number, entry->path());
  }
  std::ranges::sort(found);
  std::vector<JobFolder> jobs;
  for (auto& [number, path] : found) jobs.emplace_back(std::move(path));
  return jobs;
}

std::optional<JobFolder> find_live_job(const std::string& output, const fs::path& before) {
  std::optional<JobFolder> live;
  for (const JobFolder& folder : list_jobs(farm_folder(output))) {
    if (!before.empty() && folder.path().filename() == before.filename()) break;
    if (file_exists(folder.end_file())) continue;
    const auto text = read_record(folder.contained(folder.job_file()));
    // A job without a document is being created, perhaps for this output.
    if (!text || is_same_sequence(folder.job().output, output)) live = folder;
  }
  return live;
}

JobFolder create_job_folder(const std::string& output) {
  const fs::path parent = farm_folder(output);
  create_folder(parent);
  int number = 1;
  if (const auto jobs = list_jobs(parent); !jobs.empty()) {
    number = *number_after(kJobPrefix, jobs.back().path().filename().string()) + 1;
  }
  for (;; ++number) {
    const fs::path folder = parent / fmt::format("{}{:04}", kJobPrefix, number);
    if (mkdir(folder.c_str(), 0777) == 0) {
      for (const char* name : kSubfolders) create_folder(folder / name);
      return JobFolder(folder);
    }
    if (errno != EEXIST) {
      throw Error::from_errno("cannot create the job folder", folder.string(),
                              "Check the folder's permissions and the free space on the disk");
    }
  }
}

JobFolder find_job(const fs::path& named) {
  const fs::path absolute = fs::absolute(named).lexically_normal();
  const fs::path path = absolute.has_filename() ? absolute : absolute.parent_path();
  if (path.filename() == "job.json") return JobFolder(path.parent_path());
  if (file_exists(path / "job.json")) return JobFolder(path);
  std::vector<JobFolder> jobs = list_jobs(path);
  std::error_code ignored;
  if (jobs.empty() && !fs::is_directory(path, ignored)) {
    try {
      jobs = list_jobs(farm_folder(path.string()));
      std::erase_if(jobs, [&](const JobFolder& folder) {
        return read_record(folder.contained(folder.job_file())) &&
               !is_same_sequence(folder.job().output, path.string());
      });
    } catch (const Error&) {  // not a pattern of a sequence
      jobs.clear();
    }
  }
  if (jobs.empty()) {
    throw Error::bad_input("found no farm job", named.string(),
                           "Name a job folder (OUT/NAME.farm/job-0001), the folder of an output's "
                           "jobs, or the output (OUT/NAME.####.exr)");
  }
  return jobs.back();
}

std::vector<ContainedPath> entries_of(const ContainedPath& folder) {
  std::vector<ContainedPath> entries;
  if (!is_contained(folder)) return entries;
  std::error_code error;
  for (fs::directory_iterator entry(folder.path(), error), end; entry != end;
       entry.increment(error)) {
    entries.push_back({folder.folder, folder.relative / entry->path().filename()});
  }
  return entries;
}

std::string node_name() {
  // Several nodes may share one host; Slurm sets the variable in every task.
  if (const char* slurm = std::getenv("SLURMD_NODENAME"); slurm != nullptr && *slurm != '\0') {
    return slurm;
  }
  return host_name();
}

Nanoseconds utc_now() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

}  // namespace raystage::farm
