// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

namespace raystage::store {

/// Signs a file with an SSH key by `ssh-keygen -Y sign` (format SSHSIG, namespace "raystage"):
/// writes FILE.sig. `key`: a private key, or the public key of one that an agent holds. Throws
/// Error (failed) with what ssh-keygen says.
void sign_file(const std::filesystem::path& file, const std::filesystem::path& key);

/// Writes a file and its signature FILE.sig, both or none. Throws as sign_file().
void write_signed(const std::filesystem::path& file, const std::string& text,
                  const std::filesystem::path& key);

/// Who may sign: a file of allowed signers (ssh-keygen(1)), and the identity that must have signed.
struct Signers {
  std::filesystem::path file;
  std::string identity;
};

/// Checks a signature of `text` by `ssh-keygen -Y verify`. Returns what is wrong, or "": it
/// is of another text, or not by that signer. Throws Error (bad input) if there is no signature or
/// the file of signers cannot be read, Error (failed) if ssh-keygen cannot be started.
std::string signature_fault(const std::string& text, const std::filesystem::path& signature,
                            const Signers& signers);

}  // namespace raystage::store
