// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fcntl.h>
#include <grp.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <exception>
#include <filesystem>
#include <functional>
#include <stdexcept>
#include <string>
#include <system_error>

namespace raystage {

// For tests of permissions. Root may write anywhere: what others are refused is tried as somebody
// else, in a child process, because root once given up does not come back.

/// For a child process: root becomes nobody; who is not root stays who he is. False: it failed.
inline bool drop_root_privileges() {
  constexpr uid_t kNobody = 65534;
  if (geteuid() != 0) return true;
  return setgroups(0, nullptr) == 0 && setgid(kNobody) == 0 && setuid(kNobody) == 0;
}

/// What `work` returns in a child process that is not root. An exception of `work` and a child that
/// did not come to its end are told in the text.
inline std::string run_unprivileged(const std::function<std::string()>& work) {
  std::array<int, 2> ends{};
  if (pipe2(ends.data(), O_CLOEXEC) != 0) throw std::runtime_error("no pipe");
  const pid_t child = fork();
  if (child < 0) throw std::runtime_error("no child process");
  if (child == 0) {
    std::string text;
    try {
      text = drop_root_privileges()
                 ? work()
                 : "root cannot be given up: " + std::generic_category().message(errno);
    } catch (const std::exception& error) {
      text = std::string("exception: ") + error.what();
    }
    const ssize_t written = write(ends[1], text.data(), text.size());
    _exit(written == static_cast<ssize_t>(text.size()) ? 0 : 1);  // no destructors, no reports
  }
  close(ends[1]);
  std::string text;
  std::array<char, 4096> buffer{};
  ssize_t count = 0;
  while ((count = read(ends[0], buffer.data(), buffer.size())) > 0) {
    text.append(buffer.data(), static_cast<std::size_t>(count));
  }
  close(ends[0]);
  int status = 0;
  waitpid(child, &status, 0);
  return status == 0 ? text : "the child process failed, status " + std::to_string(status);
}

/// Why who is not root cannot reach a file or folder, e.g. in a home that is closed to others;
/// empty where he can. A reason to skip, not to fail.
inline std::string unprivileged_access_error(const std::filesystem::path& path) {
  return run_unprivileged([&]() -> std::string {
    if (access(path.c_str(), R_OK | X_OK) == 0) return {};
    return path.string() +
           " cannot be reached without root: " + std::generic_category().message(errno);
  });
}

/// Lets everybody read and write what is in a folder, and the folder.
inline void make_world_writable(const std::filesystem::path& folder) {
  using std::filesystem::perms;
  std::filesystem::permissions(folder, perms(0777));
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    std::filesystem::permissions(entry, entry.is_directory() ? perms(0777) : perms(0666));
  }
}

/// A folder in which nobody but root may create, replace or remove anything, while this lives.
class ReadOnlyFolder {
 public:
  explicit ReadOnlyFolder(std::filesystem::path folder) : folder_(std::move(folder)) {
    std::filesystem::permissions(folder_, std::filesystem::perms(0555));
  }
  ~ReadOnlyFolder() {
    std::error_code ignored;
    std::filesystem::permissions(folder_, std::filesystem::perms(0755), ignored);
  }
  ReadOnlyFolder(const ReadOnlyFolder&) = delete;
  ReadOnlyFolder& operator=(const ReadOnlyFolder&) = delete;

 private:
  std::filesystem::path folder_;
};

}  // namespace raystage
