// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "store/temporal/temporal_frame.h"

namespace raystage::store {

/// What GroupDecoder does, by FFmpeg, in the decoder's process. Throws std::runtime_error with the
/// reason. Only for decoders' programs and tests: FFmpeg reads bytes of strangers.
std::vector<std::vector<std::byte>> decode_group(VideoCodec codec, int width, int height,
                                                 std::span<const std::vector<std::byte>> frames);

}  // namespace raystage::store
