// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "store/processing/motion/frame_interpolation.h"
#include "store/take.h"

namespace raystage::store {

/// A decoded frame of a camera.
struct MovableFrame {
  FlowImage image;                         ///< of a picture of more than 8 bits only the luma
  std::vector<std::uint16_t> levels = {};  ///< of such a picture: R, G, B, A per pixel
};

/// The form in which the frames of a camera are stored: JPEG, or pictures of more than 8 bits.
class FrameForm {
 public:
  virtual ~FrameForm() = default;
  /// Returns the bytes of a frame as the retimed take stores it unchanged. Throws as
  /// ArchiveReader::jpeg().
  virtual FrameBytes unchanged(int frame) const = 0;
  /// Decodes a frame. Throws likewise.
  virtual MovableFrame read(int frame) = 0;
  /// Returns the encoded mean of two frames of one size; `part` is the weight of the second one.
  virtual std::vector<std::byte> blend(const MovableFrame& a, const MovableFrame& b,
                                       double part) const = 0;
  /// Returns the encoded frame between two frames of one size, see interpolate_frame().
  virtual std::vector<std::byte> interpolate(const MovableFrame& a, const MovableFrame& b,
                                             const std::array<FlowField, 2>& motion,
                                             const InstantBetween& instant) const = 0;
};

/// Returns the form of a camera's frames. `name`: of the camera, for errors. `quality`: of JPEGs.
/// `take` must outlive it. Not thread-safe.
std::unique_ptr<FrameForm> frame_form_of(const Take& take, int camera, std::string name,
                                         int quality);

}  // namespace raystage::store
