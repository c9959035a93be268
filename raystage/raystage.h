// SPDX-License-Identifier: Apache-2.0
// The public C++ interface: open a take, read frames, render views, sample rays. It is small on
// purpose; no other header is public.
//
// World: right-handed, metres, y up. Cameras look along -z. Images: row-major from the top-left
// corner, y down, pixel centres at +0.5. Times: seconds since the first tick of the take.
//
// Functions throw std::invalid_argument for bad input and std::runtime_error if the machine fails
// (disk, memory). The message states what happened, where, and what to do.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <variant>
#include <vector>

#define RAYSTAGE_API __attribute__((visibility("default")))

namespace raystage {

/// A pinhole camera: one of the array, or a virtual one. The defaults look along -z at the origin.
struct PinholeCamera {
  std::string id;             ///< of a camera of the array; not used for virtual cameras
  int width = 0, height = 0;  ///< pixels
  double fx = 0, fy = 0;      ///< focal lengths, pixels
  double cx = 0, cy = 0;      ///< principal point, pixels from the top-left corner
  /// Row-major, for column vectors: rotation and, in the last column, the position in metres.
  std::array<double, 16> world_from_camera{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
};

/// Returns a camera with square pixels and a centred principal point. `horizontal_fov`: full angle
/// in radians, between 0 and pi.
RAYSTAGE_API PinholeCamera make_virtual_camera(int width, int height, double horizontal_fov,
                                               const std::array<double, 16>& world_from_camera);

/// A recorded frame: R, G, B, 8 bits each, in the take's colour space.
struct RecordedFrame {
  int width = 0, height = 0;
  double time = 0;  ///< seconds since the first tick
  std::vector<std::uint8_t> rgb;
};

/// How rays are reconstructed.
struct Reconstruction {
  std::string method = "focal_plane";  ///< as in a shot, e.g. "depth"; see reconstruction_methods()
  /// Distance of the focal plane in front of the array, metres; infinity by default.
  double focal_depth = std::numeric_limits<double>::infinity();
  /// Options of the method by name, e.g. {"near", 2.0}.
  std::map<std::string, std::variant<bool, double, std::string>> options;
  bool fill_holes = false;  ///< by push-pull; filled pixels keep their coverage below 1
};

/// A rendered view.
struct ReconstructedView {
  int width = 0, height = 0;
  std::vector<float> rgba;  ///< scene-linear Rec.709, premultiplied; A is 0 where no camera saw it
  std::vector<float> coverage;  ///< per pixel, 0 to 1: share of the blending weights that saw it
  std::vector<float> depth;  ///< per pixel, along the view's axis, metres; infinity where unknown
  std::vector<std::string> notes;  ///< for the user, e.g. that the view exceeds the resolution
  /// Indices in LightField::cameras() of cameras that are absent from this view, because their
  /// stored frames are not as they were recorded (XXH3). Repair the take (raystage repair).
  std::vector<int> rotten_cameras;
};

/// A ray in the world.
struct LightRay {
  std::array<double, 3> origin{};     ///< metres
  std::array<double, 3> direction{};  ///< of any length but 0
};

/// The light along a ray.
struct LightRaySample {
  std::array<float, 4> rgba{};  ///< as in ReconstructedView
  float coverage = 0;           ///< as in ReconstructedView
  float depth = 0;              ///< along the ray, metres; infinity where A is 0
};

/// Limits of a light field.
struct LightFieldOptions {
  std::size_t cache_bytes = std::size_t{1} << 30;  ///< for decoded frames in memory
  /// Folder for depth maps that `depth` stores; empty: the take's own folder.
  std::filesystem::path cache_folder;
};

/// A recorded light field (a synchronised take). Const members are thread-safe; each uses the
/// threads of the TBB arena in which it is called. Opening the first one installs a handler of
/// SIGBUS, for files that another program truncates; it passes on signals of other addresses to the
/// handler that was there before.
class RAYSTAGE_API LightField {
 public:
  /// Opens a take. Throws std::invalid_argument if the folder is not a take, or was not
  /// synchronised (raystage sync).
  explicit LightField(const std::filesystem::path& take, const LightFieldOptions& settings = {});
  ~LightField();
  LightField(LightField&&) noexcept;
  LightField& operator=(LightField&&) noexcept;

  /// Returns the cameras of the array, without their lens distortion.
  const std::vector<PinholeCamera>& cameras() const;
  /// Returns the number of ticks: instants at which the array recorded.
  int tick_count() const;
  /// Returns the rate of the ticks, per second.
  double tick_rate() const;

  /// Returns the frame that a camera recorded at a tick; its `rgb` is empty if there is none.
  /// Throws std::invalid_argument, which names the camera and the frame, if its stored bytes are
  /// not as they were recorded (XXH3), or are damaged.
  RecordedFrame read_frame(int camera, int tick) const;

  /// Renders the view of a virtual camera at a tick. See ReconstructedView::rotten_cameras.
  ReconstructedView render(const PinholeCamera& view, int tick,
                           const Reconstruction& reconstruction) const;

  /// Samples any rays at a tick, e.g. those of a ray tracer. Rays that are adjacent in the span
  /// should be adjacent in space.
  std::vector<LightRaySample> sample(std::span<const LightRay> rays, int tick,
                                     const Reconstruction& reconstruction) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Returns the names of the reconstruction methods.
RAYSTAGE_API std::vector<std::string> reconstruction_methods();

}  // namespace raystage
