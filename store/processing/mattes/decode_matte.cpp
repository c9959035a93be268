// SPDX-License-Identifier: Apache-2.0
// raystage-decode-matte, in lib/raystage: decodes mattes for its parent process, see sandbox/. The
// request is the width and height of the camera (int) and the file's name; the result is the width
// and height of the matte and, if these are the camera's, a code for each pixel.
#include <png.h>

#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "sandbox/byte_encoding.h"
#include "sandbox/decoder_main.h"

namespace {

using namespace raystage;

struct Free {
  void operator()(png_image* image) const {
    png_image_free(image);
    delete image;
  }
};

std::vector<std::byte> answer(std::span<const std::byte> request) {
  sandbox::ByteReader reader(request);
  const int width = reader.read<int>(), height = reader.read<int>();
  const std::span<const std::byte> rest = reader.read_rest();
  const std::string name(reinterpret_cast<const char*>(rest.data()), rest.size());
  const std::unique_ptr<png_image, Free> png(new png_image{});
  png->version = PNG_IMAGE_VERSION;
  if (png_image_begin_read_from_file(png.get(), name.c_str()) == 0) {
    throw std::runtime_error(png->message);
  }
  sandbox::ByteWriter result;
  result.write(static_cast<int>(png->width));
  result.write(static_cast<int>(png->height));
  // Before pixels are allocated: a few bytes can state any size.
  if (static_cast<int>(png->width) != width || static_cast<int>(png->height) != height) {
    return result.take();
  }
  // Reads the codes unchanged: grey, without alpha, without conversion of the transfer function.
  png->format = PNG_FORMAT_GRAY;
  std::vector<std::byte> codes(std::size_t{png->width} * png->height);
  constexpr png_color kBlack{0, 0, 0};  // behind transparent pixels
  if (png_image_finish_read(png.get(), &kBlack, codes.data(), 0, nullptr) == 0) {
    throw std::runtime_error(png->message);
  }
  result.append(codes);
  return result.take();
}

}  // namespace

int main(int argc, char** argv) { return sandbox::decoder_main(argc, argv, answer); }
