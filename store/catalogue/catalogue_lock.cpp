// SPDX-License-Identifier: Apache-2.0
#include "store/catalogue/catalogue_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>

#include <cerrno>
#include <string>

#include "base/error.h"

namespace raystage::store {
namespace {

std::filesystem::path lock_file_of(const std::filesystem::path& catalogue) {
  return catalogue.parent_path() / ("." + catalogue.filename().string() + ".lock");
}

}  // namespace

// Without O_EXCL: of two first runs at once, each opens the file that one of them created.
CatalogueLock::CatalogueLock(const std::filesystem::path& catalogue)
    : file_(open(lock_file_of(catalogue).c_str(),
                 O_WRONLY | O_CREAT | O_CLOEXEC | O_NONBLOCK | O_NOFOLLOW, 0666)) {
  const std::string name = lock_file_of(catalogue).string();
  if (!file_.open()) {
    throw Error::from_errno("the lock file of the catalogue cannot be opened for writing", name,
                            "Check the permissions and the free space of its folder, or keep the "
                            "catalogue in another one");
  }
  struct stat status {};
  if (fstat(file_.number(), &status) != 0 || !S_ISREG(status.st_mode)) {
    throw Error::failed("the lock file of the catalogue is no regular file", name, "Remove it");
  }
  // The kernel releases the lock when the process ends, however it ends.
  is_held_ = flock(file_.number(), LOCK_EX | LOCK_NB) == 0;
  if (!is_held_ && errno == EWOULDBLOCK) {
    throw Error::failed("the catalogue is used by another check of these takes", catalogue.string(),
                        "Wait until that check has ended");
  }
}

}  // namespace raystage::store
