// SPDX-License-Identifier: Apache-2.0
#include "store/jpegxl/frame_packer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <random>
#include <stdexcept>

#include "base/error.h"
#include "base/resources.h"
#include "store/jpeg/encode.h"
#include "store/jpegxl/packed_frame.h"
#include "store/jpegxl/transcoding.h"
#include "testing/child_limits.h"
#include "testing/store/test_encoder.h"

namespace raystage::store {
namespace {

using ::testing::HasSubstr;
using Bytes = std::vector<std::byte>;

constexpr FramePacker::Size kSize{192, 128};
constexpr int kEffort = 7;

/// A picture with edges and noise.
RgbImage picture(int width, int height, unsigned seed = 1) {
  std::mt19937 random(seed);
  RgbImage image;
  image.width = width;
  image.height = height;
  image.values.resize(static_cast<std::size_t>(width) * height * 3);
  for (std::size_t i = 0; i < image.values.size(); ++i) {
    const std::size_t x = i / 3 % width, y = i / 3 / width;
    image.values[i] =
        static_cast<std::uint8_t>((x * 2 + y * (i % 3) + random() % 4 + (x / 16 % 2) * 60) % 256);
  }
  return image;
}

Bytes simple_jpeg() { return testing::encode_jpeg_variant(picture(192, 128), {}); }

std::string refusal_of(const Bytes& jpeg) {
  const FramePacker::Packed packed = FramePacker().pack(jpeg, kSize, kEffort, "a");
  EXPECT_TRUE(packed.bytes.empty());
  return packed.refusal;
}

std::string unpack_error(const Bytes& packed, FramePacker::Size size = kSize) {
  try {
    FramePacker().unpack(packed, size, "a");
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
    return error.what();
  }
  return "";
}

TEST(FramePacker, ReturnsEveryAcceptedVariantBitForBit) {
  using testing::JpegVariant;
  std::vector<JpegVariant> variants(7);
  variants[1].grey = true;
  variants[2].progressive = true;
  variants[3].h[0] = variants[3].v[0] = 2;
  variants[3].restart_interval = 2;
  variants[4].markers = true;
  variants[5].interleaved = false;
  variants[6].optimised = true;
  const FramePacker packer;
  for (const JpegVariant& variant : variants) {
    const Bytes jpeg = testing::encode_jpeg_variant(picture(192, 128), variant);
    for (const int effort : {3, 7, 9}) {
      const FramePacker::Packed packed = packer.pack(jpeg, kSize, effort, "a");
      EXPECT_EQ(packed.refusal, "") << &variant - variants.data();
      ASSERT_FALSE(packed.bytes.empty());
      EXPECT_LT(packed.bytes.size(), jpeg.size());
      EXPECT_TRUE(is_jpeg_xl(packed.bytes));
      EXPECT_EQ(read_jpeg_fixity(packed.bytes), fixity_of(jpeg));
      EXPECT_EQ(packer.unpack(packed.bytes, kSize, "a"), jpeg);
    }
  }
}

/// A rig states any size.
TEST(FramePacker, HugeCamerasGrantNoMoreThanHalfOfTheMachine) {
  const Bytes jpeg = simple_jpeg();
  const FramePacker packer;
  const auto packed = packer.pack(jpeg, kSize, kEffort, "a").bytes;
  constexpr FramePacker::Size kHuge{65535, 65535};
  EXPECT_EQ(packer.unpack(packed, kHuge, "a"), jpeg);
  if (!testing::kDecodersHaveLimits) GTEST_SKIP() << "decoders have no limits in this build";
  const std::uint64_t limit = testing::largest_data_limit_of_decoders();
  EXPECT_GT(limit, std::uint64_t{128} << 20);
  EXPECT_LT(limit, available_memory() / 2 + (std::uint64_t{1} << 30));
}

TEST(FramePacker, BytesAfterTheEndOfThePictureReturnToo) {
  Bytes jpeg = simple_jpeg();
  for (int i = 0; i < 50; ++i) jpeg.push_back(static_cast<std::byte>(i));
  const FramePacker::Packed packed = FramePacker().pack(jpeg, kSize, kEffort, "a");
  // libjxl may refuse such a file, but what it accepts must return.
  if (!packed.bytes.empty()) {
    EXPECT_EQ(FramePacker().unpack(packed.bytes, kSize, "a"), jpeg);
  }
}

TEST(FramePacker, RefusesWhatLibjxlDoesNotAccept) {
  testing::JpegVariant arithmetic, cmyk;
  arithmetic.arithmetic = true;
  cmyk.cmyk = true;
  EXPECT_NE(refusal_of(testing::encode_jpeg_variant(picture(192, 128), arithmetic)), "");
  EXPECT_NE(refusal_of(testing::encode_jpeg_variant(picture(192, 128), cmyk)), "");
  Bytes truncated = simple_jpeg();
  truncated.resize(truncated.size() / 2);
  EXPECT_NE(refusal_of(truncated), "");
  std::mt19937 random(3);
  Bytes garbage(5000);
  for (std::byte& byte : garbage) byte = static_cast<std::byte>(random());
  EXPECT_NE(refusal_of(garbage), "");
  EXPECT_NE(refusal_of({}), "");
  // A picture larger than its camera's.
  EXPECT_THAT(refusal_of(testing::encode_jpeg_variant(picture(256, 128), {})),
              HasSubstr("256 x 128"));
}

TEST(FramePacker, MutatedFramesAreRefusedOrUnchanged) {
  const Bytes jpeg = simple_jpeg();
  const FramePacker packer;
  const Bytes packed = packer.pack(jpeg, kSize, kEffort, "a").bytes;
  ASSERT_FALSE(packed.empty());
  int refused = 0;
  for (std::size_t bit = 0; bit < 8 * packed.size(); bit += 1 + packed.size() / 64) {
    Bytes mutated = packed;
    mutated[bit / 8] ^= static_cast<std::byte>(1U << (bit % 8));
    try {
      EXPECT_EQ(packer.unpack(mutated, kSize, "a"), jpeg) << bit;
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
      ++refused;
    }
  }
  EXPECT_GT(refused, 200);
  for (std::size_t size = 0; size < packed.size(); size += 1 + packed.size() / 16) {
    EXPECT_NE(unpack_error(Bytes(packed.begin(), packed.begin() + static_cast<long>(size))), "");
  }
}

TEST(FramePacker, TheTimeLimitFollowsEffortAndSizeAndTheReasonSaysSo) {
  using std::chrono::seconds;
  constexpr std::uint64_t kSmall = 640 * 480, kLarge = 24'000'000;
  EXPECT_GE(FramePacker::time_limit(kSmall, 1), seconds(60));
  EXPECT_EQ(FramePacker::time_limit(kSmall, 1), FramePacker::time_limit(kSmall, 7));
  EXPECT_GT(FramePacker::time_limit(kSmall, 9), FramePacker::time_limit(kSmall, 8));
  // 24 MB of JPEG take 2 minutes and more at 0.2 MB/s.
  EXPECT_GT(FramePacker::time_limit(kLarge, 9), seconds(1200));

  const Bytes large = testing::encode_jpeg_variant(picture(2400, 1600), {});
  const FramePacker::Packed packed =
      FramePacker(seconds(0)).pack(large, {2400, 1600}, 9, "archive/c0.mkv");
  EXPECT_TRUE(packed.bytes.empty());
  EXPECT_THAT(packed.refusal, HasSubstr("it cannot be packed: its decoder took"));
  EXPECT_THAT(packed.refusal, HasSubstr("more than 0 s of processor time"));
}

/// Sends a signal to all processes that this one has started. Returns how many there are.
int signal_children(int signal) {
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
    const std::string name = entry.path().filename().string();
    if (name.find_first_not_of("0123456789") != std::string::npos) continue;
    std::ifstream file(entry.path() / "status");
    for (std::string line; std::getline(file, line);) {
      if (!line.starts_with("PPid:") || std::stoi(line.substr(5)) != ::getpid()) continue;
      count += ::kill(std::stoi(name), signal) == 0 ? 1 : 0;
    }
  }
  return count;
}

// ArchiveReader takes bad input for rot, which stays known, and a failure for none.
TEST(FramePacker, AProcessThatIsStoppedFailsAndSaysNothingAboutTheFrame) {
  const Bytes jpeg = simple_jpeg();
  const Bytes packed = FramePacker().pack(jpeg, kSize, kEffort, "a").bytes;
  const FramePacker packer(std::chrono::seconds(1));
  ASSERT_EQ(packer.unpack(packed, kSize, "a"), jpeg);
  ASSERT_GT(signal_children(SIGSTOP), 0);
  try {
    packer.unpack(packed, kSize, "a");
    ADD_FAILURE() << "a process that is stopped has unpacked a frame";
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kFailed);
    EXPECT_THAT(error.what(), HasSubstr("did not answer"));
  }
  EXPECT_EQ(packer.unpack(packed, kSize, "a"), jpeg);
}

TEST(FramePacker, AFalseStatementOfSizeIsRefused) {
  const Bytes jpeg = simple_jpeg();
  const Bytes packed = FramePacker().pack(jpeg, kSize, kEffort, "a").bytes;
  ASSERT_GT(packed.size(), kPackedHeaderBytes);
  constexpr std::size_t kContainerStart = 32;
  Bytes container(packed.begin(), packed.begin() + kContainerStart);
  container.insert(container.end(), packed.begin() + kPackedHeaderBytes, packed.end());
  JpegFixity stated = fixity_of(jpeg);
  for (const std::uint32_t size : {stated.size - 1, stated.size + 1, kMaxFrameBytes, 1U}) {
    EXPECT_NE(unpack_error(add_jpeg_fixity(container, {size, stated.xxh3})), "") << size;
  }
  EXPECT_THAT(unpack_error(add_jpeg_fixity(container, {stated.size, stated.xxh3 ^ 1})),
              HasSubstr("wrong XXH3"));
  EXPECT_EQ(read_jpeg_fixity(add_jpeg_fixity(container, {kMaxFrameBytes + 1, 1})), std::nullopt);
  EXPECT_EQ(read_jpeg_fixity(add_jpeg_fixity(container, {0, 1})), std::nullopt);
}

/// A container whose codestream states 2^30 x 2^30 pixels.
Bytes huge_picture() {
  Bytes bits{std::byte{0xFF}, std::byte{0x0A}};
  int used = 8;
  const auto put = [&](std::uint64_t value, int count) {
    for (int i = 0; i < count; ++i, ++used) {
      if (used % 8 == 0) bits.push_back(std::byte{0});
      if (((value >> i) & 1) != 0) bits.back() |= static_cast<std::byte>(1U << (used % 8));
    }
  };
  constexpr std::uint64_t kMost = (std::uint64_t{1} << 30) - 1;
  put(0, 1);  // not small
  put(3, 2), put(kMost, 30);
  put(0, 3);  // no common ratio of the sides
  put(3, 2), put(kMost, 30);
  put(1, 1);  // all metadata as usual
  bits.resize(bits.size() + 200);
  Bytes container = FramePacker().pack(simple_jpeg(), kSize, kEffort, "a").bytes;
  container.resize(32);
  const auto size = static_cast<std::uint32_t>(bits.size() + 8);
  for (int shift = 24; shift >= 0; shift -= 8) {
    container.push_back(static_cast<std::byte>((size >> shift) & 0xFF));
  }
  for (const char c : std::string("jxlc")) container.push_back(static_cast<std::byte>(c));
  container.insert(container.end(), bits.begin(), bits.end());
  return container;
}

TEST(FramePacker, BombsCostNoMemory) {
  EXPECT_NE(unpack_error(add_jpeg_fixity(huge_picture(), {5000, 1})), "");
  EXPECT_THROW(reconstruct_jpeg(huge_picture(), 5000, 1 << 20), std::runtime_error);
  const Bytes jpeg = testing::encode_jpeg_variant(picture(640, 480), {});
  const Bytes container = transcode_jpeg(jpeg, kEffort);
  EXPECT_EQ(reconstruct_jpeg(container, jpeg.size(), 640 * 480), jpeg);
  EXPECT_THROW(reconstruct_jpeg(container, jpeg.size(), 640 * 480 - 1), std::runtime_error);
  EXPECT_THAT(unpack_error(add_jpeg_fixity(container, fixity_of(jpeg)), {640, 479}),
              HasSubstr("640 x 480"));
}

TEST(FramePacker, PixelsWithoutAJpegAreRefused) {
  // The codestream of a packed frame without the box for the JPEG's other parts.
  const Bytes packed = FramePacker().pack(simple_jpeg(), kSize, kEffort, "a").bytes;
  Bytes without(packed.begin(), packed.begin() + kPackedHeaderBytes);
  bool removed = false;
  for (std::size_t at = kPackedHeaderBytes; at + 8 <= packed.size();) {
    std::size_t size = 0;
    for (std::size_t i = 0; i < 4; ++i)
      size = size * 256 + std::to_integer<std::size_t>(packed[at + i]);
    if (size < 8 || size > packed.size() - at) size = packed.size() - at;
    const bool is_jbrd = std::to_integer<char>(packed[at + 4]) == 'j' &&
                         std::to_integer<char>(packed[at + 5]) == 'b';
    if (is_jbrd) {
      removed = true;
    } else {
      without.insert(without.end(), packed.begin() + static_cast<long>(at),
                     packed.begin() + static_cast<long>(at + size));
    }
    at += size;
  }
  ASSERT_TRUE(removed);
  EXPECT_THAT(unpack_error(without), HasSubstr("not made from a JPEG"));
}

}  // namespace
}  // namespace raystage::store
