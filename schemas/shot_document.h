// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "schemas/hole_fill.h"
#include "schemas/option_values.h"
#include "schemas/time.h"

namespace raystage {

/// schema "raystage/shot/1": what to render.
struct ShotDocument {
  struct CameraKey {
    double frame = 0;
    std::array<double, 3> position{0, 0, 0};        ///< world, metres
    std::array<double, 4> orientation{1, 0, 0, 0};  ///< world_from_camera quaternion w, x, y, z
    double horizontal_fov_deg = 50;                 ///< full angle, (0, 180)
  };
  struct FocalPlane {
    enum class Kind { kBest, kDepth, kInfinity, kEquation } kind = Kind::kBest;
    double depth = 0;                            ///< kDepth: metres in front of the array
    std::array<double, 4> equation{0, 0, 0, 1};  ///< kEquation: a x + b y + c z + d = 0, world
  };
  struct Layer {
    std::string name;
    std::string take;  ///< folder of the take, relative to the shot's folder
    std::string method = "focal_plane";
    OptionValues options;  ///< of the method; which there are is the renderer's to say
    FocalPlane focal_plane;
    HoleFill fill = HoleFill::kNone;
    double start_seconds = 0;  ///< time in the take, since its first tick, shown at first_frame
    double speed = 1;          ///< take seconds per shot second: 0 freezes, negative runs backwards
  };
  struct Output {
    std::string compression = "piz";  ///< none | rle | zips | zip | piz
  };
  std::string name;
  int width = 0, height = 0;
  double fps = 24;
  int fps_numerator = 24, fps_denominator = 1;  ///< fps as the exact ratio
  int first_frame = 1, last_frame = 1;
  std::vector<CameraKey> camera;  ///< by increasing frame, at least one
  std::vector<Layer> layers;      ///< exactly one in version 1
  Output output;
};

ShotDocument read_shot(const std::filesystem::path& file);
void write_shot(const ShotDocument& shot, const std::filesystem::path& file);

/// The same in memory; `name` stands for the file in errors.
ShotDocument parse_shot(std::string_view text, std::string_view name);
std::string format_shot(const ShotDocument& shot);

}  // namespace raystage
