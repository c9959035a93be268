// SPDX-License-Identifier: Apache-2.0
// Reads and writes Nuke's .chan text. Angles follow from R(third) R(second) R(first). Of the two
// sets of angles with the same rotation, each plus full turns, the one nearest to the previous line
// is written. At gimbal lock one outer angle is kept. Input and output: degrees in the text,
// radians in the interface. Cost: linear in lines.
#include "compose/camera/chan_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "base/error.h"
#include "base/number_text.h"

namespace raystage::compose {
namespace {

using Eigen::AngleAxisd;
using Eigen::Quaterniond;
using Eigen::Vector3d;

constexpr double kRadians = std::numbers::pi / 180;
constexpr std::string_view kBlank = " \t\r";

constexpr std::array<std::pair<std::string_view, RotationOrder>, 6> kOrders{
    {{"XYZ", RotationOrder::kXyz},
     {"XZY", RotationOrder::kXzy},
     {"YXZ", RotationOrder::kYxz},
     {"YZX", RotationOrder::kYzx},
     {"ZXY", RotationOrder::kZxy},
     {"ZYX", RotationOrder::kZyx}}};

/// Returns the axes (0 x, 1 y, 2 z) in the order of application.
std::array<int, 3> axes_of(RotationOrder order) {
  for (const auto& [name, known] : kOrders) {
    if (known == order) return {name[0] - 'X', name[1] - 'X', name[2] - 'X'};
  }
  return {2, 0, 1};
}

[[noreturn]] void refuse(std::string what, std::string_view name, int line,
                         std::string what_to_do) {
  throw Error::bad_input(std::move(what), fmt::format("{}:{}", name, line), std::move(what_to_do));
}

std::vector<double> numbers_of(std::string_view text, std::string_view name, int line) {
  std::vector<double> numbers;
  while (true) {
    const std::size_t begin = text.find_first_not_of(kBlank);
    if (begin == std::string_view::npos) return numbers;
    text.remove_prefix(begin);
    const std::string_view word = text.substr(0, text.find_first_of(kBlank));
    // from_chars rejects a plus sign, which some programs write.
    const std::string_view digits = word.starts_with('+') ? word.substr(1) : word;
    const auto value = parse_number<double>(digits);
    if (!value || !std::isfinite(*value)) {
      refuse(fmt::format("found \"{}\", allowed: a finite number", word.substr(0, 40)), name, line,
             "Write \"frame tx ty tz rx ry rz\" and, if known, the vertical field of view");
    }
    numbers.push_back(*value);
    text.remove_prefix(word.size());
  }
}

ChanLine line_from(const std::vector<double>& n, RotationOrder order, std::string_view name,
                   int line) {
  ChanLine result;
  result.frame = n[0];
  result.position = {n[1], n[2], n[3]};
  result.orientation = rotation_from_angles(Vector3d(n[4], n[5], n[6]) * kRadians, order);
  if (n.size() == 8) {
    if (!(n[7] > 0 && n[7] < 180)) {
      refuse(fmt::format("found a vertical field of view of {}, allowed: between 0 and 180 degrees",
                         n[7]),
             name, line, "Correct the eighth number");
    }
    result.vertical_fov = n[7] * kRadians;
  }
  return result;
}

/// Returns the angle plus a multiple of a full turn that is nearest to `to`.
double nearest_turn(double angle, double to) {
  constexpr double kTurn = 2 * std::numbers::pi;
  return angle + kTurn * std::round((to - angle) / kTurn);
}

}  // namespace

std::optional<RotationOrder> parse_rotation_order(std::string_view name) {
  for (const auto& [known, order] : kOrders) {
    if (known == name) return order;
  }
  return std::nullopt;
}

Quaterniond rotation_from_angles(const Vector3d& angles, RotationOrder order) {
  Quaterniond rotation = Quaterniond::Identity();
  for (const int axis : axes_of(order)) {
    rotation = Quaterniond(AngleAxisd(angles[axis], Vector3d::Unit(axis))) * rotation;
  }
  return rotation;
}

Vector3d angles_from_rotation(const Quaterniond& rotation, RotationOrder order,
                              const Vector3d& before) {
  const auto [first, second, third] = axes_of(order);
  const Eigen::Matrix3d m = rotation.toRotationMatrix();
  // m = R(third) R(second) R(first). The sign is positive for cyclic orders (XYZ, YZX, ZXY).
  const double sign = (second - third + 3) % 3 == 1 ? 1 : -1;
  const double sine = std::clamp(sign * m(third, first), -1.0, 1.0);
  const double cosine = std::hypot(m(third, third), m(third, second));
  Vector3d angles;
  angles[second] = std::atan2(sine, cosine);
  constexpr double kLocked = 1e-9;
  if (cosine > kLocked) {
    angles[third] = std::atan2(-sign * m(second, first), m(first, first));
    angles[first] = std::atan2(-sign * m(third, second), m(third, third));
  } else {
    // Gimbal lock: only the sum or difference of the outer angles is defined; one is kept.
    angles[third] = before[third];
    const Quaterniond rest =
        Quaterniond(AngleAxisd(angles[second], Vector3d::Unit(second))).conjugate() *
        Quaterniond(AngleAxisd(angles[third], Vector3d::Unit(third))).conjugate() * rotation;
    angles[first] = 2 * std::atan2(rest.vec()[first], rest.w());
  }
  Vector3d other = angles;  // the other angles of the same rotation
  other[first] += std::numbers::pi;
  other[second] = std::numbers::pi - other[second];
  other[third] += std::numbers::pi;
  for (int axis = 0; axis < 3; ++axis) {
    angles[axis] = nearest_turn(angles[axis], before[axis]);
    other[axis] = nearest_turn(other[axis], before[axis]);
  }
  return (other - before).norm() < (angles - before).norm() ? other : angles;
}

std::vector<ChanLine> parse_chan(std::string_view text, RotationOrder order,
                                 std::string_view name) {
  std::vector<ChanLine> lines;
  std::size_t columns = 0;
  for (int number = 1; !text.empty(); ++number) {
    const std::string_view line = text.substr(0, text.find('\n'));
    text.remove_prefix(std::min(text.size(), line.size() + 1));
    const std::size_t begin = line.find_first_not_of(kBlank);
    if (begin == std::string_view::npos || line[begin] == '#') continue;
    const std::vector<double> numbers = numbers_of(line, name, number);
    if (numbers.size() != 7 && numbers.size() != 8) {
      refuse(
          fmt::format("found {} numbers, allowed: 7, or 8 with the field of view", numbers.size()),
          name, number,
          "Write \"frame tx ty tz rx ry rz\" and, if known, the vertical field of view");
    }
    if (!lines.empty() && numbers.size() != columns) {
      refuse(fmt::format("found {} numbers, allowed: {} as before", numbers.size(), columns), name,
             number, "Give all lines a field of view, or none");
    }
    columns = numbers.size();
    if (!lines.empty() && !(numbers[0] > lines.back().frame)) {
      refuse(fmt::format("found frame {} after {}, allowed: ascending frames", numbers[0],
                         lines.back().frame),
             name, number, "Sort the lines by frame, and keep one per frame");
    }
    lines.push_back(line_from(numbers, order, name, number));
  }
  if (lines.empty()) refuse("the file has no line with a camera", name, 1, "Export it again");
  return lines;
}

std::string format_chan(const std::vector<ChanLine>& lines, RotationOrder order) {
  std::string text;
  Vector3d angles = Vector3d::Zero();
  for (const ChanLine& line : lines) {
    angles = angles_from_rotation(line.orientation, order, angles);
    const Vector3d degrees = angles / kRadians;
    const Vector3d& p = line.position;
    text += fmt::format("{}\t{}\t{}\t{}\t{}\t{}\t{}", line.frame, p.x(), p.y(), p.z(), degrees.x(),
                        degrees.y(), degrees.z());
    if (line.vertical_fov) text += fmt::format("\t{}", *line.vertical_fov / kRadians);
    text += '\n';
  }
  return text;
}

}  // namespace raystage::compose
