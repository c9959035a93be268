// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "ingest/sources/frame_source.h"
#include "schemas/record_config.h"

namespace raystage::ingest {

/// Opens a GigE Vision or USB3 Vision camera through Aravis. `sequence` is the device's frame id,
/// continued where 16-bit ids wrap. Frames with missing packets are torn and contain the data that
/// arrived. A torn frame that comes after later ones is skipped: the gap in `sequence` shows it.
/// Mono8, RGB8 and BGR8 frames use the driver's buffers, which return to the driver when a frame is
/// released. While more than half of the buffers are in use, frames are copied. Bayer patterns and
/// YUV are converted. Mono 10 to 16 lose their lower bits. Throws Error (bad input) if the device
/// rejects a setting, Error (failed) if it is not found or another program controls it.
std::unique_ptr<FrameSource> open_aravis_source(const schemas::RecordConfig::AravisSource& source);

}  // namespace raystage::ingest
