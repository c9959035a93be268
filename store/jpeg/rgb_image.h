// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "base/image.h"

namespace raystage::store {

/// An 8-bit RGB image, top left first. The codes are in the file's colour space (usually sRGB).
using RgbImage = Image<std::uint8_t, 3>;

}  // namespace raystage::store
