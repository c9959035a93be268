// SPDX-License-Identifier: Apache-2.0
#include "planning/recorded_rays.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "base/error.h"
#include "planning/complete_topology.h"
#include "planning/view_sampling.h"
#include "render/renderer.h"
#include "rig/planning/range_of_motion.h"
#include "rig/planning/wall_eyed_array.h"
#include "store/take.h"
#include "store/timeline.h"
#include "testing/render/synthetic_take.h"
#include "testing/render/test_poses.h"
#include "testing/test_folder.h"

namespace raystage::planning {
namespace {

using Eigen::Vector3d;
using testing::kDegree;
using testing::make_pose;

struct Array {
  rig::Rig rig;
  rig::Topology topology;
};

Array grid(int rows, int columns, const schemas::Distortion& distortion = {}) {
  schemas::RigDocument document;
  for (const auto& camera : testing::camera_grid(rows, columns, 0.06, 320, 240, distortion)) {
    document.cameras.push_back({camera, {}});
  }
  Array array{rig::rig_from_document(document), {}};
  array.topology = complete_topology(array.rig);
  return array;
}

/// Cameras that scatter about a grid and look in slightly different directions.
Array imperfect(std::mt19937& random, const schemas::Distortion& distortion) {
  std::uniform_real_distribution<double> any(-1, 1);
  Array array = grid(5, 5, distortion);
  for (rig::Rig::Camera& camera : array.rig.cameras) {
    camera.pose.position += 0.01 * Vector3d(any(random), any(random), any(random));
    camera.pose.world_from_camera_rotation =
        make_pose(Vector3d::Zero(), 12 * any(random), 8 * any(random)).world_from_camera_rotation;
  }
  array.topology = complete_topology(array.rig);
  return array;
}

render::VirtualCamera random_view(std::mt19937& random) {
  std::uniform_real_distribution<double> any(-1, 1);
  const Vector3d position(0.15 * any(random), 0.15 * any(random), 0.4 * any(random));
  return render::virtual_camera_with_fov(640, 480, (50 + 30 * any(random)) * kDegree,
                                         make_pose(position, 25 * any(random), 20 * any(random)));
}

Eigen::Vector4d plane_at(double depth) {
  return std::isinf(depth) ? Eigen::Vector4d(0, 0, 0, 1) : Eigen::Vector4d(0, 0, 1, depth);
}

TEST(UnrecordedShare, EqualsTheCountOfPixels) {
  std::mt19937 random(30);
  const schemas::Distortion barrel{-0.2, 0.05, 1e-3, -1e-3, 0}, pincushion{0.15, 0.02, 0, 0, 0};
  double sum = 0, worst = 0;
  int partial = 0;
  for (int round = 0; round < 120; ++round) {
    const schemas::Distortion distortion = round % 3 == 0   ? schemas::Distortion{}
                                           : round % 3 == 1 ? barrel
                                                            : pincushion;
    const Array array = imperfect(random, distortion);
    const render::VirtualCamera view = random_view(random);
    const Eigen::Vector4d plane = plane_at(round % 4 == 0 ? INFINITY : 1.5 + round % 5);
    const double share = unrecorded_share(view, array.rig, array.topology, plane);
    const double counted = unrecorded_share_reference(view, array.rig, array.topology, plane);
    ASSERT_NEAR(share, counted, 5e-4) << round;
    worst = std::max(worst, std::abs(share - counted));
    sum += share - counted;
    partial += counted > 0.01 && counted < 0.99 ? 1 : 0;
  }
  EXPECT_LT(std::abs(sum / 120), 3e-5) << "the reference is not biased";
  EXPECT_GT(partial, 60);
  RecordProperty("worst", std::to_string(worst));
}

// All rays of a view in the plane of the array pass where it stands: on a line between cameras, or
// at one of them, they are in several cells.
TEST(UnrecordedShare, OnTheBorderOfCellsIsThatBesideIt) {
  const Array array = grid(4, 4);
  const auto share_at = [&](const Vector3d& position) {
    const render::VirtualCamera view =
        render::virtual_camera_with_fov(640, 480, 60 * kDegree, make_pose(position, 12, 0));
    const double share = unrecorded_share(view, array.rig, array.topology, plane_at(INFINITY));
    EXPECT_EQ(is_recorded(view, array.rig, array.topology, plane_at(INFINITY), 0.99), share <= 0.01)
        << position.transpose();
    return share;
  };
  for (const Vector3d& position :
       {Vector3d(0, 0, 0), Vector3d(0.03, 0.03, 0), Vector3d(0.03, 0, 0), Vector3d(0, 0.03, 0),
        Vector3d(0.09, 0.01, 0), Vector3d(-0.09, 0.09, 0)}) {
    const double beside =
        share_at(position - 1e-7 * Vector3d(position.x() + 0.001, position.y() + 0.0017, 0));
    EXPECT_GT(beside, 0.03);
    EXPECT_NEAR(share_at(position), beside, 1e-6) << position.transpose();
  }
}

TEST(UnseenShare, CountsWhatNoCameraSees) {
  const Array array = grid(4, 4);
  const auto view_at = [](const Vector3d& position, double fov) {
    return render::virtual_camera_with_fov(640, 480, fov * kDegree, make_pose(position, 0, 0));
  };
  // Beside the array no ray passes it, but its cameras see nearly all points.
  const render::VirtualCamera beside = view_at({0.3, 0, 0}, 40);
  EXPECT_EQ(unrecorded_share(beside, array.rig, array.topology, plane_at(3)), 1);
  EXPECT_LT(unseen_share(beside, array.rig, array.topology, plane_at(3)), 0.05);
  EXPECT_EQ(unseen_share(view_at({0, 0, 0}, 40), array.rig, array.topology, plane_at(3)), 0);
  // At infinity the cameras see as much as one of them: of a wider view the middle.
  const double wide =
      unseen_share(view_at({0, 0, 0}, 90), array.rig, array.topology, plane_at(INFINITY));
  EXPECT_NEAR(wide, 1 - std::pow(std::tan(31 * kDegree), 2), 0.02);
  EXPECT_EQ(unseen_share(view_at({0, 0, -4}, 40), array.rig, array.topology, plane_at(3)), 1)
      << "the plane is behind the view";
}

// Straight borders are exact: the share does not change where the picture is divided.
TEST(UnrecordedShare, IsExactWithoutDistortion) {
  const Array array = grid(4, 4);
  const render::VirtualCamera view =
      render::virtual_camera_with_fov(640, 480, 70 * kDegree, make_pose({0.05, 0.02, 0.2}, 6, -3));
  const double whole = unrecorded_share(view, array.rig, array.topology, plane_at(3));
  ASSERT_GT(whole, 0.05);
  double parts = 0;
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 4; ++column) {
      render::VirtualCamera part = view;
      part.width /= 4;
      part.height /= 4;
      part.intrinsics.cx -= column * part.width;
      part.intrinsics.cy -= row * part.height;
      parts += unrecorded_share(part, array.rig, array.topology, plane_at(3)) / 16;
    }
  }
  EXPECT_NEAR(whole, parts, 1e-9);
}

// At the border of the range of motion (thesis 5.2) the last ray is recorded.
TEST(UnrecordedShare, BeginsAtTheBorderOfTheRangeOfMotion) {
  const Array array = grid(5, 5);
  const auto ideal = rig::find_wall_eyed_array(array.rig);
  ASSERT_TRUE(ideal);
  const render::VirtualCamera front = render::virtual_camera_with_fov(640, 480, 40 * kDegree, {});
  const rig::RangeOfMotion range = rig::range_of_motion(
      *ideal, {rig::camera_slopes(front.intrinsics, front.width, front.height)});
  ASSERT_FALSE(range.positions.is_empty());
  const rig::Pose& pose = ideal->pose;
  for (const Vector3d& corner : range.positions.vertices()) {
    for (const double towards : {0.98, 1.02}) {
      render::VirtualCamera view = front;
      view.pose.position = pose.position + pose.world_from_camera_rotation * (towards * corner);
      const double share = unrecorded_share(view, array.rig, array.topology, plane_at(INFINITY));
      if (towards < 1) {
        EXPECT_EQ(share, 0) << corner.transpose();
      } else {
        EXPECT_GT(share, 0) << corner.transpose();
      }
    }
  }
}

// The inscribed array promises no ray that the real one lacks.
TEST(UnrecordedShare, IsNoneInTheRangeOfTheInscribedArray) {
  std::mt19937 random(12);
  std::uniform_real_distribution<double> any(-1, 1);
  int positions = 0;
  for (int round = 0; round < 12; ++round) {
    const Array array = imperfect(
        random, round % 2 == 0 ? schemas::Distortion{} : schemas::Distortion{-0.2, 0.05, 0, 0, 0});
    EXPECT_FALSE(rig::find_wall_eyed_array(array.rig));
    const auto inner = rig::inscribed_wall_eyed_array(array.rig, array.topology);
    ASSERT_TRUE(inner);
    const render::VirtualCamera front = render::virtual_camera_with_fov(
        640, 480, 25 * kDegree, {inner->pose.world_from_camera_rotation, Vector3d::Zero()});
    const rig::RangeOfMotion range = rig::range_of_motion(
        *inner, {rig::camera_slopes(front.intrinsics, front.width, front.height),
                 front.pose.world_from_camera_rotation});
    ASSERT_FALSE(range.positions.is_empty()) << range.empty_because;
    for (int i = 0; i < 40; ++i) {
      const Vector3d point =
          range.positions.nearest_point(0.3 * Vector3d(any(random), any(random), any(random)));
      render::VirtualCamera view = front;
      view.pose.position =
          inner->pose.position + inner->pose.world_from_camera_rotation * (0.999999 * point);
      EXPECT_EQ(unrecorded_share(view, array.rig, array.topology, plane_at(INFINITY)), 0);
      ++positions;
    }
  }
  EXPECT_EQ(positions, 480);
}

TEST(UnrecordedShare, OfRowsSingleCamerasAndFoldedArrays) {
  const render::VirtualCamera view =
      render::virtual_camera_with_fov(640, 480, 50 * kDegree, make_pose({0.03, 0, 0}, 5));
  for (const auto& [rows, columns] : {std::pair{1, 5}, {5, 1}, {1, 1}}) {
    const Array array = grid(rows, columns);
    EXPECT_NEAR(unrecorded_share(view, array.rig, array.topology, plane_at(3)),
                unrecorded_share_reference(view, array.rig, array.topology, plane_at(3)), 5e-4)
        << rows << "x" << columns;
  }
  // Cameras on a bowl, seen from its side.
  Array bowl = grid(5, 5);
  for (rig::Rig::Camera& camera : bowl.rig.cameras) {
    const Eigen::Vector2d at = camera.pose.position.head<2>() - bowl.rig.centre().head<2>();
    camera.pose.position.z() = 8 * at.squaredNorm();
  }
  bowl.topology = complete_topology(bowl.rig);
  const render::VirtualCamera beside =
      render::virtual_camera_with_fov(640, 480, 60 * kDegree, make_pose({-0.5, 0.1, 0.1}, -60));
  EXPECT_NEAR(unrecorded_share(beside, bowl.rig, bowl.topology, plane_at(3)),
              unrecorded_share_reference(beside, bowl.rig, bowl.topology, plane_at(3)), 5e-4);
}

TEST(UnrecordedShare, OfViewsThatSeeNothing) {
  const Array array = grid(4, 4);
  const auto share = [&](const rig::Pose& pose, const Eigen::Vector4d& plane) {
    return unrecorded_share(render::virtual_camera_with_fov(64, 48, 50 * kDegree, pose), array.rig,
                            array.topology, plane);
  };
  EXPECT_EQ(share(make_pose({0, 0, 0.1}, 180), plane_at(3)), 1) << "it looks away";
  EXPECT_EQ(share(make_pose({5, 0, 0}, 0), plane_at(3)), 1) << "it stands beside the array";
  EXPECT_EQ(share(make_pose({0, 0, -3}, 0), plane_at(3)), 1) << "it stands on the plane";
  EXPECT_THROW(share(make_pose({0, 0, 0.1}, 0), Eigen::Vector4d::Zero()), Error);
}

// The renderer leaves the rays transparent that no camera recorded.
TEST(UnrecordedShare, EqualsTheTransparentPixelsOfFocalPlane) {
  const testing::TestFolder folder;
  testing::SyntheticTake options;
  options.cameras = testing::camera_grid(4, 4, 0.06, 160, 120, {-0.1, 0.01, 0, 0, 0});
  write_synthetic_take(options, folder.path() / "take");
  const store::Take take(folder.path() / "take");
  const store::FrameSelection frames = store::select_frames(take, 0, 30'000'000);
  const render::LightFieldRenderer renderer(take, {});
  const rig::Topology topology = complete_topology(take.rig());
  std::mt19937 random(5);
  for (int round = 0; round < 20; ++round) {
    const render::VirtualCamera view = random_view(random);
    const Eigen::Vector4d plane = plane_at(2 + round % 4);
    const auto image =
        renderer.render(view, frames, {.method = "focal_plane", .focal_plane = plane});
    double transparent = 0;
    for (std::size_t i = 3; i < image.rgba.size(); i += 4)
      transparent += image.rgba[i] == 0 ? 1 : 0;
    transparent /= static_cast<double>(view.width) * view.height;
    EXPECT_NEAR(unrecorded_share(view, take.rig(), topology, plane), transparent, 5e-4) << round;
  }
}

TEST(ViewSampling, OfAViewAmongTheCameras) {
  const Array array = grid(5, 5);
  const schemas::Intrinsics& k = array.rig.cameras[0].model.intrinsics();
  render::VirtualCamera view =
      render::virtual_camera_with_fov(320, 240, 40 * kDegree, make_pose({0.01, 0.02, 0}, 0));
  const auto ratio = least_source_pixels_per_pixel(view, array.rig, array.topology, plane_at(4));
  ASSERT_TRUE(ratio);
  EXPECT_NEAR(*ratio, k.fx / view.intrinsics.fx, 1e-6);
  // From twice as far the plane's pixels are twice as large.
  view.pose.position.z() = 4;
  view.intrinsics.fx *= 4;
  view.intrinsics.fy *= 4;
  const auto behind = least_source_pixels_per_pixel(view, array.rig, array.topology, plane_at(4));
  ASSERT_TRUE(behind);
  EXPECT_NEAR(*behind, 2 * k.fx / view.intrinsics.fx, 1e-6);
  view.pose.position.x() = 50;
  EXPECT_FALSE(least_source_pixels_per_pixel(view, array.rig, array.topology, plane_at(4)));
}

TEST(ViewSampling, GhostingIsThatOfEquation21) {
  const Array array = grid(5, 5);
  const render::VirtualCamera view =
      render::virtual_camera_with_fov(640, 480, 50 * kDegree, make_pose({0.01, 0.02, 0}, 0));
  const auto pixels = [&](const Eigen::Vector4d& plane, double depth) {
    return ghosting_pixels(view, array.rig, plane, depth, 0.06);
  };
  const double f = view.intrinsics.fx;
  EXPECT_NEAR(pixels(plane_at(4), 2).value(), f * 0.06 * (1 / 2.0 - 1 / 4.0), 1e-9);
  EXPECT_NEAR(pixels(plane_at(4), INFINITY).value(), f * 0.06 / 4, 1e-9);
  EXPECT_NEAR(pixels(plane_at(INFINITY), 3).value(), f * 0.06 / 3, 1e-9);
  EXPECT_NEAR(pixels(plane_at(4), 4).value(), 0, 1e-9);
  EXPECT_FALSE(pixels(plane_at(-4), 4)) << "the plane is behind the view";
}

/// Returns an array on a sphere or ring of 0.2 m that looks outwards.
Array outward_array(bool is_ring, const schemas::Intrinsics& intrinsics, int count) {
  schemas::RigDocument document;
  for (int i = 0; i < count; ++i) {
    const double height = is_ring ? 0 : 1 - (i + 0.5) * 2 / count;
    const double turn =
        is_ring ? 2 * std::numbers::pi * i / count : i * std::numbers::pi * (3 - std::sqrt(5.0));
    const double across = std::sqrt(1 - height * height);
    const Vector3d out(across * std::cos(turn), height, across * std::sin(turn));
    const Vector3d right = Vector3d::UnitY().cross(-out).normalized(), up = right.cross(out);
    schemas::CameraGeometry camera{"c" + std::to_string(i), 200, 160, intrinsics, {}, {}, {}};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto a = static_cast<Eigen::Index>(axis);
      camera.world_from_camera[4 * axis] = right[a];
      camera.world_from_camera[4 * axis + 1] = -up[a];
      camera.world_from_camera[4 * axis + 2] = -out[a];
      camera.world_from_camera[4 * axis + 3] = 0.2 * out[a];
    }
    camera.world_from_camera[15] = 1;
    document.cameras.push_back({camera, {}});
  }
  Array array{rig::rig_from_document(document), {}};
  array.topology = complete_topology(array.rig);
  return array;
}

TEST(RecordedRays, OfArraysThatLookOutwardsAgreeWithTheReference) {
  schemas::Intrinsics fisheye{75, 75, 100, 80, {}};
  fisheye.projection = schemas::Projection::kFtheta;
  fisheye.half_angle = 1.4;
  schemas::Intrinsics narrow = fisheye;
  narrow.fx = narrow.fy = 110;
  const Array arrays[] = {outward_array(false, fisheye, 16), outward_array(false, narrow, 16),
                          outward_array(true, {100, 100, 100, 80, {}}, 9)};
  double least = 1, most = 0;
  for (const Array& array : arrays) {
    ASSERT_TRUE(array.topology.outwards);
    for (const double yaw : {0.0, 100.0, 215.0}) {
      for (const Vector3d& eye : {Vector3d(0, 0, 0), Vector3d(0.06, 0.02, -0.05)}) {
        const render::VirtualCamera view =
            render::virtual_camera_with_fov(96, 72, 60 * kDegree, make_pose(eye, yaw, yaw / 9));
        const Eigen::Vector4d plane =
            rig::fronto_parallel_plane(array.rig, 3, view.pose.viewing_direction());
        const double share = unrecorded_share(view, array.rig, array.topology, plane);
        const double reference = unrecorded_share_reference(view, array.rig, array.topology, plane);
        EXPECT_NEAR(share, reference, 0.01) << yaw << ' ' << eye.transpose();
        least = std::min(least, reference);
        most = std::max(most, reference);
      }
    }
  }
  EXPECT_LT(least, 0.001) << "no view shows all";
  EXPECT_GT(most, 0.02) << "no view lacks rays";
}

}  // namespace
}  // namespace raystage::planning
