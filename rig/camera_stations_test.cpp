// SPDX-License-Identifier: Apache-2.0
// Stations of rigs with and without cameras next to each other.
#include "rig/camera_stations.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numeric>
#include <random>
#include <vector>

namespace raystage::rig {
namespace {

using Eigen::Vector3d;
using Centres = std::vector<Vector3d>;

/// Returns a grid of cameras 60 mm apart that are mounted with errors, metres.
Centres mounted_grid(int rows, int columns, double error = 0.003) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> off(-error, error);
  Centres centres;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      centres.emplace_back(0.06 * column + off(random), -0.06 * row + off(random), off(random));
    }
  }
  return centres;
}

/// Returns `count` points on a dome of radius 1 (a golden spiral).
Centres dome(int count) {
  Centres centres;
  for (int i = 0; i < count; ++i) {
    const double height = (i + 0.5) / count, turn = 2.4 * i,
                 radius = std::sqrt(1 - height * height);
    centres.emplace_back(radius * std::cos(turn), height, radius * std::sin(turn));
  }
  return centres;
}

std::vector<int> numbered(std::size_t count) {
  std::vector<int> all(count);
  std::iota(all.begin(), all.end(), 0);
  return all;
}

/// Adds a camera next to each of the first `pairs` centres, in any direction.
Centres with_pairs(Centres centres, std::size_t pairs, double distance) {
  std::mt19937_64 random(9);
  std::normal_distribution<double> normal;
  for (std::size_t i = 0; i < pairs; ++i) {
    const Vector3d off(normal(random), normal(random), normal(random));
    centres.push_back(centres[i] + distance * off.normalized());
  }
  return centres;
}

TEST(CameraStations, NaturalSpacingsAreKept) {
  std::vector<Centres> rigs{{},
                            {{1, 2, 3}},
                            {{0, 0, 0}, {1e-6, 0, 0}},
                            {{0, 0, 0}, {1, 0, 0}, {3, 0, 0}, {7, 0, 0}},
                            mounted_grid(1, 8),
                            mounted_grid(8, 8),
                            mounted_grid(8, 8, 0.018),
                            mounted_grid(25, 40, 0),
                            dome(4),
                            dome(46),
                            dome(200)};
  for (int i = 0; i < 11; ++i) {  // as fountain-P11
    const double angle = -0.9 + 0.18 * i;
    if (i == 0) rigs.emplace_back();
    rigs.back().emplace_back(8 * std::sin(angle), 0.03 * ((i * 7) % 5), 8 * std::cos(angle));
  }
  for (const double spacing : {1.0, 2.5}) {
    Centres columns;  // of pairs for stereo, 65 mm apart
    for (int i = 0; i < 10; ++i) {
      columns.emplace_back(spacing * i, 0, 0);
      columns.emplace_back(spacing * i, 0.065, 0);
    }
    rigs.push_back(columns);
  }
  for (const double distance : {1.5, 100.0}) {
    Centres block = mounted_grid(4, 4);  // with witness cameras around it
    for (int i = 0; i < 20; ++i) {
      const double angle = 0.3 * i;
      block.emplace_back(distance * std::cos(angle), distance * std::sin(angle), 0.5);
    }
    rigs.push_back(block);
  }
  for (const Centres& centres : rigs) {
    EXPECT_EQ(camera_stations(centres), numbered(centres.size())) << centres.size() << " cameras";
    EXPECT_EQ(first_of_stations(centres), numbered(centres.size()));
  }
}

TEST(CameraStations, CamerasNextToEachOtherAreOne) {
  for (const Centres& centres : {mounted_grid(1, 8, 0.001), mounted_grid(8, 8), dome(46)}) {
    for (const double distance : {0.0, 1e-4, 3e-4, 1e-3}) {
      for (const std::size_t pairs : {std::size_t{1}, centres.size() / 2, centres.size()}) {
        const Centres all = with_pairs(centres, pairs, distance);
        std::vector<int> expected = numbered(centres.size());
        for (std::size_t i = 0; i < pairs; ++i) expected.push_back(static_cast<int>(i));
        EXPECT_EQ(camera_stations(all), expected) << pairs << " pairs at " << distance << " m";
        EXPECT_EQ(first_of_stations(all), numbered(centres.size()));
      }
    }
  }
}

TEST(CameraStations, OfTwoOnlyThePairsAreKnown) {
  const Centres centres{{0, 0, 0}, {0.0003, 0, 0}, {0.06, 0, 0}, {0.06, 0.0003, 0}};
  EXPECT_EQ(camera_stations(centres), (std::vector<int>{0, 0, 2, 2}));
  EXPECT_EQ(first_of_stations(centres), numbered(4));
}

TEST(CameraStations, ThreeInOnePlaceAreOne) {
  const Centres grid = mounted_grid(3, 3);
  Centres all = grid;
  for (const double distance : {4e-4, -5e-4}) {
    for (const Vector3d& centre : grid) all.emplace_back(centre + Vector3d(distance, 0, 0));
  }
  std::vector<int> expected;
  for (int i = 0; i < 27; ++i) expected.push_back(i % 9);
  EXPECT_EQ(camera_stations(all), expected);
}

TEST(CameraStations, ScaleAndPlaceDoNotMatter) {
  const Centres some = with_pairs(mounted_grid(5, 5), 12, 5e-4);
  const std::vector<int> expected = camera_stations(some);
  EXPECT_NE(expected, numbered(some.size()));
  for (const double scale : {1e-6, 1e6}) {
    Centres moved;
    for (const Vector3d& centre : some) moved.emplace_back(scale * (centre + Vector3d(7, -3, 50)));
    EXPECT_EQ(camera_stations(moved), expected) << scale;
  }
}

TEST(CameraStations, CoincidentFacetsDoNotHidePairs) {
  Centres centres;
  for (const Vector3d& centre : with_pairs(mounted_grid(3, 3), 9, 1e-3)) {
    centres.insert(centres.end(), 5, centre);
  }
  const std::vector<int> stations = camera_stations(centres);
  for (std::size_t i = 0; i < stations.size(); ++i) {
    EXPECT_EQ(stations[i], static_cast<int>(i / 5 % 9 * 5));
  }
}

TEST(CameraStations, TenThousandCameras) {
  EXPECT_EQ(camera_stations(Centres(10'000, Vector3d(1, 2, 3))), std::vector<int>(10'000, 0));
  const Centres grid = mounted_grid(100, 100);
  EXPECT_EQ(camera_stations(grid), numbered(10'000));
  const Centres pairs = with_pairs(mounted_grid(50, 100), 5000, 1e-3);
  EXPECT_EQ(first_of_stations(pairs), numbered(5000));
}

TEST(NearestBaselines, AreThoseToOtherStations) {
  const auto rig_at = [](const Centres& centres) {
    Rig rig;
    for (const Vector3d& centre : centres) {
      Pose pose;
      pose.position = centre;
      const CameraModel model({"c", 640, 480, {500, 500, 320, 240, {}}, {}, {}, {}});
      rig.cameras.push_back({"c", model, pose, {}, {}, {}});
    }
    return rig;
  };
  const Centres row{{0, 0, 0}, {0.06, 0, 0}, {0.13, 0, 0}};
  EXPECT_EQ(nearest_baselines(rig_at(row)), (std::vector<double>{0.06, 0.06, 0.13 - 0.06}));
  for (const double baseline : nearest_baselines(rig_at(with_pairs(row, 3, 3e-4)))) {
    EXPECT_GT(baseline, 0.059);
    EXPECT_LT(baseline, 0.071);
  }
  constexpr double kNone = std::numeric_limits<double>::infinity();
  EXPECT_EQ(nearest_baselines(rig_at({{1, 2, 3}, {1, 2, 3}})), (std::vector<double>{kNone, kNone}));
}

}  // namespace
}  // namespace raystage::rig
