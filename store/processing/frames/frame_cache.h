// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "store/jpeg/decode.h"
#include "store/jpeg/layout.h"
#include "store/processing/frames/blend_space.h"
#include "store/processing/frames/frame_matte.h"
#include "store/take.h"

namespace raystage {

/// A camera's frame, photometrically corrected, whole or in part.
struct DecodedFrame {
  int width = 0, height = 0;  ///< pixels; rows follow each other without padding
  /// R, G, B, A per pixel, premultiplied; A = 65535 but where a matte says otherwise. Full scale
  /// 65535 stands for FrameCache::full_scale(). One row and one pixel of padding follow, so that a
  /// bilinear tap on the last pixel may read its right and lower neighbours (with weight 0). Pixels
  /// outside decoded MCUs are undefined.
  std::unique_ptr<std::uint16_t[]> rgba;
  McuMask decoded;        ///< empty: everything
  std::size_t bytes = 0;  ///< of memory held
};

/// What decoding has taken, over all threads.
struct DecodeCosts {
  double seconds = 0;           ///< of processors
  std::int64_t jpeg_bytes = 0;  ///< of the frames that were decoded, each time they were
  DecodeCosts& operator+=(const DecodeCosts& other) {
    seconds += other.seconds;
    jpeg_bytes += other.jpeg_bytes;
    return *this;
  }
};

/// Decoded frames of a take within a bound of memory, an eighth of it for memory that waits to be
/// used again, least recently used out first. A frame asked for again with more than it holds is
/// decoded whole: the second look says that it will be looked at often. Parts of one look add up.
/// Thread-safe; a frame is decoded once however many threads ask.
class FrameCache {
 public:
  /// What fetches belong to: bands of a view, say, are parts of one look.
  using Look = std::uint64_t;
  static constexpr Look kByItself = 0;  ///< each fetch is a look of its own

  /// `matte`: what shows of the frames; null: all of them.
  FrameCache(const Take& take, std::size_t budget_bytes, BlendSpace space,
             std::shared_ptr<const FrameMatte> matte = nullptr);
  /// White frames of the cameras' sizes in place of the take's: what is sampled of them are the
  /// weights alone. Reads nothing of the take's archives.
  static FrameCache white(const Take& take, BlendSpace space);
  FrameCache(FrameCache&&) noexcept;
  ~FrameCache();

  /// Throws Error (bad input) for a damaged frame or one whose size is not the camera's.
  std::shared_ptr<const JpegLayout> layout(int camera, int frame);

  /// One that no other is equal to.
  Look new_look();

  /// The frame with at least the `wanted` MCUs, all of it where `wanted` is empty (see
  /// JpegDecoder::decode_region for what that promises at their borders). What is decoded for parts
  /// of one look alone gains the MCUs that it lacks; without restart markers, where that costs as
  /// much, it is decoded whole too. Adds the pixels entropy-decoded for it to `pixels_decoded`.
  std::shared_ptr<const DecodedFrame> fetch(int camera, int frame, const McuMask& wanted,
                                            std::int64_t& pixels_decoded, Look look = kByItself);

  /// Whether all of a frame is in memory, so that any part of it costs nothing.
  bool holds_whole(int camera, int frame);

  /// Asks for a frame's bytes to be read from the disk while the caller goes on, unless the frame
  /// is held or was among the last that were asked for of its camera. Cameras of which nothing has
  /// been fetched wait until something is: those that a shot does not need cost it nothing.
  void read_ahead(int camera, int frame);

  BlendSpace blend_space() const;
  /// Whether frames may be transparent.
  bool has_matte() const;
  /// Linear light that code 65535 stands for: at least 1, more where a camera's photometric
  /// correction raises its white above 1.
  double full_scale() const;
  std::size_t bytes_held() const;
  /// Frames that read_ahead() asked for.
  int frames_read_ahead() const;
  DecodeCosts decode_costs() const;

 private:
  struct State;
  explicit FrameCache(std::shared_ptr<State> state) : state_(std::move(state)) {}
  std::shared_ptr<State> state_;
};

}  // namespace raystage
