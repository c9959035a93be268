// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "base/atomic_file.h"
#include "store/bagit/digests.h"
#include "store/bagit/tag_files.h"
#include "testing/test_folder.h"

namespace raystage::testing {

inline std::string digest_of(std::string_view bytes, store::DigestAlgorithm algorithm) {
  const std::array algorithms{algorithm};
  store::Digests digests(algorithms);
  digests.update(std::as_bytes(std::span(bytes)));
  return digests.hex().front();
}

/// A bag in a temporary folder, whose files are written one by one.
class TestBag {
 public:
  std::filesystem::path path() const { return folder_.path() / "bag"; }

  void write(const std::string& name, std::string_view bytes) const {
    create_folder((path() / name).parent_path());
    write_file_atomically(path() / name, bytes);
  }
  std::string read(const std::string& name) const { return read_file(path() / name); }

  void declare(const std::string& version = "1.0", const std::string& encoding = "UTF-8") const {
    write("bagit.txt",
          "BagIt-Version: " + version + "\nTag-File-Character-Encoding: " + encoding + "\n");
  }
  /// Returns the paths of files below the bag, sorted; of the payload or of the rest.
  std::vector<std::string> files(bool is_payload) const {
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(path())) {
      if (!entry.is_regular_file()) continue;
      const std::string name = entry.path().lexically_relative(path()).string();
      if (name.starts_with("data/") == is_payload && !name.starts_with("tagmanifest-")) {
        names.push_back(name);
      }
    }
    std::ranges::sort(names);
    return names;
  }
  /// Returns the text of a manifest of all payload files, or of all tag files.
  std::string manifest(store::DigestAlgorithm algorithm, bool is_payload = true) const {
    std::string text;
    for (const std::string& name : files(is_payload)) {
      text += digest_of(read(name), algorithm) + "  " + store::encode_bag_path(name) + "\n";
    }
    return text;
  }
  void write_manifest(std::string_view algorithm) const {
    write("manifest-" + std::string(algorithm) + ".txt",
          manifest(store::digest_algorithm(algorithm).value()));
  }
  void write_tag_manifest(std::string_view algorithm) const {
    write("tagmanifest-" + std::string(algorithm) + ".txt",
          manifest(store::digest_algorithm(algorithm).value(), false));
  }
  /// Writes bag-info.txt with the right Payload-Oxum.
  void write_info(const std::string& more = "") const {
    std::uint64_t bytes = 0;
    const auto payload = files(true);
    for (const std::string& name : payload) bytes += std::filesystem::file_size(path() / name);
    write("bag-info.txt", more + "Payload-Oxum: " + std::to_string(bytes) + "." +
                              std::to_string(payload.size()) + "\n");
  }

 private:
  TestFolder folder_;
};

}  // namespace raystage::testing
