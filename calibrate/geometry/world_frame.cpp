// SPDX-License-Identifier: Apache-2.0
// Determines the axes of an array from its positions and the mean viewing direction: principal axes
// of a plane or line, direction of rows from the steps between neighbours. Assigns grid positions
// by walking from neighbour to neighbour and fits a lattice by least squares. Scales or aligns the
// world. Input: poses in world units. Cost: cameras squared.
#include "calibrate/geometry/world_frame.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <complex>
#include <queue>
#include <set>

#include "base/error.h"
#include "base/options.h"
#include "calibrate/geometry/alignment.h"
#include "calibrate/geometry/uncertainty.h"

namespace raystage::calibrate {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

std::vector<std::size_t> found_in(const ArrayModel& model) {
  std::vector<std::size_t> found;
  for (std::size_t i = 0; i < model.cameras.size(); ++i) {
    if (model.cameras[i].pose) found.push_back(i);
  }
  return found;
}

/// Means over the cameras, world axes.
struct Means {
  Vector3d centre = Vector3d::Zero();
  Matrix3d rotation = Matrix3d::Identity();  // rotation nearest to the mean
  double agreement = 0;                      // length of the mean viewing direction, 0 to 1
};

Means means_of(const ArrayModel& model, const std::vector<std::size_t>& found) {
  Means means;
  Matrix3d sum = Matrix3d::Zero();
  Vector3d view = Vector3d::Zero();
  for (const std::size_t i : found) {
    const rig::Pose& pose = *model.cameras[i].pose;
    means.centre += pose.position;
    sum += pose.world_from_camera_rotation;
    view += pose.viewing_direction();
  }
  means.centre /= static_cast<double>(found.size());
  means.agreement = view.norm() / static_cast<double>(found.size());
  const Eigen::JacobiSVD<Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Matrix3d mirror = Matrix3d::Identity();
  mirror(2, 2) = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1;
  means.rotation = svd.matrixU() * mirror * svd.matrixV().transpose();
  return means;
}

/// Returns the steps to near neighbours, in the plane of `axes`' first two columns.
std::vector<Vector2d> neighbour_steps(const ArrayModel& model,
                                      const std::vector<std::size_t>& found, const Matrix3d& axes) {
  constexpr double kAsNear = 1.25;  // a grid's diagonal is 1.41 away
  const double near = median_neighbour_distance(model) * kAsNear;
  std::vector<Vector2d> steps;
  for (const std::size_t a : found) {
    for (const std::size_t b : found) {
      const Vector3d step = model.cameras[b].pose->position - model.cameras[a].pose->position;
      if (a != b && step.norm() <= near) steps.emplace_back((axes.transpose() * step).head<2>());
    }
  }
  return steps;
}

/// Returns the angle of the rows to the first axis, radians, within 45 degrees; 0 if the steps to
/// neighbours do not have two perpendicular directions.
double row_rotation(const std::vector<Vector2d>& steps) {
  std::complex<double> sum = 0;
  for (const Vector2d& step : steps) sum += std::polar(1.0, 4 * std::atan2(step.y(), step.x()));
  constexpr double kRegular = 0.7;
  if (steps.empty() || std::abs(sum) < kRegular * static_cast<double>(steps.size())) return 0;
  return std::arg(sum) / 4;
}

/// Returns the world axes of the array as columns x, y, z.
Matrix3d axes_of(const ArrayModel& model, const std::vector<std::size_t>& found,
                 const Means& means) {
  Matrix3d spread = Matrix3d::Zero();
  for (const std::size_t i : found) {
    const Vector3d off = model.cameras[i].pose->position - means.centre;
    spread += off * off.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Matrix3d> eigen(spread);
  const Vector3d sizes = eigen.eigenvalues().cwiseMax(0).cwiseSqrt();  // smallest first
  Matrix3d axes = means.rotation;
  if (!(sizes[2] > 0)) return axes;
  constexpr double kThin = 0.15;  // thickness relative to breadth of a plane, or of a line
  // cosine of 30 degrees: limit between a plane's normal and the viewing direction
  constexpr double kFacing = 0.86;
  const bool is_line = sizes[1] < kThin * sizes[2];
  if (is_line) {
    // The axis of the cameras that is nearer to the line.
    Vector3d along = eigen.eigenvectors().col(2);
    const Vector3d in_cameras = means.rotation.transpose() * along;
    const int axis = std::abs(in_cameras.y()) > std::abs(in_cameras.x()) ? 1 : 0;
    if (std::abs(in_cameras[axis]) < kFacing) return axes;
    along *= in_cameras[axis] < 0 ? -1 : 1;
    axes.col(axis) = along;
    const Vector3d z = (axes.col(2) - along * along.dot(axes.col(2))).normalized();
    axes.col(2) = z;
    axes.col(1 - axis) = axis == 0 ? z.cross(along) : along.cross(z);
    return axes;
  }
  const bool is_plane = sizes[0] < kThin * sizes[1];
  Vector3d normal = eigen.eigenvectors().col(0);
  normal *= normal.dot(axes.col(2)) < 0 ? -1 : 1;
  if (is_plane && normal.dot(axes.col(2)) > kFacing) {
    axes.col(2) = normal;
    axes.col(0) = (axes.col(0) - normal * normal.dot(axes.col(0))).normalized();
    axes.col(1) = normal.cross(axes.col(0));
  }
  const double turn = row_rotation(neighbour_steps(model, found, axes));
  const Vector3d x = std::cos(turn) * axes.col(0) + std::sin(turn) * axes.col(1);
  axes.col(1) = axes.col(2).cross(x);
  axes.col(0) = x;
  return axes;
}

/// Returns grid positions from steps between neighbours, relative to the first camera.
std::vector<std::optional<GridPosition>> assign_grid_positions(
    const ArrayModel& model, double spacing, const std::vector<std::size_t>& found) {
  std::vector<std::optional<GridPosition>> places(model.cameras.size());
  places[found.front()] = GridPosition{};
  std::queue<std::size_t> next({found.front()});
  while (!next.empty()) {
    const std::size_t from = next.front();
    next.pop();
    for (const std::size_t to : found) {
      if (places[to]) continue;
      const Vector3d step =
          (model.cameras[to].pose->position - model.cameras[from].pose->position) / spacing;
      const double across = std::round(step.x()), up = std::round(step.y());
      constexpr double kMaxDeviation = 0.45;
      if (std::abs(across) + std::abs(up) != 1 || std::abs(step.x() - across) > kMaxDeviation ||
          std::abs(step.y() - up) > kMaxDeviation || std::abs(step.z()) > kMaxDeviation) {
        continue;
      }
      places[to] = GridPosition{places[from]->row - static_cast<int>(up),
                                places[from]->column + static_cast<int>(across)};
      next.push(to);
    }
  }
  return places;
}

/// Least-squares grid: corner + column * along + row * down.
struct Lattice {
  Vector3d corner, along = Vector3d::Zero(), down = Vector3d::Zero();
  int rows = 0, columns = 0;

  Vector3d at(const GridPosition& place) const {
    return corner + place.column * along + place.row * down;
  }
  double spacing() const {
    if (rows < 2) return along.norm();
    if (columns < 2) return down.norm();
    return (along.norm() + down.norm()) / 2;
  }
};

Lattice lattice_of(const ArrayModel& model, const std::vector<std::size_t>& found,
                   const std::vector<std::optional<GridPosition>>& places) {
  Lattice lattice;
  Eigen::MatrixX3d left(found.size(), 3), right(found.size(), 3);
  for (std::size_t k = 0; k < found.size(); ++k) {
    const GridPosition& place = *places[found[k]];
    const auto row = static_cast<Eigen::Index>(k);
    left.row(row) << 1, place.column, place.row;
    right.row(row) = model.cameras[found[k]].pose->position.transpose();
    lattice.rows = std::max(lattice.rows, place.row + 1);
    lattice.columns = std::max(lattice.columns, place.column + 1);
  }
  const Eigen::Matrix3d solution = left.completeOrthogonalDecomposition().solve(right);
  lattice.corner = solution.row(0);
  if (lattice.columns > 1) lattice.along = solution.row(1);
  if (lattice.rows > 1) lattice.down = solution.row(2);
  return lattice;
}

struct Grid {
  std::vector<std::optional<GridPosition>> places;
  Lattice lattice;
};

std::optional<Grid> grid_of(const ArrayModel& model) {
  const std::vector<std::size_t> found = found_in(model);
  if (found.size() < 2) return std::nullopt;
  Grid grid{assign_grid_positions(model, median_neighbour_distance(model), found), {}};
  GridPosition least;
  std::set<std::pair<int, int>> taken;
  for (const std::size_t i : found) {
    const auto& place = grid.places[i];
    if (!place || !taken.emplace(place->row, place->column).second) return std::nullopt;
    least.row = std::min(least.row, place->row);
    least.column = std::min(least.column, place->column);
  }
  for (const std::size_t i : found) {
    grid.places[i]->row -= least.row;
    grid.places[i]->column -= least.column;
  }
  grid.lattice = lattice_of(model, found, grid.places);
  constexpr double kMaxDeviation = 1.0 / 3;
  for (const std::size_t i : found) {
    const Vector3d off = model.cameras[i].pose->position - grid.lattice.at(*grid.places[i]);
    if (!(off.norm() <= kMaxDeviation * grid.lattice.spacing())) return std::nullopt;
  }
  return grid;
}

std::size_t camera_named(const ArrayModel& model, const std::string& id) {
  const auto camera = std::ranges::find(model.cameras, id, &ArrayModel::Camera::id);
  if (camera == model.cameras.end()) {
    throw Error::bad_input("the camera \"" + id + "\" of the measured distance is unknown", "",
                           "Name two of the array's cameras");
  }
  if (!camera->pose) {
    throw Error::bad_input(
        "camera \"" + id + "\" has no pose, so a distance from it cannot set the scale", "",
        "Measure between two cameras that see the light");
  }
  return static_cast<std::size_t>(camera - model.cameras.begin());
}

void grow(ArrayModel& model, double factor) {
  SimilarityTransform similarity;
  similarity.scale = factor;
  apply(similarity, model);
}

}  // namespace

void align_to_array(ArrayModel& model) {
  const std::vector<std::size_t> found = found_in(model);
  const Means means = means_of(model, found);
  SimilarityTransform similarity;
  similarity.rotation = axes_of(model, found, means).transpose();
  similarity.translation = -(similarity.rotation * means.centre);
  apply(similarity, model);
}

std::optional<std::vector<std::optional<GridPosition>>> find_grid_positions(
    const ArrayModel& model) {
  const auto grid = grid_of(model);
  if (!grid) return std::nullopt;
  return grid->places;
}

double camera_spacing(const ArrayModel& model) {
  const auto grid = grid_of(model);
  return grid ? grid->lattice.spacing() : median_neighbour_distance(model);
}

bool ScaleOptions::is_valid(std::string* reason) const {
  return is_within("spacing (m)", spacing_m.value_or(1), 1e-9, 1e9, reason) &&
         is_within("distance (m)", distance ? distance->metres : 1, 1e-9, 1e9, reason);
}

bool scale_world(ArrayModel& model, const ScaleOptions& options) {
  require_valid(options, "scale of the world");
  double known = 0, found = 0;
  if (options.distance) {
    const auto& [from, to, metres] = *options.distance;
    const rig::Pose& a = *model.cameras[camera_named(model, from)].pose;
    const rig::Pose& b = *model.cameras[camera_named(model, to)].pose;
    known = metres;
    found = (b.position - a.position).norm();
  } else if (options.spacing_m) {
    known = *options.spacing_m;
    found = camera_spacing(model);
  } else {
    return false;
  }
  if (!(found > 0)) {
    throw Error::bad_input("the two cameras of the measured distance are at the same position", "",
                           "State the distance between two cameras at different positions");
  }
  grow(model, known / found);
  return true;
}

bool align_to_poses(ArrayModel& model, std::span<const std::optional<rig::Pose>> known,
                    bool scales) {
  std::vector<rig::Pose> from, to;
  for (std::size_t i = 0; i < model.cameras.size() && i < known.size(); ++i) {
    if (!model.cameras[i].pose || !known[i]) continue;
    from.push_back(*model.cameras[i].pose);
    to.push_back(*known[i]);
  }
  if (from.size() < 2) return false;
  SimilarityTransform similarity = estimate_similarity(from, to);
  if (!scales) {
    similarity.scale = 1;
    similarity.translation.setZero();
    Eigen::Vector3d translation = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < from.size(); ++i) {
      translation += to[i].position - similarity(from[i].position);
    }
    similarity.translation = translation / static_cast<double>(from.size());
  }
  apply(similarity, model);
  return true;
}

}  // namespace raystage::calibrate
