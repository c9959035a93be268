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
#include "schemas/option_values.h"
#include "store/jpeg/rgb_image.h"
#include "store/take.h"
#include "store/timeline.h"

namespace raystage::compose {

struct ProxyPoint {
  Eigen::Vector3f position;             ///< world, metres
  std::array<std::uint8_t, 3> color{};  ///< sRGB codes
};

/// A mesh with a texture. Texture coordinates: (0, 0) is the upper left, (1, 1) the lower right.
struct ProxyMesh {
  std::vector<Eigen::Vector3f> positions;  ///< world, metres
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

/// Returns the points of a view where its depth is that of a surface: at least two of the four
/// neighbours of a pixel have a similar depth. `view`: of `camera`, without distortion.
std::vector<ProxyPoint> points_of_view(const render::RenderedView& view,
                                       const render::VirtualCamera& camera);
/// Returns one point for each occupied cell of a grid, the first one, for the finest grid of at
/// most `max_points` cells: cells of `cell_m` metres, or that times a power of two.
std::vector<ProxyPoint> thin_out(const std::vector<ProxyPoint>& points, double cell_m,
                                 std::size_t max_points);
/// Returns the surface of a view: a grid with a vertex per pixel, cut where depth jumps.
ProxyMesh mesh_of_view(const render::RenderedView& view, const render::VirtualCamera& camera);

/// Returns the scene at a tick as points that several cameras of the array see. Throws Error (bad
/// input) if the tick does not exist, or if the method cannot be used.
std::vector<ProxyPoint> make_point_cloud(const store::Take& take, const store::Timeline& timeline,
                                         const SceneProxyOptions& options);
/// Returns the scene at a tick as the surface that the middle of the array sees. Throws likewise.
ProxyMesh make_proxy_mesh(const store::Take& take, const store::Timeline& timeline,
                          const SceneProxyOptions& options);

}  // namespace raystage::compose
