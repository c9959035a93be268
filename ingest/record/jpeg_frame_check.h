// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>

#include "store/archive.h"

namespace raystage {

/// Whether a JPEG that a camera delivered can be stored: kStored, kTorn (cut short, or no JPEG at
/// all) or kUnreadable (another size than `width` x `height`). Looks at the headers and the end
/// only, a microsecond: `raystage verify --decode` looks at every pixel.
FrameStatus check_jpeg_frame(std::span<const std::byte> jpeg, int width, int height);

}  // namespace raystage
