// SPDX-License-Identifier: Apache-2.0
#include "images/image_file.h"

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include <cassert>
#include <span>

#include "base/atomic_file.h"
#include "base/error.h"
#include "images/png_file.h"

namespace raystage::images {
namespace {

/// Encodes an image in memory first, because OpenImageIO ignores a full disk when it closes a file.
void write_encoded(OIIO::ImageOutput& output, const OIIO::ImageSpec& spec, const void* values,
                   const std::filesystem::path& file) {
  OIIO::Filesystem::IOVecOutput encoded;
  output.set_ioproxy(&encoded);
  if (!output.open(file.string(), spec) || !output.write_image(spec.format, values) ||
      !output.close()) {
    throw Error::failed("the image cannot be encoded: " + output.geterror(), file.string(),
                        "Check that the format allows the image size");
  }
  write_file_atomically(file, std::as_bytes(std::span(encoded.buffer())));
}

}  // namespace

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
  write_encoded(*output, {image.width, image.height, 3, OIIO::TypeDesc::UINT8}, image.values.data(),
                file);
}

void write_channels(int width, int height, const std::vector<std::string>& channels,
                    std::span<const float> values, const std::filesystem::path& file) {
  assert(values.size() ==
         static_cast<std::size_t>(width) * static_cast<std::size_t>(height) * channels.size());
  const auto output = OIIO::ImageOutput::create("openexr");
  if (!output) {
    throw Error::failed("OpenImageIO cannot write EXR files", file.string(),
                        "Install OpenImageIO with OpenEXR");
  }
  OIIO::ImageSpec spec(width, height, static_cast<int>(channels.size()), OIIO::TypeDesc::FLOAT);
  spec.channelnames = channels;
  spec.attribute("compression", "zip");
  // Otherwise OpenImageIO states the current time, and equal values would be different files.
  spec.attribute("DateTime", "1970:01:01 00:00:00");
  write_encoded(*output, spec, values.data(), file);
}

void write_depth_image(int width, int height, std::span<const float> z,
                       const std::filesystem::path& file) {
  write_channels(width, height, {"Z"}, z, file);
}

}  // namespace raystage::images
