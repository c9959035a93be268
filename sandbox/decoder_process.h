// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/contained_path.h"
#include "base/posix_file.h"

namespace raystage::sandbox {

/// Whether decoders are kept from everything but decoding.
enum class Confinement {
  kFull,       ///< limits and a filter of system calls; refused where the kernel has none
  kLimitsOnly  ///< for kernels without filters and files that are trusted
};

/// Name of the environment variable that makes default_confinement() kLimitsOnly if it is "1".
/// Processes that a command starts, e.g. ranks of a render, inherit it.
inline constexpr const char* kUnsandboxedVariable = "RAYSTAGE_UNSANDBOXED";
Confinement default_confinement();

/// Of a decoder. It may hold secrets, which few decoders need to see.
enum class Environment { kNone, kInherited };

struct DecoderOptions {
  std::string program;                              ///< name of the program in lib/raystage
  std::string kind;                                 ///< of the files, named by errors: "mesh"
  std::string advice = "Export it again";           ///< where a file is refused
  std::size_t memory_bytes = std::size_t{1} << 30;  ///< that requests may take, besides the program
  /// What memory_bytes was before the machine limited it, for errors; 0: it did not.
  std::size_t wanted_memory_bytes = 0;
  std::uint64_t result_bytes = std::uint64_t{4} << 30;  ///< largest request and result
  /// For one request, of the processor; by the clock twice as much and 10 s.
  std::chrono::seconds time{20};
  Confinement confinement = default_confinement();
  Environment environment = Environment::kNone;
};

/// Returns a file that the decoder asks for, opened for reading, or one that is not open().
using OpenFile = std::function<FileDescriptor(const std::string& name)>;

/// Returns the file itself if it is a regular one, and nothing else.
OpenFile only_file(const std::filesystem::path& file);
/// The same for a file that is opened without leaving its folder, asked for by its whole path.
OpenFile only_file(const ContainedPath& file);
/// Returns the file itself and regular files below its folder that are not behind links, each up to
/// `max_bytes`.
OpenFile files_below_folder_of(const std::filesystem::path& file, std::uint64_t max_bytes);

/// Decodes files in a process of its own. It is started with the first request, and again after a
/// crash; it ends with this object. Not thread-safe.
class DecoderProcess {
 public:
  explicit DecoderProcess(DecoderOptions options);
  ~DecoderProcess();
  DecoderProcess(DecoderProcess&&) noexcept;
  DecoderProcess& operator=(DecoderProcess&&) noexcept;

  const DecoderOptions& options() const { return options_; }
  /// Starts the process ahead of the first request. Throws Error (failed) if that is impossible.
  void start();
  /// Sends a request and returns the result. `file`: what is decoded, named by errors. Throws Error
  /// (bad input) with the decoder's reason, or if it crashed or needed too much time or memory;
  /// Error (failed) if it cannot be started or confined, was killed, or did not get to run.
  std::vector<std::byte> decode(std::span<const std::byte> request,
                                const std::filesystem::path& file, const OpenFile& open_file);

 private:
  class Child;
  class Exchange;
  DecoderOptions options_;
  std::unique_ptr<Child> child_;
};

/// Decodes one file, in a process that ends then. Throws as DecoderProcess::decode() does.
std::vector<std::byte> run_decoder(const DecoderOptions& options,
                                   std::span<const std::byte> request,
                                   const std::filesystem::path& file, const OpenFile& open_file);

}  // namespace raystage::sandbox
