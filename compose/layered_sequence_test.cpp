// SPDX-License-Identifier: Apache-2.0
#include <OpenEXR/ImfDeepFrameBuffer.h>
#include <OpenEXR/ImfDeepScanLineInputPart.h>
#include <OpenEXR/ImfFloatAttribute.h>
#include <OpenEXR/ImfInputPart.h>
#include <OpenEXR/ImfMultiPartInputFile.h>
#include <OpenEXR/ImfStandardAttributes.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/atomic_file.h"
#include "images/exr_reader.h"
#include "images/exr_slice.h"
#include "testing/compose/sequence_test_data.h"

namespace raystage::compose {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;

/// The wall's take, and a second take of the wall that is two ticks later.
class LayeredSequence : public testing::SequenceTest {
 protected:
  LayeredSequence() { options_.frames = {101}; }

  static schemas::ShotDocument::Layer solid(double grey, double alpha,
                                            std::optional<double> depth = {}) {
    schemas::ShotDocument::Layer layer;
    layer.solid = schemas::ShotDocument::Solid{{grey, grey, grey}, alpha, depth};
    return layer;
  }
  static schemas::ShotDocument::Layer later() {
    schemas::ShotDocument::Layer layer;
    layer.take = "take";
    layer.start_seconds = 0.2;
    return layer;
  }
  /// Returns the linear value, alpha and depth of a pixel.
  std::array<float, 3> at(int x, int y) const {
    const ExrImage image = read_exr(file(101));
    constexpr images::ExrChannel kZ[] = {{"Z"}};
    const std::size_t pixel = static_cast<std::size_t>(y * 40 + x);
    return {image.rgba[4 * pixel], image.rgba[4 * pixel + 3],
            images::read_exr_channels(file(101), kZ, "").values[pixel]};
  }
};

TEST_F(LayeredSequence, TwoTakesShareAPictureWithoutASeam) {
  schemas::ShotDocument::Layer right = later();
  right.clips = {{.screen = {.left = 0.5}}};
  shot_.layers.push_back(right);
  run();
  EXPECT_NEAR(at(10, 15)[0], grey(0), 0.005F);
  EXPECT_NEAR(at(19, 15)[0], grey(0), 0.005F);
  EXPECT_NEAR(at(20, 15)[0], grey(2), 0.005F);
  for (int x = 0; x < 40; ++x) EXPECT_NEAR(at(x, 15)[1], 1, 1e-3F) << x;

  shot_.layers[1].clips[0].feather = 0.5;
  options_.existing = ExistingFiles::kOverwrite;
  run();
  EXPECT_NEAR(at(20, 15)[0], 0.5F * (grey(0) + grey(2)), 0.01F);
  for (int x = 0; x < 40; ++x) EXPECT_NEAR(at(x, 15)[1], 1, 1e-3F) << x;
}

/// Reads all of the data window, which read_exr() crops to the display window.
std::vector<float> red_of_data_window(const std::filesystem::path& file, Imath::Box2i& window) {
  Imf::MultiPartInputFile input(file.c_str());
  Imf::InputPart part(input, 0);
  window = part.header().dataWindow();
  const int width = window.max.x - window.min.x + 1, height = window.max.y - window.min.y + 1;
  std::vector<float> red(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  Imf::FrameBuffer buffer;
  buffer.insert("R", images::make_exr_slice(Imf::FLOAT, red.data(), width, 1, window.min.x,
                                            window.min.y, 0.0));
  part.setFrameBuffer(buffer);
  part.readPixels(window.min.y, window.max.y);
  return red;
}

TEST_F(LayeredSequence, OverscanLiesBeyondThePicture) {
  schemas::ShotDocument::Layer half = solid(0.5, 1);
  half.clips = {{.screen = {.left = 0.5}}};
  shot_.layers.push_back(half);
  run();
  const ExrImage plain = read_exr(file(101));
  const auto matrices = [&] {
    Imf::MultiPartInputFile input(file(101).c_str());
    const Imf::Header& header = input.header(0);
    return std::tuple(Imf::worldToNDC(header), header.screenWindowWidth(),
                      header.findTypedAttribute<Imf::FloatAttribute>("pinholeFocalLength")->value(),
                      header.displayWindow());
  };
  const auto before = matrices();
  shot_.output.overscan = {6, 4};
  options_.existing = ExistingFiles::kSkip;
  EXPECT_EQ(run().rendered, 1);
  // The display window and its camera are unchanged.
  const ExrImage picture = read_exr(file(101));
  ASSERT_EQ(picture.rgba.size(), plain.rgba.size());
  for (std::size_t i = 0; i < plain.rgba.size(); ++i) {
    EXPECT_NEAR(picture.rgba[i], plain.rgba[i], 2e-3F) << i;
  }
  EXPECT_EQ(matrices(), before);
  // The overscan has the wall on the left, the solid on the right.
  Imath::Box2i window;
  const std::vector<float> red = red_of_data_window(file(101), window);
  EXPECT_EQ(window, Imath::Box2i({-6, -4}, {40 + 5, 30 + 3}));
  EXPECT_NEAR(red[0], grey(0), 0.005F);
  EXPECT_NEAR(red[51], 0.5F, 0.005F);
  EXPECT_NEAR(red[25], grey(0), 0.005F);
  EXPECT_NEAR(red[26], 0.5F, 0.005F);

  shot_.merge = schemas::ShotDocument::Merge::kDepth;
  options_.deep = true;
  EXPECT_EQ(run().rendered, 1);
  Imf::MultiPartInputFile deep(SequenceName(options_.output).with("deep").path(101).c_str());
  EXPECT_EQ(deep.header(0).dataWindow(), window);
}

TEST_F(LayeredSequence, FilesMayBeInOtherPrimaries) {
  shot_.layers = {solid(0, 1)};
  shot_.layers[0].solid->color = {1, 0, 0};
  shot_.output.color.color_space = "lin_ap1_scene";
  run();
  const ExrImage acescg = read_exr(file(101));
  EXPECT_NEAR(acescg.rgba[0], 0.6131F, 5e-4F);
  EXPECT_NEAR(acescg.rgba[1], 0.0702F, 1e-4F);
  EXPECT_NEAR(acescg.rgba[2], 0.0206F, 1e-4F);
  const auto text = [&](const char* name) {
    const Imf::MultiPartInputFile input(file(101).c_str());
    const auto* found = input.header(0).findTypedAttribute<Imf::StringAttribute>(name);
    return found == nullptr ? std::string() : found->value();
  };
  EXPECT_EQ(text("colorInteropID"), "lin_ap1_scene");
  EXPECT_EQ(text("lf:colorSpace"), "lin_ap1_scene");
  EXPECT_THAT(text("lf:colorConfig"), HasSubstr("raystage-1 built in"));

  options_.existing = ExistingFiles::kSkip;
  EXPECT_EQ(run().skipped, 1);
  shot_.output.color.color_space = "lin_rec709_scene";
  EXPECT_EQ(run().rendered, 1);
  EXPECT_EQ(text("colorInteropID"), "lin_rec709_scene");
  EXPECT_EQ(text("lf:colorConfig"), "");

  shot_.output.color.color_space = "srgb_texture";
  EXPECT_THAT(refusal(), HasSubstr("not linear light"));
  shot_.output.color.color_space = "ARRI LogC";
  EXPECT_THAT(refusal(), HasSubstr("Use one of lin_ap0_scene, lin_ap1_scene"));
  shot_.output.color.config = "nowhere.ocio";
  EXPECT_THAT(refusal(), HasSubstr("nowhere.ocio"));
}

TEST_F(LayeredSequence, DeepFilesHoldWhatThePictureIsMadeOf) {
  shot_.merge = schemas::ShotDocument::Merge::kDepth;
  shot_.layers.push_back(solid(0.5, 0.5, 1));
  options_.deep = true;
  run();
  const auto deep_file = SequenceName(options_.output).with("deep").path(101);
  EXPECT_TRUE(std::filesystem::exists(deep_file));
  Imf::MultiPartInputFile input(deep_file.c_str());
  Imf::DeepScanLineInputPart part(input, 0);
  std::vector<unsigned int> counts(40 * 30);
  Imf::DeepFrameBuffer buffer;
  buffer.insertSampleCountSlice(Imf::Slice(Imf::UINT, reinterpret_cast<char*>(counts.data()),
                                           sizeof(unsigned int), sizeof(unsigned int) * 40));
  part.setFrameBuffer(buffer);
  part.readPixelSampleCounts(0, 29);
  for (const unsigned int count : counts) EXPECT_EQ(count, 2U);  // the wall, and glass in front

  // Existing files are skipped only together with the deep file.
  options_.existing = ExistingFiles::kSkip;
  EXPECT_EQ(run().skipped, 1);
  std::filesystem::remove(deep_file);
  EXPECT_EQ(run().rendered, 1);
  EXPECT_TRUE(std::filesystem::exists(deep_file));

  shot_.merge = schemas::ShotDocument::Merge::kLayerOrder;
  EXPECT_THAT(refusal(), HasSubstr("deep files merge layers by depth"));
}

TEST_F(LayeredSequence, ASolidLiesWhereItIsStatedOrWhereItIsDeep) {
  shot_.layers.push_back(solid(0.75, 0.5, 2));
  run();
  EXPECT_NEAR(at(20, 15)[0], 0.5F * 0.75F + 0.5F * grey(0), 0.005F);
  EXPECT_FLOAT_EQ(at(20, 15)[2], 2) << "half of it";
  // The light field is on the best focal plane, 3 m in front of the array.
  shot_.merge = schemas::ShotDocument::Merge::kDepth;
  shot_.layers[1].solid->depth_m = 5;
  options_.existing = ExistingFiles::kSkip;
  EXPECT_EQ(run().rendered, 1) << "the fingerprint knows the order and the depth";
  EXPECT_NEAR(at(20, 15)[0], grey(0), 0.005F);
  EXPECT_NEAR(at(20, 15)[2], 3, 0.05F);
}

TEST_F(LayeredSequence, AHoldoutLeavesAHole) {
  shot_.layers.push_back(solid(1, 1));
  shot_.layers[1].holdout = true;
  shot_.layers[1].clips = {{.screen = {.bottom = 0.5}}};
  run();
  EXPECT_EQ(at(20, 5)[1], 0);
  EXPECT_NEAR(at(20, 25)[1], 1, 1e-3F);
}

TEST_F(LayeredSequence, OpacityAndRangesCount) {
  shot_.layers.push_back(solid(1, 1));
  shot_.layers[1].opacity = 0.25;
  run();
  EXPECT_NEAR(at(20, 15)[0], 0.25F + 0.75F * grey(0), 0.005F);
  shot_.layers[1].first_frame = 102;
  options_.existing = ExistingFiles::kSkip;
  run();
  EXPECT_NEAR(at(20, 15)[0], grey(0), 0.005F);
}

TEST_F(LayeredSequence, WhatShowsNothingIsNotOpened) {
  schemas::ShotDocument::Layer gone;
  gone.take = "gone";
  shot_.layers.insert(shot_.layers.begin(), gone);
  EXPECT_THAT(refusal(), HasSubstr("gone"));
  shot_.layers[0].last_frame = 100;
  EXPECT_EQ(run().rendered, 1);
  shot_.layers[0].last_frame.reset();
  shot_.layers[0].clips = {{.screen = {.left = 0.7, .right = 0.7}}};
  options_.existing = ExistingFiles::kOverwrite;
  EXPECT_EQ(run().rendered, 1);
  shot_.layers[0].clips.clear();
  shot_.layers[0].opacity = 0;
  EXPECT_EQ(run().rendered, 1);
  shot_.layers[0].opacity = 1;
  shot_.layers.insert(shot_.layers.begin() + 1, solid(0.5, 1));
  EXPECT_EQ(run().rendered, 1) << "it stands behind a solid";
  shot_.layers[1].solid->alpha = 0.9;
  EXPECT_THAT(refusal(), HasSubstr("gone"));
  shot_.layers[1].solid->alpha = 1;
  shot_.merge = schemas::ShotDocument::Merge::kDepth;
  EXPECT_THAT(refusal(), HasSubstr("gone"));
}

TEST_F(LayeredSequence, WhatIsHiddenIsNotDecoded) {
  EXPECT_GT(run().pixels_decoded, 0);
  options_.existing = ExistingFiles::kOverwrite;
  shot_.layers.push_back(solid(0.25, 1));
  EXPECT_EQ(run().pixels_decoded, 0);
  EXPECT_EQ(at(20, 15)[0], 0.25F);
  constexpr images::ExrChannel kCoverage[] = {{"coverage.V"}};
  EXPECT_EQ(images::read_exr_channels(file(101), kCoverage, "").values[0], 0)
      << "the channel is there in every frame";
}

TEST_F(LayeredSequence, AShotNeedsNoLightField) {
  shot_.layers = {solid(0.5, 1)};
  EXPECT_EQ(run().rendered, 1);
  EXPECT_EQ(at(3, 3)[0], 0.5F);
  constexpr images::ExrChannel kCoverage[] = {{"coverage.V"}};
  EXPECT_THROW(images::read_exr_channels(file(101), kCoverage, ""), Error);
}

TEST_F(LayeredSequence, EachLayersMissingFramesAreNamed) {
  schemas::ShotDocument::Layer layer = later();
  layer.start_seconds = 100;
  shot_.layers.push_back(layer);
  EXPECT_THAT(refusal(), HasSubstr("shot.json#/layers/1: the take has no instant for"));
  options_.missing = MissingFrames::kBlack;
  EXPECT_EQ(run().rendered, 1);
  EXPECT_THAT(messages_, Contains(HasSubstr("layer 1: 1 frames are empty")));
  EXPECT_NEAR(at(20, 15)[0], grey(0), 0.005F) << "the layer behind shows";
}

TEST_F(LayeredSequence, FocusesWhereTheCameraDoes) {
  shot_.layers[0].focal_plane.kind = schemas::ShotDocument::FocalPlane::Kind::kCamera;
  EXPECT_THAT(refusal(), HasSubstr("shot.json#/layers/0: the focal plane follows the camera"));
  shot_.camera.keys[0].focus_m = 2;
  shot_.camera.keys[1].focus_m = 4.5;
  options_.frames = {101, 106};
  run();
  constexpr images::ExrChannel kZ[] = {{"Z"}};
  EXPECT_NEAR(images::read_exr_channels(file(101), kZ, "").values[15 * 40 + 20], 2, 1e-4);
  EXPECT_NEAR(images::read_exr_channels(file(106), kZ, "").values[15 * 40 + 20], 4.5, 1e-4);
  options_.existing = ExistingFiles::kSkip;
  shot_.layers[0].focal_plane.kind = schemas::ShotDocument::FocalPlane::Kind::kInfinity;
  EXPECT_EQ(run().rendered, 2) << "another plane is another picture";
}

TEST_F(LayeredSequence, TheApertureIsTheCameras) {
  shot_.layers[0].method = "aperture";
  shot_.layers[0].focal_plane.kind = schemas::ShotDocument::FocalPlane::Kind::kCamera;
  shot_.camera.keys[0].focus_m = 3;
  shot_.camera.film_back_mm = 24;
  const auto lens = [&] {
    schemas::write_shot(shot_, shot_file());
    const ShotPlan plan(shot_file());
    return plan.light_field(0)->reconstruction_for(plan.exr_camera(101, Eye::kBoth), 101).options;
  };
  EXPECT_FALSE(lens().contains("f_number"));
  shot_.camera.keys[0].f_number = 0.5;
  EXPECT_EQ(std::get<double>(lens().at("f_number")), 0.5);
  EXPECT_EQ(std::get<double>(lens().at("film_width")), 24);
  EXPECT_EQ(run().rendered, 1);
  shot_.layers[0].options["radius"] = 0.1;
  EXPECT_FALSE(lens().contains("f_number")) << "the layer says it itself";
}

TEST_F(LayeredSequence, SameBytesForAnyNumberOfThreads) {
  schemas::ShotDocument::Layer right = later();
  right.clips = {{.screen = {.left = 0.3}, .feather = 0.2}};
  shot_.layers.push_back(right);
  shot_.layers.push_back(solid(0.1, 0.3));
  shot_.merge = schemas::ShotDocument::Merge::kDepth;
  std::string first;
  options_.existing = ExistingFiles::kOverwrite;
  for (const int frames_in_flight : {1, 4}) {
    options_.frames_in_flight = frames_in_flight;
    run();
    const std::string bytes = read_file(file(101));
    if (first.empty()) first = bytes;
    EXPECT_EQ(bytes, first);
  }
}

}  // namespace
}  // namespace raystage::compose
