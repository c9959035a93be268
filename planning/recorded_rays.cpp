// SPDX-License-Identifier: Apache-2.0
// Measures which rays of a view were recorded, as areas of the picture (thesis 4.1.2 and 5.2). The
// rays of a cell fill a convex polygon. Each of its cameras sees the focal plane in a part of the
// picture that four borders bound, which are linear in the pixel without lens distortion. The union
// of the parts of up to three cameras is the sum of their intersections with alternating signs,
// each of which is convex. With distortion, and for fisheyes, a polygon is divided until its
// borders are nearly straight. Cost: O(cells), 20 to 100 microseconds for 64 cameras.
#include "planning/recorded_rays.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <boost/container/small_vector.hpp>
#include <cmath>
#include <optional>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include "planning/ideal_view.h"
#include "render/common/plane_projection.h"
#include "render/common/ray_cells.h"

namespace raystage::planning {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using render::RayCells;

constexpr int kBorders = 4;  // left, right, top, bottom
/// How far inside its picture's borders a camera sees a point; below 0: outside.
using Borders = std::array<double, kBorders>;
constexpr Borders kNowhere{-1, -1, -1, -1};

/// A camera that looks at the focal plane, as seen by the view.
class PlaneView {
 public:
  /// `bend`: how far from straight a border may be taken for straight, in widths of the picture.
  PlaneView(const render::PlaneProjection& projection, const rig::Rig::Camera& camera, double bend)
      : model_(&camera.model),
        tolerance_(bend * camera.model.width()),
        ideal_from_pixel_(projection.ideal_from_pixel(camera.pose)),
        is_straight_(!camera.model.has_distortion()) {
    const schemas::Intrinsics& k = camera.model.intrinsics();
    const auto x = k.fx * ideal_from_pixel_.row(0) + k.cx * ideal_from_pixel_.row(2);
    const auto y = k.fy * ideal_from_pixel_.row(1) + k.cy * ideal_from_pixel_.row(2);
    borders_.row(0) = x;
    borders_.row(1) = camera.model.width() * ideal_from_pixel_.row(2) - x;
    borders_.row(2) = y;
    borders_.row(3) = camera.model.height() * ideal_from_pixel_.row(2) - y;
  }

  /// Returns whether the borders are linear in the view's pixel.
  bool is_straight() const { return is_straight_; }
  /// Returns how far from linear, pixels, the borders may be taken for linear.
  double tolerance() const { return tolerance_; }
  /// Returns how far inside its borders, in their units, a place certainly stays between others.
  double far_inside() const { return is_straight_ ? 0 : 0.15 * model_->width(); }
  /// Returns after how many halvings of a region that holds.
  int far_inside_from() const { return model_->fisheye() != nullptr ? 3 : 0; }

  Borders borders_at(const Vector2d& pixel) const {
    const Vector3d at(pixel.x(), pixel.y(), 1);
    if (is_straight_) {
      const Eigen::Vector4d values = borders_ * at;
      return {values(0), values(1), values(2), values(3)};
    }
    const auto found = project_ideal(*model_, ideal_from_pixel_ * at);
    if (!found) return scaled(kNowhere);
    return {found->x(), model_->width() - found->x(), found->y(), model_->height() - found->y()};
  }

 private:
  /// Returns borders that are as far outside as the picture is wide.
  Borders scaled(Borders borders) const {
    for (double& border : borders) border *= model_->width();
    return borders;
  }

  const rig::CameraModel* model_;
  double tolerance_;
  Matrix3d ideal_from_pixel_;
  Eigen::Matrix<double, kBorders, 3> borders_;
  bool is_straight_;
};

/// A convex polygon.
class Polygon {
 public:
  void add(const Vector2d& corner) { corners_.push_back(corner); }
  bool is_empty() const { return corners_.size() < 3; }
  std::size_t size() const { return corners_.size(); }
  const Vector2d& operator[](std::size_t i) const { return corners_[i]; }

  double area() const {
    double twice = 0;
    for (std::size_t i = 2; i < corners_.size(); ++i) {
      const Vector2d a = corners_[i - 1] - corners_[0], b = corners_[i] - corners_[0];
      twice += a.x() * b.y() - a.y() * b.x();
    }
    return std::abs(twice) / 2;
  }

  /// Returns the part where a x + b y + c is not negative.
  Polygon clipped(const Vector3d& line) const {
    const auto value = [&](const Vector2d& p) {
      return line.x() * p.x() + (line.y() * p.y() + line.z());
    };
    Polygon kept;
    if (is_empty()) return kept;
    double at_from = value(corners_.back());
    const Vector2d* from = &corners_.back();
    for (const Vector2d& to : corners_) {
      const double at_to = value(to);
      if ((at_from >= 0) != (at_to >= 0)) {
        kept.add(*from + at_from / (at_from - at_to) * (to - *from));
      }
      if (at_to >= 0) kept.add(to);
      from = &to;
      at_from = at_to;
    }
    return kept;
  }

  /// Returns whether a x + b y + c is negative in a part.
  bool reaches_beyond(const Vector3d& line) const {
    return std::any_of(corners_.begin(), corners_.end(), [&](const Vector2d& p) {
      return line.x() * p.x() + (line.y() * p.y() + line.z()) < 0;
    });
  }

  Eigen::AlignedBox2d box() const {
    Eigen::AlignedBox2d box;
    for (const Vector2d& corner : corners_) box.extend(corner);
    return box;
  }

 private:
  boost::container::small_vector<Vector2d, 12> corners_;
};

constexpr std::size_t kMaxCameras = 3;  // of a cell

/// A position in the view, and what the cell's cameras see of the focal plane there.
struct Corner {
  Vector2d at;
  std::array<Borders, kMaxCameras> borders;
};

/// The cameras of a cell.
class CellCameras {
 public:
  void add(const PlaneView& camera) { cameras_[count_++] = &camera; }

  /// Returns the area of the triangle that at least one camera sees.
  double seen_area(const std::array<Vector2d, 3>& triangle) const {
    return seen_area({corner(triangle[0]), corner(triangle[1]), corner(triangle[2])}, 0);
  }

 private:
  using Corners = std::array<Corner, 3>;

  Corner corner(const Vector2d& at) const {
    Corner result;
    result.at = at;
    for (std::size_t i = 0; i < count_; ++i) result.borders[i] = cameras_[i]->borders_at(at);
    return result;
  }

  static double area_of(const Corners& corners) {
    const Vector2d a = corners[1].at - corners[0].at, b = corners[2].at - corners[0].at;
    return std::abs(a.x() * b.y() - a.y() * b.x()) / 2;
  }

  /// Returns how far a camera's borders at the middles of the sides are from the means of those at
  /// their ends, at most.
  static double deviation(const Corners& corners, const Corners& middles, std::size_t camera) {
    double most = 0;
    for (std::size_t side = 0; side < 3; ++side) {
      const Borders &from = corners[side].borders[camera],
                    &to = corners[(side + 1) % 3].borders[camera];
      for (std::size_t k = 0; k < kBorders; ++k) {
        most = std::max(most, std::abs(middles[side].borders[camera][k] - (from[k] + to[k]) / 2));
      }
    }
    return most;
  }

  /// Returns whether a camera sees all of a triangle, so far from its borders that no bend of
  /// theirs matters.
  bool is_clearly_inside(const Corners& corners, int depth) const {
    for (std::size_t i = 0; i < count_; ++i) {
      if (depth < cameras_[i]->far_inside_from()) continue;
      double least = corners[0].borders[i][0];
      for (const Corner& corner : corners) {
        for (const double border : corner.borders[i]) least = std::min(least, border);
      }
      if (least >= cameras_[i]->far_inside()) return true;
    }
    return false;
  }

  double seen_area(const Corners& corners, int depth) const {
    constexpr int kMaxDepth = 7;
    const bool is_curved = std::any_of(cameras_.begin(), cameras_.begin() + count_,
                                       [](const auto* camera) { return !camera->is_straight(); });
    if (is_clearly_inside(corners, depth)) return area_of(corners);
    std::array<double, kMaxCameras> margin{};
    Corners middles;
    bool divide = false;
    if (is_curved) {
      for (std::size_t side = 0; side < 3; ++side) {
        middles[side] = corner((corners[side].at + corners[(side + 1) % 3].at) / 2);
      }
      for (std::size_t i = 0; i < count_; ++i) {
        const double bent = deviation(corners, middles, i);
        margin[i] = 4 * bent;  // distortion may be stronger between the middles
        divide = divide || bent > cameras_[i]->tolerance();
      }
    }
    std::vector<std::size_t> partial;
    partial.reserve(count_);
    for (std::size_t i = 0; i < count_; ++i) {
      double least = corners[0].borders[i][0];
      bool is_outside = false;
      for (std::size_t k = 0; k < kBorders; ++k) {
        const auto [low, high] = std::minmax(
            {corners[0].borders[i][k], corners[1].borders[i][k], corners[2].borders[i][k]});
        least = std::min(least, low);
        is_outside = is_outside || high < -margin[i];
      }
      const bool is_coarse = depth < cameras_[i]->far_inside_from();
      divide = divide || is_coarse;
      if (least >= margin[i] && !is_coarse) return area_of(corners);
      if (!is_outside || is_coarse) partial.push_back(i);
    }
    if (partial.empty()) return 0;
    if (!divide || depth == kMaxDepth) return union_area(corners, partial);
    double area = 0;
    for (std::size_t side = 0; side < 3; ++side) {
      area += seen_area({corners[side], middles[side], middles[(side + 2) % 3]}, depth + 1);
    }
    return area + seen_area(middles, depth + 1);
  }

  /// Returns the area that cameras see, with their borders linear within the triangle.
  static double union_area(const Corners& corners, const std::vector<std::size_t>& cameras) {
    double share = 0;  // of the triangle, in barycentric coordinates: its area there is 1/2
    for (unsigned subset = 1; subset < 1U << cameras.size(); ++subset) {
      Polygon polygon;
      for (const Vector2d& p : {Vector2d(0, 0), Vector2d(1, 0), Vector2d(0, 1)}) polygon.add(p);
      int members = 0;
      for (std::size_t i = 0; i < cameras.size() && !polygon.is_empty(); ++i) {
        if ((subset >> i & 1U) == 0) continue;
        ++members;
        for (std::size_t k = 0; k < kBorders; ++k) {
          const double origin = corners[0].borders[cameras[i]][k];
          polygon = polygon.clipped({corners[1].borders[cameras[i]][k] - origin,
                                     corners[2].borders[cameras[i]][k] - origin, origin});
        }
      }
      if (!polygon.is_empty()) share += (members % 2 == 1 ? 2 : -2) * polygon.area();
    }
    return share * area_of(corners);
  }

  std::array<const PlaneView*, kMaxCameras> cameras_{};
  std::size_t count_ = 0;
};

/// Returns whether the array folds over itself as seen from `eye`: rays then cross several cells,
/// of which the first counts.
bool is_folded(const rig::Rig& rig, const rig::Topology& topology, const Vector3d& eye) {
  // A line leaves a closed surface through one cell, from wherever it is seen.
  if (topology.kind != rig::Topology::Kind::kTriangles || topology.outwards) return false;
  bool left = false, right = false;
  for (const rig::Topology::Cell& cell : topology.cells) {
    std::array<Vector3d, 3> to;
    for (std::size_t i = 0; i < 3; ++i) to[i] = rig.cameras[cell[i]].pose.position - eye;
    const double side = to[0].dot((to[1] - to[0]).cross(to[2] - to[0]));
    (side > 0 ? right : left) = true;
  }
  return left && right;
}

/// The part of the view whose rays pass through a cell from one side of it.
struct Region {
  const RayCells::Cell* cell = nullptr;
  std::vector<Vector3d> lines;  ///< the part is where none is negative
  Polygon polygon;              ///< the part within the picture
  Eigen::AlignedBox2d box;      ///< around it
};

std::vector<Region> regions_of(const RayCells& cells, const Polygon& picture) {
  std::vector<Region> regions;
  for (const RayCells::Cell& cell : cells.cells()) {
    for (const double sign : {1.0, -1.0}) {
      if (sign < 0 && cell.only_leaving) continue;
      Region region;
      region.cell = &cell;
      region.lines.emplace_back(sign * cell.total);
      for (int i = 0; i < cell.count && cell.count > 1; ++i) {
        region.lines.emplace_back(sign * cell.share[i]);
      }
      region.polygon = picture;
      for (const Vector3d& line : region.lines) region.polygon = region.polygon.clipped(line);
      if (region.polygon.is_empty()) continue;
      region.box = region.polygon.box();
      regions.push_back(std::move(region));
    }
  }
  return regions;
}

/// Returns the parts of a region that no region before it covers.
std::vector<Polygon> uncovered_parts(std::span<const Region> before, const Region& region) {
  std::vector<Polygon> parts{region.polygon};
  for (const Region& other : before) {
    if (!other.box.intersects(region.box)) continue;
    std::vector<Polygon> outside;
    for (Polygon part : parts) {
      for (const Vector3d& line : other.lines) {
        // Not where the line is 0 everywhere, as on the border of two cells.
        if (part.reaches_beyond(line)) outside.push_back(part.clipped(-line));
        part = part.clipped(line);
      }
    }
    parts = std::move(outside);
  }
  return parts;
}

/// Returns the share by testing rays on a grid of at most `columns` x `rows`.
double sampled_share(const render::VirtualCamera& view, const rig::Rig& rig, const RayCells& cells,
                     const render::PlaneProjection& projection, int columns, int rows) {
  std::vector<PlaneView> cameras;
  cameras.reserve(rig.cameras.size());
  for (const rig::Rig::Camera& camera : rig.cameras) cameras.emplace_back(projection, camera, 0);
  const auto is_recorded = [&](const Vector2d& pixel) {
    const auto crossing = cells.locate(pixel.x(), pixel.y());
    if (!crossing || !(projection.depth(pixel.x(), pixel.y()) > 0)) return false;
    const RayCells::Cell& cell = cells.cells()[crossing->cell];
    return std::any_of(cell.camera.begin(), cell.camera.begin() + cell.count, [&](int camera) {
      return std::ranges::min(cameras[camera].borders_at(pixel)) >= 0;
    });
  };
  long missing = 0;
  for (int y = 0; y < rows; ++y) {
    for (int x = 0; x < columns; ++x) {
      const Vector2d pixel((x + 0.5) * view.width / columns, (y + 0.5) * view.height / rows);
      missing += is_recorded(pixel) ? 0 : 1;
    }
  }
  return static_cast<double>(missing) / (static_cast<double>(columns) * rows);
}

}  // namespace

namespace {

/// How precisely the unrecorded part of a view's rays is computed.
struct Precision {
  double bend = 2e-4;  ///< see PlaneView
  double enough = 1;   ///< where it is larger, any larger number will do
};

/// Returns the unrecorded part of a view's rays, 0 to 1.
double unrecorded_part(const render::VirtualCamera& given, const rig::Rig& rig,
                       const rig::Topology& topology, const Eigen::Vector4d& plane,
                       const Precision& precision) {
  const render::VirtualCamera view = ideal_view(given);
  const render::PlaneProjection projection(view, plane);
  if (!projection.at_infinity() && projection.distance() == 0) return 1;
  Polygon picture;
  for (const auto& [x, y] :
       {std::pair{0, 0}, {view.width, 0}, {view.width, view.height}, {0, view.height}}) {
    picture.add(Vector2d(x, y));
  }
  if (!projection.at_infinity()) {  // the plane is in front of the view where its depth is positive
    const double sign = projection.distance() > 0 ? 1 : -1;
    picture = picture.clipped(sign * projection.slope());
  }
  const RayCells cells(view, rig, topology);
  const std::vector<Region> regions = regions_of(cells, picture);
  const double total = static_cast<double>(view.width) * view.height;
  double of_regions = 0;
  for (const Region& region : regions) of_regions += region.polygon.area();
  // All rays of a view on the border of two cells are in both.
  constexpr double kAreaRounding = 1e-9;
  const bool overlap =
      is_folded(rig, topology, view.pose.position) || of_regions > total * (1 + kAreaRounding);
  // Of regions that overlap the areas are only known after subtraction.
  double missing = overlap ? total : total - of_regions;
  std::vector<std::optional<PlaneView>> cameras(rig.cameras.size());
  for (std::size_t r = 0; r < regions.size(); ++r) {
    if (!overlap && missing > precision.enough * total) break;
    const RayCells::Cell& cell = *regions[r].cell;
    CellCameras sources;
    for (int i = 0; i < cell.count; ++i) {
      std::optional<PlaneView>& camera = cameras[cell.camera[i]];
      if (!camera) camera.emplace(projection, rig.cameras[cell.camera[i]], precision.bend);
      sources.add(*camera);
    }
    const auto seen_in = [&](const Polygon& polygon) {
      double seen = 0;
      for (std::size_t i = 2; i < polygon.size(); ++i) {
        seen += sources.seen_area({polygon[0], polygon[i - 1], polygon[i]});
      }
      return seen;
    };
    if (!overlap) {
      missing += regions[r].polygon.area() - seen_in(regions[r].polygon);
      continue;
    }
    for (const Polygon& part : uncovered_parts(std::span(regions).first(r), regions[r])) {
      missing -= seen_in(part);
    }
  }
  constexpr double kRounding = 1e-9;
  const double share = missing / total;
  return share < kRounding ? 0 : std::min(share, 1.0);
}

}  // namespace

double unrecorded_share(const render::VirtualCamera& view, const rig::Rig& rig,
                        const rig::Topology& topology, const Eigen::Vector4d& plane) {
  return unrecorded_part(view, rig, topology, plane, {});
}

bool is_recorded(const render::VirtualCamera& view, const rig::Rig& rig,
                 const rig::Topology& topology, const Eigen::Vector4d& plane, double share) {
  const double most_missing = 1 - share;
  constexpr double kBend = 5e-4;
  return unrecorded_part(view, rig, topology, plane, {kBend, most_missing}) <= most_missing + 1e-12;
}

double unseen_share(const render::VirtualCamera& given, const rig::Rig& rig,
                    const rig::Topology& topology, const Eigen::Vector4d& plane) {
  const render::VirtualCamera view = ideal_view(given);
  const render::PlaneProjection projection(view, plane);
  if (!projection.at_infinity() && projection.distance() == 0) return 1;
  std::set<int> present;
  for (const rig::Topology::Cell& cell : topology.cells) {
    for (const int camera : cell) {
      if (camera >= 0) present.insert(camera);
    }
  }
  std::vector<PlaneView> cameras;
  for (const int camera : present) cameras.emplace_back(projection, rig.cameras[camera], 0);
  constexpr int kColumns = 65, kRows = 49;
  std::size_t last = 0;  // the camera that saw the ray before: it often sees the next one, too
  const auto is_seen = [&](const Vector2d& pixel) {
    if (!(projection.depth(pixel.x(), pixel.y()) > 0)) return false;
    for (std::size_t i = 0; i < cameras.size(); ++i) {
      const std::size_t camera = (last + i) % cameras.size();
      if (std::ranges::min(cameras[camera].borders_at(pixel)) < 0) continue;
      last = camera;
      return true;
    }
    return false;
  };
  // To the picture's borders, where views are the first to lack rays; by the trapezoidal rule.
  const auto weight = [](int i, int count) { return i == 0 || i == count - 1 ? 0.5 : 1.0; };
  double missing = 0;
  for (int y = 0; y < kRows; ++y) {
    for (int x = 0; x < kColumns; ++x) {
      const Vector2d pixel(x * view.width / (kColumns - 1.0), y * view.height / (kRows - 1.0));
      if (!is_seen(pixel)) missing += weight(x, kColumns) * weight(y, kRows);
    }
  }
  return missing / ((kColumns - 1.0) * (kRows - 1.0));
}

double unrecorded_share_reference(const render::VirtualCamera& given, const rig::Rig& rig,
                                  const rig::Topology& topology, const Eigen::Vector4d& plane) {
  const render::VirtualCamera view = ideal_view(given);
  const render::PlaneProjection projection(view, plane);
  if (!projection.at_infinity() && projection.distance() == 0) return 1;
  return sampled_share(view, rig, RayCells(view, rig, topology), projection, view.width,
                       view.height);
}

}  // namespace raystage::planning
