// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace raystage::sandbox {

/// Asks the parent for a file. Returns its bytes; nullopt: there is none that may be read. Throws
/// std::bad_alloc for files that the memory does not hold. Libraries may also open files by name:
/// the parent answers that likewise.
std::optional<std::vector<std::byte>> request_file(const std::string& name);

/// Answers a request of the parent with a result. Throws std::runtime_error with the reason if a
/// file cannot be decoded; the next request may still be answered.
using AnswerRequest = std::function<std::vector<std::byte>(std::span<const std::byte> request)>;

/// The main function of a decoder's program: confines the process and answers requests until the
/// parent has no more. Returns the exit code.
int decoder_main(int argc, char** argv, const AnswerRequest& answer);

}  // namespace raystage::sandbox
