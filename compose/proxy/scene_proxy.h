// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "render/common/view.h"
#include "rig/rig.h"
#include "schemas/option_values.h"
#include "store/jpeg/rgb_image.h"
#include "store/take.h"
#include "store/timeline.h"

namespace raystage::compose {

struct ProxyPoint {
  Eigen::Vector3f position;             ///< world, from the origin of its cloud, metres
  std::array<std::uint8_t, 3> color{};  ///< sRGB codes
};

struct PointCloud {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();  ///< world, metres
  std::vector<ProxyPoint> points;
};

/// A mesh with a texture. Texture coordinates: (0, 0) is the upper left, (1, 1) the lower right.
struct ProxyMesh {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();  ///< world, metres
  std::vector<Eigen::Vector3f> positions;            ///< world, from `origin`, metres
  std::vector<Eigen::Vector2f> texture_coordinates;
  std::vector<std::array<std::uint32_t, 3>> triangles;  ///< counter-clockwise from outside
  store::RgbImage texture;                              ///< sRGB codes
};

struct SceneProxyOptions {
  std::string method = "depth";  ///< one that gives depths of surfaces
  schemas::OptionValues options = {};
  int tick = 0;                      ///< index into the timeline
  int width = 640;                   ///< of the views, pixels; at most that of the cameras
  int views = 5;                     ///< of point clouds, at positions of cameras
  std::size_t max_points = 500'000;  ///< of point clouds
  std::size_t memory_bytes = std::size_t{2} << 30;
  std::filesystem::path cache_folder = {};  ///< as render::RendererOptions
  /// Called with values that rise from 0 to 1.
  std::function<void(double)> progress = [](double) {};
  /// Called with the ids of cameras, sorted, that are absent because their stored frames are not as
  /// they were recorded (XXH3); not called if there are none.
  std::function<void(const std::vector<std::string>&)> on_rotten_cameras =
      [](const std::vector<std::string>&) {};
  bool is_valid(std::string* reason) const;
};

/// Returns the origin for the positions of a rig's scene: that of the world or, if the array is
/// more than 1 km from it, where floats would be coarse, the array's centre in whole metres, which
/// programs that compute in float keep.
Eigen::Vector3d proxy_origin(const rig::Rig& rig);

/// Returns the points of a view where its depth is that of a surface: at least two of the four
/// neighbours of a pixel have a similar depth. `view`: of `camera`, without distortion. `origin`:
/// of the positions, world, metres.
std::vector<ProxyPoint> points_of_view(const render::RenderedView& view,
                                       const render::VirtualCamera& camera,
                                       const Eigen::Vector3d& origin);
/// Returns one point for each occupied cell of a grid, the first one, for the finest grid of at
/// most `max_points` cells: cells of `cell_m` metres, or that times a power of two.
std::vector<ProxyPoint> thin_out(const std::vector<ProxyPoint>& points, double cell_m,
                                 std::size_t max_points);
/// Returns the surface of a view: a grid with a vertex per pixel, cut where depth jumps. `origin`:
/// of the positions, world, metres.
ProxyMesh mesh_of_view(const render::RenderedView& view, const render::VirtualCamera& camera,
                       const Eigen::Vector3d& origin);

/// Returns the scene at a tick as points that several cameras of the array see. Throws Error (bad
/// input) if the tick does not exist, or if the method cannot be used.
PointCloud make_point_cloud(const store::Take& take, const store::Timeline& timeline,
                            const SceneProxyOptions& options);
/// Returns the scene at a tick as the surface that the middle of the array sees. Throws likewise.
ProxyMesh make_proxy_mesh(const store::Take& take, const store::Timeline& timeline,
                          const SceneProxyOptions& options);

}  // namespace raystage::compose
