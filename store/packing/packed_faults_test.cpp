// SPDX-License-Identifier: Apache-2.0
// Faults of disks and transfers in the archives and journals of a packed take: bits that flip,
// bytes that are lost, added or exchanged. Each must be found.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string>

#include "store/fixity/verify.h"
#include "store/jpeg/encode.h"
#include "store/packing/pack_take.h"
#include "testing/store/take_test_data.h"

namespace raystage::store {
namespace {

namespace fs = std::filesystem;
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

TEST(PackedFaults, OfAThousandEachIsFound) {
  constexpr int kPairs = 2, kEach = 3, kFaults = 1000;
  const testing::TestFolder folder;
  const fs::path take = folder.path() / "take", packed = folder.path() / "packed";
  std::mt19937 random(29);  // NOLINT: the same in every run
  {
    TakeWriter writer(take, testing::take_document(kPairs), testing::rig_document(kPairs));
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
  }
  ASSERT_EQ(pack_take(Take(take), packed, {}).total().packed, kPairs * kEach);

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

}  // namespace
}  // namespace raystage::store
