// SPDX-License-Identifier: Apache-2.0
#include "images/resize.h"

#include <OpenImageIO/imagebuf.h>
#include <OpenImageIO/imagebufalgo.h>

#include "base/error.h"

namespace raystage::images {

store::RgbImage resize(const store::RgbImage& image, int width, int height) {
  constexpr int kOneThread = 1;
  store::RgbImage values = image;  // OpenImageIO wraps memory that may be written
  const OIIO::ImageBuf from(OIIO::ImageSpec(image.width, image.height, 3, OIIO::TypeDesc::UINT8),
                            values.values.data());
  store::RgbImage result(width, height);
  OIIO::ImageBuf to(OIIO::ImageSpec(width, height, 3, OIIO::TypeDesc::UINT8), result.values.data());
  const bool shrinks = width < image.width || height < image.height;
  if (!OIIO::ImageBufAlgo::resize(to, from, shrinks ? "box" : "triangle", 0.0F, OIIO::ROI(),
                                  kOneThread)) {
    throw Error::failed("an image cannot be resized: " + to.geterror(), "", "Please report this");
  }
  return result;
}

}  // namespace raystage::images
