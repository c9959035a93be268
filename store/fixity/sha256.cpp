// SPDX-License-Identifier: Apache-2.0
#include "store/fixity/sha256.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <openssl/evp.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <new>
#include <vector>

#include "base/error.h"

namespace raystage::store {

struct Sha256::State {
  struct Free {
    void operator()(EVP_MD_CTX* context) const { EVP_MD_CTX_free(context); }
  };
  std::unique_ptr<EVP_MD_CTX, Free> context{EVP_MD_CTX_new()};

  static void require(bool holds) {
    if (!holds) throw std::bad_alloc();  // the functions of OpenSSL fail for no other reason here
  }
};

Sha256::Sha256() : state_(std::make_unique<State>()) {
  State::require(state_->context != nullptr &&
                 EVP_DigestInit_ex(state_->context.get(), EVP_sha256(), nullptr) == 1);
}
Sha256::~Sha256() = default;

void Sha256::update(std::span<const std::byte> bytes) {
  State::require(EVP_DigestUpdate(state_->context.get(), bytes.data(), bytes.size()) == 1);
}

std::string Sha256::hex() {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned size = 0;
  State::require(EVP_DigestFinal_ex(state_->context.get(), digest.data(), &size) == 1);
  std::string text;
  for (unsigned i = 0; i < size; ++i) text += fmt::format("{:02x}", digest[i]);
  return text;
}

std::string sha256_of_file(const ContainedPath& file,
                           const std::function<bool(std::size_t)>& on_bytes) {
  const FileDescriptor opened = open_contained(file, O_RDONLY);
  struct stat status {};
  if (!opened.open() || ::fstat(opened.number(), &status) != 0 || !S_ISREG(status.st_mode)) {
    throw Error::bad_input("the file is missing, is not a regular one, or cannot be read",
                           file.path().string(), "Restore it from another copy of the take");
  }
  constexpr std::size_t kPart = std::size_t{1} << 20;
  std::vector<std::byte> part(kPart);
  Sha256 hash;
  for (;;) {
    const ssize_t size = ::read(opened.number(), part.data(), part.size());
    if (size < 0 && errno == EINTR) continue;
    if (size < 0) {
      throw Error::from_errno("the file cannot be read", file.path().string(),
                              "Check the disk, and restore the file from another copy of the take");
    }
    if (size == 0) return hash.hex();
    hash.update(std::span(part).first(static_cast<std::size_t>(size)));
    if (!on_bytes(static_cast<std::size_t>(size))) return {};
  }
}

}  // namespace raystage::store
