// SPDX-License-Identifier: Apache-2.0
// Derives points or a mesh from views that are reconstructed at positions of cameras, with their
// planar depth z: a pixel (u, v) is the point ((u - cx) z / fx, -(v - cy) z / fy, -z) of its
// camera. Pixels at depth discontinuities are dropped, because reconstruction blends there. Input:
// a light field frame. Output: world coordinates, metres. Cost: the views, then linear in pixels.
#include "compose/proxy/scene_proxy.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <span>
#include <string>
#include <tuple>
#include <unordered_set>

#include "base/error.h"
#include "base/transfer_function.h"
#include "render/renderer.h"

namespace raystage::compose {
namespace {

using Eigen::Vector3d;

/// Depths of one surface: the larger is at most this times the smaller, from pixel to pixel.
constexpr float kSameSurface = 1.08F;
constexpr float kLeastAlpha = 0.5F;

/// The depths of a view's surfaces; 0 where there is none.
class SurfaceDepths {
 public:
  explicit SurfaceDepths(const render::RenderedView& view) : view_(view) {}

  float at(int x, int y) const {
    if (x < 0 || y < 0 || x >= view_.width || y >= view_.height) return 0;
    const std::size_t i = view_.index(x, y);
    const bool is_seen = view_.rgba[4 * i + 3] >= kLeastAlpha && std::isfinite(view_.z[i]);
    return is_seen ? std::max(view_.z[i], 0.0F) : 0.0F;
  }
  static bool are_of_one_surface(float a, float b) {
    return a > 0 && b > 0 && std::max(a, b) <= kSameSurface * std::min(a, b);
  }
  bool is_surface(int x, int y) const {
    const float z = at(x, y);
    constexpr int kLeastNeighbours = 2;
    int neighbours = 0;
    for (const auto& [dx, dy] : {std::pair{-1, 0}, {1, 0}, {0, -1}, {0, 1}}) {
      neighbours += are_of_one_surface(z, at(x + dx, y + dy)) ? 1 : 0;
    }
    return neighbours >= kLeastNeighbours;
  }

 private:
  const render::RenderedView& view_;
};

Eigen::Vector3f world_point(const render::VirtualCamera& camera, int x, int y, float z,
                            const Vector3d& origin) {
  const schemas::Intrinsics& k = camera.intrinsics;
  const Vector3d in_camera((x + 0.5 - k.cx) * z / k.fx, -(y + 0.5 - k.cy) * z / k.fy, -z);
  return (camera.pose.world_from_camera(in_camera) - origin).cast<float>();
}

/// Makes pixels at edges of depth those of the surface whose depth they have.
void keep_one_surface(render::RenderedView& view) {
  for (const render::EdgePixel& edge : view.edges) {
    const std::array<float, 4>& shown =
        view.z[edge.pixel] == edge.front_z ? edge.front : edge.behind;
    if (!(shown[3] > 0)) continue;
    for (std::size_t c = 0; c < 4; ++c) view.rgba[4 * edge.pixel + c] = shown[c] / shown[3];
  }
  view.edges.clear();
}

std::array<std::uint8_t, 3> code_of(const render::RenderedView& view, std::size_t i) {
  std::array<std::uint8_t, 3> code{};
  const float alpha = std::max(view.rgba[4 * i + 3], std::numeric_limits<float>::min());
  for (std::size_t c = 0; c < 3; ++c) {
    const double light = std::clamp(view.rgba[4 * i + c] / alpha, 0.0F, 1.0F);
    code[c] = static_cast<std::uint8_t>(255 * srgb_from_linear(light) + 0.5);
  }
  return code;
}

/// Returns the indices of `count` cameras: the one nearest to the middle of the array, then always
/// the one that is farthest from those before it.
std::vector<int> spread_cameras(const rig::Rig& rig, int count) {
  const Vector3d centre = rig.centre();
  std::vector<double> distance;
  for (const rig::Rig::Camera& camera : rig.cameras) {
    distance.push_back((camera.pose.position - centre).norm());
  }
  std::vector<int> chosen{static_cast<int>(std::ranges::min_element(distance) - distance.begin())};
  std::ranges::fill(distance, std::numeric_limits<double>::infinity());
  while (static_cast<int>(chosen.size()) <
         std::min<int>(count, static_cast<int>(distance.size()))) {
    const Vector3d& last = rig.cameras[chosen.back()].pose.position;
    for (std::size_t i = 0; i < distance.size(); ++i) {
      distance[i] = std::min(distance[i], (rig.cameras[i].pose.position - last).norm());
    }
    chosen.push_back(static_cast<int>(std::ranges::max_element(distance) - distance.begin()));
  }
  return chosen;
}

/// Returns the view of a real camera without distortion, at most `width` pixels wide.
render::VirtualCamera view_at(const rig::Rig::Camera& camera, int width) {
  render::VirtualCamera view = render::undistorted(camera.model, camera.pose);
  const double scale = std::min(1.0, static_cast<double>(width) / view.width);
  schemas::Intrinsics& k = view.intrinsics;
  const auto scaled = [](int pixels, double by) {
    return std::max(1, static_cast<int>(std::lround(pixels * by)));
  };
  const int scaled_width = scaled(view.width, scale), scaled_height = scaled(view.height, scale);
  const double x = static_cast<double>(scaled_width) / view.width,
               y = static_cast<double>(scaled_height) / view.height;
  k.fx *= x;
  k.cx *= x;
  k.fy *= y;
  k.cy *= y;
  view.width = scaled_width;
  view.height = scaled_height;
  return view;
}

/// Renders views of a take at a tick.
class ProxyViews {
 public:
  ProxyViews(const store::Take& take, const store::Timeline& timeline,
             const SceneProxyOptions& options)
      : take_(take), renderer_(take, renderer_options(timeline, options)) {
    std::string reason;
    if (!options.is_valid(&reason)) {
      throw Error::bad_input(reason, take.folder().string(), "Correct the options");
    }
    if (options.tick < 0 || options.tick >= static_cast<int>(timeline.ticks.size())) {
      throw Error::bad_input(fmt::format("the take has no tick {}, only 0 to {}", options.tick,
                                         timeline.ticks.size() - 1),
                             take.folder().string(), "Choose another time");
    }
    tick_ = &timeline.ticks[options.tick];
    how_.method = options.method;
    how_.options = options.options;
  }

  render::RenderedView render(const render::VirtualCamera& view) {
    render::RenderedView rendered = renderer_.render(view, *tick_, how_);
    keep_one_surface(rendered);
    for (const int camera : rendered.rotten_cameras) {
      rotten_cameras_.insert(take_.document().cameras[camera].id);
    }
    return rendered;
  }
  void report_rotten_cameras(const SceneProxyOptions& options) const {
    if (rotten_cameras_.empty()) return;
    options.on_rotten_cameras({rotten_cameras_.begin(), rotten_cameras_.end()});
  }

 private:
  static render::RendererOptions renderer_options(const store::Timeline& timeline,
                                                  const SceneProxyOptions& options) {
    render::RendererOptions result;
    result.cache_bytes = result.working_bytes = options.memory_bytes / 3;
    result.result_cache_bytes = options.memory_bytes / 3;
    result.ticks = timeline.ticks;
    result.cache_folder = options.cache_folder;
    return result;
  }

  const store::Take& take_;
  render::LightFieldRenderer renderer_;
  const store::FrameSelection* tick_ = nullptr;
  render::ReconstructionOptions how_;
  std::set<std::string> rotten_cameras_;
};

struct CellHash {
  std::size_t operator()(const Eigen::Vector3i& cell) const {
    // Teschner et al., "Optimized spatial hashing for collision detection", 2003.
    return static_cast<std::size_t>(cell.x()) * 73856093U ^
           static_cast<std::size_t>(cell.y()) * 19349663U ^
           static_cast<std::size_t>(cell.z()) * 83492791U;
  }
};

}  // namespace

bool SceneProxyOptions::is_valid(std::string* reason) const {
  const auto fail = [&](const char* why) {
    *reason = why;
    return false;
  };
  if (width < 16 || width > 16384) return fail("the width of the views is not 16 to 16384 pixels");
  if (views < 1 || views > 1000) return fail("the number of views is not 1 to 1000");
  if (max_points < 1) return fail("the number of points is not above 0");
  return true;
}

Vector3d proxy_origin(const rig::Rig& rig) {
  constexpr double kNear = 1000;  // metres; floats are exact to 0.03 mm there
  const Vector3d centre = rig.centre();
  return centre.norm() > kNear ? Vector3d(centre.array().round()) : Vector3d(Vector3d::Zero());
}

std::vector<ProxyPoint> points_of_view(const render::RenderedView& view,
                                       const render::VirtualCamera& camera,
                                       const Vector3d& origin) {
  const SurfaceDepths depths(view);
  std::vector<ProxyPoint> points;
  for (int y = 0; y < view.height; ++y) {
    for (int x = 0; x < view.width; ++x) {
      if (!depths.is_surface(x, y)) continue;
      points.push_back(
          {world_point(camera, x, y, depths.at(x, y), origin), code_of(view, view.index(x, y))});
    }
  }
  return points;
}

std::vector<ProxyPoint> thin_out(const std::vector<ProxyPoint>& points, double cell_m,
                                 std::size_t max_points) {
  for (double cell = cell_m;; cell *= 2) {
    std::unordered_set<Eigen::Vector3i, CellHash> occupied;
    std::vector<ProxyPoint> kept;
    for (const ProxyPoint& point : points) {
      constexpr double kLimit = 1e9;  // far points share the outermost cells
      const Eigen::Vector3d scaled =
          (point.position.cast<double>() / cell).array().floor().max(-kLimit).min(kLimit);
      if (!occupied.insert(scaled.cast<int>()).second) continue;
      if (kept.size() == max_points) {
        kept.clear();
        break;
      }
      kept.push_back(point);
    }
    if (!kept.empty() || points.empty()) return kept;
  }
}

ProxyMesh mesh_of_view(const render::RenderedView& view, const render::VirtualCamera& camera,
                       const Vector3d& origin) {
  const SurfaceDepths depths(view);
  ProxyMesh mesh;
  mesh.origin = origin;
  mesh.texture = store::RgbImage(view.width, view.height);
  constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();
  std::vector<std::uint32_t> vertex(static_cast<std::size_t>(view.width) * view.height, kNone);
  for (int y = 0; y < view.height; ++y) {
    for (int x = 0; x < view.width; ++x) {
      const std::size_t i = view.index(x, y);
      std::ranges::copy(code_of(view, i), mesh.texture.row(y).begin() + 3 * x);
      if (!depths.is_surface(x, y)) continue;
      vertex[i] = static_cast<std::uint32_t>(mesh.positions.size());
      mesh.positions.push_back(world_point(camera, x, y, depths.at(x, y), origin));
      mesh.texture_coordinates.emplace_back((x + 0.5F) / view.width, (y + 0.5F) / view.height);
    }
  }
  const auto add = [&](std::array<std::array<int, 2>, 3> corners) {
    std::array<std::uint32_t, 3> triangle{};
    for (std::size_t k = 0; k < 3; ++k) {
      const auto [x, y] = corners[k];
      const auto [next_x, next_y] = corners[(k + 1) % 3];
      triangle[k] = vertex[view.index(x, y)];
      if (triangle[k] == kNone ||
          !SurfaceDepths::are_of_one_surface(depths.at(x, y), depths.at(next_x, next_y))) {
        return;
      }
    }
    mesh.triangles.push_back(triangle);
  };
  for (int y = 0; y + 1 < view.height; ++y) {
    for (int x = 0; x + 1 < view.width; ++x) {
      add({{{x, y}, {x, y + 1}, {x + 1, y}}});
      add({{{x + 1, y}, {x, y + 1}, {x + 1, y + 1}}});
    }
  }
  return mesh;
}

PointCloud make_point_cloud(const store::Take& take, const store::Timeline& timeline,
                            const SceneProxyOptions& options) {
  ProxyViews views(take, timeline, options);
  const Vector3d origin = proxy_origin(take.rig());
  std::vector<ProxyPoint> points;
  double cell = std::numeric_limits<double>::infinity();
  const std::vector<int> cameras = spread_cameras(take.rig(), options.views);
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    options.progress(static_cast<double>(i) / cameras.size());
    const render::VirtualCamera camera = view_at(take.rig().cameras[cameras[i]], options.width);
    const std::vector<ProxyPoint> added = points_of_view(views.render(camera), camera, origin);
    for (const ProxyPoint& point : added) {
      const Vector3d in_world = origin + point.position.cast<double>();
      const double z = -camera.pose.camera_from_world(in_world).z();
      cell = std::min(cell, z / camera.intrinsics.fx);  // a pixel of the nearest surface
    }
    points.insert(points.end(), added.begin(), added.end());
  }
  options.progress(1);
  views.report_rotten_cameras(options);
  return {origin, thin_out(points, std::isfinite(cell) && cell > 0 ? cell : 1, options.max_points)};
}

ProxyMesh make_proxy_mesh(const store::Take& take, const store::Timeline& timeline,
                          const SceneProxyOptions& options) {
  ProxyViews views(take, timeline, options);
  const int middle = spread_cameras(take.rig(), 1).front();
  const render::VirtualCamera camera = view_at(take.rig().cameras[middle], options.width);
  options.progress(0);
  ProxyMesh mesh = mesh_of_view(views.render(camera), camera, proxy_origin(take.rig()));
  options.progress(1);
  views.report_rotten_cameras(options);
  return mesh;
}

}  // namespace raystage::compose
