// SPDX-License-Identifier: Apache-2.0
// Converts X-Rite's CIE L*a*b* values (D50, 2 degrees) of the 24 patches of a ColorChecker Classic
// to linear light with Rec.709 primaries (CIE 15:2004), after Bradford adaptation from D50 to D65.
// Output: 24 x R, G, B, 1 = a perfect white. Cost: constant.
#include "rig/color_checker.h"

#include <Eigen/Dense>

namespace raystage::rig {
namespace {

constexpr std::array<std::array<double, 3>, kChartPatches> kLab{{
    {37.54, 14.37, 14.92},  {64.66, 19.27, 17.50},   {49.32, -3.82, -22.54}, {43.46, -12.74, 22.72},
    {54.94, 9.61, -24.79},  {70.48, -32.26, -0.37},  {62.73, 35.83, 56.50},  {39.43, 10.75, -45.17},
    {50.57, 48.64, 16.67},  {30.10, 22.54, -20.87},  {71.77, -24.13, 58.19}, {71.51, 18.24, 67.37},
    {28.37, 15.42, -49.80}, {54.38, -39.72, 32.27},  {42.43, 51.05, 28.62},  {81.80, 2.67, 80.41},
    {50.63, 51.28, -14.12}, {49.57, -29.71, -28.32}, {95.19, -1.03, 2.93},   {81.29, -0.57, 0.44},
    {66.89, -0.75, -0.06},  {50.76, -0.13, 0.14},    {35.63, -0.46, -0.48},  {20.64, 0.07, -0.46},
}};

/// Returns the inverse of the function f of CIE L*a*b* (CIE 15:2004).
double inverse_lab_f(double t) {
  constexpr double kKnee = 6.0 / 29;
  return t > kKnee ? t * t * t : 3 * kKnee * kKnee * (t - 4.0 / 29);
}

/// Returns the Bradford matrix, from XYZ to cone responses.
Eigen::Matrix3d bradford() {
  Eigen::Matrix3d m;
  m << 0.8951, 0.2664, -0.1614, -0.7502, 1.7135, 0.0367, 0.0389, -0.0685, 1.0296;
  return m;
}

/// Returns the matrix from linear light with ITU-R BT.709 primaries to XYZ for a white point.
Eigen::Matrix3d xyz_from_rec709(const Eigen::Vector3d& white) {
  Eigen::Matrix3d primaries;
  primaries << 0.64, 0.30, 0.15, 0.33, 0.60, 0.06, 0.03, 0.10, 0.79;
  const Eigen::Vector3d strength = primaries.inverse() * white;
  return primaries * strength.asDiagonal();
}

}  // namespace

PatchColors color_checker_reference() {
  const Eigen::Vector3d d50(0.96422, 1, 0.82521);
  const Eigen::Vector3d d65(0.3127 / 0.3290, 1, (1 - 0.3127 - 0.3290) / 0.3290);
  const Eigen::Vector3d change = (bradford() * d65).cwiseQuotient(bradford() * d50);
  const Eigen::Matrix3d rec709_from_d50 =
      xyz_from_rec709(d65).inverse() * bradford().inverse() * change.asDiagonal() * bradford();
  PatchColors light{};
  for (std::size_t i = 0; i < light.size(); ++i) {
    const auto& [l, a, b] = kLab[i];
    const double y = (l + 16) / 116;
    const Eigen::Vector3d xyz(d50.x() * inverse_lab_f(y + a / 500), inverse_lab_f(y),
                              d50.z() * inverse_lab_f(y - b / 200));
    const Eigen::Vector3d rgb = rec709_from_d50 * xyz;
    light[i] = {rgb.x(), rgb.y(), rgb.z()};
  }
  return light;
}

}  // namespace raystage::rig
