// SPDX-License-Identifier: Apache-2.0
// For tests of repairs with a copy: a take, its copy, and damage to either.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "base/error.h"
#include "store/fixity/repair_from_copy.h"
#include "store/timeline.h"
#include "testing/store/fixity_test_data.h"
#include "testing/store/take_test_data.h"

namespace raystage::testing {

/// The files of a folder by relative path, without hidden and set-aside ones.
using FolderContents = std::map<std::string, std::vector<std::byte>>;

inline constexpr int kCopiedCameras = 3, kCopiedFrames = 12;

inline void write_bytes_to(const std::filesystem::path& file, const std::vector<std::byte>& bytes) {
  std::filesystem::create_directories(file.parent_path());
  std::ofstream out(file, std::ios::binary | std::ios::trunc);
  out.write(reinterpret_cast<const char*>(bytes.data()),
            static_cast<std::streamsize>(bytes.size()));
}

inline FolderContents contents_of(const std::filesystem::path& folder) {
  FolderContents contents;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (!entry.is_regular_file() || name.find(".damaged") != std::string::npos) continue;
    contents.emplace(entry.path().lexically_relative(folder).string(), bytes_of(entry.path()));
  }
  return contents;
}

/// A take and a copy of it, each of which is damaged by the tests.
class CopiedTake : public ::testing::Test {
 protected:
  CopiedTake() {
    store::TakeWriter writer(take, take_document(kCopiedCameras), rig_document(kCopiedCameras));
    for (int camera = 0; camera < kCopiedCameras; ++camera) {
      for (unsigned i = 0; i < kCopiedFrames; ++i) {
        const auto jpeg = fake_jpeg(100U * static_cast<unsigned>(camera) + i, 40 + i);
        writer.archive(camera).append(jpeg, frame_time(i), frame_origin(i));
        if (i % 3 == 2) {
          writer.archive(camera).append_missing(store::FrameStatus::kDroppedLate, frame_time(i),
                                                {1, 100 + i});
        }
      }
    }
    std::filesystem::create_directory(writer.working_folder() / "recording");
    write_bytes_to(writer.working_folder() / "recording" / "one.json", account(true));
    write_bytes_to(writer.working_folder() / "notes.txt",
                   std::vector<std::byte>(20, std::byte{'x'}));
    writer.commit();
    store::write_timeline(store::read_timeline(store::Take(take)), store::Take(take));
    whole = contents_of(take);
    make_copy();
  }

  static std::vector<std::byte> account(bool finished) {
    std::string text = R"({"schema": "raystage/recording/1", "node": "one", "sessions": [{
      "program": "test", "started_utc": "2026-01-01T00:00:00Z", "memory_bytes": 1,
      "buffered_in_memory": false, "clock": {"source": "unknown"}, "cameras": [])";
    text += finished ? R"(, "stopped_utc": "2026-01-01T00:00:01Z"}]})" : "}]}";
    std::vector<std::byte> bytes(text.size());
    std::ranges::transform(text, bytes.begin(), [](char c) { return static_cast<std::byte>(c); });
    return bytes;
  }
  void make_copy() const {
    std::filesystem::remove_all(copy);
    std::filesystem::copy(take, copy, std::filesystem::copy_options::recursive);
  }
  void restore_take() const {
    std::filesystem::remove_all(take);
    std::filesystem::copy(copy, take, std::filesystem::copy_options::recursive);
  }
  store::RepairReport repair(bool dry_run = false) const {
    return store::repair_take(take, {.dry_run = dry_run, .copy = copy});
  }
  std::string refusal() const {
    try {
      repair();
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
      return error.what();
    }
    return "nothing was thrown";
  }
  /// Damages random files of a take: bits, cut ends, zeroed parts, missing files.
  static void damage(const std::filesystem::path& folder, std::mt19937_64& random) {
    std::vector<std::string> files;
    for (const auto& [name, bytes] : contents_of(folder)) files.push_back(name);
    for (auto faults = 1 + random() % 4; faults > 0; --faults) {
      const std::string& file = files[random() % files.size()];
      const std::filesystem::path path = folder / file;
      if (!std::filesystem::exists(path)) continue;
      std::vector<std::byte> bytes = bytes_of(path);
      const bool is_archive = file.starts_with("archive/");
      const auto kind = random() % 4;
      if (kind == 0 || bytes.empty() || (!is_archive && kind > 1)) {
        std::filesystem::remove(path);
        continue;
      }
      if (kind == 1) {
        // A document without its last bytes cannot be parsed.
        bytes.resize(is_archive ? random() % bytes.size() : bytes.size() - 4);
        if (file == "notes.txt") continue;
      } else if (kind == 2) {
        flip(bytes, random() % (8 * bytes.size()));
      } else {
        const std::size_t at = random() % bytes.size();
        std::fill_n(bytes.begin() + static_cast<std::ptrdiff_t>(at),
                    std::min<std::size_t>(bytes.size() - at, 1 + random() % 200), std::byte{0});
      }
      write_bytes_to(path, bytes);
    }
  }

  TestFolder folder;
  std::filesystem::path take = folder.path() / "take", copy = folder.path() / "copy";
  FolderContents whole;
};

}  // namespace raystage::testing
