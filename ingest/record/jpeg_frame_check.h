// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>

#include "store/archive.h"

namespace raystage::ingest {

/// Returns kStored if a JPEG from a camera can be stored and kTorn if it is incomplete or not a
/// JPEG. Returns kUnreadable if its size is not `width` x `height` pixels. Reads only the headers
/// and the end, in about a microsecond; it does not decode pixels.
store::FrameStatus check_jpeg_frame(std::span<const std::byte> jpeg, int width, int height);

}  // namespace raystage::ingest
