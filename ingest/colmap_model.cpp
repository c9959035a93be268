// SPDX-License-Identifier: Apache-2.0
#include "ingest/colmap_model.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <map>
#include <string_view>
#include <utility>
#include <vector>

#include "base/atomic_file.h"
#include "base/error.h"
#include "rig/pose.h"

// Converts a COLMAP text model: inverts its poses (camera_from_world to world_from_camera) and
// negates the camera's y and z axes (y down, +z forward to y up, -z forward). Lens parameters and
// world coordinates stay unchanged. Cost: linear in the size of the two files.

namespace raystage::ingest {
namespace {

/// Reads a text file line by line, and a line word by word.
class LineReader {
 public:
  explicit LineReader(const std::filesystem::path& file)
      : name_(file.string()), text_(read_file(file, kMaxSceneBytes)), rest_(text_) {}

  /// Goes to the next line; returns false at the end.
  bool next_line() {
    if (rest_.empty()) return false;
    const std::size_t end = std::min(rest_.find('\n'), rest_.size());
    line_ = rest_.substr(0, end);
    if (line_.ends_with('\r')) line_.remove_suffix(1);
    rest_.remove_prefix(std::min(end + 1, rest_.size()));
    ++number_;
    return true;
  }
  /// Goes to the next line that is neither empty nor a comment; returns false at the end.
  bool next_entry() {
    while (next_line()) {
      const std::size_t first = line_.find_first_not_of(" \t");
      if (first != line_.npos && line_[first] != '#') return true;
    }
    return false;
  }
  std::string_view word(std::string_view what) {
    skip_space();
    if (line_.empty()) throw refuse(fmt::format("the {} is missing", what));
    const std::size_t end = std::min(line_.find_first_of(" \t"), line_.size());
    const std::string_view result = line_.substr(0, end);
    line_.remove_prefix(end);
    return result;
  }
  /// Returns the rest of the line: a file name may contain spaces.
  std::string_view rest_of_line(std::string_view what) {
    skip_space();
    if (line_.empty()) throw refuse(fmt::format("the {} is missing", what));
    return line_.substr(0, line_.find_last_not_of(" \t") + 1);
  }
  bool at_end_of_line() {
    skip_space();
    return line_.empty();
  }
  template <typename Number>
  Number number(std::string_view what) {
    const std::string_view text = word(what);
    Number value{};
    const auto [stop, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    const bool whole = error == std::errc{} && stop == text.data() + text.size();
    if (!whole || !std::isfinite(static_cast<double>(value))) {
      throw refuse(fmt::format("found \"{}\" for the {}, allowed: a finite number", text, what));
    }
    return value;
  }
  Error refuse(std::string what) const {
    return Error::bad_input(std::move(what), fmt::format("{}:{}", name_, number_),
                            "Export the model again with colmap model_converter --output_type TXT");
  }

 private:
  void skip_space() { line_.remove_prefix(std::min(line_.find_first_not_of(" \t"), line_.size())); }
  std::string name_, text_;
  std::string_view rest_, line_;
  int number_ = 0;
};

struct ColmapCamera {
  int width = 0, height = 0;
  schemas::Intrinsics intrinsics;
};

/// The parameters of a camera model in their order (colmap/src/colmap/sensor/models.h).
struct ColmapCameraModel {
  std::string_view name;
  std::vector<double schemas::Intrinsics::*> pinhole;
  std::vector<double schemas::Distortion::*> distortion;
  bool one_focal_length;
};

const ColmapCameraModel* find_model(std::string_view name) {
  using I = schemas::Intrinsics;
  using D = schemas::Distortion;
  static const std::array<ColmapCameraModel, 5> kModels{{
      {"SIMPLE_PINHOLE", {&I::fx, &I::cx, &I::cy}, {}, true},
      {"PINHOLE", {&I::fx, &I::fy, &I::cx, &I::cy}, {}, false},
      {"SIMPLE_RADIAL", {&I::fx, &I::cx, &I::cy}, {&D::k1}, true},
      {"RADIAL", {&I::fx, &I::cx, &I::cy}, {&D::k1, &D::k2}, true},
      {"OPENCV", {&I::fx, &I::fy, &I::cx, &I::cy}, {&D::k1, &D::k2, &D::p1, &D::p2}, false},
  }};
  const auto found = std::find_if(kModels.begin(), kModels.end(),
                                  [&](const auto& model) { return model.name == name; });
  return found == kModels.end() ? nullptr : &*found;
}

ColmapCamera read_camera(LineReader& lines) {
  const std::string_view name = lines.word("camera model");
  const ColmapCameraModel* model = find_model(name);
  if (model == nullptr) {
    throw lines.refuse(fmt::format(
        "the camera model {} is not supported, allowed: SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, "
        "RADIAL, OPENCV; undistort the images with colmap image_undistorter",
        name));
  }
  ColmapCamera camera;
  camera.width = lines.number<int>("width");
  camera.height = lines.number<int>("height");
  if (std::min(camera.width, camera.height) < 1 || std::max(camera.width, camera.height) > 65535) {
    throw lines.refuse(fmt::format("found the size {}x{}, allowed: 1 to 65535 pixels", camera.width,
                                   camera.height));
  }
  schemas::Intrinsics& intrinsics = camera.intrinsics;
  for (const auto member : model->pinhole) {
    intrinsics.*member = lines.number<double>("camera parameter");
  }
  for (const auto member : model->distortion) {
    intrinsics.distortion.*member = lines.number<double>("camera parameter");
  }
  if (model->one_focal_length) intrinsics.fy = intrinsics.fx;
  if (!lines.at_end_of_line()) {
    throw lines.refuse(fmt::format("found more parameters than {} has", name));
  }
  if (intrinsics.fx <= 0 || intrinsics.fy <= 0) {
    throw lines.refuse("the focal length must be greater than 0");
  }
  return camera;
}

std::map<std::int64_t, ColmapCamera> read_cameras(const std::filesystem::path& file) {
  LineReader lines(file);
  std::map<std::int64_t, ColmapCamera> cameras;
  while (lines.next_entry()) {
    const auto id = lines.number<std::int64_t>("camera id");
    if (!cameras.emplace(id, read_camera(lines)).second) {
      throw lines.refuse(fmt::format("the camera id {} is used twice", id));
    }
  }
  return cameras;
}

struct ColmapImage {
  std::string name;
  ColmapCamera camera;
  schemas::Matrix4 world_from_camera{};
};

schemas::Matrix4 read_pose(LineReader& lines) {
  std::array<double, 7> values{};
  for (double& value : values) value = lines.number<double>("pose");
  Eigen::Quaterniond camera_from_world(values[0], values[1], values[2], values[3]);
  constexpr double kSmallest = 1e-9;
  if (camera_from_world.norm() < kSmallest) throw lines.refuse("the quaternion has length 0");
  camera_from_world.normalize();
  const Eigen::Matrix3d world_from_camera =
      camera_from_world.toRotationMatrix().transpose();  // y down, +z forward
  rig::Pose pose;
  pose.position = -(world_from_camera * Eigen::Vector3d(values[4], values[5], values[6]));
  pose.world_from_camera_rotation = world_from_camera * Eigen::Vector3d(1, -1, -1).asDiagonal();
  return rig::matrix_from_pose(pose);
}

std::vector<ColmapImage> read_images(const std::filesystem::path& file,
                                     const std::map<std::int64_t, ColmapCamera>& cameras) {
  LineReader lines(file);
  std::vector<ColmapImage> images;
  while (lines.next_entry()) {
    ColmapImage image;
    lines.word("image id");
    image.world_from_camera = read_pose(lines);
    const auto id = lines.number<std::int64_t>("camera id");
    const auto camera = cameras.find(id);
    if (camera == cameras.end()) {
      throw lines.refuse(fmt::format("the camera {} is not in cameras.txt", id));
    }
    image.camera = camera->second;
    image.name = lines.rest_of_line("image name");
    images.push_back(std::move(image));
    lines.next_line();  // skips the image's 2-D points, which may be empty
  }
  std::sort(images.begin(), images.end(),
            [](const auto& a, const auto& b) { return a.name < b.name; });
  return images;
}

}  // namespace

schemas::ImportManifest read_colmap_model(const std::filesystem::path& folder,
                                          const ModelImportOptions& options) {
  const std::filesystem::path file = folder / "images.txt";
  const auto images = read_images(file, read_cameras(folder / "cameras.txt"));
  if (images.empty()) {
    throw Error::bad_input("the model has no registered image", file.string(),
                           "Export a model with registered images");
  }
  std::vector<std::filesystem::path> folders;
  if (options.images) {
    folders = {*options.images};
  } else {
    folders = {folder / ".." / "images", folder / ".." / ".." / "images", folder / "images",
               folder};
  }
  const auto base = find_image_folder(folders, images.front().name, file);

  std::vector<std::string> names;
  for (const ColmapImage& image : images) names.push_back(image.name);
  const std::vector<std::string> ids = make_camera_ids(names);

  schemas::ImportManifest manifest = make_model_manifest(file, options);
  for (std::size_t i = 0; i < images.size(); ++i) {
    const ColmapCamera& camera = images[i].camera;
    schemas::ImportManifest::Camera entry;
    entry.geometry = {.id = ids[i],
                      .width = camera.width,
                      .height = camera.height,
                      .intrinsics = camera.intrinsics,
                      .world_from_camera = images[i].world_from_camera,
                      .row = std::nullopt,
                      .column = std::nullopt};
    entry.frames.push_back({(base / images[i].name).string(), 0});
    manifest.cameras.push_back(std::move(entry));
  }
  return manifest;
}

}  // namespace raystage::ingest
