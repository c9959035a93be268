// SPDX-License-Identifier: Apache-2.0
// For tests: rigs in the formats of other programs.
#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "ingest/rig_formats/rig_format.h"
#include "rig/pose.h"
#include "schemas/rig_document.h"

namespace raystage::testing {

/// Returns the rig of texts in the order of RigFormat::files().
inline ingest::ForeignRig parse_rig_files(std::string_view format,
                                          const std::vector<std::string>& texts) {
  const ingest::RigFormat& of_name = ingest::rig_format(format);
  std::vector<ingest::NamedText> files;
  for (std::size_t i = 0; i < texts.size(); ++i) files.push_back({of_name.files()[i], texts[i]});
  return of_name.parse(files, nullptr);
}

inline schemas::RigDocument document_of(const ingest::ForeignRig& rig) {
  schemas::RigDocument document;
  for (const ingest::ForeignRig::Camera& camera : rig.cameras) {
    document.cameras.push_back({camera.geometry, {}});
  }
  // As after a rig.json of ours.
  return schemas::parse_rig(schemas::format_rig(document), "rig.json");
}

/// Returns a rig after it was written and read again.
inline schemas::RigDocument rewritten(std::string_view format, const schemas::RigDocument& rig) {
  const ingest::ExportedRig exported = ingest::rig_format(format).format(rig);
  std::vector<std::string> texts;
  for (const ingest::NamedText& file : exported.files) texts.push_back(file.text);
  return document_of(parse_rig_files(format, texts));
}

/// Returns the largest difference of two matrices.
inline double pose_difference(const schemas::CameraGeometry& a, const schemas::CameraGeometry& b) {
  double worst = 0;
  for (std::size_t i = 0; i < a.world_from_camera.size(); ++i) {
    worst = std::max(worst, std::abs(a.world_from_camera.at(i) - b.world_from_camera.at(i)));
  }
  return worst;
}

inline void expect_same(const schemas::RigDocument& found, const schemas::RigDocument& expected) {
  ASSERT_EQ(found.cameras.size(), expected.cameras.size());
  for (std::size_t i = 0; i < found.cameras.size(); ++i) {
    const schemas::CameraGeometry& a = found.cameras[i].geometry;
    const schemas::CameraGeometry& b = expected.cameras[i].geometry;
    EXPECT_EQ(a.id, b.id);
    EXPECT_EQ(a.width, b.width);
    EXPECT_EQ(a.height, b.height);
    EXPECT_EQ(a.intrinsics, b.intrinsics) << a.id;
    EXPECT_LT(pose_difference(a, b), 1e-12) << a.id;
  }
}

/// Returns a camera that is turned about several axes.
inline schemas::CameraGeometry turned_camera(const std::string& id, double turn,
                                             schemas::Projection projection) {
  schemas::CameraGeometry camera;
  camera.id = id;
  camera.width = 640;
  camera.height = 480;
  camera.intrinsics.fx = camera.intrinsics.fy = 201.25;
  camera.intrinsics.cx = 321.1;
  camera.intrinsics.cy = 239.7;
  camera.intrinsics.projection = projection;
  rig::Pose pose;
  pose.position = {0.1 * turn, -2, 0.3};
  pose.world_from_camera_rotation =
      Eigen::AngleAxisd(turn, Eigen::Vector3d(1, 2, -0.5).normalized()).toRotationMatrix();
  camera.world_from_camera = rig::matrix_from_pose(pose);
  return camera;
}

inline schemas::RigDocument rig_of_fisheyes(schemas::Projection projection) {
  schemas::RigDocument rig;
  for (const double turn : {0.0, 0.4, 2.0, std::numbers::pi}) {
    rig.cameras.push_back({turned_camera(fmt::format("c{}", turn * 10), turn, projection), {}});
    rig.cameras.back().geometry.intrinsics.radial_distortion = {-0.03 - turn / 1000, 1e-3, -1e-4,
                                                                0};
  }
  return rig;
}

inline std::string rig_refusal(std::string_view format, const std::vector<std::string>& texts) {
  try {
    parse_rig_files(format, texts);
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
    EXPECT_FALSE(error.what_to_do().empty());
    return error.what();
  }
  return "accepted";
}

inline std::string export_refusal(std::string_view format, const schemas::RigDocument& rig) {
  try {
    ingest::rig_format(format).format(rig);
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
    EXPECT_FALSE(error.what_to_do().empty());
    return error.what();
  }
  return "written";
}

}  // namespace raystage::testing
