// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <iterator>
#include <random>
#include <string>
#include <vector>

#include "base/error.h"
#include "images/exr_reader.h"
#include "testing/png_bomb.h"
#include "testing/test_folder.h"
#include "tests/attack/attack_archives.h"
#include "tests/attack/attack_scene.h"
#include "tests/attack/mutation.h"
#include "tests/end_to_end/run_command.h"

namespace raystage::testing {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMemoryBound = 1'200'000'000;  // --memory 0.5, libraries, and a decoder's
constexpr double kMaxSeconds = 20;

/// Commands are slower than functions: without RAYSTAGE_ATTACK_CASES each format has few cases.
int command_case_count() {
  return std::getenv("RAYSTAGE_ATTACK_CASES") == nullptr ? 4 : attack_case_count();
}

/// Returns whether a file below out/ is a rendered or exported picture, and no part of a new take.
bool is_result(const fs::path& file) {
  return file.string().starts_with("f.") || *file.begin() == "exported";
}

/// Expects that R, G, B and A of a picture are finite. A picture of an earlier run may be one that
/// cannot be decoded: what is kept is checked for its header and chunks, not for its pixels.
void expect_finite(const images::ExrReader& reader, const fs::path& file,
                   const AttackedFormat& format) {
  constexpr images::ExrChannel kChannels[] = {{"R"}, {"G"}, {"B"}, {"A", 1.0F}};
  images::ExrChannelData pixels;
  try {
    pixels = reader.read(file, kChannels, "");
  } catch (const Error& error) {
    EXPECT_TRUE(format.keeps_earlier_pictures) << error.what();
    return;
  }
  for (const float value : pixels.values) {
    ASSERT_TRUE(std::isfinite(value)) << file;
  }
}

/// Expects that no text says what only faults of ours or of the disk say.
void expect_named_fault(const std::string& err) {
  for (const char* text :
       {": unexpected: ", "Please report", "Check the free space", "filesystem error"}) {
    EXPECT_EQ(err.find(text), std::string::npos) << err;
  }
}

/// Returns contents to try in place of the seed: itself first, then for PNG one whose few bytes
/// state a huge size, then mutations.
std::string contents_of(const AttackedFormat& format, const std::string& seed, int number,
                        std::mt19937& random) {
  constexpr std::uint32_t kHuge = 16384;
  if (number == 0) return seed;
  if (number == 1 && format.file.ends_with(".png")) return png_that_states(kHuge, kHuge);
  return format.is_text ? mutated_text(seed, random) : mutated_bytes(seed, random);
}

TEST(CommandAttack, EveryCaseEndsInAResultOrAnErrorOfOurs) {
  const TestFolder folder;
  const fs::path& scene = folder.path();
  write_attack_scene(scene);
  write_attack_archives(scene);
  const images::ExrReader reader(100'000'000);
  std::mt19937 random(7);  // NOLINT: the same in every run
  std::size_t largest = 0;
  const char* const first = std::getenv("RAYSTAGE_ATTACK_FIRST_FORMAT");
  bool is_attacked = first == nullptr;
  std::vector<AttackedFormat> formats = attacked_formats(scene);
  std::ranges::move(attacked_archives(scene), std::back_inserter(formats));
  for (const AttackedFormat& format : formats) {
    is_attacked = is_attacked || format.name == first;
    if (!is_attacked) continue;
    const std::string seed = read_text(scene / format.file);
    int refused = 0;
    for (int i = 0; i < command_case_count(); ++i) {
      SCOPED_TRACE(format.name + " " + std::to_string(i));
      const bool is_seed = i == 0;
      const std::string contents = contents_of(format, seed, i, random);
      write_text(scene / format.file, contents);
      fs::remove_all(scene / "out");
      fs::create_directories(scene / "out");
      const auto start = std::chrono::steady_clock::now();
      const CommandResult result =
          run("cd '" + scene.string() + "' && exec timeout 60 sh -c '" + format.command + "'");
      const std::chrono::duration<double> duration = std::chrono::steady_clock::now() - start;
      const bool is_ours = result.exit_code >= 0 && result.exit_code <= 4;
      EXPECT_TRUE(is_ours) << result.exit_code << "\n" << result.err;
      expect_named_fault(result.err);
      EXPECT_LT(duration.count(), kMaxSeconds);
      EXPECT_LT(result.peak_memory, kMemoryBound);
      if (is_seed) {
        EXPECT_EQ(result.exit_code, format.seed_exit_code) << result.err << result.out;
      }
      refused += result.exit_code != 0 ? 1 : 0;
      largest = std::max(largest, result.peak_memory);
      for (const fs::path& picture : find_files(scene / "out", ".exr")) {
        if (is_result(picture.lexically_relative(scene / "out"))) {
          expect_finite(reader, picture, format);
        }
      }
      if (HasFailure()) {
        const fs::path kept =
            fs::temp_directory_path() /
            ("attack-" + std::to_string(i) + "-" + fs::path(format.file).filename().string());
        write_text(kept, contents);
        FAIL() << "the input is kept as " << kept;
      }
    }
    write_text(scene / format.file, seed);
    RecordProperty(format.name, refused);
  }
  EXPECT_TRUE(is_attacked) << "there is no format " << first;
  std::printf("largest process %.0f MB\n", static_cast<double>(largest) / 1e6);
}

}  // namespace
}  // namespace raystage::testing
