// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "base/posix_file.h"

namespace raystage::sandbox {

/// Whether a decoder is kept from everything but decoding.
enum class Confinement {
  kFull,       ///< limits and a filter of system calls; refused where the kernel has none
  kLimitsOnly  ///< for kernels without filters and files that are trusted
};

struct DecoderOptions {
  std::string program;                                  ///< name of the program in lib/raystage
  std::vector<std::string> arguments;                   ///< of the program
  std::filesystem::path file;                           ///< that is decoded, named by errors
  std::string kind;                                     ///< of the file, named by errors: "mesh"
  std::size_t memory_bytes = std::size_t{2} << 30;      ///< address space of the process
  std::uint64_t result_bytes = std::uint64_t{4} << 30;  ///< largest result
  std::chrono::seconds time{20};  ///< of the processor; by the clock four times as much and 10 s
  Confinement confinement = Confinement::kFull;
};

/// Returns a file that the decoder asks for, opened for reading, or one that is not open().
using OpenFile = std::function<FileDescriptor(const std::string& name)>;

/// Decodes a file in a process of its own and returns its result. Throws Error (bad input) with the
/// decoder's reason, or if it crashed, took too long, or needed too much memory; Error (failed) if
/// it cannot be started or confined.
std::vector<std::byte> run_decoder(const DecoderOptions& options, const OpenFile& open_file);

}  // namespace raystage::sandbox
