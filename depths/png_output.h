// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <png.h>

namespace raystage::depths {

/// libpng's function to write, with a std::vector<std::byte> as its io pointer. No exception may
/// pass the frames of libpng, which is C: without memory this is an error of libpng.
void append_png_bytes(png_structp png, png_bytep data, png_size_t size);

}  // namespace raystage::depths
