// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "store/take.h"

namespace raystage::store {

/// Returns the path TAKE/mattes/CAMERA/FRAME.png (docs/formats/mattes.md). `frame`: index into the
/// camera's archive.
std::filesystem::path matte_file_path(const Take& take, int camera, int frame);

/// Returns the codes of a matte file, one byte per pixel. Throws Error (bad input) if the file is
/// not a PNG of this size.
std::vector<std::uint8_t> read_matte_png(const std::filesystem::path& file, int width, int height);

}  // namespace raystage::store
