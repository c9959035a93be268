// SPDX-License-Identifier: Apache-2.0
#include "images/image_file.h"

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include <span>

#include "base/atomic_file.h"
#include "base/error.h"
#include "images/png_file.h"

namespace raystage::images {

void write_image(const store::RgbImage& image, const std::filesystem::path& file) {
  // One writer for all commands: a snapshot of the viewer is the file that a preview would be.
  if (file.extension() == ".png") return write_png(image, file);
  // By file name: OpenImageIO accepts an extension only without its dot.
  const auto output = OIIO::ImageOutput::create(file.string());
  if (!output) {
    throw Error::bad_input("the file extension is not that of a supported image format",
                           file.string(), "Use .png");
  }
  if (output->supports("ioproxy") == 0) {
    throw Error::bad_input("writing this image format is not supported", file.string(), "Use .png");
  }
  // Encoded in memory first, because OpenImageIO ignores a full disk when it closes a file.
  OIIO::Filesystem::IOVecOutput encoded;
  output->set_ioproxy(&encoded);
  const OIIO::ImageSpec spec(image.width, image.height, 3, OIIO::TypeDesc::UINT8);
  if (!output->open(file.string(), spec) ||
      !output->write_image(OIIO::TypeDesc::UINT8, image.values.data()) || !output->close()) {
    throw Error::failed("the image cannot be encoded: " + output->geterror(), file.string(),
                        "Check that the format allows the image size");
  }
  write_file_atomically(file, std::as_bytes(std::span(encoded.buffer())));
}

}  // namespace raystage::images
