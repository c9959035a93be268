// SPDX-License-Identifier: Apache-2.0
// Converts a COLMAP text model: inverts its poses (camera_from_world to world_from_camera) and
// negates the camera's y and z axes (y down, +z forward to y up, -z forward). Lens parameters, with
// pixel centres at +0.5, and world coordinates stay unchanged. Cost: linear in the size of the two
// files.
#include "ingest/rig_formats/colmap_model.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <string_view>
#include <utility>
#include <vector>

#include "base/error.h"
#include "ingest/rig_formats/camera_ids.h"
#include "ingest/rig_formats/colmap_lines.h"
#include "ingest/rig_formats/fov_lens.h"
#include "ingest/rig_formats/rig_conversion.h"

namespace raystage::ingest {
namespace {

struct ColmapCamera {
  int width = 0, height = 0;
  schemas::Intrinsics intrinsics;
};

/// The parameters of a camera model in their order (colmap/src/colmap/sensor/models.h): focal
/// lengths, principal point, then distortion, a letter each: 1 to 4 for k1 to k4, p and q for p1
/// and p2, w for omega, 0 for a coefficient that our models lack.
struct ColmapCameraModel {
  std::string_view name;
  schemas::Projection projection;
  bool one_focal_length;
  std::string_view distortion;
};
constexpr auto kPinholeLens = schemas::Projection::kPinhole;
constexpr auto kFisheyeLens = schemas::Projection::kFisheye;
constexpr std::array<ColmapCameraModel, 11> kColmapModels{{
    {"SIMPLE_PINHOLE", kPinholeLens, true, ""},
    {"PINHOLE", kPinholeLens, false, ""},
    {"SIMPLE_RADIAL", kPinholeLens, true, "1"},
    {"RADIAL", kPinholeLens, true, "12"},
    {"OPENCV", kPinholeLens, false, "12pq"},
    {"FULL_OPENCV", kPinholeLens, false, "12pq3000"},
    {"SIMPLE_RADIAL_FISHEYE", kFisheyeLens, true, "1"},
    {"RADIAL_FISHEYE", kFisheyeLens, true, "12"},
    {"OPENCV_FISHEYE", kFisheyeLens, false, "1234"},
    {"THIN_PRISM_FISHEYE", kFisheyeLens, false, "12003400"},
    {"FOV", kFisheyeLens, false, "w"},
}};

const ColmapCameraModel* find_model(std::string_view name) {
  const auto found = std::ranges::find(kColmapModels, name, &ColmapCameraModel::name);
  return found == kColmapModels.end() ? nullptr : &*found;
}

/// Returns the variable of a letter of ColmapCameraModel::distortion; null for "0" and "w".
double* distortion_variable(char letter, schemas::Intrinsics& lens) {
  if (lens.projection == kPinholeLens) {
    switch (letter) {
      case '1':
        return &lens.distortion.k1;
      case '2':
        return &lens.distortion.k2;
      case '3':
        return &lens.distortion.k3;
      case 'p':
        return &lens.distortion.p1;
      case 'q':
        return &lens.distortion.p2;
      default:
        return nullptr;
    }
  }
  return letter >= '1' && letter <= '4' ? &lens.radial_distortion.at(letter - '1') : nullptr;
}

constexpr const char* kUndistort =
    "Undistort the images with colmap image_undistorter, and import the model that it writes";

Error unsupported_model(const LineReader& lines, std::string_view name) {
  std::string allowed;
  for (const ColmapCameraModel& model : kColmapModels) {
    allowed += fmt::format("{}{}", allowed.empty() ? "" : ", ", model.name);
  }
  return lines.refuse(
      fmt::format("the camera model {} is not supported, allowed: {}", name, allowed), kUndistort);
}

/// Replaces the lens of an FOV camera by a fisheye, and notes the error.
void approximate_fov(ColmapCamera& camera, double omega, const LineReader& lines,
                     std::vector<std::string>& notes) {
  constexpr double kLargestError = 0.01;  // pixels
  const schemas::Intrinsics& lens = camera.intrinsics;
  if (!(std::abs(omega) < std::numbers::pi)) {
    throw lines.refuse(
        fmt::format("found omega {} of the model FOV, allowed: less than pi", omega));
  }
  const FovApproximation fisheye =
      approximate_fov_lens(lens.fx, lens.fy, lens.cx, lens.cy, omega, camera.width, camera.height);
  if (!std::isfinite(fisheye.max_error_px)) {
    throw lines.refuse(
        "the camera model FOV is approximated by a fisheye, and none reaches the corners of this "
        "picture",
        kUndistort);
  }
  if (!(fisheye.max_error_px < kLargestError)) {
    throw lines.refuse(
        fmt::format(
            "the camera model FOV is approximated by a fisheye, which would be {:.3g} px off here, "
            "allowed: less than {} px",
            fisheye.max_error_px, kLargestError),
        kUndistort);
  }
  camera.intrinsics = fisheye.intrinsics;
  notes.push_back(fmt::format("{}: the lens FOV is approximated by a fisheye, up to {:.2g} px off",
                              lines.place(), fisheye.max_error_px));
}

ColmapCamera read_camera(LineReader& lines, std::vector<std::string>& notes) {
  const std::string_view name = lines.word("camera model");
  const ColmapCameraModel* model = find_model(name);
  if (model == nullptr) throw unsupported_model(lines, name);
  ColmapCamera camera;
  camera.width = lines.number<int>("width");
  camera.height = lines.number<int>("height");
  if (std::min(camera.width, camera.height) < 1 || std::max(camera.width, camera.height) > 65535) {
    throw lines.refuse(fmt::format("found the size {}x{}, allowed: 1 to 65535 pixels", camera.width,
                                   camera.height));
  }
  schemas::Intrinsics& lens = camera.intrinsics;
  const auto number = [&](double largest) {
    const auto value = lines.number<double>("camera parameter");
    if (std::abs(value) <= largest) return value;
    throw lines.refuse(
        fmt::format("found the camera parameter {}, allowed: up to {}", value, largest));
  };
  constexpr double kLargestPixels = 1e7, kLargestDistortion = 1e6;  // of rig.json
  lens.projection = model->projection;
  lens.fx = lens.fy = number(kLargestPixels);
  if (!model->one_focal_length) lens.fy = number(kLargestPixels);
  lens.cx = number(kLargestPixels);
  lens.cy = number(kLargestPixels);
  double omega = 0;
  for (const char letter : model->distortion) {
    const double value = number(kLargestDistortion);
    if (double* variable = distortion_variable(letter, lens)) {
      *variable = value;
    } else if (letter == 'w') {
      omega = value;
    } else if (value != 0) {
      throw lines.refuse(
          fmt::format("the camera model {} is supported only without {}, which is {} here", name,
                      model->projection == kPinholeLens ? "k4, k5 and k6" : "p1, p2, sx1 and sy1",
                      value),
          kUndistort);
    }
  }
  if (!lines.at_end_of_line()) {
    throw lines.refuse(fmt::format("found more parameters than {} has", name));
  }
  if (lens.fx <= 0 || lens.fy <= 0) {
    throw lines.refuse("the focal length must be greater than 0");
  }
  if (model->distortion == "w") approximate_fov(camera, omega, lines, notes);
  return camera;
}

Error too_many(const LineReader& lines, std::string_view what) {
  return lines.refuse(
      fmt::format("the file has more {} than allowed: {}", what, kMaxForeignCameras),
      "Export a model with fewer images");
}

std::map<std::int64_t, ColmapCamera> read_cameras(const NamedText& file,
                                                  std::vector<std::string>& notes) {
  LineReader lines(file);
  std::map<std::int64_t, ColmapCamera> cameras;
  while (lines.next_entry()) {
    if (cameras.size() == kMaxForeignCameras) throw too_many(lines, "cameras");
    const auto id = lines.number<std::int64_t>("camera id");
    if (!cameras.emplace(id, read_camera(lines, notes)).second) {
      throw lines.refuse(fmt::format("the camera id {} is used twice", id));
    }
  }
  return cameras;
}

struct ColmapImage {
  std::string name, place;
  ColmapCamera camera;
  schemas::Matrix4 world_from_camera{};
};

schemas::Matrix4 read_pose(LineReader& lines) {
  constexpr double kLargest = 1e9;  // of rig.json
  const auto check = [&](double value, std::string_view what) {
    if (std::abs(value) <= kLargest) return;
    throw lines.refuse(fmt::format("found {} in the {}, allowed: up to {}", value, what, kLargest));
  };
  std::array<double, 7> values{};
  for (double& value : values) {
    value = lines.number<double>("pose");
    check(value, "pose");
  }
  Eigen::Quaterniond camera_from_world(values[0], values[1], values[2], values[3]);
  constexpr double kSmallest = 1e-9;
  if (camera_from_world.norm() < kSmallest) throw lines.refuse("the quaternion has length 0");
  camera_from_world.normalize();
  const Eigen::Matrix3d rotation = camera_from_world.toRotationMatrix();
  const Eigen::Vector3d position =
      -(rotation.transpose() * Eigen::Vector3d(values[4], values[5], values[6]));
  for (const double coordinate : position) check(coordinate, "position of the camera");
  return rig::matrix_from_pose(pose_from_opencv(rotation, position));
}

constexpr std::size_t kMaxImageName = 4000;  // bytes, as in transforms.json

std::vector<ColmapImage> read_images(const NamedText& file,
                                     const std::map<std::int64_t, ColmapCamera>& cameras) {
  LineReader lines(file);
  std::vector<ColmapImage> images;
  while (lines.next_entry()) {
    if (images.size() == kMaxForeignCameras) throw too_many(lines, "images");
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
    if (image.name.size() > kMaxImageName) {
      throw lines.refuse(fmt::format("the image name has {} bytes, allowed: {}", image.name.size(),
                                     kMaxImageName));
    }
    if (has_control_characters(image.name)) {
      throw lines.refuse("the image name has control characters");
    }
    image.place = lines.place();
    images.push_back(std::move(image));
    lines.next_line();  // skips the image's 2-D points, which may be empty
  }
  std::ranges::sort(images, {}, &ColmapImage::name);
  return images;
}

/// Returns the camera model that holds a lens, and its parameters in a line.
std::string colmap_camera_line(const schemas::CameraGeometry& camera) {
  const schemas::Intrinsics& lens = camera.intrinsics;
  const std::string pixels = fmt::format("{} {} {} {} {} {}", camera.width, camera.height, lens.fx,
                                         lens.fy, lens.cx, lens.cy);
  if (lens.projection == schemas::Projection::kPinhole) {
    const schemas::Distortion& d = lens.distortion;
    if (d == schemas::Distortion{}) return "PINHOLE " + pixels;
    const std::string four = fmt::format("{} {} {} {} {}", pixels, d.k1, d.k2, d.p1, d.p2);
    return d.k3 == 0 ? "OPENCV " + four : fmt::format("FULL_OPENCV {} {} 0 0 0", four, d.k3);
  }
  if (lens.projection == schemas::Projection::kFisheye ||
      lens.projection == schemas::Projection::kFtheta) {
    const auto& k = lens.radial_distortion;
    return fmt::format("OPENCV_FISHEYE {} {} {} {} {}", pixels, k[0], k[1], k[2], k[3]);
  }
  throw lens_error(camera, "COLMAP has only OpenCV's fisheye", "Choose another format");
}

class ColmapFormat : public RigFormat {
 public:
  std::string_view name() const override { return "colmap"; }
  std::string_view description() const override {
    return "COLMAP text model (cameras.txt, images.txt)";
  }
  std::vector<std::string> files() const override {
    return {"cameras.txt", "images.txt", "points3D.txt"};
  }
  std::size_t needed_files() const override { return 2; }
  std::vector<std::string> model_folders() const override { return {"", "sparse/0", "sparse"}; }
  std::vector<std::string> picture_folders() const override {
    return {"../images", "../../images", "images", ""};
  }
  std::uint64_t max_bytes() const override { return kMaxSceneBytes; }
  bool matches(const JsonOutline& /*outline*/) const override { return false; }
  void check_variant(const std::filesystem::path& path) const override;
  ForeignRig parse(std::span<const NamedText> files,
                   const PictureSizeReader& size_of_picture) const override;
  ExportedRig format(const schemas::RigDocument& rig) const override;
};

void ColmapFormat::check_variant(const std::filesystem::path& path) const {
  const auto refuse = [](const std::filesystem::path& file) {
    throw Error::bad_input("this is a binary COLMAP model", file.string(),
                           "Convert it with colmap model_converter --output_type TXT");
  };
  if (path.filename() == "cameras.bin" || path.filename() == "images.bin") refuse(path);
  for (const std::string& folder : model_folders()) {
    const std::filesystem::path file = path / folder / "cameras.bin";
    std::error_code ignored;
    if (std::filesystem::is_regular_file(file, ignored)) refuse(file);
  }
}

ForeignRig ColmapFormat::parse(std::span<const NamedText> files,
                               const PictureSizeReader& /*size_of_picture*/) const {
  ForeignRig rig;
  rig.arbitrary_scale = true;
  const auto images = read_images(files[1], read_cameras(files[0], rig.notes));
  if (images.empty()) {
    throw Error::bad_input("the model has no registered image", files[1].name,
                           "Export a model with registered images");
  }
  std::vector<std::string> names;
  for (const ColmapImage& image : images) names.push_back(image.name);
  const std::vector<std::string> ids = make_camera_ids(names);
  for (std::size_t i = 0; i < images.size(); ++i) {
    schemas::CameraGeometry geometry;
    geometry.id = ids[i];
    geometry.width = images[i].camera.width;
    geometry.height = images[i].camera.height;
    geometry.intrinsics = images[i].camera.intrinsics;
    geometry.world_from_camera = images[i].world_from_camera;
    rig.cameras.push_back({std::move(geometry), images[i].name, images[i].place});
  }
  return rig;
}

ExportedRig ColmapFormat::format(const schemas::RigDocument& rig) const {
  std::string cameras = "# CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]\n";
  std::string images =
      "# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, then the image's points: none\n";
  // In the order of the names, in which `colmap feature_extractor` numbers images:
  // point_triangulator of COLMAP 3.8 refuses a model whose numbers are not those of its database.
  std::vector<const schemas::CameraGeometry*> sorted;
  for (const schemas::RigDocument::Camera& entry : rig.cameras) sorted.push_back(&entry.geometry);
  std::ranges::sort(sorted, {},
                    [](const schemas::CameraGeometry* camera) { return camera->id + ".jpg"; });
  int number = 0;
  for (const schemas::CameraGeometry* of_rig : sorted) {
    const schemas::CameraGeometry& camera = *of_rig;
    ++number;
    cameras += fmt::format("{} {}\n", number, colmap_camera_line(camera));
    const rig::Pose pose = rig::pose_from_matrix(camera.world_from_camera);
    const Eigen::Matrix3d rotation = opencv_camera_from_world_rotation(pose);
    const Eigen::Quaterniond q = Eigen::Quaterniond(rotation).normalized();
    const Eigen::Vector3d t = -(q.toRotationMatrix() * pose.position);
    images += fmt::format("{} {} {} {} {} {} {} {} {} {}.jpg\n\n", number, q.w(), q.x(), q.y(),
                          q.z(), t.x(), t.y(), t.z(), number, camera.id);
  }
  return {{{"cameras.txt", std::move(cameras)},
           {"images.txt", std::move(images)},
           {"points3D.txt", "# POINT3D_ID X Y Z R G B ERROR TRACK[]: none\n"}},
          losses_of(rig, {})};
}

}  // namespace

const RigFormat& colmap_format() {
  static const ColmapFormat kFormat;
  return kFormat;
}

}  // namespace raystage::ingest
