// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "ingest/sources/frame_source.h"
#include "schemas/record_config.h"

namespace raystage {

/// Frames of a GigE Vision or USB3 Vision camera through Aravis. The device's frame ids become
/// `sequence`, counting on where 16-bit ids wrap. Frames with missing packets are torn, with what
/// came of them (a torn frame that comes after later ones is left out: the gap has told of it).
/// Mono8, RGB8 and BGR8 are handed out in the driver's own buffers, which go back to it when the
/// picture is let go; where half of them are out, pictures are copied. Bayer patterns and YUV are
/// converted. Mono 10 to 16 lose their lower bits.
///
/// Throws Error: bad input where the device does not take a setting, failed where it is not there
/// or not ours to control.
std::unique_ptr<FrameSource> open_aravis_source(const RecordConfig::AravisSource& source);

}  // namespace raystage
