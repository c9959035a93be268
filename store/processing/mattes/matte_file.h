// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "store/take.h"

namespace raystage {

/// TAKE/mattes/CAMERA/FRAME.png, see docs/formats/mattes.md. `frame`: index into the camera's
/// archive.
std::filesystem::path matte_file(const Take& take, int camera, int frame);

/// Its codes, a byte a pixel. Throws Error (bad input) for a file that is no PNG or not of this
/// size.
std::vector<std::uint8_t> read_matte_codes(const std::filesystem::path& file, int width,
                                           int height);

}  // namespace raystage
