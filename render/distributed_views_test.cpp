// SPDX-License-Identifier: Apache-2.0
// Compares the combined contributions of hosts that hold some of the cameras each with the view
// that one host renders.
#include <Imath/half.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <string>
#include <thread>

#include "base/large_buffer.h"
#include "render/common/fragment_encoding.h"
#include "render/methods.h"
#include "schemas/planes_document.h"
#include "store/processing/frames/frame_cache.h"
#include "store/take.h"
#include "testing/render/synthetic_take.h"
#include "testing/render/test_depth.h"
#include "testing/render/thread_communicators.h"
#include "testing/test_folder.h"

namespace raystage::render {
namespace {

/// How the cameras of a grid are distributed to hosts.
enum class Split { kBlocks, kRoundRobin };

int half_steps(float a, float b) {
  const auto ordered = [](float value) {
    const int bits = Imath::half(value).bits();
    return bits < 0x8000 ? bits : 0x8000 - bits;
  };
  return std::abs(ordered(a) - ordered(b));
}

class DistributedViews : public ::testing::Test {
 protected:
  static constexpr int kSide = 4, kCameras = kSide * kSide;

  void SetUp() override { open("take", {}); }

  /// Writes and opens a take of a scene; none: a painted plane.
  void open(const std::string& name, const testing::SceneFunction& scene) {
    testing::SyntheticTake settings;
    settings.cameras = testing::camera_grid(kSide, kSide, 0.2, 96, 64);
    settings.depth_range = schemas::DepthRange{2.5, 10};
    settings.scene = scene;
    testing::write_synthetic_take(settings, folder_.path() / name);
    take_ = std::make_unique<store::Take>(folder_.path() / name);
    cache_ = std::make_unique<store::FrameCache>(*take_, 1 << 28, store::BlendSpace::kPerceptual);
    instant_.take = take_.get();
    instant_.rig = &take_->rig();
    instant_.cache = cache_.get();
    instant_.frame_of_camera.assign(kCameras, 0);
    instant_.included_cameras.clear();
    for (int i = 0; i < kCameras; ++i) instant_.included_cameras.push_back(i);
    instant_.complete = std::make_shared<const rig::Topology>(
        rig::make_topology(take_->rig(), instant_.included_cameras));
    instant_.present = instant_.complete;
  }

  void lose(const std::vector<int>& cameras) {
    std::vector<int> present;
    for (const int camera : cameras) instant_.frame_of_camera[camera] = -1;
    for (const int camera : instant_.included_cameras) {
      if (instant_.is_present(camera)) present.push_back(camera);
    }
    instant_.present =
        std::make_shared<const rig::Topology>(rig::make_topology(take_->rig(), present));
  }

  static int host_of(int camera, int hosts, Split split) {
    if (split == Split::kRoundRobin) return camera % hosts;
    const int column = camera % kSide, row = camera / kSide;
    const int columns = hosts >= 4 ? 2 : 1;  // of hosts
    return (row * (hosts / columns) / kSide) * columns + column * columns / kSide;
  }

  ViewRequest request(const LightFieldFrame& instant, const MethodOptions& options,
                      ResultCache& kept) {
    ViewRequest asked{view_, instant, plane_, options, kept, working_bytes_, buffers_};
    asked.use_take_folder = false;
    asked.measure_coverage = measure_coverage_;
    return asked;
  }

  RenderedView distributed(const Method& method, const MethodOptions& options, int hosts,
                           Split split) {
    std::vector<Contribution> contributions(static_cast<std::size_t>(hosts));
    const bool is_lockstep = method.distribution(options) == DistributionMode::kLockstep;
    testing::ThreadCommunicators threads(hosts);
    const auto contribute = [&](int host) {
      LightFieldFrame own = instant_;
      own.this_rank = host;
      for (int camera = 0; camera < kCameras; ++camera) {
        own.rank_of_camera.push_back(host_of(camera, hosts, split));
      }
      ResultCache kept(1 << 28);
      const testing::ThreadCommunicators::Group group(threads, host);
      ViewRequest asked = request(own, options, kept);
      asked.measure_coverage = false;
      if (is_lockstep) asked.group = &group;
      contributions[host] = method.contribute(asked);
    };
    if (is_lockstep) {
      std::vector<std::jthread> running;
      for (int host = 0; host < hosts; ++host) running.emplace_back(contribute, host);
    } else {
      for (int host = 0; host < hosts; ++host) contribute(host);
    }
    std::vector<PixelValues> planes;
    for (const Contribution& contribution : contributions) {
      planes.resize(contribution.planes.size(), PixelValues(view_value_count(view_), 0.0F));
      for (std::size_t plane = 0; plane < planes.size(); ++plane) {
        const FragmentTag tag{1, 0, static_cast<std::uint32_t>(plane)};
        const auto message = encode_fragments(tag, contribution.planes[plane], view_.width,
                                              view_.height, {}, counts_);
        add_fragments(message, tag, view_.width, view_.height, planes[plane]);
      }
    }
    return method.combine(request(instant_, options, kept_), std::move(planes));
  }

  /// Compares a view of several hosts with that of one, in the half floats of the files.
  void expect_same(const RenderedView& distributed, const RenderedView& local,
                   const std::string& what) {
    ASSERT_EQ(distributed.rgba.size(), local.rgba.size());
    int most = 0;
    std::size_t differ = 0;
    for (std::size_t i = 0; i < local.rgba.size(); ++i) {
      const int steps = half_steps(distributed.rgba[i], local.rgba[i]);
      most = std::max(most, steps);
      differ += steps > 0 ? 1 : 0;
    }
    EXPECT_LE(most, 1) << what;
    EXPECT_LE(differ, local.rgba.size() / 100) << what;
    EXPECT_EQ(distributed.z, local.z) << what;
    for (std::size_t i = 0; i < local.coverage.size(); ++i) {
      ASSERT_LE(half_steps(distributed.coverage[i], local.coverage[i]), 1) << what;
    }
    ASSERT_EQ(distributed.edges.size(), local.edges.size()) << what;
    for (std::size_t i = 0; i < local.edges.size(); ++i) {
      const EdgePixel &theirs = distributed.edges[i], &ours = local.edges[i];
      ASSERT_EQ(theirs.pixel, ours.pixel) << what;
      EXPECT_EQ(theirs.front_z, ours.front_z) << what;
      EXPECT_EQ(theirs.behind_z, ours.behind_z) << what;
      for (std::size_t c = 0; c < 4; ++c) {
        EXPECT_LE(half_steps(theirs.front[c], ours.front[c]), 1) << what;
        EXPECT_LE(half_steps(theirs.behind[c], ours.behind[c]), 1) << what;
      }
    }
    EXPECT_EQ(distributed.cameras, local.cameras) << what;
    EXPECT_EQ(distributed.nearest_ray, local.nearest_ray) << what;
  }

  void expect_all_same(const std::string& name, const schemas::OptionValues& values) {
    const Method& method = method_named(name);
    const MethodOptions options(method.options(), values, name);
    ASSERT_THAT(method.distribution(options),
                ::testing::AnyOf(DistributionMode::kContributions, DistributionMode::kLockstep));
    const RenderedView local = method.render(request(instant_, options, kept_));
    EXPECT_GT(*std::ranges::max_element(local.rgba), 0.05F) << name << " shows nothing";
    for (const int hosts : {1, 2, 4, 8}) {
      for (const Split split : {Split::kBlocks, Split::kRoundRobin}) {
        expect_same(distributed(method, options, hosts, split), local,
                    name + " of " + std::to_string(hosts) + " hosts");
      }
    }
  }

  void expect_all_methods_same() {
    std::ofstream(folder_.path() / "take" / "box.obj")
        << "v -0.4 -0.4 -3\nv 0.4 -0.4 -3\nv 0 0.5 -3.5\nf 1 2 3\n";
    expect_all_same("focal_plane", {});
    expect_all_same("nearest", {});
    expect_all_same("aperture", {{"radius", 0.3}});
    expect_all_same("lumigraph", {});
    expect_all_same("lumigraph", {{"weights", std::string("blending_field")}});
    expect_all_same("lumigraph",
                    {{"proxy", std::string("mesh")}, {"mesh", std::string("box.obj")}});
    expect_all_same("slabs", {});
    expect_all_same("slabs", {{"interpolation", std::string("nearest")}});
    expect_all_same("slabs", {{"columns", 3.0}, {"rows", 5.0}});
  }

  testing::TestFolder folder_;
  std::unique_ptr<store::Take> take_;
  std::unique_ptr<store::FrameCache> cache_;
  LightFieldFrame instant_;
  ResultCache kept_{1 << 28};
  BufferPool buffers_;
  VirtualCamera view_ = virtual_camera_with_fov(
      83, 61, 0.9, rig::Pose{Eigen::Matrix3d::Identity(), Eigen::Vector3d(0.06, -0.03, 0.2)});
  Eigen::Vector4d plane_{0, 0, 1, 4};
  bool measure_coverage_ = false;
  std::size_t working_bytes_ = 1 << 28;
  FragmentCounts counts_;
};

TEST_F(DistributedViews, EqualTheViewOfOneHost) { expect_all_methods_same(); }

TEST_F(DistributedViews, EqualItWithATiltedPlaneAndMeasures) {
  measure_coverage_ = true;
  plane_ = {0.3, 0.1, 1, 3};
  expect_all_methods_same();
}

TEST_F(DistributedViews, EqualItAtInfinity) {
  plane_ = {0, 0, 0, 1};
  expect_all_methods_same();
}

TEST_F(DistributedViews, EqualItWhereCamerasHaveNoFrame) {
  lose({5, 6, 15});
  measure_coverage_ = true;
  expect_all_methods_same();
}

TEST_F(DistributedViews, EqualItWhereTheViewLeavesTheArray) {
  view_ = virtual_camera_with_fov(
      70, 50, 1.8, rig::Pose{Eigen::Matrix3d::Identity(), Eigen::Vector3d(0.5, 0, 1)});
  expect_all_methods_same();
}

TEST_F(DistributedViews, EqualItWithPlanesOfObjects) {
  const schemas::PlanesDocument planes{
      {{"a", {{-0.5, -0.5, -3}, {0.1, -0.5, -3}, {0.1, 0.5, -3}, {-0.5, 0.5, -3}}}}};
  std::ofstream(folder_.path() / "take" / "planes.json") << schemas::format_planes(planes);
  expect_all_same("focal_plane", {{"objects", std::string("planes.json")}});
  expect_all_same("nearest", {{"objects", std::string("planes.json")}});
}

TEST_F(DistributedViews, EqualItWithDepthsThatHostsFindTogether) {
  expect_all_same("depth", {});
  expect_all_same("depth", {{"cameras", 3.0}, {"support_views", 4.0}, {"neighbours", 3.0}});
}

TEST_F(DistributedViews, EqualItWithDepthsWhereMemoryIsShortAndCamerasHaveNoFrame) {
  lose({5, 6, 15});
  working_bytes_ = 3 << 20;  // too little for the images of all cameras or the samples of all rows
  expect_all_same("depth", {});
}

TEST_F(DistributedViews, EqualItWithDepthsOfWhatIsShownOnly) {
  instant_.shown_views = {view_};
  expect_all_same("depth", {});
}

TEST_F(DistributedViews, EqualItWhereEdgesShowTwoSurfaces) {
  open("steps", testing::step_scene);
  const Method& method = method_named("depth");
  const MethodOptions options(method.options(), {}, "depth");
  ASSERT_GT(method.render(request(instant_, options, kept_)).edges.size(), 20U);
  expect_all_same("depth", {});
}

/// A reflection in front of a wall: fits over the positions of the cameras replace the means.
TEST_F(DistributedViews, EqualItBehindGlass) {
  open("glass", [](const Eigen::Vector3d& eye, const Eigen::Vector3d& ray) {
    std::array<double, 3> light{};
    for (const double depth : {4.0, 3.0}) {
      const Eigen::Vector3d hit = eye - ray * ((depth + eye.z()) / ray.z());
      const auto layer = testing::texture(hit.x() / 2 + depth, hit.y() / 2);
      for (std::size_t c = 0; c < 3; ++c) light[c] += layer[c] / 2;
    }
    return light;
  });
  const Method& method = method_named("depth");
  const MethodOptions options(method.options(), {}, "depth");
  const Contribution alone = method.contribute(request(instant_, options, kept_));
  EXPECT_GT(std::ranges::count_if(alone.planes.back(), [](float sum) { return sum > 0; }), 1000)
      << "nothing is fitted";
  expect_all_same("depth", {});
  working_bytes_ = 3 << 20;
  expect_all_same("depth", {});
}

TEST_F(DistributedViews, CrossAsSamplesOfThePictureNotOfTheCameras) {
  const Method& method = method_named("focal_plane");
  const MethodOptions none(method.options(), {}, "focal_plane");
  // The view is as wide as the array, which is between it and the scene: all cameras contribute.
  view_ = virtual_camera_with_fov(
      240, 240, 0.8, rig::Pose{Eigen::Matrix3d::Identity(), Eigen::Vector3d(0, 0, 0.7)});
  distributed(method, none, 4, Split::kBlocks);
  EXPECT_LE(static_cast<double>(counts_.samples) / (240 * 240), 1.75);  // 15 / 9 without the edges
  counts_ = {};
  distributed(method, none, 16, Split::kRoundRobin);  // a camera per host: three samples per pixel
  EXPECT_NEAR(static_cast<double>(counts_.samples) / (240 * 240), 3, 0.25);
}

TEST_F(DistributedViews, AreRefusedByMethodsThatCannot) {
  const auto is_distributed = [](std::string_view name, const schemas::OptionValues& values) {
    const Method& method = method_named(name);
    return method.distribution({method.options(), values, name}) != DistributionMode::kNone;
  };
  EXPECT_FALSE(is_distributed("visual_hull", {}));
  EXPECT_FALSE(is_distributed("auto", {}));
  EXPECT_FALSE(is_distributed("lumigraph", {{"proxy", std::string("depth")}}));
  const MethodOptions none;
  EXPECT_THROW(method_named("auto").contribute(request(instant_, none, kept_)), std::logic_error);
}

}  // namespace
}  // namespace raystage::render
