// SPDX-License-Identifier: Apache-2.0
#include "render/sweep/cost_kernels.h"

#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <Eigen/Geometry>
#include <random>
#include <set>

#include "render/matching/matching.h"

namespace raystage {
namespace {

constexpr int kWidth = 70, kHeight = 50;

Rig::Camera camera_at(double x, double turn, const Distortion& distortion) {
  CameraGeometry geometry;
  geometry.id = "c";
  geometry.width = kWidth;
  geometry.height = kHeight;
  geometry.intrinsics = {60, 60, 35, 25, distortion};
  Pose pose;
  pose.position = {x, 0.02 * x, 0};
  pose.world_from_camera_rotation =
      Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitY()).toRotationMatrix();
  return {"c", CameraModel(geometry), pose, {}, {}, {}};
}

DecodedFrame random_frame(unsigned seed) {
  DecodedFrame frame;
  frame.width = kWidth;
  frame.height = kHeight;
  const std::size_t pixels = kWidth * (kHeight + 1) + 1;
  frame.rgbx = std::make_unique<std::uint16_t[]>(4 * pixels);
  std::mt19937 random(seed);
  for (std::size_t i = 0; i < 4 * kWidth * kHeight; ++i) {
    frame.rgbx[i] = i % 4 == 3 ? std::uint16_t{65535} : static_cast<std::uint16_t>(random());
  }
  return frame;
}

/// Of `count` cameras, everywhere in a view that some of them see in part only.
void expect_costs_of_reference(std::size_t count, BlendSpace space, const SweepPlanes& planes) {
  std::vector<Rig::Camera> cameras;
  std::vector<DecodedFrame> frames;
  for (std::size_t i = 0; i < count; ++i) {
    const double place = 0.1 * static_cast<double>(i) - 0.15;
    cameras.push_back(camera_at(place, 0.1 * place,
                                i % 2 ? Distortion{-0.2, 0.05, 0.001, -0.002, 0} : Distortion{}));
    frames.push_back(random_frame(static_cast<unsigned>(i)));
  }
  const VirtualCamera view = virtual_camera_with_fov(83, 40, 1.3, {});
  std::vector<MatchingFrame> matching;
  std::vector<MatchingCamera> sources(count);
  std::vector<const MatchingCamera*> pointers;
  std::vector<ReferenceCamera> references;
  matching.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    matching.emplace_back(frames[i], space);
    sources[i] = {depth_source(view, cameras[i]), matching[i].pixels(), matching[i].pitch()};
    pointers.push_back(&sources[i]);
    references.push_back({&cameras[i], &frames[i]});
  }
  const auto stride = static_cast<std::size_t>(plane_stride(planes.count));
  std::vector<std::uint8_t> costs(83 * stride);
  CostScratch scratch(planes.count);
  const ViewRays rays(view);
  int unknown = 0, told = 0;
  for (const int y : {0, 21, 39}) {
    fill_costs({0, 83, y, pointers, planes, 40, costs.data()}, scratch);
    for (std::size_t x = 0; x < 83; ++x) {
      const auto ray = *rays.through(static_cast<double>(x) + 0.5, y + 0.5);
      for (int plane = 0; plane < planes.count; ++plane) {
        const double expected = cost_reference(references, space, view.pose.position, ray,
                                               planes.inverse_depth(plane), 40);
        ASSERT_NEAR(costs[x * stride + static_cast<std::size_t>(plane)], expected, 2)
            << "pixel " << x << ", " << y << " plane " << plane;
        expected == kUnknownCost ? ++unknown : ++told;
      }
    }
  }
  if (count > 1) {
    EXPECT_GT(told, 100);
  } else {
    EXPECT_EQ(told, 0);
  }
  EXPECT_GT(unknown, 10);
}

TEST(CostKernels, EveryInstructionSetAgreesWithTheReference) {
  std::set<std::string> seen;
  for (const auto target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    SCOPED_TRACE(sweep_target());
    seen.insert(sweep_target());
    expect_costs_of_reference(4, BlendSpace::kPerceptual, {37, 0, 0.1});
    expect_costs_of_reference(16, BlendSpace::kPerceptual, {5, 0.2, 0.4});
    expect_costs_of_reference(2, BlendSpace::kLinear, {1, 0.5, 0});
    expect_costs_of_reference(1, BlendSpace::kPerceptual, {3, 0, 0.4});
  }
  hwy::SetSupportedTargetsForTest(0);
  hwy::GetChosenTarget().DeInit();
  EXPECT_FALSE(seen.empty());
}

}  // namespace
}  // namespace raystage
