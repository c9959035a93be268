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
/// std::bad_alloc for files that the memory does not hold.
std::optional<std::vector<std::byte>> request_file(const std::string& name);

/// Decodes and returns the result. `arguments`: of DecoderOptions. Throws std::runtime_error with
/// the reason if the file cannot be decoded.
using Decode = std::function<std::vector<std::byte>(std::span<const char* const> arguments)>;

/// The main function of a decoder's program: confines the process, decodes, writes the result and
/// returns the exit code.
int decoder_main(int argc, char** argv, const Decode& decode);

}  // namespace raystage::sandbox
