// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "store/jpeg/decode.h"

namespace raystage::store {

/// Requests the memory pages of the wanted MCUs of a frame (4 values per pixel, row by row) in few
/// calls: the first access to each page would interrupt the decoder, which took longer than
/// decoding where a frame is decoded for a small window. Values do not change. `wanted`: empty: all
/// MCUs.
void request_pages(std::span<std::uint16_t> rgba, const JpegLayout& layout, const McuMask& wanted);

}  // namespace raystage::store
