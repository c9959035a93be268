// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "store/jpeg/decode.h"
#include "store/jpeg/layout.h"
#include "store/processing/frames/blend_space.h"
#include "store/processing/frames/frame_matte.h"
#include "store/processing/frames/interpolated_frames.h"
#include "store/take.h"

namespace raystage::store {

/// A decoded frame of one camera after photometric correction, whole or in part.
struct DecodedFrame {
  int width = 0, height = 0;  ///< pixels; rows without padding
  /// R, G, B, A per pixel, premultiplied; A = 65535 without a matte. Code 65535 represents
  /// FrameCache::full_scale(). One row and one pixel of padding follow, so that bilinear
  /// interpolation at the last pixel may read its right and lower neighbours (with weight 0).
  /// Pixels outside decoded MCUs are undefined.
  std::unique_ptr<std::uint16_t[]> rgba;
  McuMask decoded;        ///< empty: all MCUs
  std::size_t bytes = 0;  ///< of memory
};

/// The cost of decoding, summed over all threads.
struct DecodeCosts {
  double seconds = 0;           ///< of processor time
  std::int64_t jpeg_bytes = 0;  ///< of decoded frames; a frame counts each time it is decoded
  DecodeCosts& operator+=(const DecodeCosts& other) {
    seconds += other.seconds;
    jpeg_bytes += other.jpeg_bytes;
    return *this;
  }
};

/// A cache of the decoded frames of a take, within a memory budget; the least recently used frames
/// are evicted first. Interpolated frames are computed whole from decoded ones, along optical flow.
/// An eighth of the budget is for buffers that wait for reuse, and up to an eighth for the JPEGs of
/// packed frames. A second fetch of a frame that needs
/// more MCUs decodes all of it, since more fetches are likely. Within one fetch group only the
/// missing MCUs are added. Thread-safe; concurrent fetches decode a frame once.
class FrameCache {
 public:
  /// Identifies fetches that belong together, for example those of the bands of one view.
  using FetchGroup = std::uint64_t;
  static constexpr FetchGroup kUngrouped = 0;  ///< each fetch is a group of its own

  /// Makes an empty cache. `matte`: gives the frames their alpha; null: all pixels are opaque.
  /// `interpolated`: knows the interpolated frames, also for other caches; null: there are none.
  FrameCache(const Take& take, std::size_t budget_bytes, BlendSpace space,
             std::shared_ptr<const FrameMatte> matte = nullptr,
             std::shared_ptr<const InterpolatedFrames> interpolated = nullptr);
  /// Returns a cache of white frames in the cameras' sizes, whose samples are the blending weights
  /// alone. Reads no archive.
  static FrameCache white(const Take& take, BlendSpace space);
  /// Returns this cache with other numbers of cameras: `camera` i is camera `cameras[i]` of the
  /// take. Both share their frames and memory.
  FrameCache renumbered(std::vector<int> cameras) const;
  FrameCache(FrameCache&&) noexcept;
  ~FrameCache();

  /// Returns the sources of an interpolated frame; nullopt: it is a frame of the archive.
  std::optional<InterpolatedFrames::Sources> sources_of(int frame) const;

  /// Returns the JPEG layout of a frame; of an interpolated one that of a picture which can only be
  /// decoded whole. Throws Error (bad input) if the frame is damaged or does
  /// not have the camera's size.
  std::shared_ptr<const JpegLayout> layout(int camera, int frame);

  /// Returns a group that differs from all others.
  FetchGroup new_fetch_group();

  /// Returns the frame with at least the `wanted` MCUs decoded, or all of it if `wanted` is empty.
  /// JpegDecoder::decode_region states what holds at the borders of MCUs. Frames of more than 8
  /// bits are decoded whole. A partly decoded frame of the same group gains the missing MCUs.
  /// Without restart markers, where that costs as much, it is decoded whole. Adds the number of
  /// entropy-decoded pixels to `pixels_decoded`.
  std::shared_ptr<const DecodedFrame> fetch(int camera, int frame, const McuMask& wanted,
                                            std::int64_t& pixels_decoded,
                                            FetchGroup look = kUngrouped);

  /// Returns whether all of a frame is in memory, so that fetching any part costs nothing.
  bool is_fully_decoded(int camera, int frame);

  /// Starts reading a frame's bytes from disk in the background, unless the frame is in memory or
  /// among the camera's latest requests. Requests of a camera wait until its first fetch, so
  /// cameras that a shot does not need cost nothing.
  void read_ahead(int camera, int frame);

  /// Returns the scale of the codes: the one that was asked for, or kHighRange.
  BlendSpace blend_space() const;
  /// Returns whether frames may be transparent.
  bool has_matte() const;
  /// Returns the linear light of code 65535: 1, or more if a camera's photometric correction raises
  /// its white above 1.
  double full_scale() const;
  CodeScale scale() const;  ///< blend_space() and full_scale()
  std::size_t bytes_held() const;
  /// Returns the number of frames that read_ahead() has requested from disk.
  int frames_read_ahead() const;
  DecodeCosts decode_costs() const;

 private:
  struct State;
  explicit FrameCache(std::shared_ptr<State> state) : state_(std::move(state)) {}
  int camera_of_take(int camera) const { return cameras_.empty() ? camera : cameras_[camera]; }

  std::shared_ptr<State> state_;
  std::vector<int> cameras_;  ///< of renumbered(); empty: those of the take
};

}  // namespace raystage::store
