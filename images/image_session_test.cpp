// SPDX-License-Identifier: Apache-2.0
// Compares images of a session with what OpenImageIO reads from the same files.
#include "images/image_session.h"

#include <OpenImageIO/imageio.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <png.h>
#include <turbojpeg.h>

#include <cstdint>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

#include "base/atomic_file.h"
#include "base/error.h"
#include "testing/test_folder.h"

namespace raystage::images {
namespace {

using ::testing::HasSubstr;

/// A PNG file that few programs write.
struct RarePng {
  std::string name, bytes;
};

/// Writes a PNG by libpng's own interface. `setup`: called before the header is written.
std::string encode_png(int width, int height, int bits, int colors, int interlacing,
                       const std::function<void(png_structp, png_infop)>& setup) {
  std::string bytes;
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png_create_info_struct(png);
  png_set_write_fn(
      png, &bytes,
      [](png_structp to, png_bytep data, std::size_t count) {
        static_cast<std::string*>(png_get_io_ptr(to))->append(reinterpret_cast<char*>(data), count);
      },
      nullptr);
  png_set_IHDR(png, info, static_cast<png_uint_32>(width), static_cast<png_uint_32>(height), bits,
               colors, interlacing, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  setup(png, info);
  png_write_info(png, info);
  std::vector<std::uint8_t> row(png_get_rowbytes(png, info));
  std::vector<std::uint8_t> rows;
  for (int y = 0; y < height; ++y) {
    for (std::size_t i = 0; i < row.size(); ++i)
      rows.push_back(static_cast<std::uint8_t>(37 * y + 11 * i));
  }
  if (colors == PNG_COLOR_TYPE_PALETTE) {
    for (std::uint8_t& code : rows) code &= bits == 1 ? 0 : 0x33;
  }
  std::vector<png_bytep> pointers;
  for (int y = 0; y < height; ++y)
    pointers.push_back(rows.data() + row.size() * static_cast<std::size_t>(y));
  png_write_image(png, pointers.data());
  png_write_end(png, info);
  png_destroy_write_struct(&png, &info);
  return bytes;
}

std::string cmyk_jpeg(int width, int height) {
  std::vector<unsigned char> inks;
  for (int i = 0; i < width * height * 4; ++i) inks.push_back(static_cast<unsigned char>(3 * i));
  unsigned char* compressed = nullptr;
  unsigned long size = 0;  // NOLINT(google-runtime-int): TurboJPEG's
  const tjhandle encoder = tjInitCompress();
  tjCompress2(encoder, inks.data(), width, 0, height, TJPF_CMYK, &compressed, &size, TJSAMP_444, 90,
              0);
  std::string bytes(reinterpret_cast<char*>(compressed), size);
  tjFree(compressed);
  tjDestroy(encoder);
  return bytes;
}

std::vector<RarePng> rare_pngs() {
  const auto palette = [](png_structp png, png_infop info) {
    std::vector<png_color> colors(64);
    for (std::uint8_t i = 0; i < 64; ++i) {
      colors[i] = {static_cast<png_byte>(4 * i), static_cast<png_byte>(255 - i), i};
    }
    png_set_PLTE(png, info, colors.data(), 64);
  };
  const auto four_colors = [](png_structp png, png_infop info) {
    const png_color colors[4] = {{1, 2, 3}, {40, 50, 60}, {255, 0, 9}, {7, 255, 80}};
    const png_byte alpha[2] = {0, 128};
    png_set_PLTE(png, info, colors, 4);
    png_set_tRNS(png, info, alpha, 2, nullptr);
  };
  const auto nothing = [](png_structp, png_infop) {};
  const auto gamma = [](png_structp png, png_infop info) { png_set_gAMA(png, info, 1.0); };
  const auto transparent = [](png_structp png, png_infop info) {
    const png_color_16 color{0, 11, 22, 33, 37};
    png_set_tRNS(png, info, nullptr, 0, &color);
  };
  constexpr int kPlain = PNG_INTERLACE_NONE, kAdam7 = PNG_INTERLACE_ADAM7;
  return {
      {"palette.png", encode_png(13, 7, 8, PNG_COLOR_TYPE_PALETTE, kPlain, palette)},
      {"palette2.png", encode_png(13, 7, 2, PNG_COLOR_TYPE_PALETTE, kAdam7, four_colors)},
      {"grey1.png", encode_png(13, 7, 1, PNG_COLOR_TYPE_GRAY, kPlain, nothing)},
      {"grey4.png", encode_png(13, 7, 4, PNG_COLOR_TYPE_GRAY, kAdam7, transparent)},
      {"grey16.png", encode_png(13, 7, 16, PNG_COLOR_TYPE_GRAY, kPlain, transparent)},
      {"rgb.png", encode_png(13, 7, 8, PNG_COLOR_TYPE_RGB, kAdam7, transparent)},
      {"linear.png", encode_png(13, 7, 8, PNG_COLOR_TYPE_RGB, kPlain, gamma)},
      {"rgba16.png", encode_png(13, 7, 16, PNG_COLOR_TYPE_RGB_ALPHA, kAdam7, gamma)},
  };
}

class SessionFormats : public ::testing::Test {
 protected:
  std::filesystem::path write(const std::string& name, const std::string& bytes) const {
    const auto file = folder_.path() / name;
    std::ofstream(file, std::ios::binary) << bytes;
    return file;
  }
  static std::vector<float> pixels(ImageSession& session, const ImageSession::Image& image) {
    const ImageProperties& size = image.properties;
    std::vector<float> values(size.pixels() * static_cast<std::size_t>(size.channels));
    const int middle = size.y + size.height / 2, end = size.y + size.height;
    const auto row = static_cast<std::size_t>(size.width) * static_cast<std::size_t>(size.channels);
    const auto above = row * static_cast<std::size_t>(size.height / 2);
    const auto bytes = std::as_writable_bytes(std::span(values));
    session.read_rows(image, 0, 0, middle, end, PixelType::kFloat,
                      bytes.subspan(above * sizeof(float)));
    if (above > 0) {
      session.read_rows(image, 0, 0, size.y, middle, PixelType::kFloat,
                        bytes.first(above * sizeof(float)));
    }
    return values;
  }
  static std::vector<float> reference(const std::filesystem::path& file, ImageProperties& size) {
    OIIO::ImageSpec as_in_file;
    as_in_file.attribute("oiio:UnassociatedAlpha", 1);
    const auto input = OIIO::ImageInput::open(file.string(), &as_in_file);
    EXPECT_TRUE(input) << OIIO::geterror();
    const OIIO::ImageSpec& spec = input->spec();
    size = {.x = spec.x,
            .y = spec.y,
            .width = spec.width,
            .height = spec.height,
            .full_x = spec.full_x,
            .full_y = spec.full_y,
            .full_width = spec.full_width,
            .full_height = spec.full_height,
            .channels = spec.nchannels,
            .alpha_channel = spec.alpha_channel,
            .type = spec.format == OIIO::TypeDesc::UINT16 ? PixelType::kUint16 : PixelType::kUint8};
    std::vector<float> values(size.pixels() * static_cast<std::size_t>(size.channels));
    EXPECT_TRUE(input->read_image(0, 0, 0, spec.nchannels, OIIO::TypeDesc::FLOAT, values.data()));
    return values;
  }
  void expect_as_openimageio(ImageSession& session, const std::filesystem::path& file) const {
    SCOPED_TRACE(file.filename());
    ImageProperties size;
    const std::vector<float> expected = reference(file, size);
    const ImageSession::Image image = session.open(file);
    EXPECT_EQ(image.decoder, ImageSession::Decoder::kPngAndJpeg);
    EXPECT_EQ(image.properties, size);
    EXPECT_EQ(pixels(session, image), expected);
    session.close(image);
  }
  std::filesystem::path write_oiio(const std::string& name, const OIIO::ImageSpec& spec,
                                   const std::vector<float>& values) const {
    const auto file = folder_.path() / name;
    const auto output = OIIO::ImageOutput::create(file.string());
    EXPECT_TRUE(output && output->open(file.string(), spec) &&
                output->write_image(OIIO::TypeDesc::FLOAT, values.data()) && output->close());
    return file;
  }

  raystage::testing::TestFolder folder_;
};

TEST_F(SessionFormats, PngIsReadAsByOpenImageIo) {
  ImageSession session(1'000'000);
  std::vector<float> values(std::size_t{13} * 7 * 4);
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = static_cast<float>(i % 61) / 60;
  for (const auto& type : {OIIO::TypeDesc::UINT8, OIIO::TypeDesc::UINT16}) {
    for (int channels = 1; channels <= 4; ++channels) {
      OIIO::ImageSpec spec(13, 7, channels, type);
      if (channels == 2) {
        spec.channelnames = {"Y", "A"};
        spec.alpha_channel = 1;
      }
      spec.x = channels == 3 ? 4 : 0;
      spec.attribute("oiio:UnassociatedAlpha", 1);
      expect_as_openimageio(session,
                            write_oiio("a" + std::to_string(channels) + ".png", spec, values));
    }
  }
}

// Palettes, fewer than 8 bits, interlacing, transparent colours and gamma, which OpenImageIO does
// not write.
TEST_F(SessionFormats, PngOfRareKinds) {
  ImageSession session(1'000'000);
  for (const RarePng& png : rare_pngs()) {
    expect_as_openimageio(session, write(png.name, png.bytes));
  }
}

TEST_F(SessionFormats, JpegHasTheSameCodesAndOddOnesAreReadAllTheSame) {
  ImageSession session(1'000'000);
  std::vector<float> values(std::size_t{13} * 7 * 4);
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = static_cast<float>(i % 61) / 60;
  const auto file = write_oiio("a.jpg", OIIO::ImageSpec(13, 7, 3, OIIO::TypeDesc::UINT8), values);
  expect_as_openimageio(session, file);
  const auto grey = write_oiio("g.jpg", OIIO::ImageSpec(13, 7, 1, OIIO::TypeDesc::UINT8), values);
  ImageProperties size;
  const std::vector<float> expected = reference(grey, size);
  const ImageSession::Image image = session.open(grey);
  const std::vector<float> found = pixels(session, image);
  ASSERT_EQ(found.size(), 3 * expected.size());
  for (std::size_t i = 0; i < found.size(); ++i) EXPECT_EQ(found[i], expected[i / 3]);
  // OpenImageIO reads those without an end and CMYK.
  const std::string bytes = read_file(file);
  for (const auto& odd :
       {write("cut.jpg", bytes.substr(0, bytes.size() - 2)), write("cmyk.jpg", cmyk_jpeg(13, 7))}) {
    SCOPED_TRACE(odd.filename());
    const std::vector<float> as_before = reference(odd, size);
    const ImageSession::Image opened = session.open(odd);
    EXPECT_EQ(opened.decoder, ImageSession::Decoder::kAllFormats);
    EXPECT_EQ(opened.properties, size);
    EXPECT_EQ(pixels(session, opened), as_before);
  }
}

// Before any memory is taken: rows of zeros in one kilobyte cannot be so many pixels.
TEST_F(SessionFormats, ImagesThatAreTooShortForTheirSizeAreRefused) {
  ImageSession session(std::size_t{1} << 40);
  std::string bomb =
      encode_png(13, 7, 8, PNG_COLOR_TYPE_RGB, PNG_INTERLACE_NONE, [](png_structp, png_infop) {});
  // IHDR: width and height, then its CRC.
  for (const int at : {16, 20})
    bomb.replace(static_cast<std::size_t>(at), 4, {0, 0, '\xea', '\x60'});
  std::uint32_t crc = 0xffffffff;  // PNG specification, annex D
  for (int at = 12; at < 29; ++at) {
    crc ^= static_cast<std::uint8_t>(bomb[at]);
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ ((crc & 1) != 0 ? 0xedb88320U : 0U);
  }
  crc = ~crc;
  for (int i = 0; i < 4; ++i) bomb[29 + i] = static_cast<char>(crc >> (24 - 8 * i));
  try {
    session.open(write("bomb.png", bomb));
    FAIL() << "opened";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("60000 x 60000 pixels do not fit in"));
  }
}

TEST_F(SessionFormats, LargePlainPalettesOfOneBitAreShortAndRead) {
  ImageSession session(100'000'000);
  const auto white = [](png_structp png, png_infop info) {
    const png_color colors[2] = {{255, 255, 255}, {255, 255, 255}};
    png_set_PLTE(png, info, colors, 2);
  };
  const auto file = write(
      "white.png", encode_png(2000, 2000, 1, PNG_COLOR_TYPE_PALETTE, PNG_INTERLACE_NONE, white));
  expect_as_openimageio(session, file);
}

TEST_F(SessionFormats, MoreImagesThanMemoryHoldsAreDecodedAgain) {
  ImageSession session(2'000);
  std::vector<ImageSession::Image> images;
  for (int i = 0; i < 6; ++i) {
    std::vector<float> values(std::size_t{20} * 20 * 3, static_cast<float>(i) / 51);
    images.push_back(
        session.open(write_oiio("m" + std::to_string(i) + ".png",
                                OIIO::ImageSpec(20, 20, 3, OIIO::TypeDesc::UINT8), values)));
  }
  for (int round = 0; round < 3; ++round) {
    for (std::size_t i = 0; i < images.size(); ++i) {
      EXPECT_FLOAT_EQ(pixels(session, images[i])[7], static_cast<float>(5 * i) / 255) << i;
    }
  }
  const auto large = write_oiio("large.png", OIIO::ImageSpec(40, 40, 3, OIIO::TypeDesc::UINT8),
                                std::vector<float>(4800));
  try {
    session.open(large);
    FAIL() << "opened";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("are granted"));
  }
}

}  // namespace
}  // namespace raystage::images
