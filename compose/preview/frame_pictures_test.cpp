// SPDX-License-Identifier: Apache-2.0
#include "compose/preview/frame_pictures.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "base/error.h"
#include "compose/preview/false_color.h"
#include "compose/preview/preview.h"
#include "compose/sequence_name.h"
#include "images/image_reader.h"
#include "testing/compose/test_exr_view.h"
#include "testing/test_folder.h"

namespace raystage::compose {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class FramePictureTest : public ::testing::Test {
 protected:
  /// Writes a frame of 4 x 2 pixels with this red, and the depths 1, 2, 4 m and infinity.
  std::string write(const std::string& name, float red, float farther = 1, int width = 4) {
    render::RenderedView view;
    view.width = width;
    view.height = 2;
    for (int i = 0; i < 2 * width; ++i) {
      view.rgba.insert(view.rgba.end(), {red, 0, 0, 1});
      view.coverage.push_back(0.25F * static_cast<float>(i % 4));
      const float depths[] = {1, 2, 4, std::numeric_limits<float>::infinity()};
      view.z.push_back(depths[i % 4] * farther);
    }
    const std::string sequence = (folder_.path() / (name + ".####.exr")).string();
    const ExrCamera camera{.view = render::virtual_camera_with_fov(width, 2, 1, {})};
    testing::write_exr({{testing::exr_view(view)}}, {{camera}}, {}, SequenceName(sequence).path(1));
    return sequence;
  }
  /// Writes white and black columns in turn; `first`: index of the first white one.
  std::string write_stripes(const std::string& name, int first) {
    render::RenderedView view;
    view.width = 4;
    view.height = 2;
    for (int i = 0; i < 8; ++i) {
      const float light = i % 2 == first ? 1.0F : 0.0F;
      view.rgba.insert(view.rgba.end(), {light, light, light, 1});
      view.coverage.push_back(1);
      view.z.push_back(1);
    }
    const std::string sequence = (folder_.path() / (name + ".####.exr")).string();
    const ExrCamera camera{.view = render::virtual_camera_with_fov(4, 2, 1, {})};
    testing::write_exr({{testing::exr_view(view)}}, {{camera}}, {}, SequenceName(sequence).path(1));
    return sequence;
  }
  static std::vector<int> row_of(const store::RgbImage& picture) {
    std::vector<int> red;
    for (int x = 0; x < picture.width; ++x) red.push_back(picture.row(0)[3 * x]);
    return red;
  }
  static store::RgbImage picture_of(const FramePictureOptions& options) {
    FramePictures pictures(options);
    pictures.read(1);
    return pictures.picture();
  }
  static std::string reason_of(const FramePictureOptions& options) {
    std::string reason;
    EXPECT_FALSE(options.is_valid(&reason));
    return reason;
  }
  testing::TestFolder folder_;
};

TEST_F(FramePictureTest, DepthHasFalseColoursOfItsInverse) {
  FramePictureOptions options{.sequences = {write("a", 1)}, .channel = "Z"};
  options.range = {1.0, 4.0};
  const store::RgbImage picture = picture_of(options);
  const auto at = [&](int x) {
    return std::array{picture.row(0)[3 * x], picture.row(0)[3 * x + 1], picture.row(0)[3 * x + 2]};
  };
  EXPECT_EQ(at(0), false_color(1));
  EXPECT_EQ(at(1), false_color((0.5 - 0.25) / 0.75));
  EXPECT_EQ(at(2), false_color(0));
  EXPECT_EQ(at(3), (std::array<std::uint8_t, 3>{24, 24, 24}));
  FramePictures by_itself({.sequences = options.sequences, .channel = "Z"});
  by_itself.read(1);
  EXPECT_EQ(by_itself.range_text(), "");
  by_itself.picture();
  EXPECT_EQ(by_itself.range_text(), "Z from 1 m (red) to 4 m (blue)");
}

TEST_F(FramePictureTest, SharesAreGreysFromZeroToOne) {
  EXPECT_THAT(row_of(picture_of({.sequences = {write("a", 1)}, .channel = "coverage"})),
              ElementsAre(0, 64, 128, 191));
  EXPECT_THAT(row_of(picture_of({.sequences = {write("a", 1)}, .channel = "alpha"})),
              ElementsAre(255, 255, 255, 255));
  EXPECT_THAT(
      row_of(picture_of({.sequences = {write("b", 0.5F)}, .channel = "R", .range = {{0.0, 2.0}}})),
      ElementsAre(64, 64, 64, 64));
}

TEST_F(FramePictureTest, WipesAndPutsSideBySide) {
  FramePictureOptions options{.sequences = {write("a", 1), write("b", 0)},
                              .arrangement = Arrangement::kWipe};
  options.wipe_position = 0.75;
  EXPECT_THAT(row_of(picture_of(options)), ElementsAre(255, 255, 220, 220));
  options.wipe_position = 0;
  EXPECT_THAT(row_of(picture_of(options)), ElementsAre(220, 0, 0, 0));
  options.arrangement = Arrangement::kSideBySide;
  const store::RgbImage both = picture_of(options);
  EXPECT_EQ(both.width, 4 + 8 + 4);
  EXPECT_THAT(row_of(both),
              ElementsAre(255, 255, 255, 255, 38, 38, 38, 38, 38, 38, 38, 38, 0, 0, 0, 0));
  FramePictures small(options);
  small.read(1);
  EXPECT_EQ(small.thumbnail(2).width, 2 + 8 + 2);
}

TEST_F(FramePictureTest, PacksTheViewsOfAStereoFrame) {
  const auto view_of = [](float red) {
    render::RenderedView view;
    view.width = 4;
    view.height = 2;
    for (int i = 0; i < 8; ++i) {
      view.rgba.insert(view.rgba.end(), {red, 0, 0, 1});
      view.coverage.push_back(red / 4);
      view.z.push_back(1);
    }
    return view;
  };
  const render::RenderedView left = view_of(1), right = view_of(0);
  const std::array views{testing::exr_view(left, "left"), testing::exr_view(right, "right")};
  const ExrCamera camera{.view = render::virtual_camera_with_fov(4, 2, 1, {})};
  const std::array cameras{camera, camera};
  for (const ExrLayout layout : {ExrLayout::kStandard, ExrLayout::kSingle, ExrLayout::kNuke}) {
    const std::string sequence = (folder_.path() / "s.####.exr").string();
    ExrMetadata metadata;
    metadata.layout = layout;
    testing::write_exr(views, cameras, metadata, SequenceName(sequence).path(1));
    FramePictureOptions options{.sequences = {sequence}, .stereo = StereoPacking::kSideBySide};
    EXPECT_THAT(row_of(picture_of(options)), ElementsAre(255, 255, 255, 255, 0, 0, 0, 0));
    options.channel = "coverage";
    EXPECT_THAT(row_of(picture_of(options)), ElementsAre(64, 64, 64, 64, 0, 0, 0, 0));
    options.stereo = StereoPacking::kNone;
    EXPECT_THAT(row_of(picture_of(options)), ElementsAre(64, 64, 64, 64)) << "the left view";
    options.channel = "";
    options.stereo = StereoPacking::kTopBottom;
    const store::RgbImage packed = picture_of(options);
    EXPECT_EQ(packed.width, 4);
    EXPECT_EQ(packed.height, 4);
    EXPECT_EQ(packed.row(1)[0], 255);
    EXPECT_EQ(packed.row(2)[0], 0);
  }
  EXPECT_THROW(picture_of({.sequences = {write("mono", 1)}, .stereo = StereoPacking::kSideBySide}),
               Error);
}

TEST_F(FramePictureTest, DifferencesAreOfValues) {
  FramePictureOptions options{.sequences = {write("a", 0.25F), write("b", 0.75F, 2)},
                              .arrangement = Arrangement::kDifference};
  EXPECT_THAT(row_of(picture_of(options)), ElementsAre(188, 188, 188, 188)) << "0.5 in light";
  options.channel = "Z";  // 1, 2, 4 m apart, and both infinite
  options.range = {0.0, 4.0};
  EXPECT_THAT(row_of(picture_of(options)), ElementsAre(64, 128, 255, 0));
}

TEST_F(FramePictureTest, DifferencesOfDetailsStayInThumbnails) {
  FramePictureOptions options{.sequences = {write_stripes("a", 0), write_stripes("b", 1)},
                              .arrangement = Arrangement::kDifference};
  FramePictures pictures(options);
  pictures.read(1);
  EXPECT_THAT(row_of(pictures.thumbnail(2)), ElementsAre(255, 255));
}

TEST_F(FramePictureTest, SaysWhatIsMissing) {
  const std::string a = write("a", 1);
  const auto refusal = [&](const FramePictureOptions& options) -> std::string {
    try {
      picture_of(options);
    } catch (const Error& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_THAT(refusal({.sequences = {a}, .channel = "confidence"}),
              HasSubstr("a.0001.exr: the file has no channel confidence"));
  EXPECT_THAT(refusal({.sequences = {a}, .channel = "N.X"}), HasSubstr("N.X"));
  EXPECT_THAT(refusal({.sequences = {a, write("b", 1, 1, 6)}}),
              HasSubstr("6 x 2 pixels, that of the first sequence 4 x 2"));
  EXPECT_THAT(reason_of({.sequences = {a}, .arrangement = Arrangement::kWipe}),
              HasSubstr("two sequences"));
  EXPECT_THAT(reason_of({.sequences = {a}, .range = {{0.0, 1.0}}}), HasSubstr("only a channel"));
  EXPECT_THAT(reason_of({.sequences = {a}, .channel = "Z", .range = {{0.0, 1.0}}}),
              HasSubstr("above 0 m"));
  EXPECT_THAT(reason_of({.sequences = {a}, .channel = "R", .range = {{1.0, 1.0}}}),
              HasSubstr("empty"));
}

TEST_F(FramePictureTest, APreviewComparesTheFramesThatBothHave) {
  PreviewOptions options;
  options.pictures_of.sequences = {write("a", 1), write("b", 0)};
  options.pictures_of.arrangement = Arrangement::kDifference;
  options.contact_sheet = folder_.path() / "sheet.png";
  options.pictures = (folder_.path() / "d.####.png").string();
  EXPECT_EQ(make_preview(options, {}).frames, 1);
  EXPECT_EQ(images::ImageReader().read_rgb(folder_.path() / "d.0001.png").width, 4);
  std::filesystem::rename(folder_.path() / "b.0001.exr", folder_.path() / "b.0002.exr");
  try {
    make_preview(options, {});
    FAIL() << "frames of two numbers were compared";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("1 of 1 frames are missing (1)"));
  }
}

}  // namespace
}  // namespace raystage::compose
