// SPDX-License-Identifier: Apache-2.0
// Parts, views and channel names, read back by OpenEXR and by OpenImageIO.
#include "compose/exr/exr_layout.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfMultiPartInputFile.h>
#include <OpenEXR/ImfPartType.h>
#include <OpenEXR/ImfStandardAttributes.h>
#include <OpenImageIO/imageio.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/atomic_file.h"
#include "base/error.h"
#include "compose/exr/exr_file.h"
#include "testing/compose/test_exr_view.h"
#include "testing/test_folder.h"

namespace raystage::compose {
namespace {

using ::testing::ElementsAre;

constexpr int kColumns = 20, kRows = 13;

render::RenderedView picture(float red) {
  render::RenderedView view;
  view.width = kColumns;
  view.height = kRows;
  for (int i = 0; i < kColumns * kRows; ++i) {
    const float value = static_cast<float>(i) / (kColumns * kRows);
    view.rgba.insert(view.rgba.end(), {red, value, 0.25F, 1});
    view.z.push_back(2 + value);
    view.coverage.push_back(value);
    view.cameras.push_back(3);
    view.nearest_ray.push_back(0.5F);
  }
  return view;
}

ExrCamera camera_at(double x) {
  ExrCamera camera;
  camera.view =
      render::virtual_camera_with_fov(kColumns, kRows, 1, rig::Pose{.position = {x, 0, 0}});
  camera.film_back_mm = 24;
  camera.focus_m = 3.5;
  camera.f_number = 2.8;
  camera.exposure_seconds = 1.0 / 48;
  return camera;
}

std::vector<std::string> channels_of(const Imf::Header& header) {
  std::vector<std::string> names;
  for (auto i = header.channels().begin(); i != header.channels().end(); ++i) {
    names.emplace_back(i.name());
  }
  return names;
}

class ExrLayouts : public ::testing::Test {
 protected:
  void write(ExrLayout layout, bool stereo) {
    ExrMetadata metadata;
    metadata.layout = layout;
    metadata.data_compression = "zips";
    metadata.fingerprint = "f";
    std::vector<ExrView> views{testing::exr_view(left_, stereo ? "left" : "")};
    std::vector<ExrCamera> cameras{camera_at(-0.03)};
    if (stereo) {
      views.push_back(testing::exr_view(right_, "right"));
      cameras.push_back(camera_at(0.03));
    }
    testing::write_exr(views, cameras, metadata, file_);
    EXPECT_TRUE(is_complete_exr(file_, "f"));
  }
  std::vector<std::string> part_names() const {
    const Imf::MultiPartInputFile input(file_.c_str());
    std::vector<std::string> names;
    for (int i = 0; i < input.parts(); ++i) {
      names.push_back(input.header(i).hasName() ? input.header(i).name() : "");
    }
    return names;
  }

  testing::TestFolder folder_;
  std::filesystem::path file_ = folder_.path() / "frame.0001.exr";
  render::RenderedView left_ = picture(0.5F), right_ = picture(0.75F);
};

TEST_F(ExrLayouts, StandardHasAPartForEachLayer) {
  write(ExrLayout::kStandard, false);
  EXPECT_THAT(part_names(), ElementsAre("rgba", "depth", "lf"));
  const Imf::MultiPartInputFile input(file_.c_str());
  EXPECT_THAT(channels_of(input.header(0)), ElementsAre("A", "B", "G", "R"));
  EXPECT_THAT(channels_of(input.header(1)), ElementsAre("Z"));
  EXPECT_THAT(channels_of(input.header(2)), ElementsAre("cameras.V", "coverage.V", "nearest.V"));
  for (int i = 0; i < 3; ++i) {
    const Imf::Header& header = input.header(i);
    EXPECT_FALSE(header.hasView());
    EXPECT_EQ(header.type(), Imf::SCANLINEIMAGE);
    EXPECT_EQ(header.typedAttribute<Imf::StringAttribute>("colorInteropID").value(),
              i == 0 ? "lin_rec709_scene" : "data");
    EXPECT_EQ(header.compression(), i == 0 ? Imf::ZIP_COMPRESSION : Imf::ZIPS_COMPRESSION);
    EXPECT_FLOAT_EQ(Imf::focus(header), 3.5F);
    EXPECT_FLOAT_EQ(Imf::aperture(header), 2.8F);
    EXPECT_FLOAT_EQ(Imf::expTime(header), 1 / 48.0F);
  }
}

TEST_F(ExrLayouts, StereoHasAViewInEachPartAndNoneInChannelNames) {
  write(ExrLayout::kStandard, true);
  EXPECT_THAT(part_names(), ElementsAre("rgba.left", "rgba.right", "depth.left", "depth.right",
                                        "lf.left", "lf.right"));
  const Imf::MultiPartInputFile input(file_.c_str());
  for (int i = 0; i < 6; ++i) {
    EXPECT_EQ(input.header(i).view(), i % 2 == 0 ? "left" : "right");
    EXPECT_FALSE(Imf::hasMultiView(input.header(i)));
    // Each view its own camera, here 6 cm apart.
    EXPECT_FLOAT_EQ(Imf::worldToCamera(input.header(i))[3][0], i % 2 == 0 ? 0.03F : -0.03F);
  }
  EXPECT_THAT(channels_of(input.header(1)), ElementsAre("A", "B", "G", "R"));
}

TEST_F(ExrLayouts, PixelsOfEveryPartComeBackThroughOpenImageIo) {
  write(ExrLayout::kStandard, true);
  const auto input = OIIO::ImageInput::open(file_.string());
  ASSERT_TRUE(input) << OIIO::geterror();
  const auto first_pixels = [&](int part, int channels) {
    std::vector<float> pixels(static_cast<std::size_t>(kColumns * kRows * channels));
    EXPECT_TRUE(input->seek_subimage(part, 0));
    EXPECT_EQ(input->spec().nchannels, channels);
    EXPECT_TRUE(input->read_image(part, 0, 0, channels, OIIO::TypeFloat, pixels.data()));
    return pixels;
  };
  EXPECT_EQ(first_pixels(0, 4)[0], 0.5F);
  EXPECT_EQ(first_pixels(1, 4)[0], 0.75F);
  const std::vector<float> z = first_pixels(3, 1);
  EXPECT_EQ(z, std::vector<float>(right_.z.begin(), right_.z.end()));
  const std::vector<float> lf = first_pixels(4, 3);  // sorted by name
  EXPECT_EQ(lf[0], 3);
  EXPECT_EQ(lf[3 * 7 + 1], left_.coverage[7]);
  EXPECT_EQ(lf[2], 0.5F);
  EXPECT_FALSE(input->seek_subimage(6, 0));
}

TEST_F(ExrLayouts, SingleNamesViewsInChannels) {
  write(ExrLayout::kSingle, true);
  const Imf::MultiPartInputFile input(file_.c_str());
  EXPECT_EQ(input.parts(), 1);
  const Imf::Header& header = input.header(0);
  EXPECT_THAT(
      channels_of(header),
      ElementsAre("A", "B", "G", "R", "Z", "cameras.left.V", "cameras.right.V", "coverage.left.V",
                  "coverage.right.V", "nearest.left.V", "nearest.right.V", "right.A", "right.B",
                  "right.G", "right.R", "right.Z"));
  EXPECT_THAT(Imf::multiView(header), ElementsAre("left", "right"));
  EXPECT_FALSE(header.hasView());
}

TEST_F(ExrLayouts, NukeNamesTheDepthOfEachView) {
  write(ExrLayout::kNuke, true);
  const Imf::MultiPartInputFile input(file_.c_str());
  EXPECT_THAT(channels_of(input.header(0)),
              ::testing::IsSupersetOf({"A", "depth.left.Z", "right.A", "depth.right.Z"}));
}

TEST_F(ExrLayouts, NukeKnowsDepthByItsLayer) {
  write(ExrLayout::kNuke, false);
  const Imf::MultiPartInputFile input(file_.c_str());
  EXPECT_THAT(channels_of(input.header(0)),
              ElementsAre("A", "B", "G", "R", "cameras.V", "coverage.V", "depth.Z", "nearest.V"));
  EXPECT_FALSE(Imf::hasMultiView(input.header(0)));
}

TEST_F(ExrLayouts, ThePictureIsReadFromEveryLayout) {
  for (const ExrLayout layout : {ExrLayout::kStandard, ExrLayout::kSingle, ExrLayout::kNuke}) {
    for (const bool stereo : {false, true}) {
      write(layout, stereo);
      const ExrImage image = read_exr(file_);
      EXPECT_EQ(image.width, kColumns);
      EXPECT_EQ(image.rgba[0], 0.5F);
      EXPECT_EQ(image.rgba[3], 1);
    }
  }
}

TEST_F(ExrLayouts, ACutInAnyPartIsSeen) {
  write(ExrLayout::kStandard, true);
  const std::string bytes = read_file(file_);
  for (std::size_t size = 0; size < bytes.size(); size += 1 + bytes.size() / 61) {
    write_file_atomically(file_, std::string_view(bytes).substr(0, size));
    EXPECT_FALSE(is_complete_exr(file_, "f")) << size;
  }
}

TEST(ExrLayoutNames, AreThree) {
  EXPECT_EQ(parse_exr_layout("nuke"), ExrLayout::kNuke);
  EXPECT_THROW(parse_exr_layout("other"), Error);
}

}  // namespace
}  // namespace raystage::compose
