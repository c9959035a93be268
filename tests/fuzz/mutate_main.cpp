// SPDX-License-Identifier: Apache-2.0
// Runs a fuzz target on every seed and 2000 mutations of the seeds, the same in every run.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace {

using Bytes = std::vector<std::uint8_t>;

std::vector<Bytes> read_seeds(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> files;
  if (std::filesystem::is_directory(folder)) {
    for (const auto& entry : std::filesystem::directory_iterator(folder)) files.push_back(entry);
  }
  std::sort(files.begin(), files.end());
  std::vector<Bytes> seeds;
  for (const auto& file : files) {
    std::ifstream stream(file, std::ios::binary);
    seeds.emplace_back(std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>());
  }
  if (seeds.empty()) seeds.emplace_back();
  return seeds;
}

Bytes mutate(Bytes bytes, std::mt19937& random) {
  const auto pick = [&](std::size_t bound) { return bound ? random() % bound : 0; };
  for (std::size_t edits = 1 + pick(4); edits > 0; --edits) {
    switch (pick(5)) {
      case 0:
        if (!bytes.empty()) bytes[pick(bytes.size())] = static_cast<std::uint8_t>(random());
        break;
      case 1:
        if (!bytes.empty()) bytes[pick(bytes.size())] ^= static_cast<std::uint8_t>(1u << pick(8));
        break;
      case 2:
        bytes.resize(pick(bytes.size() + 1));
        break;
      case 3:
        bytes.insert(bytes.begin() + static_cast<std::ptrdiff_t>(pick(bytes.size() + 1)),
                     static_cast<std::uint8_t>(random()));
        break;
      default:
        if (!bytes.empty())
          bytes.erase(bytes.begin() + static_cast<std::ptrdiff_t>(pick(bytes.size())));
    }
  }
  return bytes;
}

}  // namespace

int main(int argc, char** argv) {
  const std::vector<Bytes> seeds = read_seeds(argc > 1 ? argv[1] : "");
  for (const Bytes& seed : seeds) LLVMFuzzerTestOneInput(seed.data(), seed.size());
  std::mt19937 random(1);
  constexpr int kMutations = 2000;
  for (int i = 0; i < kMutations; ++i) {
    const Bytes input = mutate(seeds[static_cast<std::size_t>(i) % seeds.size()], random);
    LLVMFuzzerTestOneInput(input.data(), input.size());
  }
  std::printf("%zu seeds and %d mutations survived\n", seeds.size(), kMutations);
  return 0;
}
