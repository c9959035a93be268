// SPDX-License-Identifier: Apache-2.0
#include "farm/node_checks.h"

#include <dlfcn.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <link.h>
#include <unistd.h>
#include <xxhash.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <fstream>
#include <system_error>
#include <vector>

#include "base/atomic_file.h"
#include "base/child_process.h"
#include "base/error.h"
#include "base/module_file.h"
#include "compose/sequence_name.h"
#include "farm/job_folder.h"
#include "render/common/simd_level.h"

namespace raystage::farm {
namespace {

namespace fs = std::filesystem;

constexpr std::uintmax_t kProbeBytes = std::uintmax_t{1} << 20;

/// Libraries that pixels and files depend on. Other libraries vary between runs of one build: the
/// system loads some for user names, and textures may need more.
constexpr std::array<std::string_view, 16> kLibraries{
    "libOpenEXR", "libImath",       "libIlmThread",      "libOpenColorIO",
    "libembree",  "libtbb.so",      "libturbojpeg",      "libjpeg",
    "libhwy",     "libpng",         "libassimp",         "libm.so",
    "libc.so",    "libopencv_core", "libopencv_imgproc", "libopencv_video"};

int add_library(dl_phdr_info* info, std::size_t /*size*/, void* names) {
  if (info->dlpi_name == nullptr || info->dlpi_name[0] != '/') return 0;
  std::error_code ignored;
  // The name of the link's target has the full version.
  const std::string name = fs::canonical(info->dlpi_name, ignored).filename().string();
  if (std::ranges::any_of(kLibraries, [&](auto known) { return name.starts_with(known); })) {
    static_cast<std::vector<std::string>*>(names)->push_back(name);
  }
  return 0;
}

std::uint64_t hash_of_file(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::vector<char> buffer(std::size_t{1} << 20);
  XXH3_state_t* state = XXH3_createState();
  XXH3_64bits_reset(state);
  while (in.read(buffer.data(), static_cast<std::streamsize>(buffer.size())) || in.gcount() > 0) {
    XXH3_64bits_update(state, buffer.data(), static_cast<std::size_t>(in.gcount()));
  }
  const std::uint64_t hash = XXH3_64bits_digest(state);
  XXH3_freeState(state);
  return hash;
}

/// Returns the build in the file. The first node writes its own build there.
std::string first_build(const fs::path& file) {
  const std::string own = build_id();
  const int created = open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  if (created >= 0) {
    const bool written = write(created, own.data(), own.size()) == static_cast<ssize_t>(own.size());
    close(created);
    if (written) return own;
  }
  const std::string first = read_record({file.parent_path(), file.filename()}).value_or("");
  return first.empty() ? own : first;  // being written by another node
}

}  // namespace

std::string build_id() {
  // Decoders are programs of their own. The library of that of meshes is listed with those of this
  // one, which has the other libraries that matter.
  (void)dlopen("libassimp.so.5", RTLD_LAZY | RTLD_LOCAL);
  const fs::path motion = module_path("raystage-motion.so");  // which has OpenCV
  (void)dlopen(motion.c_str(), RTLD_LAZY | RTLD_LOCAL);
  std::vector<std::string> libraries;
  dl_iterate_phdr(add_library, &libraries);
  std::ranges::sort(libraries);
  std::string text = fmt::format("{:016x}", hash_of_file(sibling_program("raystage-render")));
  text += fmt::format(" {:016x}", hash_of_file(motion));
  for (const char* kind : {"exr", "image", "mesh", "png"}) {
    text +=
        fmt::format(" {:016x}", hash_of_file(module_path(fmt::format("raystage-decode-{}", kind))));
  }
  for (const std::string& library : libraries) text += " " + library;
  return fmt::format("{:016x}", XXH3_64bits(text.data(), text.size()));
}

std::optional<std::string> write_fault(const fs::path& folder, std::uintmax_t bytes) {
  std::error_code error;
  if (!fs::is_directory(folder, error)) {
    return fmt::format("{}: the folder does not exist", folder.string());
  }
  const fs::space_info space = fs::space(folder, error);
  if (!error && space.available < bytes) {
    return fmt::format("{}: the disk has room for {:.1f} MB, a frame needs {:.1f} MB",
                       folder.string(), space.available * 1e-6, bytes * 1e-6);
  }
  try {
    // Only a write detects quotas and disks that are mounted read-only.
    const TemporaryFile probe(folder / "probe");
    std::ofstream file(probe.path(), std::ios::binary);
    const std::vector<char> block(kProbeBytes, 'x');
    errno = 0;
    file.write(block.data(), static_cast<std::streamsize>(block.size()));
    file.close();
    if (!file) {
      return fmt::format("{}: the folder cannot be written to: {}", folder.string(),
                         std::generic_category().message(errno));
    }
  } catch (const Error& refused) {
    return fmt::format("{}: {}", folder.string(), refused.what_happened());
  }
  return std::nullopt;
}

std::optional<std::string> node_fault(const schemas::FarmJobDocument& job, const fs::path& folder) {
  std::error_code error;
  const std::string wanted = job.build.empty() ? first_build(folder / "build") : job.build;
  if (const std::string build = build_id(); build != wanted) {
    return fmt::format("build {} is installed, the job was made with build {}", build, wanted);
  }
  if (const render::SimdLevel best = render::best_simd_level();
      render::parse_simd_level(job.simd) > best) {
    return fmt::format("the processor supports {}, the job needs {}", render::simd_level_name(best),
                       job.simd);
  }
  if (!fs::is_directory(job.shot_folder, error)) {
    return fmt::format("{}: the shot's folder does not exist", job.shot_folder);
  }
  for (const std::string& input : job.inputs) {
    if (access(input.c_str(), R_OK) != 0) {
      return fmt::format("{}: cannot be read: {}", input, std::generic_category().message(errno));
    }
  }
  return write_fault(compose::SequenceName(job.output).folder(),
                     static_cast<std::uintmax_t>(job.frame_bytes));
}

}  // namespace raystage::farm
