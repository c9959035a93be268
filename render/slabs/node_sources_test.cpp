// SPDX-License-Identifier: Apache-2.0
#include "render/slabs/node_sources.h"

#include <gtest/gtest.h>

#include <numeric>
#include <random>

#include "testing/render/synthetic_take.h"

namespace raystage::render {
namespace {

using Eigen::Vector2d;

rig::Rig rig_of(const std::vector<schemas::CameraGeometry>& cameras) {
  schemas::RigDocument document;
  for (const schemas::CameraGeometry& camera : cameras) document.cameras.push_back({camera, {}});
  return rig::rig_from_document(document);
}

TEST(NearestInTriangle, IsTheNearestOfManyPoints) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> anywhere(-1, 1);
  const auto point = [&] { return Vector2d(anywhere(random), anywhere(random)); };
  for (int trial = 0; trial < 300; ++trial) {
    std::array<Vector2d, 3> corners{point(), point(), point()};
    if (trial % 10 == 0) corners[2] = corners[1];
    if (trial % 10 == 1) corners[2] = corners[1] = corners[0];
    const Vector2d p = point() * 1.5;
    const NearestInTriangle found = nearest_in_triangle(p, corners);
    EXPECT_NEAR(found.weight[0] + found.weight[1] + found.weight[2], 1, 1e-9);
    const Vector2d at =
        found.weight[0] * corners[0] + found.weight[1] * corners[1] + found.weight[2] * corners[2];
    EXPECT_NEAR((at - p).squaredNorm(), found.squared_distance, 1e-9);
    for (const double w : found.weight) EXPECT_GE(w, 0);
    constexpr int kSteps = 40;
    for (int i = 0; i <= kSteps; ++i) {
      for (int j = 0; i + j <= kSteps; ++j) {
        const Vector2d other =
            (i * corners[0] + j * corners[1] + (kSteps - i - j) * corners[2]) / kSteps;
        ASSERT_GE((other - p).squaredNorm(), found.squared_distance - 1e-9);
      }
    }
  }
}

TEST(NodeSources, AreTheCamerasOfAGridAndTheirNeighboursWhereOneIsAbsent) {
  const rig::Rig rig = rig_of(testing::camera_grid(3, 3, 0.06, 40, 30));
  std::vector<int> all(9);
  std::iota(all.begin(), all.end(), 0);
  const rig::Topology complete = rig::make_topology(rig, all);
  const Slab slab = fit_slabs(rig, all, complete.normal, {})[0];
  for (const NodeSources& node : node_sources(slab, rig, complete, complete)) {
    EXPECT_EQ(node.count, 1);
    EXPECT_TRUE(node.at_camera);
    EXPECT_EQ(node.weight[0], 1);
    EXPECT_EQ(node.present_weight, 1);
  }
  for (const int absent : {4, 0}) {  // in the middle, at a corner
    std::vector<int> rest = all;
    std::erase(rest, absent);
    const rig::Topology present = rig::make_topology(rig, rest);
    const auto nodes = node_sources(slab, rig, present, complete);
    for (int i = 0; i < 9; ++i) {
      const NodeSources& node = nodes[i];
      EXPECT_EQ(node.at_camera, i != absent);
      EXPECT_EQ(node.present_weight, i == absent ? 0 : 1);
      double sum = 0;
      for (int c = 0; c < node.count; ++c) {
        EXPECT_NE(node.camera[c], absent);
        sum += node.weight[c];
      }
      EXPECT_NEAR(sum, 1, 1e-12);
    }
    EXPECT_EQ(nodes[absent].count, 2);  // between two, half each
  }
  // Without a camera near enough, the node has no sources.
  const rig::Topology corner = rig::make_topology(rig, std::vector<int>{0});
  EXPECT_EQ(node_sources(slab, rig, corner, complete)[8].count, 0);
  EXPECT_EQ(node_sources(slab, rig, corner, complete)[1].count, 1);
}

}  // namespace
}  // namespace raystage::render
