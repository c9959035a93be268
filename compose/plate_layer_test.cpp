// SPDX-License-Identifier: Apache-2.0
#include "compose/plate_layer.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfOutputFile.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <png.h>

#include <array>
#include <fstream>
#include <limits>
#include <optional>

#include "base/atomic_file.h"
#include "testing/compose/sequence_test_data.h"

namespace raystage::compose {
namespace {

using ::testing::HasSubstr;

/// Frame 101 of the wall as a plate of other shots.
class Plates : public testing::SequenceTest {
 protected:
  void SetUp() override {
    SequenceTest::SetUp();
    options_.frames = {101};
    options_.existing = ExistingFiles::kOverwrite;
  }
  schemas::ShotDocument::Layer plate(const std::string& name) const {
    schemas::ShotDocument::Layer layer;
    layer.plate = schemas::ShotDocument::Plate{.file = name};
    return layer;
  }
  std::array<float, 4> rgba_at(int x, int y) const {
    const ExrImage image = read_exr(file(101));
    std::array<float, 4> pixel{};
    std::copy_n(&image.rgba[4 * static_cast<std::size_t>(y * 40 + x)], 4, pixel.begin());
    return pixel;
  }
  /// Renders the wall to plate.0101.exr, and continues with a shot without layers.
  void render_plate() {
    const std::string output = options_.output;
    options_.output = (folder_.path() / "plate.####.exr").string();
    ASSERT_EQ(run().rendered, 1);
    options_.output = output;
    shot_.output = {};
    shot_.layers.clear();
  }
};

TEST_F(Plates, AnExrComesBackAsItIs) {
  render_plate();
  shot_.layers = {plate("plate.####.exr")};
  ASSERT_EQ(run().rendered, 1);
  const ExrImage again = read_exr(file(101));
  EXPECT_EQ(again.rgba, read_exr(folder_.path() / "plate.0101.exr").rgba);
  // Plates of other frame numbers, and transparent overscan.
  shot_.layers[0].plate->frame_offset = 3;
  EXPECT_THAT(refusal(), HasSubstr("the plate of frame 101 is missing"));
  shot_.layers[0].plate->file = "plate.0101.exr";
  shot_.output.overscan = {2, 2};
  EXPECT_EQ(run().rendered, 1);
  EXPECT_EQ(read_exr(file(101)).rgba, again.rgba);
}

TEST_F(Plates, OtherPrimariesBecomeTheScenes) {
  shot_.output.color.color_space = "lin_ap1_scene";
  render_plate();
  shot_.layers = {plate("plate.####.exr")};
  ASSERT_EQ(run().rendered, 1);
  EXPECT_NEAR(rgba_at(20, 15)[0], grey(0), 0.003F);
  shot_.layers[0].plate->space = "lin_rec709_scene";  // deliberately wrong
  ASSERT_EQ(run().rendered, 1);
  EXPECT_NEAR(rgba_at(20, 15)[3], 1, 1e-3F);
  shot_.layers[0].plate->space = "nowhere";
  EXPECT_THAT(refusal(), HasSubstr("no space \"nowhere\""));
}

TEST_F(Plates, WithAnOldColourAttributeAreStillTheScenes) {
  shot_.output.color.color_space = "lin_ap1_scene";
  options_.chromaticities = true;
  render_plate();
  options_.chromaticities = false;
  shot_.layers = {plate("plate.####.exr")};
  ASSERT_EQ(run().rendered, 1);
  EXPECT_NEAR(rgba_at(20, 15)[0], grey(0), 0.003F);
}

TEST_F(Plates, WhatIsNoNumberDoesNotShowThroughWhatHidesIt) {
  constexpr float kInfinite = std::numeric_limits<float>::infinity();
  constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
  constexpr std::array<std::pair<const char*, float>, 5> kSun{
      {{"R", kInfinite}, {"G", kNone}, {"B", 2}, {"A", 1}, {"Z", kNone}}};
  Imf::Header header(40, 30);
  Imf::FrameBuffer buffer;
  std::array<std::vector<float>, kSun.size()> values;
  for (std::size_t c = 0; c < kSun.size(); ++c) {
    const auto& [name, value] = kSun[c];
    values[c].assign(40 * 30, value);
    header.channels().insert(name, Imf::Channel(Imf::FLOAT));
    buffer.insert(name, Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(values[c].data()),
                                   sizeof(float), 40 * sizeof(float)));
  }
  {
    Imf::OutputFile sun((folder_.path() / "sun.exr").c_str(), header);
    sun.setFrameBuffer(buffer);
    sun.writePixels(30);
  }
  schemas::ShotDocument::Layer front;
  front.solid = schemas::ShotDocument::Solid{{0.25, 0.5, 0.75}, 1, 2};
  shot_.merge = schemas::ShotDocument::Merge::kDepth;
  shot_.layers = {plate("sun.exr"), front};
  ASSERT_EQ(run().rendered, 1);
  EXPECT_EQ(rgba_at(20, 15), (std::array<float, 4>{0.25F, 0.5F, 0.75F, 1}));
  shot_.layers = {plate("sun.exr")};
  ASSERT_EQ(run().rendered, 1);
  EXPECT_EQ(rgba_at(20, 15), (std::array<float, 4>{65504, 0, 2, 1}));
}

TEST_F(Plates, StandWhereTheirDepthSays) {
  render_plate();
  shot_.merge = schemas::ShotDocument::Merge::kDepth;
  schemas::ShotDocument::Layer glass;
  glass.solid = schemas::ShotDocument::Solid{{1, 0, 0}, 1, 3.5};
  shot_.layers = {glass, plate("plate.####.exr")};
  ASSERT_EQ(run().rendered, 1);
  const float wall_depth = 3;  // best focal plane of 2 to 6 m
  EXPECT_NEAR(rgba_at(20, 15)[0], grey(0), 0.003F) << "at " << wall_depth;
  shot_.layers[1].plate->depth_m = 4;
  ASSERT_EQ(run().rendered, 1);
  EXPECT_EQ(rgba_at(20, 15), (std::array<float, 4>{1, 0, 0, 1}));
}

TEST_F(Plates, PngAndJpegAreCodesOfSrgb) {
  store::RgbImage picture{40, 30, std::vector<std::uint8_t>()};
  for (int i = 0; i < 40 * 30; ++i) {
    for (const int code : {200, 100, 50}) picture.values.push_back(static_cast<std::uint8_t>(code));
  }
  store::JpegEncodeOptions jpeg;
  jpeg.quality = 100;
  const auto bytes = store::encode_jpeg(picture, jpeg);
  write_file_atomically(folder_.path() / "p.jpg", std::as_bytes(std::span(bytes)));
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  png.width = 40;
  png.height = 30;
  png.format = PNG_FORMAT_RGBA;
  std::vector<std::uint8_t> codes;
  for (int i = 0; i < 40 * 30; ++i) {
    for (const int code : {200, 100, 50, 128}) codes.push_back(static_cast<std::uint8_t>(code));
  }
  ASSERT_NE(png_image_write_to_file(&png, (folder_.path() / "p.png").c_str(), 0, codes.data(), 0,
                                    nullptr),
            0);
  const auto light = [](int code) { return static_cast<float>(linear_from_srgb(code / 255.0)); };
  shot_.layers = {plate("p.jpg")};
  ASSERT_EQ(run().rendered, 1);
  EXPECT_NEAR(rgba_at(20, 15)[0], light(200), 0.01F);
  EXPECT_NEAR(rgba_at(20, 15)[2], light(50), 0.01F);
  shot_.layers = {plate("p.png")};
  ASSERT_EQ(run().rendered, 1);
  EXPECT_NEAR(rgba_at(20, 15)[0], light(200) * 128 / 255, 0.002F);
  EXPECT_NEAR(rgba_at(20, 15)[3], 128.0F / 255, 0.002F);
  // Naming the default space changes nothing; another space changes the light.
  shot_.layers[0].plate->space = "srgb_texture";
  ASSERT_EQ(run().rendered, 1);
  EXPECT_NEAR(rgba_at(20, 15)[0], light(200) * 128 / 255, 0.002F);
  shot_.layers[0].plate->space = "lin_rec709_scene";
  ASSERT_EQ(run().rendered, 1);
  EXPECT_NEAR(rgba_at(20, 15)[0], 200.0F / 255 * 128 / 255, 0.002F);
}

TEST_F(Plates, WhatIsWrongIsSaid) {
  render_plate();
  shot_.layers = {plate("plate.tif")};
  EXPECT_THAT(refusal(), HasSubstr("the plate is not EXR, PNG or JPEG"));
  shot_.layers = {plate("plate.####.exr")};
  shot_.width = 60;
  EXPECT_THAT(refusal(), HasSubstr("40 x 30 pixels, the shot 60 x 30"));
  std::ofstream(folder_.path() / "plate.0101.png") << "no picture";
  shot_.layers = {plate("plate.####.png")};
  EXPECT_THAT(refusal(), HasSubstr("plate.0101.png"));
  std::ofstream(folder_.path() / "plate.0101.jpg") << "no picture";
  shot_.layers = {plate("plate.####.jpg")};
  EXPECT_THAT(refusal(), HasSubstr("plate.0101.jpg"));
}

TEST_F(Plates, AnotherPictureIsAnotherFrame) {
  render_plate();
  shot_.layers = {plate("plate.####.exr")};
  run();
  options_.existing = ExistingFiles::kSkip;
  EXPECT_EQ(run().skipped, 1);
  schemas::ShotDocument::Layer red;
  red.solid = schemas::ShotDocument::Solid{{1, 0, 0}, 1};
  const auto layers = std::exchange(shot_.layers, {red});
  const std::string output =
      std::exchange(options_.output, (folder_.path() / "plate.####.exr").string());
  EXPECT_EQ(run().rendered, 1);
  shot_.layers = layers;
  options_.output = output;
  EXPECT_EQ(run().rendered, 1);
}

}  // namespace
}  // namespace raystage::compose
