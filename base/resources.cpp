// SPDX-License-Identifier: Apache-2.0
#include "base/resources.h"

#include <fcntl.h>
#include <sched.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <thread>

namespace raystage {
namespace {

/// Calls `visit` with the folders of this process's control group and its parents: all limit it.
void for_each_control_group(const std::function<void(const std::filesystem::path&)>& visit) {
  const std::filesystem::path root = "/sys/fs/cgroup";
  std::ifstream groups("/proc/self/cgroup");
  std::string line;
  while (std::getline(groups, line)) {
    if (!line.starts_with("0::/")) continue;
    std::filesystem::path group = line.substr(4);
    while (!group.empty()) {
      visit(root / group);
      group = group.parent_path();
    }
    break;
  }
  visit(root);
}

}  // namespace

int available_threads() {
  int threads = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  cpu_set_t set;
  CPU_ZERO(&set);
  if (sched_getaffinity(0, sizeof(set), &set) == 0) threads = std::max(1, CPU_COUNT(&set));
  for_each_control_group([&](const std::filesystem::path& folder) {
    std::ifstream file(folder / "cpu.max");
    double quota = 0, period = 0;  // "max 100000" (no quota) does not parse as a number
    if (file >> quota >> period && quota > 0 && period > 0) {
      threads = std::min(threads, std::max(1, static_cast<int>(std::ceil(quota / period))));
    }
  });
  return threads;
}

std::size_t available_memory() {
  const long pages = sysconf(_SC_PHYS_PAGES), page_size = sysconf(_SC_PAGESIZE);
  std::size_t bytes = std::size_t{4} << 30;
  if (pages > 0 && page_size > 0) {
    bytes = static_cast<std::size_t>(pages) * static_cast<std::size_t>(page_size);
  }
  for_each_control_group([&](const std::filesystem::path& folder) {
    std::ifstream file(folder / "memory.max");
    std::size_t limit = 0;
    if (file >> limit && limit > 0) bytes = std::min(bytes, limit);
  });
  return bytes;
}

std::size_t free_memory() {
  std::size_t bytes = available_memory();
  const auto read_number = [](const std::filesystem::path& path, std::string_view before) {
    std::ifstream file(path);
    std::string word;
    std::size_t number = 0;
    while (!before.empty() && file >> word && word != before) {
    }
    return file >> number ? std::optional(number) : std::nullopt;
  };
  constexpr std::size_t kKib = 1024;
  if (const auto free = read_number("/proc/meminfo", "MemAvailable:"); free) {
    bytes = std::min(bytes, *free * kKib);
  }
  for_each_control_group([&](const std::filesystem::path& folder) {
    const auto limit = read_number(folder / "memory.max", "");
    const auto used = read_number(folder / "memory.current", "");
    if (!limit || !used) return;
    const std::size_t cache = read_number(folder / "memory.stat", "inactive_file").value_or(0);
    const std::size_t held = *used - std::min(*used, cache);
    bytes = std::min(bytes, *limit - std::min(*limit, held));
  });
  return bytes;
}

std::size_t peak_memory() {
  struct rusage usage {};
  if (getrusage(RUSAGE_SELF, &usage) != 0) return 0;
  return static_cast<std::size_t>(usage.ru_maxrss) * 1024;  // Linux counts in KiB
}

std::size_t peak_resident_memory() {
  std::ifstream file("/proc/self/status");
  std::string word;
  std::size_t kib = 0;
  while (file >> word && word != "VmHWM:") {
  }
  return file >> kib ? kib * 1024 : 0;
}

std::optional<std::size_t> control_group_memory() {
  std::optional<std::size_t> limit;
  for_each_control_group([&](const std::filesystem::path& folder) {
    for (const char* name : {"memory.max", "memory.high"}) {
      std::ifstream file(folder / name);
      std::size_t bytes = 0;  // "max" (no limit) does not parse as a number
      if (file >> bytes && bytes > 0) limit = std::min(bytes, limit.value_or(bytes));
    }
  });
  return limit;
}

MemoryUseReader::MemoryUseReader() : file_(open("/proc/self/statm", O_RDONLY | O_CLOEXEC)) {}

std::optional<MemoryUse> MemoryUseReader::read() const {
  // proc(5): size, resident, shared, text, lib, data, dt; in pages.
  constexpr std::size_t kFields = 6, kResident = 1, kData = 5;
  std::array<char, 256> text{};
  if (!file_.open() || pread(file_.number(), text.data(), text.size() - 1, 0) <= 0) return {};
  std::array<std::size_t, kFields> pages{};
  char* at = text.data();
  for (std::size_t& number : pages) number = std::strtoull(at, &at, 10);
  const auto page = static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
  return MemoryUse{pages[kResident] * page, pages[kData] * page};
}

double cpu_seconds() {
  struct rusage usage {};
  if (getrusage(RUSAGE_SELF, &usage) != 0) return 0;
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

std::string host_name() {
  std::array<char, 256> name{};
  if (gethostname(name.data(), name.size() - 1) != 0 || name[0] == '\0') return "unknown";
  return name.data();
}

bool reset_peak_memory() {
  std::ofstream file("/proc/self/clear_refs");
  file << "5" << std::flush;  // proc(5): resets the peak resident set size
  return file.good();
}

}  // namespace raystage
