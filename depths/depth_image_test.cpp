// SPDX-License-Identifier: Apache-2.0
#include "depths/depth_image.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "base/atomic_file.h"
#include "base/error.h"
#include "depths/png_output.h"
#include "images/image_file.h"
#include "images/png_file.h"
#include "testing/test_folder.h"

namespace raystage::depths {
namespace {

using ::testing::AllOf;
using ::testing::AnyOf;
using ::testing::HasSubstr;

constexpr float kInfinity = std::numeric_limits<float>::infinity();
const schemas::DepthRange kNearAndFar{0.5, 20};

class DepthImages : public ::testing::Test {
 protected:
  std::filesystem::path file(const std::string& name) const { return folder_.path() / name; }
  render::InverseDepthMap read(const std::string& name, const DepthEncoding& encoding = {}) const {
    return reader_.read(file(name), encoding);
  }
  std::string refusal(const std::string& name, const DepthEncoding& encoding = {}) const {
    try {
      read(name, encoding);
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kBadInput) << error.what();
      EXPECT_FALSE(error.what_to_do().empty());
      return error.what();
    }
    return "accepted";
  }
  static DepthEncoding inverse_codes(const schemas::DepthRange& range) {
    DepthEncoding encoding;
    encoding.inverse_range = range;
    return encoding;
  }

  testing::TestFolder folder_;
  DepthImageReader reader_;
};

TEST_F(DepthImages, ExrFilesHoldMetres) {
  const std::vector<float> z{2, 0, 0.25F, kInfinity, std::nanf(""), 1e10F};
  images::write_depth_image(3, 2, z, file("a.exr"));
  const render::InverseDepthMap map = read("a.exr");
  EXPECT_EQ(map.width, 3);
  EXPECT_EQ(map.height, 2);
  EXPECT_EQ(map.values, (std::vector<float>{0.5F, render::kUnknownDepth, 4, render::kUnknownDepth,
                                            render::kUnknownDepth, 1e-10F}));
  DepthEncoding millimetres;
  millimetres.unit_m = 0.001;
  EXPECT_FLOAT_EQ(read("a.exr", millimetres).values[0], 500);
}

TEST_F(DepthImages, CodesAreInverseDepthsAsInMpegsFormula) {
  // d = 1 / (code / 65535 (1/near - 1/far) + 1/far)
  EXPECT_FLOAT_EQ(1 / inverse_depth_of_code(65535, kNearAndFar), 0.5F);
  EXPECT_FLOAT_EQ(1 / inverse_depth_of_code(21845, kNearAndFar), 1 / (1.95F / 3 + 0.05F));
  EXPECT_EQ(inverse_depth_of_code(0, kNearAndFar), render::kUnknownDepth);
  EXPECT_EQ(code_of_inverse_depth(render::kUnknownDepth, kNearAndFar), 0);
  EXPECT_EQ(code_of_inverse_depth(0.05F, kNearAndFar), 1);  // 0 is unknown
  EXPECT_EQ(code_of_inverse_depth(100, kNearAndFar), 65535);
  for (const schemas::DepthRange& range : {kNearAndFar, schemas::DepthRange{0.3, kInfinity}}) {
    for (int code = 0; code <= kMaxDepthCode; ++code) {
      const auto given = static_cast<std::uint16_t>(code);
      ASSERT_EQ(code_of_inverse_depth(inverse_depth_of_code(given, range), range), given);
    }
  }
}

TEST_F(DepthImages, PngFilesComeBack) {
  render::InverseDepthMap map(5, 3);
  for (std::size_t i = 0; i < map.values.size(); ++i) {
    map.values[i] = inverse_depth_of_code(static_cast<std::uint16_t>(4369 * i), kNearAndFar);
  }
  write_file_atomically(file("a.png"), encode_depth_png(map, kNearAndFar, "a.png"));
  EXPECT_EQ(read("a.png", inverse_codes(kNearAndFar)), map);
  DepthEncoding millimetres;
  millimetres.unit_m = 0.001;
  const render::InverseDepthMap metres = read("a.png", millimetres);
  EXPECT_EQ(metres.values[0], render::kUnknownDepth);
  EXPECT_FLOAT_EQ(metres.values[2], 1 / 8.738F);
}

// An exception in the frames of libpng would end the process or leak.
TEST_F(DepthImages, BytesThatFindNoMemoryAreAnErrorOfLibpng) {
  std::string reason(64, ' ');  // room for the message
  png_structp png = png_create_write_struct(
      PNG_LIBPNG_VER_STRING, &reason,
      [](png_structp writer, png_const_charp message) {
        *static_cast<std::string*>(png_get_error_ptr(writer)) = message;
        png_longjmp(writer, 1);
      },
      nullptr);
  ASSERT_NE(png, nullptr);
  std::vector<std::byte> bytes(1);  // so that the sum is beyond all vectors
  png_set_write_fn(png, &bytes, append_png_bytes, nullptr);
  png_byte data = 0;
  if (setjmp(png_jmpbuf(png)) == 0) {  // NOLINT: libpng has no other way
    png_write_chunk_data(png, &data, std::numeric_limits<std::ptrdiff_t>::max());
    ADD_FAILURE() << "written";
  }
  EXPECT_EQ(reason, "out of memory");
  EXPECT_EQ(bytes.size(), 1U);
  png_destroy_write_struct(&png, nullptr);
}

TEST_F(DepthImages, SaysWhatIsMissingOrWrong) {
  images::write_depth_image(2, 1, std::vector<float>{1, -2}, file("negative.exr"));
  EXPECT_THAT(refusal("negative.exr"),
              AllOf(HasSubstr("the depth at pixel (1, 0) is -2 m"), HasSubstr("negative.exr")));
  images::write_depth_image(2, 1, std::vector<float>{1, 1e-9F}, file("near.exr"));
  EXPECT_THAT(refusal("near.exr"), HasSubstr("Check the unit"));
  images::write_depth_image(2, 1, std::vector<float>{0, kInfinity}, file("empty.exr"));
  EXPECT_THAT(refusal("empty.exr"), HasSubstr("has no known depth"));
  DepthEncoding other;
  other.channel = "depth.D";
  EXPECT_THAT(refusal("negative.exr", other),
              AllOf(HasSubstr("depth.D"), HasSubstr("State the channel")));
  EXPECT_THAT(refusal("negative.exr", inverse_codes(kNearAndFar)), HasSubstr("State no range"));
  images::write_png(store::RgbImage(4, 4), file("eight.png"));
  EXPECT_THAT(refusal("eight.png"), HasSubstr("the codes of a PNG file are no metres"));
  EXPECT_THAT(refusal("eight.png", inverse_codes(kNearAndFar)),
              HasSubstr("has 3 channels of 8 bits"));
  EXPECT_THAT(refusal("missing.exr"), HasSubstr("missing.exr"));
}

TEST_F(DepthImages, HostileFilesAreRefused) {
  const std::vector<float> z(64UL * 48, 2);
  images::write_depth_image(64, 48, z, file("a.exr"));
  const render::InverseDepthMap map(64, 48, 0.7F);
  const std::vector<std::byte> png = encode_depth_png(map, kNearAndFar, "a.png");
  write_file_atomically(file("a.png"), png);
  for (const std::string name : {"a.exr", "a.png"}) {
    const std::string whole = read_file(file(name));
    for (const std::size_t length : {std::size_t{0}, std::size_t{20}, whole.size() / 2}) {
      write_file_atomically(file("cut" + name), whole.substr(0, length));
      EXPECT_NE(
          refusal("cut" + name, name == "a.png" ? inverse_codes(kNearAndFar) : DepthEncoding{}),
          "accepted")
          << name << " " << length;
    }
  }
  // A header of 2^31 - 1 pixels on each side (the CRC of the chunk is wrong, too).
  std::string huge = read_file(file("a.png"));
  for (const std::size_t at : {16U, 20U}) huge.replace(at, 4, "\x7F\xFF\xFF\xFF");
  write_file_atomically(file("huge.png"), huge);
  EXPECT_NE(refusal("huge.png", inverse_codes(kNearAndFar)), "accepted");
  std::string window = read_file(file("a.exr"));
  for (const char* name : {"dataWindow", "displayWindow"}) {
    const std::size_t at = window.find(name);
    ASSERT_NE(at, window.npos);
    // name, "box2i", size, then the corners
    const std::size_t corners = window.find("box2i", at) + 6 + 4;
    window.replace(corners + 8, 8, std::string("\xFF\xFF\x00\x10\xFF\xFF\x00\x10", 8));
  }
  write_file_atomically(file("huge.exr"), window);
  EXPECT_THAT(refusal("huge.exr"), AnyOf(HasSubstr("pixels"), HasSubstr("cannot be read")));
}

TEST(DepthEncodings, AreChecked) {
  std::string reason;
  DepthEncoding encoding;
  EXPECT_TRUE(encoding.is_valid(&reason));
  encoding.inverse_range = schemas::DepthRange{2, 2};
  EXPECT_FALSE(encoding.is_valid(&reason));
  EXPECT_THAT(reason, HasSubstr("far is not greater"));
  encoding.inverse_range = schemas::DepthRange{2, kInfinity};
  EXPECT_TRUE(encoding.is_valid(&reason));
  encoding.unit_m = 0.001;
  EXPECT_FALSE(encoding.is_valid(&reason));
  encoding = {};
  encoding.unit_m = 0;
  EXPECT_FALSE(encoding.is_valid(&reason));
}

}  // namespace
}  // namespace raystage::depths
