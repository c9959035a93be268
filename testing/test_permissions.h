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

namespace raystage::testing {

// For tests of permissions. Root may write anywhere, so these tests run as another user, in a child
// process, because a process cannot regain root.

/// Changes the user of a child process to nobody if it is root. Returns false if that fails.
inline bool drop_root_privileges() {
  constexpr uid_t kNobody = 65534;
  if (geteuid() != 0) return true;
  return setgroups(0, nullptr) == 0 && setgid(kNobody) == 0 && setuid(kNobody) == 0;
}

/// Returns the result of `work` in a child process that is not root, or a text that describes its
/// exception or the failure of the child process.
inline std::string run_unprivileged(const std::function<std::string()>& work) {
  std::array<int, 2> ends{};
  if (pipe2(ends.data(), O_CLOEXEC) != 0) throw std::runtime_error("cannot create a pipe");
  const pid_t child = fork();
  if (child < 0) throw std::runtime_error("cannot create a child process");
  if (child == 0) {
    std::string text;
    try {
      text = drop_root_privileges()
                 ? work()
                 : "cannot drop root privileges: " + std::generic_category().message(errno);
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

/// Returns why users other than root cannot access a file or folder, for example in a private home
/// folder, or an empty text if they can. Tests skip for this reason.
inline std::string unprivileged_access_error(const std::filesystem::path& path) {
  return run_unprivileged([&]() -> std::string {
    if (access(path.c_str(), R_OK | X_OK) == 0) return {};
    return path.string() +
           " is not accessible without root: " + std::generic_category().message(errno);
  });
}

/// Makes a folder and its contents readable and writable for all users.
inline void make_world_writable(const std::filesystem::path& folder) {
  using std::filesystem::perms;
  std::filesystem::permissions(folder, perms(0777));
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    std::filesystem::permissions(entry, entry.is_directory() ? perms(0777) : perms(0666));
  }
}

/// Makes a folder read-only for all users except root during its lifetime.
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

}  // namespace raystage::testing
