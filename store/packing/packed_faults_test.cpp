// SPDX-License-Identifier: Apache-2.0
// Faults of disks and transfers in a packed take: bits that flip, bytes that are lost, added or
// exchanged in archives and journals, and files that are. Each must be found.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <string>

#include "base/atomic_file.h"
#include "base/error.h"
#include "store/fixity/manifest.h"
#include "store/fixity/verify.h"
#include "store/jpeg/encode.h"
#include "store/packing/pack_take.h"
#include "store/timeline.h"
#include "testing/store/take_test_data.h"

namespace raystage::store {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using FileBytes = std::vector<std::byte>;

enum class Fault { kFlip, kLoss, kAddition, kExchange };

/// Returns the bytes with one fault. The same for the same state of `random`.
FileBytes with_fault(const FileBytes& whole, Fault fault, std::mt19937& random) {
  const auto below = [&](std::size_t bound) { return random() % bound; };
  FileBytes bytes = whole;
  const auto at = [&](std::size_t index) {
    return bytes.begin() + static_cast<std::ptrdiff_t>(index);
  };
  const std::size_t count = 1 + below(64);
  switch (fault) {
    case Fault::kFlip:
      bytes[below(bytes.size())] ^= static_cast<std::byte>(1U << below(8));
      break;
    case Fault::kLoss: {
      const std::size_t begin = below(bytes.size() - count);
      bytes.erase(at(begin), at(begin + count));
      break;
    }
    case Fault::kAddition: {
      FileBytes added(count);
      for (std::byte& value : added) value = static_cast<std::byte>(random());
      bytes.insert(at(below(bytes.size() + 1)), added.begin(), added.end());
      break;
    }
    case Fault::kExchange:
      while (bytes == whole) {  // equal bytes are no fault
        const std::size_t a = below(bytes.size() - 2 * count);
        const std::size_t b = a + count + below(bytes.size() - a - 2 * count + 1);
        std::swap_ranges(at(a), at(a + count), at(b));
      }
  }
  return bytes;
}

constexpr int kPairs = 2, kEach = 3;

/// Writes a take and packs it. The same for the same state of `random`.
void write_packed_take(const fs::path& take, const fs::path& packed, const std::string& name,
                       std::mt19937& random) {
  schemas::TakeDocument document = testing::take_document(kPairs);
  schemas::RigDocument rig = testing::rig_document(kPairs);
  document.name = rig.name = name;
  TakeWriter writer(take, document, rig);
  for (int camera = 0; camera < kPairs; ++camera) {
    for (int frame = 0; frame < kEach; ++frame) {
      RgbImage image(320, 240);
      for (std::size_t i = 0; i < image.values.size(); ++i) {
        image.values[i] = static_cast<std::uint8_t>(i / 960 + i / 3 % 320 + random() % 8);
      }
      writer.archive(camera).append(encode_jpeg(image, {}), 1000 * (frame + 1));
    }
    writer.archive(camera).append_missing(FrameStatus::kDroppedLate, 9000);
  }
  writer.commit();
  write_timeline(build_timeline(Take(take), 15, 0), take);
  write_file_atomically(take / "notes.txt", "notes of " + name);
  write_file_atomically(take / kManifestFile, manifest_as_text(make_manifest(Take(take), {})));
  ASSERT_EQ(pack_take(Take(take), packed, {}).total().packed, kPairs * kEach);
}

TEST(PackedFaults, OfAThousandEachIsFound) {
  constexpr int kFaults = 1000;
  const testing::TestFolder folder;
  const fs::path packed = folder.path() / "packed";
  std::mt19937 random(29);  // NOLINT: the same in every run
  ASSERT_NO_FATAL_FAILURE(write_packed_take(folder.path() / "take", packed, "test", random));

  int found = 0;
  for (int i = 0; i < kFaults; ++i) {
    const auto camera = static_cast<std::size_t>(i / 4 % kPairs);
    // The journals are much smaller than the archives, and as important.
    const char* const extension = i / 8 % 3 == 0 ? ".journal" : ".mkv";
    const fs::path file = packed / "archive" / ("c" + std::to_string(camera) + extension);
    const FileBytes whole = testing::bytes_of(file);
    testing::overwrite(file, with_fault(whole, static_cast<Fault>(i % 4), random));
    const TakeFixityReport report = verify_take(packed, {});
    EXPECT_FALSE(report.is_intact()) << "fault " << i << " of " << file;
    EXPECT_TRUE(report.cameras[1 - camera].report.is_intact()) << i;
    found += report.is_intact() ? 0 : 1;
    testing::overwrite(file, whole);
  }
  EXPECT_EQ(found, kFaults);
  EXPECT_TRUE(verify_take(packed, {}).is_intact());
}

/// Whole files of a packed take that has a manifest are lost, added, exchanged or come from
/// another take.
class PackedFileFaults : public ::testing::Test {
 protected:
  void SetUp() override {
    std::mt19937 random(31);  // NOLINT: the same in every run
    ASSERT_NO_FATAL_FAILURE(write_packed_take(folder_.path() / "take", packed_, "test", random));
    ASSERT_NO_FATAL_FAILURE(
        write_packed_take(folder_.path() / "other take", other_, "other", random));
    manifest_ = manifest_as_text(make_manifest(Take(packed_), {}));
    for (const std::string& file : files_of_take(packed_)) {
      files_[file] = testing::bytes_of(packed_ / file);
    }
    ASSERT_THAT(names(), ElementsAre("archive/c0.journal", "archive/c0.mkv", "archive/c1.journal",
                                     "archive/c1.mkv", "notes.txt", "original/manifest.sha256",
                                     "rig.json", "take.json", "timeline.zst"));
    ASSERT_TRUE(found().is_intact());
    ASSERT_FALSE(is_found_without_manifest());
  }
  std::vector<std::string> names() const {
    std::vector<std::string> all;
    for (const auto& [name, bytes] : files_) all.push_back(name);
    return all;
  }
  ManifestReport found() const { return check_manifest(packed_, manifest_, {}); }
  bool is_found_without_manifest() const {
    try {
      return !verify_take(packed_, {}).is_intact();
    } catch (const Error&) {  // the take cannot be opened
      return true;
    }
  }
  static bool is_archive_or_journal(const std::string& file) {
    return file.starts_with("archive/");
  }
  void replace(const std::string& file, const FileBytes& bytes) const {
    testing::overwrite(packed_ / file, bytes);
  }
  void restore(const std::string& file) const { replace(file, files_.at(file)); }

  testing::TestFolder folder_;
  const fs::path packed_ = folder_.path() / "packed", other_ = folder_.path() / "other";
  std::string manifest_;
  std::map<std::string, FileBytes> files_;
};

TEST_F(PackedFileFaults, LostFilesAreFound) {
  for (const std::string& file : names()) {
    fs::remove(packed_ / file);
    const ManifestReport report = found();
    EXPECT_THAT(report.missing, ElementsAre(file));
    EXPECT_THAT(report.changed, IsEmpty()) << file;
    EXPECT_THAT(report.unlisted, IsEmpty()) << file;
    if (is_archive_or_journal(file) || file == "take.json" || file == "rig.json") {
      EXPECT_TRUE(is_found_without_manifest()) << file;
    }
    restore(file);
  }
  EXPECT_TRUE(found().is_intact());
}

TEST_F(PackedFileFaults, AddedFilesAreFound) {
  for (const std::string added :
       {"archive/c2.mkv", "archive/c0.mkv.damaged", "archive/more/c0.mkv", "take.json.bak",
        "original/take.json", "recording/a.txt", "new/empty"}) {
    fs::create_directories((packed_ / added).parent_path());
    replace(added, added == "new/empty" ? FileBytes() : files_.at("archive/c0.mkv"));
    const ManifestReport report = found();
    EXPECT_THAT(report.unlisted, ElementsAre(added));
    EXPECT_THAT(report.changed, IsEmpty()) << added;
    EXPECT_THAT(report.missing, IsEmpty()) << added;
    fs::remove(packed_ / added);
  }
}

TEST_F(PackedFileFaults, ExchangedFilesAreFound) {
  for (const auto& [a, bytes_of_a] : files_) {
    for (const auto& [b, bytes_of_b] : files_) {
      if (!(a < b)) continue;
      replace(a, bytes_of_b);
      replace(b, bytes_of_a);
      const ManifestReport report = found();
      EXPECT_THAT(report.changed, ElementsAre(a, b));
      EXPECT_THAT(report.missing, IsEmpty()) << a << b;
      EXPECT_THAT(report.unlisted, IsEmpty()) << a << b;
      // Of all other files this format knows what they are.
      if (a != "notes.txt" || b != "original/manifest.sha256") {
        EXPECT_TRUE(is_found_without_manifest()) << a << b;
      }
      restore(a);
      restore(b);
    }
  }
}

TEST_F(PackedFileFaults, FilesOfAnotherCameraAreFound) {
  const std::vector<std::vector<std::string>> cases{
      {"archive/c0.mkv"}, {"archive/c0.journal"}, {"archive/c0.journal", "archive/c0.mkv"}};
  for (const std::vector<std::string>& replaced : cases) {
    for (std::string other : replaced) {
      const std::string file = other;
      replace(file, files_.at(other.replace(other.find("c0"), 2, "c1")));
    }
    EXPECT_EQ(found().changed, replaced);
    EXPECT_TRUE(is_found_without_manifest()) << replaced.front();
    for (const std::string& file : replaced) restore(file);
  }
}

TEST_F(PackedFileFaults, FilesOfAnotherTakeAreFound) {
  const auto expect_found = [&](const std::vector<std::string>& replaced, bool without_manifest) {
    for (const std::string& file : replaced) replace(file, testing::bytes_of(other_ / file));
    EXPECT_EQ(found().changed, replaced);
    if (without_manifest) {
      EXPECT_TRUE(is_found_without_manifest()) << replaced.front();
    }
    for (const std::string& file : replaced) restore(file);
  };
  for (const std::string& file : names()) {
    expect_found({file}, is_archive_or_journal(file) || file == "timeline.zst");
  }
  // They match each other, but not the timeline.
  expect_found({"archive/c0.journal", "archive/c0.mkv"}, true);
}

}  // namespace
}  // namespace raystage::store
