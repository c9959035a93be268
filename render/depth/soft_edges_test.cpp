// SPDX-License-Identifier: Apache-2.0
// Pixels of method "depth" that show two surfaces, against the shares that a fine grid of rays
// meets.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "render/common/push_pull.h"
#include "render/depth/surface_pairs.h"
#include "testing/render/test_depth.h"

namespace raystage::render::soft_edges_test {
namespace {

using testing::default_view;
using testing::kBack;
using testing::kFront;
using testing::Plane;
using testing::SyntheticTake;
using testing::texture;

constexpr double kSpacing = 0.15;  // of the cameras, metres

/// Returns whether a ray meets an oblique wall on the front plane.
bool meets_wall(const Eigen::Vector3d& from, const Eigen::Vector3d& direction) {
  const Eigen::Vector3d at = from + kFront.distance(from, direction) * direction;
  return at.x() + 0.4 * at.y() < 0.1;
}
/// A bright wall before a dark one.
std::array<double, 3> oblique_scene(const Eigen::Vector3d& from, const Eigen::Vector3d& direction) {
  const bool is_wall = meets_wall(from, direction);
  const Plane& plane = is_wall ? kFront : kBack;
  const Eigen::Vector3d hit = from + plane.distance(from, direction) * direction;
  const auto coarse = texture(hit.x(), hit.y() + plane.c);
  const auto fine = testing::painted_plane(14 * hit.x() + 2, 11 * hit.y() + hit.x());
  std::array<double, 3> light;
  for (std::size_t c = 0; c < 3; ++c) {
    const double value = (coarse[c] + 2 * fine[2 - c]) / 3;
    light[c] = is_wall ? 0.4 + 0.6 * value : 0.6 * value;
  }
  return light;
}

class SoftEdges : public testing::DepthTest {
 protected:
  static SyntheticTake oblique() {
    SyntheticTake take = slanted(3, 4);
    // The planes are 4 pixels of disparity apart.
    take.cameras = testing::camera_grid(3, 4, kSpacing, 160, 120);
    take.scene = oblique_scene;
    take.samples = 4;
    take.jpeg = {95, store::JpegEncodeOptions::Chroma::k444, 0};
    return take;
  }
};

/// Returns the part of a pixel that the wall covers.
double true_share(const VirtualCamera& view, const ViewRays& rays, int x, int y) {
  constexpr int kGrid = 16;
  int hits = 0;
  for (int row = 0; row < kGrid; ++row) {
    for (int column = 0; column < kGrid; ++column) {
      const auto ray = rays.through(x + (column + 0.5) / kGrid, y + (row + 0.5) / kGrid);
      hits += meets_wall(view.pose.position, *ray) ? 1 : 0;
    }
  }
  return hits / static_cast<double>(kGrid * kGrid);
}

/// Renders with the true depths of the cameras' pixels, so that what is found of edges is that of
/// the views alone.
RenderedView render_with_true_depths(const store::Take& take, const VirtualCamera& view,
                                     bool soft_edges) {
  const auto cache = std::make_shared<ResultCache>(std::size_t{1} << 28);
  LightFieldFrame instant;
  instant.frame_of_camera.assign(take.rig().cameras.size(), 0);
  DepthEstimationOptions estimation;
  estimation.scene = *take.document().depth_range;
  cache->get<depth::NotedDepths>(
      depth::depth_cache_key(instant, estimation), [&](std::size_t& bytes) {
        auto known = std::make_shared<depth::NotedDepths>();
        CameraDepths& depths = known->depths;
        for (const rig::Rig::Camera& camera : take.rig().cameras) {
          depths.pinholes.push_back(undistorted(camera.model, camera.pose));
          const VirtualCamera& pinhole = depths.pinholes.back();
          const ViewRays rays(pinhole);
          InverseDepthMap map(pinhole.width, pinhole.height);
          for (int y = 0; y < map.height; ++y) {
            for (int x = 0; x < map.width; ++x) {
              const bool is_wall =
                  meets_wall(camera.pose.position, *rays.through(x + 0.5, y + 0.5));
              map.at(x, y) = static_cast<float>(-1 / (is_wall ? kFront : kBack).c);
            }
          }
          depths.maps.push_back(std::move(map));
          depths.inverse_depth_per_pixel = 1 / (pinhole.intrinsics.fx * kSpacing);
        }
        depths.compute_block_nearest();
        bytes = depths.bytes();
        return known;
      });
  RendererOptions options;
  options.result_cache = cache;
  options.use_take_folder = false;
  return LightFieldRenderer(take, options)
      .render(view, store::select_frames(take, 0, 30'000'000),
              {"depth", {0, 0, 0, 1}, {{"soft_edges", soft_edges}}});
}

struct EdgeErrors {
  double share = 0;  ///< mean of absolute errors at pixels of the wall's edge
  int pixels = 0;
};

EdgeErrors errors_at_edge(const RenderedView& image, const VirtualCamera& view) {
  std::vector<float> share(image.z.size());
  for (std::size_t i = 0; i < share.size(); ++i) share[i] = image.z[i] < 3.5F ? 1 : 0;
  for (const EdgePixel& edge : image.edges) share[edge.pixel] = edge.front[3];
  const ViewRays rays(view);
  EdgeErrors errors;
  for (int y = 4; y < view.height - 4; ++y) {
    for (int x = 4; x < view.width - 4; ++x) {
      const double truth = true_share(view, rays, x, y);
      if (truth == 0 || truth == 1) continue;
      const std::size_t at = image.index(x, y);
      errors.share += std::abs(truth - static_cast<double>(share[at]));
      ++errors.pixels;
    }
  }
  errors.share /= errors.pixels;
  return errors;
}

TEST_F(SoftEdges, CoverAsMuchOfAPixelAsTheSurfaceInFront) {
  const store::Take take = write(oblique());
  const VirtualCamera view = default_view();
  const RenderedView soft = render_with_true_depths(take, view, true),
                     hard = render_with_true_depths(take, view, false);
  EXPECT_TRUE(hard.edges.empty());
  EXPECT_GT(soft.edges.size(), 60U);
  const EdgeErrors of_soft = errors_at_edge(soft, view), of_hard = errors_at_edge(hard, view);
  ASSERT_GT(of_soft.pixels, 60);
  EXPECT_LT(of_soft.share, 0.6 * of_hard.share);
}

TEST_F(SoftEdges, AreThoseOfTheReference) {
  const store::Take take = write(oblique());
  RendererOptions slow;
  slow.reference = true;
  const RenderedView fast = render(take, default_view()),
                     reference = render(take, default_view(), {}, slow);
  testing::expect_equal(fast, reference);
  // Rounding may decide whether a surface counts as seen, at few pixels.
  std::size_t found = 0;
  for (const EdgePixel& edge : fast.edges) {
    const auto same = std::ranges::lower_bound(reference.edges, edge.pixel, {}, &EdgePixel::pixel);
    if (same == reference.edges.end() || same->pixel != edge.pixel) continue;
    ++found;
    EXPECT_NEAR(edge.front_z, same->front_z, 1e-4 * static_cast<double>(same->front_z));
    EXPECT_NEAR(edge.behind_z, same->behind_z, 1e-4 * static_cast<double>(same->behind_z));
    for (std::size_t c = 0; c < 4; ++c) {
      EXPECT_NEAR(edge.front[c], same->front[c], 4e-3) << edge.pixel;
      EXPECT_NEAR(edge.behind[c], same->behind[c], 4e-3) << edge.pixel;
    }
  }
  EXPECT_GT(found, 60U);
  EXPECT_GE(found + 2, std::max(fast.edges.size(), reference.edges.size()));
}

TEST_F(SoftEdges, TogetherAreThePixel) {
  const store::Take take = write(oblique());
  const RenderedView image = render(take, default_view());
  for (const EdgePixel& edge : image.edges) {
    EXPECT_LT(edge.front_z, edge.behind_z);
    EXPECT_GT(edge.front[3], 0);
    EXPECT_LT(edge.front[3], 1);
    for (std::size_t c = 0; c < 4; ++c) {
      EXPECT_NEAR(image.rgba[4 * edge.pixel + c],
                  edge.front[c] + (1 - edge.front[3]) * edge.behind[c], 1e-6);
    }
    EXPECT_EQ(image.z[edge.pixel], edge.front[3] >= 0.5F ? edge.front_z : edge.behind_z);
  }
  EXPECT_TRUE(std::ranges::is_sorted(image.edges, {}, &EdgePixel::pixel));
  // Several samples a pixel are averaged: such pixels may hold more than two surfaces.
  EXPECT_TRUE(render(take, virtual_camera_with_fov(30, 21, 40 * testing::kDegree,
                                                   testing::make_pose({0.02, 0.013, 0.03}, 2)))
                  .edges.empty());
}

// Where no camera sees what is behind, the pixel shows the front alone.
TEST(CombineSurfaces, OneThatIsAloneIsWhole) {
  const depth::SurfacePair pair{0.5F, 0.2F};
  const std::array<float, 4> front{0.4F, 0.2F, 0.1F, 1}, behind{0, 0.5F, 0, 1}, nothing{};
  const auto alone = depth::combine_surfaces(pair, {1, 0.3F}, front, nothing);
  EXPECT_FALSE(alone.edge);
  EXPECT_EQ(alone.rgba, front);
  EXPECT_EQ(alone.inverse_depth, 0.5F);
  const auto hidden = depth::combine_surfaces(pair, {1, 0}, nothing, behind);
  EXPECT_FALSE(hidden.edge);
  EXPECT_EQ(hidden.rgba, behind);
  EXPECT_EQ(hidden.inverse_depth, 0.2F);
  EXPECT_EQ(depth::combine_surfaces(pair, {0, 0}, nothing, nothing).rgba, nothing);
  // Next to no camera has the front: its colours are those of other surfaces.
  EXPECT_EQ(depth::combine_surfaces(pair, {1, 1e-5F}, front, nothing).rgba, nothing);
  // A does not jump where something behind comes into view.
  for (const float seen : {0.0F, 0.01F, 0.5F, 1.0F}) {
    const std::array<float, 4> partly{0, seen / 2, 0, seen};
    EXPECT_NEAR(depth::combine_surfaces(pair, {1, 0.5F}, front, partly).rgba[3],
                1 - (1 - seen) * 0.5F * seen, 0.01)
        << seen;
  }
  // Few cameras: the colours of the front are those of 0.03 / kFullAlphaWeight of it.
  std::array<float, 4> thin{};
  for (std::size_t c = 0; c < 4; ++c) thin[c] = 0.3F * front[c];
  const auto both = depth::combine_surfaces(pair, {0.06F, 0.03F}, thin, behind);
  ASSERT_TRUE(both.edge);
  EXPECT_NEAR(both.edge->front[3], 0.5F * 0.6F, 1e-6);
  EXPECT_NEAR(both.rgba[0], 0.3F * 0.4F, 1e-6);
  EXPECT_NEAR(both.rgba[3], 1, 1e-6);
  EXPECT_EQ(both.inverse_depth, 0.2F);
}

TEST(SurfacePairs, AreTheNearestAndOwnOrOwnAndFarthest) {
  InverseDepthMap map(4, 1);
  map.values = {0.5F, 0.2F, 0.21F, 0.21F};
  const auto at = [&](int x) { return depth::surface_pair(map, x, 0, 0.05F); };
  ASSERT_TRUE(at(0));
  EXPECT_EQ(at(0)->front, 0.5F);
  EXPECT_EQ(at(0)->behind, 0.2F);
  EXPECT_EQ(at(1)->front, 0.5F);
  EXPECT_EQ(at(1)->behind, 0.2F);
  EXPECT_FALSE(at(2));
  EXPECT_FALSE(at(3));
  const depth::SurfaceRun run = depth::surfaces_of_run(map, 0, 0, 4, 0.05F);
  EXPECT_EQ(run.begin, 0);
  EXPECT_EQ(run.end, 2);
  EXPECT_EQ(run.front[2], 0.21F);
  EXPECT_FALSE(depth::surfaces_of_run(map, 0, 0, 4, std::nullopt).has_pairs());
}

TEST(FillBehindEdges, WhatWasFilledIsBehind) {
  RenderedView view;
  view.width = 2;
  view.height = 1;
  view.rgba = {0, 0.5F, 0, 1, 0.5F, 0.25F, 0, 1};  // the second pixel had A 0.75
  view.edges = {{0, {0, 0, 0, 0.5F}, {0, 1, 0, 1}, 1, 2},
                {1, {0.5F, 0, 0, 0.5F}, {0, 0.4F, 0, 0.5F}, 1, 2}};
  fill_behind_edges(view);
  EXPECT_EQ(view.edges[0].behind, (std::array<float, 4>{0, 1, 0, 1}));
  EXPECT_EQ(view.edges[1].behind, (std::array<float, 4>{0, 0.5F, 0, 1}));
}

}  // namespace
}  // namespace raystage::render::soft_edges_test
