// SPDX-License-Identifier: Apache-2.0
#include "images/png_file.h"

#include <gtest/gtest.h>

#include <cstdint>

#include "base/error.h"
#include "images/image_reader.h"
#include "testing/test_folder.h"

namespace raystage::images {
namespace {

TEST(PngFile, OpenImageIoReadsTheSameCodes) {
  const testing::TestFolder folder;
  store::RgbImage image(7, 5);
  for (std::size_t i = 0; i < image.values.size(); ++i) {
    image.values[i] = static_cast<std::uint8_t>(i * 37);
  }
  write_png(image, folder.path() / "a.png");
  const store::RgbImage read = ImageReader().read_rgb(folder.path() / "a.png");
  EXPECT_EQ(read.width, 7);
  EXPECT_EQ(read.height, 5);
  EXPECT_EQ(read.values, image.values);
}

TEST(PngFile, AFolderThatDoesNotExistIsAnError) {
  const testing::TestFolder folder;
  EXPECT_THROW(write_png(store::RgbImage(2, 2), folder.path() / "none" / "a.png"), Error);
}

}  // namespace
}  // namespace raystage::images
