// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "sandbox/decoder_process.h"

namespace raystage::sandbox {

/// Returns the most memory that a decoder is granted where a document of a stranger states the size
/// of pictures, bytes: half of this machine's, or of its control group's limit.
std::size_t most_decoder_memory();

/// Returns options whose memory and largest result are at most most_decoder_memory(). Errors then
/// name what the size of the picture would have allowed, too.
DecoderOptions within_machine(DecoderOptions options);

}  // namespace raystage::sandbox
