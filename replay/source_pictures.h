// SPDX-License-Identifier: Apache-2.0
// Pictures of what the cameras recorded, as the archives store it: small, all in one, or one whole.
#pragma once

#include <string>
#include <vector>

#include "replay/picture_layout.h"
#include "store/jpeg/rgb_image.h"
#include "store/take.h"
#include "store/timeline.h"

namespace raystage::replay {

/// The source frames of one instant of a take.
struct SourceFrames {
  const store::Take& take;
  store::FrameSelection frames;
};

/// A rectangle of a mosaic that shows one camera, pixels from the top left.
struct MosaicCell {
  std::string camera_id;
  int x = 0, y = 0, width = 0, height = 0;
  bool is_absent = false;  ///< the camera has no frame at this instant, or one that is damaged
};

struct Mosaic {
  store::RgbImage picture;
  std::vector<MosaicCell> cells;  ///< one per camera of the take, in its order
};

/// Returns the cells of a take's cameras as the array is seen from behind: by their rows and
/// columns, or else in lines of about the picture's shape.
std::vector<MosaicCell> mosaic_cells(const store::Take& take, int width, int height);

/// Returns the frame of a camera at an 8th, 4th, half or all of its size. Throws Error (bad input)
/// if it is damaged, or does not have the camera's size.
store::RgbImage decode_source_frame(const SourceFrames& source, int camera, int divisor);

/// Returns all frames in one picture of this size. Frames are decoded at a fraction of their size.
/// Damaged ones are left out. Uses the current TBB arena.
Mosaic make_mosaic(const SourceFrames& source, int width, int height);

/// Returns the frame of one camera, reduced to fit into this size. Throws Error (bad input) if the
/// camera has none, or it is damaged.
store::RgbImage source_picture(const SourceFrames& source, int camera, int width, int height);

}  // namespace raystage::replay
