// SPDX-License-Identifier: Apache-2.0
// Files are compared with those of OpenEXR's own writer: the same header, and the same pixels as
// OpenEXR reads them.
#include "compose/exr/scanline_file.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfInputPart.h>
#include <OpenEXR/ImfIntAttribute.h>
#include <OpenEXR/ImfMultiPartInputFile.h>
#include <OpenEXR/ImfMultiPartOutputFile.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfOutputPart.h>
#include <OpenEXR/ImfPartType.h>
#include <OpenEXR/ImfStandardAttributes.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <gtest/gtest.h>
#include <half.h>

#include <cstring>
#include <limits>
#include <map>
#include <random>

#include "base/atomic_file.h"
#include "compose/exr/memory_stream.h"
#include "images/exr_slice.h"
#include "testing/test_folder.h"

namespace raystage::compose {
namespace {

/// Pixels of a part, interleaved: R, G, B (half), Z (float). Smooth with noise, so that chunks
/// compress, but for `is_noise`, which none can compress.
struct Picture {
  Imath::Box2i window;
  std::vector<float> values;

  Picture(const Imath::Box2i& data_window, bool is_noise) : window(data_window) {
    std::mt19937 random(7);
    std::uniform_real_distribution<float> uniform(0, 1);
    for (int y = window.min.y; y <= window.max.y; ++y) {
      for (int x = window.min.x; x <= window.max.x; ++x) {
        for (int c = 0; c < 4; ++c) {
          const float smooth = 0.01F * static_cast<float>(x) + 0.02F * static_cast<float>(y * c);
          values.push_back(is_noise ? 1e3F * uniform(random) : smooth + 0.001F * uniform(random));
        }
      }
    }
    values[5] = std::numeric_limits<float>::infinity();
    values[6] = -0.0F;
    values[7] = std::numeric_limits<float>::infinity();
  }
  int width() const { return window.max.x - window.min.x + 1; }
  int height() const { return window.max.y - window.min.y + 1; }

  std::vector<ScanlineChannel> channels() const {
    return {{"R", true, values.data(), 4},
            {"G", true, values.data() + 1, 4},
            {"B", true, values.data() + 2, 4},
            {"Z", false, values.data() + 3, 4}};
  }
};

Imf::Header header_of(const Picture& picture, Imf::Compression compression, const char* name) {
  Imf::Header header({{0, 0}, {40, 30}}, picture.window);
  header.compression() = compression;
  if (*name != '\0') {
    header.setName(name);
    header.setType(Imf::SCANLINEIMAGE);
  }
  header.insert("comment", Imf::StringAttribute("a remark"));
  addFramesPerSecond(header, Imf::Rational(24000, 1001));
  return header;
}

/// Returns the same file by OpenEXR's writer.
std::vector<std::byte> by_openexr(std::span<const ScanlinePart> parts,
                                  std::span<const Picture> pictures) {
  std::vector<Imf::Header> headers;
  std::vector<Imf::FrameBuffer> buffers(parts.size());
  std::vector<std::vector<half>> halves(parts.size());
  std::vector<std::vector<float>> floats(parts.size());
  for (std::size_t p = 0; p < parts.size(); ++p) {
    const Picture& picture = pictures[p];
    Imf::Header header = parts[p].header;
    halves[p].resize(picture.values.size());
    floats[p] = picture.values;
    for (std::size_t i = 0; i < halves[p].size(); ++i) {
      halves[p][i] = clamp_to_half(picture.values[i]);
    }
    for (std::size_t c = 0; c < 4; ++c) {
      const ScanlineChannel& channel = parts[p].channels[c];
      const Imf::PixelType type = channel.is_half ? Imf::HALF : Imf::FLOAT;
      header.channels().insert(channel.name, Imf::Channel(type));
      const auto slice = [&](auto* first) {
        return images::make_exr_slice(type, first, picture.width(), 4, picture.window.min.x,
                                      picture.window.min.y, 0.0);
      };
      buffers[p].insert(channel.name, channel.is_half ? slice(halves[p].data() + c)
                                                      : slice(floats[p].data() + c));
    }
    headers.push_back(header);
  }
  MemoryStream stream;
  if (parts.size() == 1) {
    Imf::OutputFile output(stream, headers[0], kNoExrThreads);
    output.setFrameBuffer(buffers[0]);
    output.writePixels(pictures[0].height());
  } else {
    Imf::MultiPartOutputFile output(stream, headers.data(), static_cast<int>(headers.size()), false,
                                    kNoExrThreads);
    for (std::size_t p = 0; p < parts.size(); ++p) {
      Imf::OutputPart part(output, static_cast<int>(p));
      part.setFrameBuffer(buffers[p]);
      part.writePixels(pictures[p].height());
    }
  }
  return stream.take();
}

/// Reads all channels of a part as the bytes of floats.
std::map<std::string, std::vector<float>> pixels_of(Imf::MultiPartInputFile& file, int index) {
  Imf::InputPart part(file, index);
  const Imath::Box2i window = part.header().dataWindow();
  const int width = window.max.x - window.min.x + 1, height = window.max.y - window.min.y + 1;
  std::map<std::string, std::vector<float>> pixels;
  Imf::FrameBuffer buffer;
  const Imf::ChannelList& channels = part.header().channels();
  for (auto i = channels.begin(); i != channels.end(); ++i) {
    auto& values = pixels[i.name()];
    values.resize(static_cast<std::size_t>(width) * height);
    buffer.insert(i.name(), images::make_exr_slice(Imf::FLOAT, values.data(), width, 1,
                                                   window.min.x, window.min.y, 0.0));
  }
  part.setFrameBuffer(buffer);
  part.readPixels(window.min.y, window.max.y);
  return pixels;
}

class ScanlineFile : public ::testing::TestWithParam<Imf::Compression> {
 protected:
  void expect_same_file(std::span<const ScanlinePart> parts, std::span<const Picture> pictures) {
    const std::vector<std::byte> ours = write_scanline_file(parts);
    const std::vector<std::byte> theirs = by_openexr(parts, pictures);
    EXPECT_EQ(write_scanline_file(parts), ours) << "deterministic";
    EXPECT_EQ(std::memcmp(ours.data(), theirs.data(), 8), 0) << "magic number and version";
    if (GetParam() == Imf::NO_COMPRESSION) {
      EXPECT_EQ(ours, theirs);
    }
    const auto our_file = folder_.path() / "ours.exr", their_file = folder_.path() / "theirs.exr";
    write_file_atomically(our_file, ours);
    write_file_atomically(their_file, theirs);
    Imf::MultiPartInputFile our_input(our_file.c_str()), their_input(their_file.c_str());
    ASSERT_EQ(our_input.parts(), their_input.parts());
    for (int p = 0; p < our_input.parts(); ++p) {
      EXPECT_TRUE(our_input.partComplete(p));
      MemoryStream our_header, their_header;
      our_input.header(p).writeTo(our_header);
      their_input.header(p).writeTo(their_header);
      EXPECT_EQ(our_header.take(), their_header.take());
      const auto found = pixels_of(our_input, p), expected = pixels_of(their_input, p);
      ASSERT_EQ(found.size(), expected.size());
      for (const auto& [name, values] : expected) {
        EXPECT_EQ(std::memcmp(found.at(name).data(), values.data(), 4 * values.size()), 0) << name;
      }
    }
  }

  testing::TestFolder folder_;
};

TEST_P(ScanlineFile, OnePartIsThatOfOpenExr) {
  for (const Imath::Box2i& window :
       {Imath::Box2i({0, 0}, {40, 30}), Imath::Box2i({-3, -17}, {43, 47}),
        Imath::Box2i({5, 6}, {5, 7}), Imath::Box2i({0, 0}, {63, 15}),
        Imath::Box2i({0, 0}, {7, 16})}) {
    for (const bool is_noise : {false, true}) {
      const Picture picture(window, is_noise);
      const ScanlinePart part{header_of(picture, GetParam(), ""), picture.channels()};
      expect_same_file({{part}}, {{picture}});
    }
  }
}

TEST_P(ScanlineFile, SeveralPartsAreThoseOfOpenExr) {
  const std::vector<Picture> pictures{{{{0, 0}, {40, 30}}, false}, {{{-2, -2}, {41, 32}}, true}};
  const std::vector<ScanlinePart> parts{
      {header_of(pictures[0], GetParam(), "rgba"), pictures[0].channels()},
      {header_of(pictures[1], GetParam(), "lf"), pictures[1].channels()}};
  expect_same_file(parts, pictures);
}

TEST_P(ScanlineFile, LongNamesAreFlagged) {
  const Picture picture({{0, 0}, {40, 30}}, false);
  ScanlinePart part{header_of(picture, GetParam(), ""), picture.channels()};
  part.channels[1].name = "a.channel.with.more.than.thirty.one.letters";
  expect_same_file({{part}}, {{picture}});
  part = {header_of(picture, GetParam(), ""), picture.channels()};
  part.header.insert("an attribute with more than 31 letters", Imf::IntAttribute(3));
  expect_same_file({{part}}, {{picture}});
}

TEST_P(ScanlineFile, NanIsReplaced) {
  Picture picture({{0, 0}, {40, 30}}, false);
  picture.values[0] = picture.values[3] = std::numeric_limits<float>::quiet_NaN();
  ScanlinePart part{header_of(picture, GetParam(), ""), picture.channels()};
  part.channels[3].nan_replacement = 9;
  const auto file = folder_.path() / "nan.exr";
  write_file_atomically(file, write_scanline_file({{part}}));
  Imf::MultiPartInputFile input(file.c_str());
  const auto pixels = pixels_of(input, 0);
  EXPECT_EQ(pixels.at("R")[0], 0);
  EXPECT_EQ(pixels.at("Z")[0], 9);
}

INSTANTIATE_TEST_SUITE_P(Compressions, ScanlineFile,
                         ::testing::Values(Imf::NO_COMPRESSION, Imf::ZIPS_COMPRESSION,
                                           Imf::ZIP_COMPRESSION));

}  // namespace
}  // namespace raystage::compose
