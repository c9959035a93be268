// SPDX-License-Identifier: Apache-2.0
#include "store/fixity/signature.h"

#include "base/atomic_file.h"
#include "base/child_process.h"
#include "base/error.h"

namespace raystage::store {
namespace {

namespace fs = std::filesystem;

constexpr const char* kNamespace = "raystage";
constexpr const char* kProgram = "ssh-keygen";
constexpr std::size_t kMaxSignersBytes = std::size_t{1} << 24;

fs::path signature_of(const fs::path& file) { return file.string() + ".sig"; }

/// The output of a program on one line.
std::string one_line(std::string text) {
  while (!text.empty() && (text.back() == '\n' || text.back() == '\r')) text.pop_back();
  for (char& c : text) {
    if (c == '\n' || c == '\r') c = ' ';
  }
  return text;
}

}  // namespace

void sign_file(const fs::path& file, const fs::path& key) {
  // ssh-keygen asks before it overwrites. The signature would not fit the new file anyway.
  std::error_code error;
  fs::remove(signature_of(file), error);
  const ChildResult result = run_child(
      {kProgram, "-Y", "sign", "-f", key.string(), "-n", kNamespace, fs::absolute(file).string()});
  if (result.exit_code == 0 && file_exists(signature_of(file))) return;
  throw Error::failed("the file cannot be signed: " + one_line(result.out), key.string(),
                      "Give an SSH key that ssh-keygen can use; load it into an agent if it has a "
                      "passphrase");
}

void write_signed(const fs::path& file, const std::string& text, const fs::path& key) {
  // Signed under another name, so that a key that fails costs neither file.
  const fs::path staged = file.parent_path() / ("." + file.filename().string() + ".signing");
  const auto remove_staged = [&] {
    std::error_code error;
    fs::remove(staged, error);
    fs::remove(signature_of(staged), error);
  };
  try {
    write_file_atomically(staged, text);
    sign_file(staged, key);
    fs::rename(staged, file);
    fs::rename(signature_of(staged), signature_of(file));
  } catch (...) {
    remove_staged();
    throw;
  }
}

std::string signature_fault(const std::string& text, const fs::path& signature,
                            const Signers& signers) {
  std::error_code unknown;
  if (!fs::is_regular_file(fs::symlink_status(signature, unknown))) {
    throw Error::bad_input("the signature is missing", signature.string(),
                           "Sign the manifest, or restore its signature");
  }
  read_file(signers.file, kMaxSignersBytes);  // throws if it is missing or no file
  ChildOptions options;
  options.input = text;
  const std::string file = fs::absolute(signature).string();
  const ChildResult result =
      run_child({kProgram, "-Y", "verify", "-f", fs::absolute(signers.file).string(), "-I",
                 signers.identity, "-n", kNamespace, "-s", file},
                options);
  if (result.exit_code == 0) return "";
  const ChildResult by_anybody =
      run_child({kProgram, "-Y", "check-novalidate", "-n", kNamespace, "-s", file}, options);
  if (by_anybody.exit_code == 0) {
    return "of the manifest, but not by " + signers.identity + " as " + signers.file.string() +
           " lists them";
  }
  return "bad: " + std::string(kProgram) + " ended with code " + std::to_string(result.exit_code) +
         (result.out.empty() ? "" : ": " + one_line(result.out));
}

}  // namespace raystage::store
