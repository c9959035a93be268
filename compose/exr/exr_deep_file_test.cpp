// SPDX-License-Identifier: Apache-2.0
// Deep files, read back by OpenEXR and flattened by OpenImageIO.
#include "compose/exr/exr_deep_file.h"

#include <OpenEXR/ImfMultiPartInputFile.h>
#include <OpenEXR/ImfPartType.h>
#include <OpenEXR/ImfStandardAttributes.h>
#include <OpenImageIO/deepdata.h>
#include <OpenImageIO/imagebuf.h>
#include <OpenImageIO/imagebufalgo.h>
#include <gtest/gtest.h>

#include "base/atomic_file.h"
#include "compose/exr/exr_file.h"
#include "testing/compose/test_exr_view.h"
#include "testing/test_folder.h"

namespace raystage::compose {
namespace {

constexpr int kDeepColumns = 24, kDeepRows = 10;

/// Pixels with 0 to 3 samples.
struct Deep {
  std::vector<std::uint32_t> begin{0};
  std::vector<float> samples;
  std::vector<float> flat;
};

Deep deep_picture() {
  Deep deep;
  for (int pixel = 0; pixel < kDeepColumns * kDeepRows; ++pixel) {
    float through = 1;
    std::array<float, 4> flat{};
    for (int i = 0; i < pixel % 4; ++i) {
      const float alpha = i == 2 ? 1.0F : 0.5F;
      const std::array<float, 4> rgba{alpha * 0.25F * static_cast<float>(i + 1), 0.125F * alpha,
                                      alpha * static_cast<float>(pixel) / 512, alpha};
      for (std::size_t c = 0; c < 4; ++c) flat[c] += through * rgba[c];
      through *= 1 - alpha;
      deep.samples.insert(deep.samples.end(), rgba.begin(), rgba.end());
      deep.samples.push_back(2.0F + static_cast<float>(i) + 0.001F * static_cast<float>(pixel));
    }
    deep.begin.push_back(static_cast<std::uint32_t>(deep.samples.size() / 5));
    deep.flat.insert(deep.flat.end(), flat.begin(), flat.end());
  }
  return deep;
}

class DeepFiles : public ::testing::Test {
 protected:
  DeepFiles() {
    camera_.view = render::virtual_camera_with_fov(kDeepColumns, kDeepRows, 1, rig::Pose{});
    metadata_.fingerprint = "f";
    metadata_.program_version = "0.1.0";
  }
  std::filesystem::path file() const { return folder_.path() / "deep.exr"; }

  testing::TestFolder folder_;
  ExrCamera camera_;
  ExrMetadata metadata_;
  Deep deep_ = deep_picture();
};

TEST_F(DeepFiles, SayWhatTheyAre) {
  const ExrDeepView views[] = {{"left", deep_.begin, deep_.samples},
                               {"right", deep_.begin, deep_.samples}};
  const ExrCamera cameras[] = {camera_, camera_};
  const std::size_t bytes = testing::write_deep_exr(views, cameras, metadata_, file());
  EXPECT_EQ(bytes, std::filesystem::file_size(file()));
  Imf::MultiPartInputFile input(file().c_str());
  ASSERT_EQ(input.parts(), 2);
  for (int i = 0; i < 2; ++i) {
    const Imf::Header& header = input.header(i);
    EXPECT_EQ(header.type(), Imf::DEEPSCANLINE);
    EXPECT_EQ(header.view(), i == 0 ? "left" : "right");
    EXPECT_EQ(header.name(), i == 0 ? "deep.left" : "deep.right");
    EXPECT_EQ(deepImageState(header), Imf::DIS_SORTED);
    EXPECT_TRUE(hasWorldToCamera(header));
  }
}

TEST_F(DeepFiles, FlattenToThePictureInAnotherReader) {
  const ExrDeepView view{"", deep_.begin, deep_.samples};
  for (const char* compression : {"none", "rle", "zips", "piz"}) {
    metadata_.compression = compression;
    testing::write_deep_exr({&view, 1}, {&camera_, 1}, metadata_, file());
    const OIIO::ImageBuf read(file().string());
    ASSERT_TRUE(read.deep()) << read.geterror();
    const OIIO::ImageBuf flat = OIIO::ImageBufAlgo::flatten(read);
    ASSERT_FALSE(flat.has_error()) << flat.geterror();
    const auto channel = [&](const char* name) { return flat.spec().channelindex(name); };
    const std::array<int, 4> order{channel("R"), channel("G"), channel("B"), channel("A")};
    std::vector<float> pixel(static_cast<std::size_t>(flat.nchannels()));
    for (int y = 0; y < kDeepRows; ++y) {
      for (int x = 0; x < kDeepColumns; ++x) {
        flat.getpixel(x, y, pixel.data(), flat.nchannels());
        for (std::size_t c = 0; c < 4; ++c) {
          ASSERT_NEAR(pixel[order[c]],
                      deep_.flat[4 * static_cast<std::size_t>(y * kDeepColumns + x) + c], 1e-3F)
              << compression << ' ' << x << ' ' << y << ' ' << c;
        }
      }
    }
    const std::size_t last = deep_.samples.size() - 1;
    EXPECT_EQ(
        read.deepdata()->deep_value(kDeepColumns * kDeepRows - 1, read.spec().channelindex("Z"), 2),
        deep_.samples[last]);
  }
}

TEST_F(DeepFiles, AreKnownToBeWhole) {
  const ExrDeepView view{"", deep_.begin, deep_.samples};
  testing::write_deep_exr({&view, 1}, {&camera_, 1}, metadata_, file());
  EXPECT_TRUE(is_complete_exr(file(), "f"));
  EXPECT_FALSE(is_complete_exr(file(), "g"));
  const std::string bytes = read_file(file());
  write_file_atomically(file(), std::as_bytes(std::span(bytes).first(bytes.size() - 40)));
  EXPECT_FALSE(is_complete_exr(file(), "f"));
}

TEST_F(DeepFiles, MayBeEmpty) {
  const std::vector<std::uint32_t> none(kDeepColumns * kDeepRows + 1, 0);
  const ExrDeepView view{"", none, {}};
  testing::write_deep_exr({&view, 1}, {&camera_, 1}, metadata_, file());
  EXPECT_TRUE(is_complete_exr(file(), "f"));
}

}  // namespace
}  // namespace raystage::compose
