// SPDX-License-Identifier: Apache-2.0
#include "planning/arrays/array_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <set>
#include <tuple>

#include "base/error.h"
#include "evaluation/pareto_front.h"
#include "rig/planning/effective_resolution.h"
#include "rig/pose.h"

namespace raystage::planning {
namespace {

using schemas::ArraySpecification;
using CatalogueCamera = ArraySpecification::Camera;

constexpr double kRadians = std::numbers::pi / 180;
constexpr double kMillimetresPerMetre = 1000;
constexpr double kAsGood = 1e-9;  // relative, for comparisons of computed lengths and angles
constexpr int kMostCameras = 100'000;
/// Spacings of the alternatives, relative to the largest one without ghosting.
constexpr std::array<double, 17> kSpacings{0.25, 0.354, 0.5,  0.707, 1,    1.414, 2,    2.83, 4,
                                           5.66, 8,     11.3, 16,    22.6, 32,    45.3, 64};

std::vector<rig::PlannedView> views_of(const ArraySpecification& specification) {
  std::vector<rig::PlannedView> views;
  for (const ArraySpecification::Position& position : specification.positions) {
    const double yaw = specification.views.max_yaw_deg, pitch = specification.views.max_pitch_deg;
    rig::PlannedView view;
    view.position = {position.x_m, position.y_m, -position.depth_m};
    view.yaw = {position.yaw_deg.value_or(-yaw) * kRadians,
                position.yaw_deg.value_or(yaw) * kRadians};
    view.pitch = {position.pitch_deg.value_or(-pitch) * kRadians,
                  position.pitch_deg.value_or(pitch) * kRadians};
    views.push_back(view);
  }
  return views;
}

double fov_of(const CatalogueCamera& camera, double focal_length_mm) {
  return 2 * std::atan(camera.sensor_width_mm / (2 * focal_length_mm));
}

double pitch_of(double fov, double pixels) { return 2 * std::tan(fov / 2) / pixels; }

/// The middle and the size of the specified positions, in the frame of the array.
Eigen::AlignedBox3d box_of_positions(const ArraySpecification& specification) {
  Eigen::AlignedBox3d box;
  for (const ArraySpecification::Position& position : specification.positions) {
    box.extend(Eigen::Vector3d(position.x_m, position.y_m, -position.depth_m));
  }
  return box;
}

/// Throws Error (bad input) where equal sides of a cube would not record what is specified: the
/// requirements are those of the first side.
void check_sides(const ArraySpecification& specification, const std::string& name) {
  const Eigen::Vector3d size = box_of_positions(specification).sizes();
  constexpr double kCube = 1e-3;  // of the largest edge
  if (size.maxCoeff() - size.minCoeff() > kCube * size.maxCoeff()) {
    throw Error::bad_input(
        fmt::format("six sides surround a cube, the positions fill {:.3f} x {:.3f} x {:.3f} m",
                    size.x(), size.y(), size.z()),
        name + "#/positions", "Give the corners of a cube");
  }
  constexpr double kRightAngle = 90 - 1e-9;
  const ArraySpecification::Views& views = specification.views;
  if (views.largest_fov_deg < kRightAngle || views.height_px < views.width_px) {
    throw Error::bad_input("six sides see all directions if each sees 90 degrees both ways",
                           name + "#/views", "Give square views of at least 90 degrees");
  }
  if (specification.subject) {
    throw Error::bad_input("a subject is in front of one array, six sides look outwards",
                           name + "#/subject", "Remove the subject, or the sides");
  }
}

/// Computes alternatives of one specification.
class ArrayPlanner {
 public:
  ArrayPlanner(const ArraySpecification& specification, const std::string& name)
      : specification_(specification) {
    const ArraySpecification::Views& views = specification.views;
    rig::PlannedPicture picture;
    picture.horizontal_fov = views.largest_fov_deg * kRadians;
    picture.aspect = static_cast<double>(views.width_px) / views.height_px;
    picture.interaxial = views.interaxial_mm / kMillimetresPerMetre;
    if (specification.sides > 1) check_sides(specification, name);
    const auto needed = rig::array_requirements(views_of(specification), picture);
    if (!needed) {
      throw Error::bad_input("a view looks back at the plane of the array", name,
                             "Use a smaller field of view or rotation");
    }
    plan_.specification = specification;
    plan_.needed = *needed;
    plan_.view_pitch = pitch_of(views.least_fov_deg * kRadians, views.width_px);
    plan_.largest_spacing = rig::largest_spacing(plan_.view_pitch, specification.depth_range,
                                                 specification.largest_error_px);
  }

  ArrayPlan plan(const std::string& name) {
    for (const CatalogueCamera& camera : specification_.cameras) add_arrays_of(camera);
    if (plan_.alternatives.empty()) {
      std::string reasons;
      for (const UnusableCamera& camera : plan_.unusable) {
        reasons += (reasons.empty() ? "" : "; ") + camera.camera + ": " + camera.because;
      }
      throw Error::bad_input("no camera can be used (" + reasons + ")", name,
                             "Add a camera, or specify less");
    }
    std::ranges::sort(plan_.alternatives, {}, [](const ArrayAlternative& one) {
      return std::tuple(one.price, one.ghosting_px, -one.resolution);
    });
    mark_front();
    plan_.best = best();
    add_trade();
    return std::move(plan_);
  }

 private:
  Eigen::Vector2d extent() const { return plan_.needed.extent.sizes(); }

  /// Returns the longest of a camera's focal lengths with which it sees an angle; nullopt if none
  /// does.
  static std::optional<double> longest_focal_length(const CatalogueCamera& camera,
                                                    double horizontal_fov, double vertical_fov) {
    std::optional<double> longest;
    for (const double focal_length : camera.focal_lengths_mm) {
      const double half_width = std::tan(fov_of(camera, focal_length) / 2);
      const double half_height = half_width * camera.height_px / camera.width_px;
      if (half_width < std::tan(horizontal_fov / 2) * (1 - kAsGood) ||
          half_height < std::tan(vertical_fov / 2) * (1 - kAsGood)) {
        continue;
      }
      longest = std::max(longest.value_or(0), focal_length);
    }
    return longest;
  }

  void add_arrays_of(const CatalogueCamera& camera) {
    if (camera.max_fps && *camera.max_fps < specification_.fps) {
      plan_.unusable.push_back(
          {camera.id, fmt::format("records {:.4g} frames a second", *camera.max_fps)});
      return;
    }
    if (rate_of(camera) > specification_.node.megabytes_per_s * (1 + kAsGood)) {
      plan_.unusable.push_back(
          {camera.id, fmt::format("sends {:.4g} MB/s, a node receives {:.4g}", rate_of(camera),
                                  specification_.node.megabytes_per_s)});
      return;
    }
    const auto parallel =
        longest_focal_length(camera, plan_.needed.horizontal_fov, plan_.needed.vertical_fov);
    if (parallel) add_spacings(camera, *parallel, false);
    std::optional<double> rotated;
    if (specification_.subject) {
      const auto fov = rig::fov_of_rotated_cameras(
          plan_.needed.extent, specification_.subject->depth_m, specification_.subject->radius_m);
      if (fov) rotated = longest_focal_length(camera, *fov, *fov);
      if (rotated) add_spacings(camera, *rotated, true);
    }
    if (!parallel && !rotated) {
      const double widest = fov_of(camera, *std::ranges::min_element(camera.focal_lengths_mm));
      plan_.unusable.push_back(
          {camera.id,
           fmt::format(
               "sees {:.1f} x {:.1f} deg at most, {:.1f} x {:.1f} deg are needed",
               widest / kRadians,
               2 * std::atan(std::tan(widest / 2) * camera.height_px / camera.width_px) / kRadians,
               plan_.needed.horizontal_fov / kRadians, plan_.needed.vertical_fov / kRadians)});
    }
  }

  void add_spacings(const CatalogueCamera& camera, double focal_length, bool is_rotated) {
    std::set<std::pair<int, int>> seen;  // columns and rows
    for (const double factor : kSpacings) {
      const auto one = array_with(camera, focal_length, is_rotated, factor * plan_.largest_spacing);
      if (one && seen.insert({one->columns, one->rows}).second) plan_.alternatives.push_back(*one);
    }
  }

  /// Returns the number of cameras along a length, at most `spacing` apart.
  static double count_along(double length, double spacing) {
    if (length <= 0) return 1;
    return std::max(2.0, std::ceil(length / spacing * (1 - kAsGood)) + 1);
  }

  /// Returns the array with at most a spacing, or with cameras that touch each other if their
  /// bodies are wider; nullopt if it has too many cameras.
  std::optional<ArrayAlternative> array_with(const CatalogueCamera& camera, double focal_length,
                                             bool is_rotated, double spacing) const {
    ArrayAlternative array;
    std::array<double, 2> counts{};
    for (int axis = 0; axis < 2; ++axis) {
      const double length = extent()[axis], body = camera.body_mm / kMillimetresPerMetre;
      double count = count_along(length, spacing);
      if (count > 1 && length / (count - 1) < body * (1 - kAsGood)) {
        count = std::max(2.0, std::floor(length / body * (1 + kAsGood)) + 1);
        array.is_limited_by_bodies = true;
      }
      counts[static_cast<std::size_t>(axis)] = count;
      array.spacing[axis] = count > 1 ? std::max(length / (count - 1), body) : 0;
    }
    if (!(counts[0] * counts[1] * specification_.sides <= kMostCameras)) return std::nullopt;
    array.camera = camera.id;
    array.focal_length_mm = focal_length;
    array.horizontal_fov = fov_of(camera, focal_length);
    array.is_rotated = is_rotated;
    array.width_px = camera.width_px;
    array.height_px = camera.height_px;
    array.columns = static_cast<int>(counts[0]);
    array.rows = static_cast<int>(counts[1]);
    array.sides = specification_.sides;
    array.ghosting_px = rig::ghosting_at_spacing(plan_.view_pitch, specification_.depth_range,
                                                 array.spacing.maxCoeff());
    array.resolution = resolution_of(array.horizontal_fov, camera.width_px);
    add_costs(camera, array);
    array.is_sufficient = array.ghosting_px <= specification_.largest_error_px * (1 + kAsGood) &&
                          array.resolution >= least_resolution();
    return array;
  }

  /// Returns the least resolution that lacks no whole pixel.
  double least_resolution() const { return 1 - 0.5 / specification_.views.width_px; }

  double resolution_of(double fov, double pixels) const {
    rig::CameraRow row;
    row.pixel_pitch = pitch_of(fov, pixels);
    row.fov = fov;
    rig::RowView view;
    view.fov = specification_.views.least_fov_deg * kRadians;
    view.rotation = specification_.views.max_yaw_deg * kRadians;
    const double distinct = rig::effective_resolution(row, view).never_oversampled;
    return std::min(1.0, distinct / specification_.views.width_px);
  }

  /// Returns the megabytes a second of one camera.
  double rate_of(const CatalogueCamera& camera) const {
    constexpr double kBitsPerByte = 8;
    return 1e-6 * camera.width_px * camera.height_px * specification_.fps * camera.bits_per_pixel /
           kBitsPerByte;
  }

  void add_costs(const CatalogueCamera& camera, ArrayAlternative& array) const {
    const ArraySpecification::Node& node = specification_.node;
    const ArraySpecification::Disk& disk = specification_.disk;
    constexpr double kSecondsPerMinute = 60, kMegaPerGiga = 1000;
    const double cameras = array.cameras();
    array.megapixels_per_s =
        cameras * camera.width_px * camera.height_px * specification_.fps * 1e-6;
    array.megabytes_per_s = cameras * rate_of(camera);
    const double per_node = std::min<double>(
        node.cameras, std::floor(node.megabytes_per_s / rate_of(camera) * (1 + kAsGood)));
    constexpr double kMost = 1e9;  // of nodes and disks: they are counted as int
    const double nodes = std::min(kMost, std::ceil(cameras / per_node));
    const double each = std::min(cameras, per_node) * rate_of(camera);  // of a full node
    const double gigabytes = each * specification_.minutes * kSecondsPerMinute / kMegaPerGiga;
    const double disks = std::max(
        {1.0, std::ceil(each / disk.megabytes_per_s), std::ceil(gigabytes / disk.gigabytes)});
    const double all_disks = std::min(kMost, nodes * disks);
    array.nodes = static_cast<int>(nodes);
    array.disks = static_cast<int>(all_disks);
    array.price = cameras * camera.price + nodes * node.price + all_disks * disk.price;
  }

  void mark_front() {
    double finest = 0;
    for (const ArrayAlternative& one : plan_.alternatives) {
      finest = std::max(finest, one.resolution);
    }
    std::vector<evaluation::ParetoPoint> points;
    for (const ArrayAlternative& one : plan_.alternatives) {
      // Arrays that lack resolution are not on the front while others have it.
      const bool counts = one.resolution >= finest * (1 - kAsGood);
      points.push_back({one.price, counts ? -one.ghosting_px : std::nan("")});
    }
    const std::vector<char> front = evaluation::pareto_front(points);
    for (std::size_t i = 0; i < front.size(); ++i) {
      plan_.alternatives[i].is_on_front = front[i] != 0;
    }
  }

  std::size_t best() const {
    const auto& all = plan_.alternatives;
    const auto sufficient = std::ranges::find(all, true, &ArrayAlternative::is_sufficient);
    if (sufficient != all.end()) return static_cast<std::size_t>(sufficient - all.begin());
    const auto least = std::ranges::min_element(all, {}, [](const ArrayAlternative& one) {
      return std::tuple(!one.is_on_front, one.ghosting_px);
    });
    return static_cast<std::size_t>(least - all.begin());
  }

  /// Compares numbers of cameras at one total rate: more cameras have fewer pixels each.
  void add_trade() {
    const ArrayAlternative& best = plan_.alternatives[*plan_.best];
    plan_.trade_megapixels_per_s = specification_.megapixels_per_s.value_or(best.megapixels_per_s);
    const double pixels =
        plan_.trade_megapixels_per_s * 1e6 / specification_.fps / specification_.sides;
    const double aspect = static_cast<double>(best.width_px) / best.height_px;
    std::set<std::pair<int, int>> seen;
    for (const double factor : kSpacings) {
      const double spacing = factor * best.spacing.maxCoeff();
      const double columns = count_along(extent().x(), spacing);
      const double rows = count_along(extent().y(), spacing);
      if (!(columns * rows * specification_.sides <= kMostCameras)) continue;
      RateTrade trade;
      trade.columns = static_cast<int>(columns);
      trade.rows = static_cast<int>(rows);
      trade.width_px = std::sqrt(pixels / (columns * rows) * aspect);
      trade.height_px = trade.width_px / aspect;
      if (trade.width_px < 1 || trade.height_px < 1) continue;
      if (!seen.insert({trade.columns, trade.rows}).second) continue;
      trade.spacing_m = std::max(columns > 1 ? extent().x() / (columns - 1) : 0,
                                 rows > 1 ? extent().y() / (rows - 1) : 0);
      trade.ghosting_px =
          rig::ghosting_at_spacing(plan_.view_pitch, specification_.depth_range, trade.spacing_m);
      trade.resolution = resolution_of(best.horizontal_fov, trade.width_px);
      plan_.trade.push_back(trade);
    }
    std::ranges::sort(plan_.trade, {}, [](const RateTrade& one) { return one.columns * one.rows; });
  }

  const ArraySpecification& specification_;
  ArrayPlan plan_;
};

}  // namespace

ArrayPlan plan_array(const ArraySpecification& specification, const std::string& name) {
  return ArrayPlanner(specification, name).plan(name);
}

namespace {

/// Returns the rotations of the sides of a cube against its first one.
std::vector<Eigen::Matrix3d> rotations_of_sides(int sides) {
  constexpr double kRight = std::numbers::pi / 2;
  std::vector<Eigen::Matrix3d> rotations{Eigen::Matrix3d::Identity()};
  if (sides == 1) return rotations;
  for (const int quarter : {1, 2, 3}) {
    rotations.push_back(
        Eigen::AngleAxisd(quarter * kRight, Eigen::Vector3d::UnitY()).toRotationMatrix());
  }
  for (const int quarter : {1, -1}) {
    rotations.push_back(
        Eigen::AngleAxisd(quarter * kRight, Eigen::Vector3d::UnitX()).toRotationMatrix());
  }
  return rotations;
}

/// Returns the poses of an array's cameras, row by row.
std::vector<rig::Pose> poses_of_side(const ArrayPlan& plan, const ArrayAlternative& of) {
  const Eigen::Vector2d middle = plan.needed.extent.center();
  std::vector<rig::Pose> poses;
  for (int row = 0; row < of.rows; ++row) {
    for (int column = 0; column < of.columns; ++column) {
      rig::Pose& pose = poses.emplace_back();
      pose.position = {middle.x() + (column - (of.columns - 1) / 2.0) * of.spacing.x(),
                       middle.y() - (row - (of.rows - 1) / 2.0) * of.spacing.y(), 0};
      if (!of.is_rotated) continue;
      const Eigen::Vector3d target(middle.x(), middle.y(), -plan.specification.subject->depth_m);
      const Eigen::Vector3d back = (pose.position - target).normalized();
      pose.world_from_camera_rotation.col(2) = back;
      pose.world_from_camera_rotation.col(0) = Eigen::Vector3d::UnitY().cross(back).normalized();
      pose.world_from_camera_rotation.col(1) = back.cross(pose.world_from_camera_rotation.col(0));
    }
  }
  return poses;
}

}  // namespace

schemas::RigDocument rig_of_alternative(const ArrayPlan& plan, const ArrayAlternative& of) {
  schemas::RigDocument rig;
  rig.name = plan.specification.name.empty() ? "planned" : plan.specification.name;
  // Rows and columns of several sides do not form one grid.
  rig.topology = of.sides == 1 && of.columns > 1 && of.rows > 1 ? "grid" : "auto";
  const double focal_length = of.width_px / (2 * std::tan(of.horizontal_fov / 2));
  const std::vector<rig::Pose> poses = poses_of_side(plan, of);
  const Eigen::Vector3d pivot = box_of_positions(plan.specification).center();
  const std::vector<Eigen::Matrix3d> rotations = rotations_of_sides(of.sides);
  for (std::size_t side = 0; side < rotations.size(); ++side) {
    for (int i = 0; i < of.columns * of.rows; ++i) {
      rig::Pose pose = poses[static_cast<std::size_t>(i)];
      pose.position = rotations[side] * (pose.position - pivot) + pivot;
      pose.world_from_camera_rotation = rotations[side] * pose.world_from_camera_rotation;
      const int row = i / of.columns, column = i % of.columns;
      schemas::RigDocument::Camera camera;
      camera.geometry.id =
          fmt::format("{}r{}c{}", of.sides == 1 ? "" : fmt::format("s{}", side), row, column);
      camera.geometry.width = of.width_px;
      camera.geometry.height = of.height_px;
      camera.geometry.intrinsics = {
          focal_length, focal_length, of.width_px / 2.0, of.height_px / 2.0, {}};
      camera.geometry.world_from_camera = rig::matrix_from_pose(pose);
      camera.geometry.row = row;
      camera.geometry.column = column;
      rig.cameras.push_back(camera);
    }
  }
  return rig;
}

}  // namespace raystage::planning
