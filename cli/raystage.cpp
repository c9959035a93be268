// SPDX-License-Identifier: Apache-2.0
// `raystage COMMAND ...` runs the executable raystage-COMMAND next to itself, so that each command
// loads only the libraries that it uses.
#include <dlfcn.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <string>
#include <string_view>

namespace {

struct Command {
  std::string_view name, summary;
};

constexpr Command kCommands[] = {
    {"import", "import images or movies as a take: a manifest, or a rig of another program"},
    {"export", "write a take or a rig for other programs: movies, images, quilts, COLMAP, NeRF"},
    {"record", "record the cameras of one ingest node"},
    {"join", "join the recordings of several nodes to one take"},
    {"simulate", "simulate a take with ground truth"},
    {"sync", "resynchronise the free-running cameras of a take"},
    {"calibrate", "calibrate geometry and colour of an array, compare rigs"},
    {"info", "show the contents of a take and what is missing"},
    {"verify", "check a take against its recorded hashes; exit code 1 if it differs"},
    {"repair", "complete an interrupted recording, repair a damaged take"},
    {"pack", "recompress the frames of a take without loss"},
    {"unpack", "return the take that was packed, bit for bit"},
    {"bag", "write a take as a bag of BagIt or an OCFL object for an archive, check bags"},
    {"proxy", "write the scene of a take as points or a mesh for other programs"},
    {"prepare", "derive and store the camera depths that a shot needs"},
    {"render", "render a shot as an EXR sequence"},
    {"farm", "render a shot as jobs on Slurm, or as the same tasks on this machine"},
    {"camera", "export the virtual camera of a shot: .nk, .chan, .gltf"},
    {"evaluate", "measure error and time on views with ground truth"},
    {"bench", "compare methods: error against time, as an HTML page"},
    {"plan", "compute what an array can show: range of motion, resolution, the check of a shot"},
    {"replay", "show a take or a shot in the browser: fly, focus, play, save the shot"},
    {"preview", "turn an EXR sequence into a movie and a contact sheet"},
};

void print_help(std::FILE* stream) {
  std::fputs(
      "Raystage records light field video from a camera array and renders it for film.\n\n"
      "Usage: raystage COMMAND [OPTION...]      raystage COMMAND --help for its options\n\n"
      "Commands:\n",
      stream);
  for (const Command& command : kCommands) {
    std::fprintf(stream, "  %-10s %s\n", command.name.data(), command.summary.data());
  }
  std::fputs(
      "\nOptions:\n"
      "  -h, --help     print this\n"
      "  --version      print version, kernels and libraries\n\n"
      "Exit codes: 0 all requested output is complete, 1 failed, 2 bad usage or input,\n"
      "3 some frames failed, 4 some frames fall short, 33 out of memory,\n"
      "128+n stopped by signal n.\n",
      stream);
}

/// Returns the instruction set that the kernels require (cmake/House.cmake) and this processor
/// lacks, or null.
const char* missing_instructions() {
#if defined(__x86_64__)
  if (!__builtin_cpu_supports("sse4.2")) return "SSE4.2";
  if (!__builtin_cpu_supports("pclmul")) return "PCLMULQDQ";
  if (!__builtin_cpu_supports("aes")) return "AES-NI";
#endif
  return nullptr;
}

/// Returns whether the command is one rank of several that mpirun started. A separate program runs
/// ranks, so that the usual one loads no MPI.
bool is_one_of_ranks(std::string_view command) {
  const char* ranks = std::getenv("OMPI_COMM_WORLD_SIZE");  // NOLINT(concurrency-mt-unsafe)
  return command == "render" && ranks != nullptr && std::atoi(ranks) > 1;
}

std::filesystem::path folder_of_program() {
  std::error_code error;
  return std::filesystem::read_symlink("/proc/self/exe", error).parent_path();
}

/// Prints the version, which a module states: it links Highway, whose library measures the clock
/// for 4 ms whenever it is loaded. Returns the exit code.
int print_version() {
  const auto file =
      (folder_of_program() / RAYSTAGE_MODULE_DIRECTORY "/raystage-version.so").lexically_normal();
  void* const module = dlopen(file.c_str(), RTLD_LAZY | RTLD_LOCAL);
  void* const text = module == nullptr ? nullptr : dlsym(module, "raystage_version_text");
  if (text == nullptr) {
    std::fprintf(stderr, "raystage: the version cannot be read: %s. Install raystage again.\n",
                 dlerror());
    return 1;
  }
  std::puts(reinterpret_cast<const char* (*)()>(text)());
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  const std::string_view command = argc > 1 ? argv[1] : "";
  if (command == "--version") return print_version();
  if (command == "--help" || command == "-h" || command == "help") {
    print_help(stdout);
    return 0;
  }
  if (command.empty()) {
    print_help(stderr);
    return 2;
  }
  for (const Command& known : kCommands) {
    if (known.name != command) continue;
    if (const char* missing = missing_instructions()) {
      std::fprintf(stderr,
                   "raystage: this processor lacks %s. Use one of 2011 or later (Intel Westmere, "
                   "AMD Bulldozer, or newer).\n",
                   missing);
      return 1;
    }
    const std::string name = std::string(command) + (is_one_of_ranks(command) ? "-ranks" : "");
    const std::string program = (folder_of_program() / ("raystage-" + name)).string();
    execv(program.c_str(), argv + 1);
    std::fprintf(stderr,
                 "raystage: %s: cannot be run: %s. Build all commands (cmake --build), or install "
                 "raystage again.\n",
                 program.c_str(), std::strerror(errno));
    return 1;
  }
  std::fprintf(stderr, "raystage: there is no command '%s'. See raystage --help.\n", argv[1]);
  return 2;
}
