// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "render/common/world_ray.h"
#include "rig/camera_model.h"
#include "rig/pose.h"
#include "schemas/geometry.h"

namespace raystage::render {

/// A virtual camera: a camera that was not on the set. Pixel centres lie at +0.5, y points down;
/// the camera looks along -z.
struct VirtualCamera {
  int width = 0, height = 0;       ///< pixels
  schemas::Intrinsics intrinsics;  ///< rendered with its distortion only by the per-ray reference
  rig::Pose pose;
  /// Equirectangular cameras see all directions: longitude by latitude, -z at the centre, +x on its
  /// right, +y at the top. They have no intrinsics, and their depths are distances.
  bool is_equirectangular = false;
  /// Of an equirectangular camera: metres from the centre to the eye, to the right of each column's
  /// direction (omnidirectional stereo: Peleg et al., "Omnistereo", PAMI 23(3), 2001); 0: mono.
  double eye_offset = 0;
};

/// Returns an equirectangular camera.
VirtualCamera equirectangular_camera(int width, int height, const rig::Pose& pose,
                                     double eye_offset = 0);

/// Returns the ray through a position in pixels from the upper left corner, without distortion.
WorldRay pixel_ray(const VirtualCamera& camera, double x, double y);
/// Returns the point, world, at a depth (metres): along the optical axis, or, if equirectangular,
/// along the ray.
Eigen::Vector3d point_at_depth(const VirtualCamera& camera, double x, double y, double depth);
/// Returns the depth of the point at a distance (metres) along a ray of the camera.
double depth_of(const VirtualCamera& camera, const WorldRay& ray, double distance);
/// Returns the angle between the rays of adjacent pixels at the picture's centre, radians.
double pixel_angle(const VirtualCamera& camera);

/// Returns the virtual camera that `geometry` (as in views.json and rig.json) describes.
VirtualCamera virtual_camera_from_geometry(const schemas::CameraGeometry& geometry);
/// Returns a camera with square pixels and a centred principal point. `horizontal_fov`: full angle,
/// radians, (0, pi).
VirtualCamera virtual_camera_with_fov(int width, int height, double horizontal_fov,
                                      const rig::Pose& pose);

/// Returns a camera without distortion at the pose of a real camera. Without lens distortion it
/// equals the real camera. Otherwise it has the same focal length, and its image contains all that
/// the frame shows, up to twice the frame's width and height. Of a fisheye it has the focal length
/// of the middle of the frame; of a facet it shows all.
VirtualCamera undistorted(const rig::CameraModel& model, const rig::Pose& pose);

/// The clock of RenderStatistics.
using RenderClock = std::chrono::steady_clock;
inline double milliseconds(RenderClock::duration duration) {
  return std::chrono::duration<double, std::milli>(duration).count();
}

/// Reports the cost of rendering a view.
struct RenderStatistics {
  double plan_ms = 0;               ///< geometry, and determining the source pixels that contribute
  double decode_ms = 0;             ///< wall-clock time in which frames were decoded
  double render_ms = 0;             ///< wall-clock time of the sampling
  std::int64_t pixels_decoded = 0;  ///< entropy-decoded source pixels, all cameras
  /// Distinct source pixels with a weight; counted on request only.
  std::int64_t pixels_needed = 0;
  int cameras_used = 0;  ///< cameras that contribute to at least one pixel
  /// Bytes of working buffers held at once, as the method computes them, without the view, decoded
  /// frames and cached results. Buffers used to compute cached results of this frame are included.
  /// 0 where the method needs only a few bytes per row of the view.
  std::size_t working_bytes = 0;
  /// Source pixels per pixel of the view, along one axis; 0 where no camera sees the view.
  double source_pixels_per_pixel = 0;
  int supersampling = 1;  ///< samples per pixel of the view along each axis, averaged

  /// Adds the cost of a part of the view. Cameras and memory become the maximum; source pixels that
  /// several parts need are counted in each.
  void add_part(const RenderStatistics& part);
};

/// An allocator that leaves values uninitialised when a vector grows without given values.
/// Otherwise writing the 15 MB of zeros of a view takes as long as rendering it.
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

/// A pixel at an edge of depth, in which two surfaces are seen: the one in front covers a part of
/// the pixel. Colours are premultiplied, as RenderedView::rgba; depths are in metres.
struct EdgePixel {
  std::uint32_t pixel = 0;        ///< RenderedView::index()
  std::array<float, 4> front{};   ///< A: that of the surface times the part that it covers
  std::array<float, 4> behind{};  ///< as if the one in front were not there
  float front_z = 0, behind_z = 0;
};

/// A reconstructed view, row-major from the top left.
struct RenderedView {
  int width = 0, height = 0;
  /// R, G, B, A: scene-linear Rec.709 primaries, premultiplied. A is the sum of the weights of the
  /// cameras that saw the ray (1 where all did, 0 where none did). With `plane_sweep` and `depth`,
  /// whose cameras replace each other, A is ten times that sum, at most 1.
  PixelValues rgba;
  /// As A, but relative to the whole rig: also below 1 where a camera of the ray has no frame at
  /// this instant and other cameras replaced it.
  PixelValues coverage;
  /// Planar depth along the view's axis, in metres, of the surface on which the rays were sampled;
  /// +infinity where A is 0.
  PixelValues z;
  /// On request, otherwise empty: the effective number of cameras of a pixel, (sum w)^2 / sum w^2;
  /// 0 where no camera contributes.
  PixelValues cameras;
  /// On request, otherwise empty: the least distance in metres from the pixel's ray (a whole line)
  /// to the centre of a contributing camera; +infinity where none contributes.
  PixelValues nearest_ray;
  /// On request, otherwise empty: the confidence, 0 to 1; see measure_confidence().
  PixelValues confidence;
  /// The part of a pixel's rays that are known to meet nothing, 0 to 1; empty where the method does
  /// not determine it. No camera saw the other rays that are missing from A.
  PixelValues empty_space;
  /// The pixels of two surfaces, by increasing index, where the method tells them apart: `rgba` is
  /// the front over what is behind, and `z` that of the first one at which half of A is reached.
  std::vector<EdgePixel> edges;
  /// The cameras whose frame, or an adjacent one that the method reads, is rotten: it was left out.
  /// Only where the view would have read a rotten frame.
  std::vector<int> rotten_cameras;
  RenderStatistics statistics;
  /// Notes for the user about how the view was made, one line each, the same for every frame of a
  /// shot.
  std::vector<std::string> notes;

  /// Returns the index of a pixel's values; four times that in `rgba`.
  std::size_t index(int x, int y) const { return static_cast<std::size_t>(y) * width + x; }
};

/// Adds the notes that `to` does not contain.
void add_notes(const std::vector<std::string>& notes, std::vector<std::string>& to);
/// Returns the bytes of RGBA, coverage and depth, which every RenderedView has.
std::size_t view_buffer_bytes(const VirtualCamera& view);
/// Returns an image of the view's size in which no camera saw any ray.
RenderedView empty_view(const VirtualCamera& view);
/// Returns an image of the view's size for callers that write every pixel. `rgba`: memory to reuse,
/// with its contents; empty: memory is allocated.
RenderedView uninitialised_view(const VirtualCamera& view, PixelValues rgba = {});
/// Allocates `cameras` and `nearest_ray`, for pixels to which no camera contributes.
void clear_coverage_measures(RenderedView& image);
/// Returns the number of R, G, B and A values of a view.
std::size_t view_value_count(const VirtualCamera& view);

}  // namespace raystage::render
