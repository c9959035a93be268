// SPDX-License-Identifier: Apache-2.0
#include "render/sweep/cost_kernels.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <random>

#include "matching/matching.h"
#include "testing/test_simd_targets.h"

namespace raystage::render {
namespace {

constexpr int kWidth = 140, kHeight = 90;
constexpr double kDegree = std::numbers::pi / 180;

struct Case {
  std::size_t cameras = 4;
  SweepPlanes planes{37, 0, 0.1};
  store::BlendSpace space = store::BlendSpace::kPerceptual;
  double full_scale = 1;
  double truncation = 40;
  int excluded_cameras = 0;
  double view_fov = 1.3;  ///< radians
  int view_width = 83, view_height = 40;
  double focal = 120;  ///< pixels
  double roll = 0;     ///< radians, of every camera about its axis
  schemas::Distortion bent{-0.2, 0.05, 0.001, -0.002, 0};  ///< every other camera's lens
};

rig::Rig::Camera camera_at(double x, const Case& c, bool bends) {
  schemas::CameraGeometry geometry;
  geometry.id = "c";
  geometry.width = kWidth;
  geometry.height = kHeight;
  geometry.intrinsics = {c.focal, c.focal, kWidth / 2.0, kHeight / 2.0,
                         bends ? c.bent : schemas::Distortion{}};
  rig::Pose pose;
  pose.position = {x, 0.02 * x, 0};
  pose.world_from_camera_rotation = (Eigen::AngleAxisd(0.1 * x, Eigen::Vector3d::UnitY()) *
                                     Eigen::AngleAxisd(c.roll, Eigen::Vector3d::UnitZ()))
                                        .toRotationMatrix();
  return {"c", rig::CameraModel(geometry), pose, {}, {}, {}};
}

store::DecodedFrame random_frame(unsigned seed) {
  store::DecodedFrame frame;
  frame.width = kWidth;
  frame.height = kHeight;
  const std::size_t pixels = kWidth * (kHeight + 1) + 1;
  frame.rgba = std::make_unique<std::uint16_t[]>(4 * pixels);
  std::mt19937 random(seed);
  for (std::size_t i = 0; i < 4 * kWidth * kHeight; ++i) {
    frame.rgba[i] = i % 4 == 3 ? std::uint16_t{65535} : static_cast<std::uint16_t>(random());
  }
  return frame;
}

struct Counts {
  int told = 0, unknown = 0;
  int torn = 0;  ///< that excluded another camera than the reference did
};

/// Compares all pixels of a view that some cameras see only partly.
Counts expect_costs_of_reference(const Case& c) {
  std::vector<rig::Rig::Camera> cameras;
  std::vector<store::DecodedFrame> frames;
  for (std::size_t i = 0; i < c.cameras; ++i) {
    cameras.push_back(camera_at(0.1 * static_cast<double>(i) - 0.15, c, i % 2 == 1));
    frames.push_back(random_frame(static_cast<unsigned>(i)));
  }
  const VirtualCamera view = virtual_camera_with_fov(c.view_width, c.view_height, c.view_fov, {});
  std::vector<MatchingFrame> matching;
  std::vector<MatchingCamera> sources(c.cameras);
  std::vector<const MatchingCamera*> pointers;
  std::vector<ReferenceCamera> references;
  matching.reserve(c.cameras);
  for (std::size_t i = 0; i < c.cameras; ++i) {
    matching.emplace_back(frames[i], store::CodeScale{c.space, c.full_scale},
                          FrameBox{0, kWidth, 0, kHeight});
    sources[i] = {depth_source(view, cameras[i]), &matching[i]};
    pointers.push_back(&sources[i]);
    references.push_back({&cameras[i], &frames[i]});
  }
  const auto stride = static_cast<std::size_t>(matching::plane_stride(c.planes.count));
  const auto width = static_cast<std::size_t>(c.view_width);
  std::vector<std::uint8_t> costs(width * stride);
  CostScratch scratch(c.planes.count, static_cast<int>(c.cameras));
  const ViewRays rays(view);
  // Positions are accurate to 1/256 pixel: on white noise, with steps of up to 255 codes per pixel,
  // that is up to one code, and a cost of 255 / truncation per code.
  const double a_code = 255 / c.truncation;
  Counts counts;
  double off = 0;
  for (const int y : {0, c.view_height / 2, c.view_height - 1}) {
    compute_matching_costs(
        {0, c.view_width, y, pointers, c.planes, c.truncation, c.excluded_cameras, costs.data()},
        scratch);
    for (std::size_t x = 0; x < width; ++x) {
      const auto ray = *rays.through(static_cast<double>(x) + 0.5, y + 0.5);
      for (int plane = 0; plane < c.planes.count; ++plane) {
        const double expected = matching_cost_reference(
            references, {c.space, c.full_scale}, view.pose.position, ray,
            c.planes.inverse_depth(plane), c.truncation, c.excluded_cameras);
        const int found = costs[x * stride + static_cast<std::size_t>(plane)];
        off += std::abs(found - expected);
        // If two cameras differ nearly equally, a fraction of a code decides which is excluded.
        if (c.excluded_cameras > 0 && std::abs(found - expected) > 1 + a_code) {
          ++counts.torn;
        } else {
          EXPECT_NEAR(found, expected, 1 + a_code)
              << "pixel " << x << ", " << y << " plane " << plane;
        }
        if (::testing::Test::HasFailure()) return counts;
        expected == matching::kUnknownCost ? ++counts.unknown : ++counts.told;
      }
    }
  }
  EXPECT_LT(off / (counts.unknown + counts.told), 0.5 + 0.05 * a_code);
  return counts;
}

void expect_costs_everywhere(const Case& c, int least_told, int least_unknown) {
  testing::for_each_simd_target(cost_kernel_target, [&] {
    const Counts counts = expect_costs_of_reference(c);
    EXPECT_GE(counts.told, least_told);
    EXPECT_GE(counts.unknown, least_unknown);
    EXPECT_LE(counts.torn, counts.told / 100);
  });
}

TEST(CostKernels, AgreeWithTheReferenceWhereCamerasSeeInPart) {
  expect_costs_everywhere({}, 100, 10);
  expect_costs_everywhere({.cameras = 16, .planes = {5, 0.2, 0.4}}, 100, 10);
  expect_costs_everywhere(
      {.cameras = 2, .planes = {1, 0.5, 0}, .space = store::BlendSpace::kLinear}, 100, 10);
  expect_costs_everywhere({.cameras = 2,
                           .planes = {1, 0.5, 0},
                           .space = store::BlendSpace::kHighRange,
                           .full_scale = 40},
                          100, 10);
}

TEST(CostKernels, OneCameraKnowsNothing) {
  expect_costs_everywhere({.cameras = 1, .planes = {3, 0, 0.4}}, 0, 100);
}

// All cameras see the whole view: positions by parabolas.
constexpr double kNarrow = 0.4;
constexpr SweepPlanes kFarPlanes{40, 0.02, 0.01};

TEST(CostKernels, AgreeWhereAllCamerasSee) {
  const int all = 3 * 83 * kFarPlanes.count;
  const Case narrow{.planes = kFarPlanes, .view_fov = kNarrow};
  expect_costs_everywhere(narrow, all, 0);
  for (const double truncation : {1.0, 7.5, 255.0}) {
    Case cut = narrow;
    cut.truncation = truncation;
    expect_costs_everywhere(cut, all, 0);
  }
  Case many = narrow;
  many.cameras = 16;
  many.truncation = 255;  // the sum of differences exceeds 16 bits
  many.planes = {9, 0.02, 0.01};
  expect_costs_everywhere(many, 3 * 83 * 9, 0);
}

TEST(CostKernels, LeaveOutTheCamerasThatAgreeLeast) {
  for (const int excluded_cameras : {1, 2, 14}) {
    expect_costs_everywhere({.excluded_cameras = excluded_cameras}, 100, 10);
    expect_costs_everywhere(
        {.planes = kFarPlanes, .excluded_cameras = excluded_cameras, .view_fov = kNarrow},
        3 * 83 * kFarPlanes.count, 0);
  }
  expect_costs_everywhere({.cameras = 16, .planes = {5, 0.2, 0.4}, .excluded_cameras = 8}, 100, 10);
}

TEST(CostKernels, AgreeWhenPixelsAreStepsOfOtherSizes) {
  for (const int width : {12, 24, 40, 60, 150, 400}) {  // of 5 to 0.15 pixels of a camera
    expect_costs_everywhere({.planes = {17, 0.02, 0.02},
                             .view_fov = kNarrow,
                             .view_width = width,
                             .view_height = width / 2},
                            3 * width * 17, 0);
  }
}

TEST(CostKernels, AgreeWhenCamerasAreTurned) {
  for (const double degrees : {0.7, -2.0, 11.0, 90.0, 180.0}) {
    expect_costs_everywhere(
        {.planes = {17, 0.02, 0.02}, .view_fov = kNarrow, .roll = degrees * kDegree}, 3 * 83 * 17,
        0);
  }
}

TEST(CostKernels, AgreeWhereALensBendsMoreThanAParabola) {
  expect_costs_everywhere({.planes = {17, 0, 0.05},
                           .view_fov = 1.6,
                           .focal = 50,
                           .bent = {-0.35, 0.1, 0.004, -0.003, 0}},
                          3 * 83 * 17, 0);
}

TEST(CostKernels, APartOfAFrameIsMatchedAsTheWhole) {
  const Case c{.planes = kFarPlanes, .view_fov = kNarrow};
  const VirtualCamera view = virtual_camera_with_fov(c.view_width, c.view_height, c.view_fov, {});
  const auto stride = static_cast<std::size_t>(matching::plane_stride(c.planes.count));
  std::vector<std::vector<std::uint8_t>> costs;
  for (const FrameBox& box : {FrameBox{0, kWidth, 0, kHeight}, FrameBox{24, 120, 16, 80}}) {
    std::vector<MatchingFrame> frames;
    std::vector<MatchingCamera> sources(c.cameras);
    std::vector<const MatchingCamera*> pointers;
    frames.reserve(c.cameras);
    for (std::size_t i = 0; i < c.cameras; ++i) {
      const store::DecodedFrame frame = random_frame(static_cast<unsigned>(i));
      frames.emplace_back(frame, store::CodeScale{c.space, c.full_scale}, box);
      sources[i] = {
          depth_source(view, camera_at(0.1 * static_cast<double>(i) - 0.15, c, i % 2 == 1)),
          &frames[i]};
      pointers.push_back(&sources[i]);
    }
    CostScratch scratch(c.planes.count, static_cast<int>(c.cameras));
    costs.emplace_back(stride * static_cast<std::size_t>(c.view_width));
    compute_matching_costs({0, c.view_width, 20, pointers, c.planes, 40, 0, costs.back().data()},
                           scratch);
  }
  EXPECT_EQ(costs[0], costs[1]);
}

}  // namespace
}  // namespace raystage::render
