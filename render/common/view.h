// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "rig/camera_model.h"
#include "rig/pose.h"
#include "schemas/geometry.h"

namespace raystage {

/// The camera that was never on the set. Pixel centres at +0.5, y down; looks down -z.
struct VirtualCamera {
  int width = 0, height = 0;  ///< pixels
  Intrinsics intrinsics;      ///< distortion is honoured, at the per-ray reference's speed
  Pose pose;
};

/// `geometry` as views.json and rig.json hold it.
VirtualCamera virtual_camera_from_geometry(const CameraGeometry& geometry);
/// Square pixels, principal point in the middle. `horizontal_fov`: full angle, radians, (0, pi).
VirtualCamera virtual_camera_with_fov(int width, int height, double horizontal_fov,
                                      const Pose& pose);

/// The camera without distortion, at a camera's place: the camera itself unless its lens distorts;
/// else one of the same focal length whose image holds all that the frame shows, up to twice the
/// frame's width and height.
VirtualCamera undistorted(const CameraModel& model, const Pose& pose);

/// What rendering a view took.
struct RenderStatistics {
  double plan_ms = 0;               ///< geometry, and finding the source pixels that contribute
  double decode_ms = 0;             ///< wall-clock time in which frames were decoded
  double render_ms = 0;             ///< wall-clock time of the sampling
  std::int64_t pixels_decoded = 0;  ///< entropy-decoded source pixels, all cameras
  std::int64_t pixels_needed =
      0;                 ///< distinct source pixels with a weight; only counted on request
  int cameras_used = 0;  ///< that contribute to some pixel
  /// Working buffers held at once, as the method reckons, beside the view, decoded frames and what
  /// is kept for other views; with those that took what was found for this instant now. 0 where it
  /// works in little: a few bytes a row of the view.
  std::size_t working_bytes = 0;
  /// Pixels of the cameras, along one axis, that a pixel of the view covers; 0 where none is seen.
  double source_pixels_per_pixel = 0;
  int supersampling = 1;  ///< samples of the view's pixels along each axis, averaged
};

/// std::allocator, but that values of a vector grown without saying what they are stay unset: to
/// write a view's 15 MB of zeros takes as long as to render it.
template <class T>
struct DefaultInitAllocator : std::allocator<T> {
  template <class U>
  struct rebind {
    using other = DefaultInitAllocator<U>;
  };
  template <class U, class... Arguments>
  void construct(U* at, Arguments&&... arguments) {
    if constexpr (sizeof...(Arguments) == 0) {
      ::new (static_cast<void*>(at)) U;
    } else {
      ::new (static_cast<void*>(at)) U(std::forward<Arguments>(arguments)...);
    }
  }
};
using PixelValues = std::vector<float, DefaultInitAllocator<float>>;

/// A reconstructed view, row-major from the top left.
struct RenderedView {
  int width = 0, height = 0;
  /// R, G, B, A: scene-linear Rec.709 primaries, premultiplied. A = sum of the weights of the
  /// cameras that saw the ray (1 where all did, 0 where none); with `plane_sweep` and `depth`,
  /// whose cameras stand in for each other, ten times that and 1 at most.
  PixelValues rgba;
  /// As A, but against the whole rig: below 1 also where a camera that belongs here has no frame at
  /// this instant and others stood in for it.
  PixelValues coverage;
  /// Planar depth along the view's axis, metres, of the surface the rays were looked up on;
  /// +infinity where A is 0.
  PixelValues z;
  /// On request, else empty: how many cameras of equal weight would be as many as those behind a
  /// pixel, (sum w)^2 / sum w^2; 0 where there are none.
  PixelValues cameras;
  /// On request, else empty: metres, least distance from the pixel's ray (a whole line) to the
  /// centre of a camera that contributes; +infinity where none does.
  PixelValues nearest_ray;
  /// On request, else empty: how much of what the cameras about a pixel's ray see agrees with it, 0
  /// to 1; see measure_confidence().
  PixelValues confidence;
  /// Where a method knows of rays that meet nothing at all, else empty: the part of a pixel's rays
  /// that are such, 0 to 1. The others that are missing from A were seen by nobody.
  PixelValues empty_space;
  RenderStatistics statistics;
  /// What people should know about how it was made, a line each, the same for every frame of a
  /// shot.
  std::vector<std::string> notes;
};

/// RGBA, coverage and depth, which every RenderedView has, bytes.
std::size_t view_buffer_bytes(const VirtualCamera& view);
/// An image of the view's size in which no camera saw a ray.
RenderedView empty_view(const VirtualCamera& view);
/// An image of the view's size for who writes every pixel of it. `rgba`: its memory, with what it
/// holds; empty: new memory.
RenderedView uninitialised_view(const VirtualCamera& view, PixelValues rgba = {});
/// R, G, B, A values of a view.
std::size_t view_value_count(const VirtualCamera& view);

}  // namespace raystage
