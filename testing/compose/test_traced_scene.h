// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <numbers>
#include <string>
#include <vector>

#include "images/exr_reader.h"
#include "testing/compose/sequence_test_data.h"

namespace raystage::testing {

/// A square array of cameras on a plane that look along its normal at a scene of meshes.
struct TracedRig {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double turn_deg = 0;  ///< about the y axis, counter-clockwise from above; 0: they look along -z
  int side = 5;         ///< cameras
  double spacing = 0.08, horizontal_fov_deg = 56;  ///< metres, degrees
  int width = 320, height = 240;
  schemas::DepthRange depth_range{2.5, 7};
};

/// A folder with meshes; renders scenes of these meshes and takes of such scenes.
class TracedScene {
 public:
  TracedScene() { write_meshes(); }
  std::filesystem::path path(const std::string& name) const { return folder_.path() / name; }

  /// Returns a layer of plane.obj (2 by 2, faces +z) or ball.obj (radius 1).
  static schemas::ShotDocument::Layer mesh(const std::string& name, const std::string& file,
                                           const std::array<double, 3>& position, double scale) {
    schemas::ShotDocument::Layer layer;
    layer.name = name;
    schemas::ShotDocument::Geometry geometry{.file = file};
    geometry.material =
        schemas::ShotDocument::Material{.color = {{1, 1, 1}}, .texture = "texture.ppm"};
    geometry.keys = {{.frame = 1, .position = position, .scale = scale}};
    geometry.samples = 16;
    layer.geometry = geometry;
    return layer;
  }
  struct Picture {
    compose::ExrImage image;
    std::vector<float> front;  ///< id of the object with the largest share of a pixel
  };
  Picture render(const schemas::ShotDocument& shot) const {
    schemas::write_shot(shot, path("shot.json"));
    compose::SequenceOptions options;
    options.output = path("out.####.exr").string();
    options.program_version = "0.1.0";
    options.existing = compose::ExistingFiles::kOverwrite;
    options.on_message = [](std::string_view) {};
    options.progress = [](double) {};
    compose::render_sequence(path("shot.json"), options, {});
    constexpr images::ExrChannel kIds[] = {{"CryptoObject00.R"}};
    return {compose::read_exr(path("out.0001.exr")),
            images::read_exr_channels(path("out.0001.exr"), kIds, "").values};
  }

  /// Writes the take of one light field frame that an array records of `scene`.
  void write_take(const std::string& name, const schemas::ShotDocument& scene,
                  const TracedRig& array) const {
    schemas::TakeDocument take;
    take.name = name;
    take.created_by = "test";
    take.epoch_utc = 1'700'000'000 * kNanosecondsPerSecond;
    take.nominal_fps = 24;
    take.color_space = "srgb_texture";
    take.depth_range = array.depth_range;
    schemas::RigDocument rig;
    rig.name = "grid";
    const Eigen::Quaterniond turn(
        Eigen::AngleAxisd(array.turn_deg * std::numbers::pi / 180, Eigen::Vector3d::UnitY()));
    schemas::ShotDocument seen = scene;
    seen.width = array.width;
    seen.height = array.height;
    for (int i = 0; i < array.side * array.side; ++i) {
      schemas::RigDocument::Camera camera;
      schemas::CameraGeometry& g = camera.geometry;
      g.id = "c" + std::to_string(i);
      g.width = array.width;
      g.height = array.height;
      const double focal =
          array.width / 2.0 / std::tan(array.horizontal_fov_deg * std::numbers::pi / 360);
      g.intrinsics = {focal, focal, array.width / 2.0, array.height / 2.0, {}};
      const int middle = array.side / 2;
      const int right = i % array.side - middle, down = i / array.side - middle;
      const Eigen::Vector3d place(array.spacing * right, -array.spacing * down, 0);
      const Eigen::Vector3d position = array.centre + turn * place;
      const Eigen::Matrix3d rotation = turn.toRotationMatrix();
      for (int row = 0; row < 3; ++row) {
        for (int column = 0; column < 3; ++column) {
          g.world_from_camera[4 * row + column] = rotation(row, column);
        }
        g.world_from_camera[4 * row + 3] = position[row];
      }
      rig.cameras.push_back(camera);
      take.cameras.push_back({g.id, "", "", ""});
    }
    store::TakeWriter writer(path(name), take, rig);
    for (int i = 0; i < array.side * array.side; ++i) {
      const auto& m = rig.cameras[i].geometry.world_from_camera;
      seen.camera.keys = {camera_key(1, {m[3], m[7], m[11]}, array.horizontal_fov_deg)};
      seen.camera.keys[0].orientation = {{turn.w(), turn.x(), turn.y(), turn.z()}};
      writer.archive(i).append(store::encode_jpeg(as_frame(render(seen).image), {.quality = 98}),
                               0);
    }
    writer.commit();
    store::write_timeline(store::build_timeline(store::Take(path(name)), 24, 0), path(name));
  }

  /// Returns the PSNR of sRGB codes (full scale 1) over the pixels with `counts`, dB.
  template <class Counts>
  static double psnr(const compose::ExrImage& a, const compose::ExrImage& b, const Counts& counts) {
    double sum = 0;
    std::size_t values = 0;
    for (std::size_t i = 0; i < a.rgba.size(); ++i) {
      if (i % 4 == 3 || !counts(i / 4)) continue;
      const auto code = [&](const compose::ExrImage& image) {
        return srgb_from_linear(std::clamp(double{image.rgba[i]}, 0.0, 1.0));
      };
      sum += std::pow(code(a) - code(b), 2);
      ++values;
    }
    EXPECT_GT(values, 3000U);
    return -10 * std::log10(sum / static_cast<double>(values));
  }

 private:
  void write_meshes() const {
    std::ofstream plane(path("plane.obj"));
    plane << "o plane\nv -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
             "f 1/1 2/2 3/3 4/4\n";
    std::ofstream ball(path("ball.obj"));
    ball << "o ball\n";
    constexpr int kSteps = 40;
    for (int row = 0; row <= kSteps; ++row) {
      for (int column = 0; column <= 2 * kSteps; ++column) {
        const double p = std::numbers::pi * row / kSteps, t = std::numbers::pi * column / kSteps;
        const double x = std::sin(p) * std::cos(t), y = std::cos(p), z = std::sin(p) * std::sin(t);
        ball << "v " << x << ' ' << y << ' ' << z << "\nvn " << x << ' ' << y << ' ' << z << "\nvt "
             << column / (2.0 * kSteps) << ' ' << 1 - row / double{kSteps} << '\n';
      }
    }
    const auto corner = [](int row, int column) {
      const std::string i = std::to_string(row * (2 * kSteps + 1) + column + 1);
      return i + '/' + i + '/' + i + ' ';
    };
    for (int row = 0; row < kSteps; ++row) {
      for (int column = 0; column < 2 * kSteps; ++column) {
        ball << "f " << corner(row, column) << corner(row + 1, column)
             << corner(row + 1, column + 1) << corner(row, column + 1) << '\n';
      }
    }
    std::ofstream texture(path("texture.ppm"), std::ios::binary);
    constexpr int kTexels = 256;
    texture << "P6 " << kTexels << ' ' << kTexels << " 255\n";
    for (int y = 0; y < kTexels; ++y) {
      for (int x = 0; x < kTexels; ++x) {
        for (const double turn : {0.0, 2.1, 4.2}) {
          const double wave = std::sin(0.19 * x + 0.07 * y + turn) +
                              std::sin(0.11 * y - 0.05 * x + 2 * turn) +
                              std::sin(0.023 * (x + 2 * y) + turn);
          texture.put(static_cast<char>(static_cast<unsigned char>(128 + 40 * wave)));
        }
      }
    }
  }

  static store::RgbImage as_frame(const compose::ExrImage& seen) {
    store::RgbImage frame{seen.width, seen.height, std::vector<std::uint8_t>()};
    for (std::size_t pixel = 0; pixel < seen.rgba.size() / 4; ++pixel) {
      for (std::size_t c = 0; c < 3; ++c) {
        const double code = srgb_from_linear(std::min(double{seen.rgba[4 * pixel + c]}, 1.0));
        frame.values.push_back(static_cast<std::uint8_t>(std::lround(255 * code)));
      }
    }
    return frame;
  }

  TestFolder folder_;
};

}  // namespace raystage::testing
