// SPDX-License-Identifier: Apache-2.0
// A thousand faults of a bag, each found by the level of check that can find it, and by none
// before.
#include <gtest/gtest.h>

#include <array>
#include <filesystem>
#include <functional>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "base/error.h"
#include "store/bagit/check_bag.h"
#include "testing/store/bag_test_data.h"

namespace raystage::store {
namespace bag_faults_test {

namespace fs = std::filesystem;
using testing::TestBag;

constexpr std::array kLevels{BagCheckLevel::kQuick, BagCheckLevel::kCompleteness,
                             BagCheckLevel::kChecksums};

/// Returns whether a level of check finds that the bag is not valid.
bool finds(const TestBag& bag, BagCheckLevel level) {
  BagCheckOptions options;
  options.level = level;
  try {
    return !check_bag(bag.path(), options).is_valid();
  } catch (const Error&) {
    return true;  // it is no bag any more, or of no known version
  }
}

/// Makes and undoes faults of one bag.
class Faults {
 public:
  Faults() {
    bag_.declare();
    for (int i = 0; i < 8; ++i) {
      std::string bytes(100 + 10 * (i / 2), '\0');  // pairs of the same size
      for (char& c : bytes) c = static_cast<char>(random_());
      bag_.write("data/" + std::string(i % 3 == 0 ? "folder/" : "") + std::to_string(i), bytes);
    }
    bag_.write("notes/a.txt", "the first of two\n");
    bag_.write("notes/b.txt", "the second, more\n");
    bag_.write_manifest("sha256");
    bag_.write_info("Contact-Name: A\n");
    bag_.write_tag_manifest("sha256");
    payload_ = bag_.files(true);
    tags_ = bag_.files(false);
    tags_.emplace_back("tagmanifest-sha256.txt");
  }
  const TestBag& bag() const { return bag_; }

  std::string any(const std::vector<std::string>& names) { return names[random_() % names.size()]; }
  const std::vector<std::string>& payload() const { return payload_; }
  const std::vector<std::string>& tags() const { return tags_; }

  void flip(const std::string& name) {
    std::string bytes = bag_.read(name);
    const std::size_t at = random_() % bytes.size();
    unsigned bit = random_() % 8;
    // Digests may be in either case, so that this bit of a letter says nothing.
    constexpr unsigned kCase = 5;
    if (name.starts_with("tagmanifest") && bit == kCase) bit = 0;
    bytes[at] = static_cast<char>(static_cast<unsigned char>(bytes[at]) ^ (1u << bit));
    change(name, bytes);
  }
  void resize(const std::string& name) {
    std::string bytes = bag_.read(name);
    if (random_() % 2 == 0) {
      bytes.resize(random_() % bytes.size());
    } else {
      bytes += static_cast<char>(random_());
    }
    change(name, bytes);
  }
  void remove(const std::string& name) {
    keep(name);
    fs::remove(bag_.path() / name);
  }
  void add(const std::string& name) {
    added_.push_back(name);
    bag_.write(name, "added");
  }
  void swap(const std::string& a, const std::string& b) {
    const std::string first = bag_.read(a), second = bag_.read(b);
    change(a, second);
    change(b, first);
  }
  void rename(const std::string& name) {
    keep(name);
    added_.push_back(name + "x");
    fs::rename(bag_.path() / name, bag_.path() / added_.back());
  }
  void link(const std::string& name) {
    keep(name);
    added_.emplace_back("outside");
    fs::rename(bag_.path() / name, bag_.path() / "outside");
    fs::create_symlink(bag_.path() / "outside", bag_.path() / name);
  }
  void undo() {
    for (const std::string& name : added_) fs::remove(bag_.path() / name);
    for (const auto& [name, bytes] : kept_) {
      fs::remove(bag_.path() / name);
      bag_.write(name, bytes);
    }
    added_.clear();
    kept_.clear();
  }

 private:
  void keep(const std::string& name) { kept_.emplace_back(name, bag_.read(name)); }
  void change(const std::string& name, const std::string& bytes) {
    keep(name);
    bag_.write(name, bytes);
  }

  TestBag bag_;
  std::mt19937 random_{20051};
  std::vector<std::string> payload_, tags_, added_;
  std::vector<std::pair<std::string, std::string>> kept_;
};

struct Kind {
  const char* name;
  std::function<void(Faults&)> make;
  /// The level that finds it, and none before; nullopt: checksums at the latest.
  std::optional<BagCheckLevel> level;
};

TEST(BagFaults, AThousandAreFoundByTheRightLevel) {
  Faults faults;
  ASSERT_FALSE(finds(faults.bag(), BagCheckLevel::kChecksums));
  const std::vector<std::string> pair{"data/1", "data/folder/0"};
  const std::vector<Kind> kinds{
      {"flip a bit of a payload file", [](Faults& f) { f.flip(f.any(f.payload())); },
       BagCheckLevel::kChecksums},
      {"flip a bit of a payload file", [](Faults& f) { f.flip(f.any(f.payload())); },
       BagCheckLevel::kChecksums},
      {"swap payload files", [&](Faults& f) { f.swap(pair[0], pair[1]); },
       BagCheckLevel::kChecksums},
      {"rename a payload file", [](Faults& f) { f.rename(f.any(f.payload())); },
       BagCheckLevel::kCompleteness},
      {"remove a payload file", [](Faults& f) { f.remove(f.any(f.payload())); },
       BagCheckLevel::kQuick},
      {"add a payload file", [](Faults& f) { f.add("data/added"); }, BagCheckLevel::kQuick},
      {"resize a payload file", [](Faults& f) { f.resize(f.any(f.payload())); },
       BagCheckLevel::kQuick},
      {"link a payload file", [](Faults& f) { f.link(f.any(f.payload())); }, BagCheckLevel::kQuick},
      {"swap tag files", [](Faults& f) { f.swap("notes/a.txt", "notes/b.txt"); },
       BagCheckLevel::kChecksums},
      {"flip a bit of notes", [](Faults& f) { f.flip("notes/a.txt"); }, BagCheckLevel::kChecksums},
      {"remove notes", [](Faults& f) { f.remove("notes/b.txt"); }, BagCheckLevel::kCompleteness},
      {"remove the manifest", [](Faults& f) { f.remove("manifest-sha256.txt"); },
       BagCheckLevel::kCompleteness},
      {"remove the declaration", [](Faults& f) { f.remove("bagit.txt"); }, BagCheckLevel::kQuick},
      {"remove the information", [](Faults& f) { f.remove("bag-info.txt"); },
       BagCheckLevel::kQuick},
      {"flip a bit of any tag file", [](Faults& f) { f.flip(f.any(f.tags())); }, std::nullopt},
      {"flip a bit of any tag file", [](Faults& f) { f.flip(f.any(f.tags())); }, std::nullopt},
  };
  constexpr int kFaults = 1000;
  int found = 0;
  for (int i = 0; i < kFaults; ++i) {
    const Kind& kind = kinds[static_cast<std::size_t>(i) % kinds.size()];
    kind.make(faults);
    const bool is_found = finds(faults.bag(), kind.level.value_or(BagCheckLevel::kChecksums));
    EXPECT_TRUE(is_found) << i << ": " << kind.name;
    found += is_found ? 1 : 0;
    for (const BagCheckLevel level : kLevels) {
      if (kind.level && level < *kind.level) {
        EXPECT_FALSE(finds(faults.bag(), level)) << i << ": " << kind.name;
      }
    }
    faults.undo();
  }
  EXPECT_EQ(found, kFaults);
  EXPECT_FALSE(finds(faults.bag(), BagCheckLevel::kChecksums));
}

}  // namespace bag_faults_test
}  // namespace raystage::store
