// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "store/jpeg/decode.h"
#include "store/jpeg/layout.h"
#include "store/jpeg/scan_decoder.h"

namespace raystage::store {

/// Upsamples chroma, converts YCbCr to RGB and applies `table`, for the wanted MCUs of decoded
/// planes. Codes equal those of libjpeg-turbo's full decode with smooth upsampling bit for bit.
/// `rgba_linear`: 4 values per pixel of the whole picture; pixels of other MCUs are not changed.
void convert_to_linear(const ScanDecoder& scan, const JpegLayout& layout,
                       std::span<const std::uint8_t> wanted, const LinearTable& table,
                       std::span<std::uint16_t> rgba_linear);

}  // namespace raystage::store
