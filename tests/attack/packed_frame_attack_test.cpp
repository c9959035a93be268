// SPDX-License-Identifier: Apache-2.0
// Mutated packed frames in takes whose journals confirm them, as only someone who means harm
// writes.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <random>
#include <span>
#include <string>

#include "base/error.h"
#include "store/fixity/verify.h"
#include "store/jpeg/encode.h"
#include "store/jpegxl/frame_packer.h"
#include "store/jpegxl/packed_frame.h"
#include "store/packing/pack_take.h"
#include "store/rotten_frame.h"
#include "store/take.h"
#include "testing/store/take_test_data.h"
#include "testing/test_folder.h"
#include "tests/attack/mutation.h"

namespace raystage::testing {
namespace {

namespace fs = std::filesystem;

std::string text_of(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

std::vector<std::byte> jpeg_of_a_camera() {
  std::mt19937 random(3);  // NOLINT: the same in every run
  store::RgbImage image(320, 240);
  for (std::size_t i = 0; i < image.values.size(); ++i) {
    image.values[i] = static_cast<std::uint8_t>(i / 960 + i / 3 % 320 + random() % 8);
  }
  return store::encode_jpeg(image, {});
}

/// Reads a take by everything that unpacks frames. Returns whether its frame is the JPEG.
bool read_everything(const fs::path& folder, std::span<const std::byte> jpeg) {
  const store::Take take(folder);
  bool is_jpeg = false;
  try {
    is_jpeg = std::ranges::equal(take.archive(0).jpeg(0), jpeg);
  } catch (const store::RottenFrame&) {
    EXPECT_TRUE(take.archive(0).is_rotten(0));
  }
  store::TakeVerifyOptions decoding;
  decoding.decode = true;
  const store::TakeFixityReport report = store::verify_take(folder, decoding);
  EXPECT_TRUE(report.is_readable());
  EXPECT_EQ(report.is_intact(), is_jpeg);
  fs::remove_all(folder.parent_path() / "unpacked");
  try {
    store::unpack_take(take, folder.parent_path() / "unpacked", {});
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kBadInput) << error.what();
    EXPECT_FALSE(is_jpeg);
  }
  return is_jpeg;
}

TEST(PackedFrameAttack, EveryCaseIsTheJpegOrRot) {
  const TestFolder folder;
  const std::vector<std::byte> jpeg = jpeg_of_a_camera();
  const store::FramePacker::Packed packed = store::FramePacker().pack(jpeg, {320, 240}, 7, "seed");
  ASSERT_EQ(packed.refusal, "");
  const std::string seed = text_of(packed.bytes);
  std::mt19937 random(13);  // NOLINT: the same in every run
  int refused = 0;
  for (int i = 0; i < attack_case_count(); ++i) {
    SCOPED_TRACE(i);
    const std::string frame = i > 0 ? mutated_packed_frame(seed, random) : seed;
    if (frame.empty()) continue;
    const fs::path take = folder.path() / "attacked";
    fs::remove_all(take);
    store::TakeWriter writer(take, take_document(1), rig_document(1), store::FrameCodec::kPacked);
    writer.archive(0).append(std::as_bytes(std::span(frame)), 1);
    writer.commit();
    const auto start = std::chrono::steady_clock::now();
    const bool is_jpeg = read_everything(take, jpeg);
    EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(20));
    if (i == 0) {
      EXPECT_TRUE(is_jpeg);
    }
    refused += is_jpeg ? 0 : 1;
  }
  EXPECT_GT(refused, attack_case_count() / 2);
}

}  // namespace
}  // namespace raystage::testing
