// SPDX-License-Identifier: Apache-2.0
#include "images/image_reader.h"

#include <OpenImageIO/imageio.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <fstream>
#include <functional>
#include <iterator>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "base/error.h"
#include "images/image_requests.h"
#include "images/image_session.h"
#include "images/png_file.h"
#include "testing/test_folder.h"

namespace raystage::images {
namespace {

using ::testing::HasSubstr;

class ImageReaderTest : public ::testing::Test {
 protected:
  std::filesystem::path write(const std::string& name, const std::string& bytes) {
    const auto file = folder_.path() / name;
    std::ofstream(file, std::ios::binary) << bytes;
    return file;
  }
  /// A picture of 2 x 3 pixels with codes 0 to 17.
  std::filesystem::path write_picture() {
    std::string bytes = "P6 2 3 255\n";
    for (char code = 0; code < 18; ++code) bytes += code;
    return write("a.ppm", bytes);
  }
  static std::string error_of(const std::function<void()>& function) {
    try {
      function();
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
      return error.what();
    }
    return "no error";
  }

  raystage::testing::TestFolder folder_;
};

TEST_F(ImageReaderTest, ReadsPropertiesAndValues) {
  const ImageReader reader;
  const auto file = write_picture();
  const ImageProperties properties = reader.properties(file);
  EXPECT_EQ(properties.width, 2);
  EXPECT_EQ(properties.height, 3);
  EXPECT_EQ(properties.channels, 3);
  EXPECT_EQ(properties.type, PixelType::kUint8);
  EXPECT_EQ(reader.read_codes(file).values[17], 17);
  EXPECT_FLOAT_EQ(reader.read_floats(file).values[17], 17.0F / 255);
  EXPECT_EQ(reader.read_rgb(file).values[17], 17);
}

/// Returns a raw picture of a camera (DNG): little endian TIFF of one strip of 16-bit codes behind
/// a Bayer pattern.
std::string raw_picture(std::uint32_t width, std::uint32_t height) {
  const auto number = [](std::uint64_t value, int bytes) {
    std::string text;
    for (int i = 0; i < bytes; ++i) text += static_cast<char>(value >> (8 * i) & 0xff);
    return text;
  };
  std::string matrix, white, strip;
  for (const std::uint32_t value : {1, 0, 0, 0, 1, 0, 0, 0, 1})
    matrix += number(value, 4) + number(1, 4);
  for (int i = 0; i < 3; ++i) white += number(1, 4) + number(1, 4);
  for (std::uint32_t i = 0; i < width * height; ++i) strip += number(96 + i * 37 % 4000, 2);
  struct Entry {
    std::uint32_t tag, type, count;
    std::string value;
  };
  constexpr std::uint32_t kByte = 1, kText = 2, kShort = 3, kLong = 4, kRatio = 5,
                          kSignedRatio = 10;
  std::vector<Entry> entries{{254, kLong, 1, number(0, 4)},
                             {256, kLong, 1, number(width, 4)},
                             {257, kLong, 1, number(height, 4)},
                             {258, kShort, 1, number(16, 2)},
                             {259, kShort, 1, number(1, 2)},
                             {262, kShort, 1, number(32803, 2)},
                             {271, kText, 5, std::string("Test\0", 5)},
                             {272, kText, 4, std::string("Cam\0", 4)},
                             {273, kLong, 1, ""},
                             {277, kShort, 1, number(1, 2)},
                             {278, kLong, 1, number(height, 4)},
                             {279, kLong, 1, number(strip.size(), 4)},
                             {33421, kShort, 2, number(2, 2) + number(2, 2)},
                             {33422, kByte, 4, std::string("\0\1\1\2", 4)},
                             {50706, kByte, 4, std::string("\1\4\0\0", 4)},
                             {50708, kText, 9, std::string("Test Cam\0", 9)},
                             {50717, kLong, 1, number(4095, 4)},
                             {50721, kSignedRatio, 9, matrix},
                             {50728, kRatio, 3, white},
                             {50778, kShort, 1, number(21, 2)}};
  const std::size_t end_of_entries = 8 + 2 + 12 * entries.size() + 4;
  std::size_t values = 0;
  for (const Entry& entry : entries)
    values += entry.value.size() > 4 ? (entry.value.size() + 1) / 2 * 2 : 0;
  entries[8].value = number(end_of_entries + values, 4);
  std::string text = std::string("II*\0", 4) + number(8, 4) + number(entries.size(), 2), behind;
  for (Entry& entry : entries) {
    text += number(entry.tag, 2) + number(entry.type, 2) + number(entry.count, 4);
    if (entry.value.size() > 4) {
      text += number(end_of_entries + behind.size(), 4);
      behind += entry.value + std::string(entry.value.size() % 2, '\0');
    } else {
      text += entry.value + std::string(4 - entry.value.size(), '\0');
    }
  }
  return text + number(0, 4) + behind + strip;
}

TEST_F(ImageReaderTest, ReadsEveryFormatInTheConfinedProcess) {
  const ImageReader reader;
  OIIO::ImageSpec spec(48, 32, 3, OIIO::TypeDesc::UINT8);
  const std::vector<std::uint8_t> codes(std::size_t{48} * 32 * 3, 100);
  int written = 0;
  for (const char* extension : {"png", "jpg", "tif", "tga", "bmp", "gif", "webp", "heic", "jp2",
                                "pnm", "sgi", "iff", "rla", "fits", "ico", "dpx", "psd", "dds"}) {
    SCOPED_TRACE(extension);
    const auto file = folder_.path() / ("a." + std::string(extension));
    const auto output = OIIO::ImageOutput::create(file.string());
    if (!output || !output->open(file.string(), spec)) continue;  // it is only read
    ASSERT_TRUE(output->write_image(OIIO::TypeDesc::UINT8, codes.data()) && output->close());
    ++written;
    try {
      const store::RgbImage image = reader.read_rgb(file);
      ASSERT_EQ(image.width, 48);
      ASSERT_EQ(image.height, 32);
      EXPECT_NEAR(image.values[3 * (48 * 16 + 24)], 100, 8);
    } catch (const Error& error) {
      ADD_FAILURE() << error.what();
    }
  }
  EXPECT_GE(written, 12);
  const store::RgbImage raw = reader.read_rgb(write("a.dng", raw_picture(64, 48)));
  EXPECT_EQ(raw.width, 64);
  EXPECT_GT(*std::ranges::max_element(raw.values), 20);
}

TEST_F(ImageReaderTest, WhatIsNoImageIsAnErrorThatNamesTheFile) {
  const ImageReader reader;
  EXPECT_THAT(error_of([&] { reader.read_rgb(folder_.path() / "none.png"); }),
              HasSubstr("does not exist"));
  EXPECT_THAT(error_of([&] { reader.read_rgb(write("text.png", "no picture")); }),
              HasSubstr("text.png"));
  EXPECT_THAT(error_of([&] { reader.read_rgb(write("cut.ppm", "P6 2 3 255\nabc")); }),
              HasSubstr("cannot be read"));
  const auto pipe = folder_.path() / "pipe.png";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_THAT(error_of([&] { reader.read_rgb(pipe); }), HasSubstr("not a regular file"));
  // The reader goes on.
  EXPECT_EQ(reader.read_rgb(write_picture()).width, 2);
}

TEST_F(ImageReaderTest, SizesAreCheckedBeforeMemoryIsTaken) {
  const ImageReader reader(10'000'000);
  const std::string what =
      error_of([&] { reader.read_rgb(write("bomb.ppm", "P6 60000 60000 255\nabc")); });
  EXPECT_THAT(what, HasSubstr("60000 x 60000 pixels"));
  EXPECT_THAT(what, HasSubstr("10 MB are granted"));
}

/// Tiles do not help: the pixels are wanted.
// OpenEXR, to which OpenImageIO hands the file, allocates what an attribute states to have.
TEST_F(ImageReaderTest, AttributesOfExrFilesThatAreLargerThanTheFileAreRefused) {
  const auto number = [](std::uint32_t value) {
    std::string bytes;
    for (int i = 0; i < 4; ++i) bytes += static_cast<char>(value >> (8 * i) & 0xff);
    return bytes;
  };
  using namespace std::string_literals;
  const auto file =
      write("a.exr", number(20000630) + number(2) + "a\0string\0"s + number(0x676e6904) + "text");
  EXPECT_THAT(error_of([&] { ImageReader().properties(file); }),
              HasSubstr("states to be larger than the file"));
}

TEST_F(ImageReaderTest, FloatsNeedMoreMemoryThanCodes) {
  const ImageReader reader(40);
  EXPECT_EQ(reader.read_codes(write_picture()).values.size(), 18u);  // 18 bytes
  EXPECT_THAT(error_of([&] { reader.read_floats(write_picture()); }),
              HasSubstr("are granted"));  // 72 bytes
}

TEST_F(ImageReaderTest, ASessionReadsPartsOfFilesAndOfImagesInMemory) {
  ImageSession session(1'000'000);
  const ImageSession::Image image = session.open(write_picture());
  std::array<std::byte, 6> row{};
  session.read_rows(image, 0, 0, 2, 3, PixelType::kUint8, row);
  EXPECT_EQ(row[5], std::byte{17});
  EXPECT_EQ(session.level(image, 0, 0), image.properties);
  EXPECT_EQ(session.level(image, 0, 1), std::nullopt);
  EXPECT_THROW(session.read_rows(image, 0, 0, 2, 4, PixelType::kUint8, row), Error);
  EXPECT_THROW(session.read_tile(image, 0, 0, 0, 0, PixelType::kUint8, row), Error);
  session.close(image);
  EXPECT_THROW(session.read_rows(image, 0, 0, 2, 3, PixelType::kUint8, row), Error);

  store::RgbImage picture(3, 2);
  picture.values[0] = 200;
  write_png(picture, folder_.path() / "b.png");
  std::ifstream file(folder_.path() / "b.png", std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(file), {}};
  const ImageSession::Image in_memory = session.open_bytes("b of a mesh", "png", bytes);
  EXPECT_EQ(in_memory.properties.width, 3);
  std::array<std::byte, 9> first{};
  session.read_rows(in_memory, 0, 0, 0, 1, PixelType::kUint8, first);
  EXPECT_EQ(first[0], std::byte{200});
  // An image in memory opens no file, whatever its name.
  EXPECT_THROW(session.open_bytes((folder_.path() / "b.png").string(), "ppm", "nothing"), Error);
}

/// They may come from a decoder that a hostile file has taken over.
TEST(ImageRequests, PropertiesOfADecoderAreChecked) {
  const ImageProperties good{
      .width = 2, .height = 3, .full_width = 2, .full_height = 3, .channels = 3};
  const auto round_trip = [](const ImageProperties& properties) {
    sandbox::ByteWriter writer;
    write_properties(writer, properties);
    const auto bytes = writer.take();
    sandbox::ByteReader reader(bytes);
    return read_properties(reader);
  };
  EXPECT_EQ(round_trip(good), good);
  for (const auto& spoil : std::vector<std::function<void(ImageProperties&)>>{
           [](auto& p) { p.width = -1; }, [](auto& p) { p.height = 1 << 30; },
           [](auto& p) { p.channels = 0; }, [](auto& p) { p.alpha_channel = 3; },
           [](auto& p) { p.tile_width = -4; }, [](auto& p) { p.x = 1 << 30; },
           [](auto& p) { p.type = static_cast<PixelType>(9); }}) {
    ImageProperties bad = good;
    spoil(bad);
    EXPECT_THROW(round_trip(bad), std::runtime_error);
  }
}

}  // namespace
}  // namespace raystage::images
