// SPDX-License-Identifier: Apache-2.0
#include "store/bagit/digests.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <openssl/evp.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <new>

#include "base/error.h"

namespace raystage::store {
namespace {

struct KnownDigest {
  DigestAlgorithm algorithm;
  std::string_view name;
  std::size_t digits;
  const EVP_MD* (*make)();
};
constexpr KnownDigest kKnownDigests[] = {
    {DigestAlgorithm::kMd5, "md5", 32, EVP_md5},
    {DigestAlgorithm::kSha1, "sha1", 40, EVP_sha1},
    {DigestAlgorithm::kSha224, "sha224", 56, EVP_sha224},
    {DigestAlgorithm::kSha256, "sha256", 64, EVP_sha256},
    {DigestAlgorithm::kSha384, "sha384", 96, EVP_sha384},
    {DigestAlgorithm::kSha512, "sha512", 128, EVP_sha512},
};

const KnownDigest& known_digest(DigestAlgorithm algorithm) {
  return kKnownDigests[static_cast<std::size_t>(algorithm)];
}

struct FreeDigestContext {
  void operator()(EVP_MD_CTX* context) const { EVP_MD_CTX_free(context); }
};

void require_digest(bool holds) {
  if (!holds) throw std::bad_alloc();  // the functions of OpenSSL fail for no other reason here
}

}  // namespace

std::optional<DigestAlgorithm> digest_algorithm(std::string_view name) {
  std::string plain;
  for (const char c : name) {
    if (c == '-') continue;
    plain += c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  }
  for (const KnownDigest& known : kKnownDigests) {
    if (known.name == plain) return known.algorithm;
  }
  return std::nullopt;
}

std::string_view digest_name(DigestAlgorithm algorithm) { return known_digest(algorithm).name; }
std::size_t digest_digits(DigestAlgorithm algorithm) { return known_digest(algorithm).digits; }

struct Digests::State {
  std::vector<std::unique_ptr<EVP_MD_CTX, FreeDigestContext>> contexts;
};

Digests::Digests(std::span<const DigestAlgorithm> algorithms) : state_(std::make_unique<State>()) {
  for (const DigestAlgorithm algorithm : algorithms) {
    auto& context = state_->contexts.emplace_back(EVP_MD_CTX_new());
    require_digest(context != nullptr &&
                   EVP_DigestInit_ex(context.get(), known_digest(algorithm).make(), nullptr) == 1);
  }
}
Digests::~Digests() = default;

void Digests::update(std::span<const std::byte> bytes) {
  for (const auto& context : state_->contexts) {
    require_digest(EVP_DigestUpdate(context.get(), bytes.data(), bytes.size()) == 1);
  }
}

std::vector<std::string> Digests::hex() {
  std::vector<std::string> digests;
  for (const auto& context : state_->contexts) {
    std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
    unsigned size = 0;
    require_digest(EVP_DigestFinal_ex(context.get(), digest.data(), &size) == 1);
    std::string& text = digests.emplace_back();
    for (unsigned i = 0; i < size; ++i) text += fmt::format("{:02x}", digest[i]);
  }
  return digests;
}

bool read_in_parts(const ContainedPath& file,
                   const std::function<bool(std::span<const std::byte>)>& on_part) {
  const FileDescriptor opened = open_contained(file, O_RDONLY);
  struct stat status {};
  if (!opened.open() || ::fstat(opened.number(), &status) != 0 || !S_ISREG(status.st_mode)) {
    throw Error::bad_input("the file is missing, is not a regular one, or cannot be read",
                           file.path().string(), "Restore it from another copy");
  }
  constexpr std::size_t kPart = std::size_t{1} << 20;
  std::vector<std::byte> part(kPart);
  for (;;) {
    const ssize_t size = ::read(opened.number(), part.data(), part.size());
    if (size < 0 && errno == EINTR) continue;
    if (size < 0) {
      throw Error::from_errno("the file cannot be read", file.path().string(),
                              "Check the disk, and restore the file from another copy");
    }
    if (size == 0) return true;
    if (!on_part(std::span(part).first(static_cast<std::size_t>(size)))) return false;
  }
}

}  // namespace raystage::store
