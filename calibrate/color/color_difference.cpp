// SPDX-License-Identifier: Apache-2.0
// Computes CIE L*a*b* from linear Rec.709 light (IEC 61966-2-1, CIE 15:2004) and the CIEDE2000
// difference (Sharma, Wu and Dalal 2005). Cost: constant per colour.
#include "calibrate/color/color_difference.h"

#include <cmath>
#include <numbers>

namespace raystage::calibrate {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

double power7(double x) {
  const double cube = x * x * x;
  return cube * cube * x;
}

/// Returns the hue in degrees, [0, 360); 0 for greys.
double hue_of(double a, double b) {
  if (a == 0 && b == 0) return 0;
  const double hue = std::atan2(b, a) / kDegree;
  return hue < 0 ? hue + 360 : hue;
}

/// Returns the signed hue difference along the shorter arc, degrees; 0 if one is grey.
double hue_difference(double from, double to, double chromas) {
  if (chromas == 0) return 0;
  const double difference = to - from;
  if (std::abs(difference) <= 180) return difference;
  return difference > 180 ? difference - 360 : difference + 360;
}

double mean_hue(double one, double other, double chromas) {
  if (chromas == 0) return one + other;
  if (std::abs(one - other) <= 180) return (one + other) / 2;
  return one + other < 360 ? (one + other + 360) / 2 : (one + other - 360) / 2;
}

}  // namespace

Lab lab_from_linear(const std::array<double, 3>& rgb) {
  constexpr double kXyz[3][3] = {
      {0.4124, 0.3576, 0.1805}, {0.2126, 0.7152, 0.0722}, {0.0193, 0.1192, 0.9505}};
  double f[3];
  for (int i = 0; i < 3; ++i) {
    double value = 0, white = 0;
    for (int c = 0; c < 3; ++c) {
      value += kXyz[i][c] * rgb[c];
      white += kXyz[i][c];
    }
    const double t = value / white;
    constexpr double kCut = 6.0 / 29;
    f[i] = t > kCut * kCut * kCut ? std::cbrt(t) : t / (3 * kCut * kCut) + 4.0 / 29;
  }
  return {116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])};
}

double color_difference(const Lab& one, const Lab& other) {
  const double mean_chroma = (std::hypot(one.a, one.b) + std::hypot(other.a, other.b)) / 2;
  const double g = 0.5 * (1 - std::sqrt(power7(mean_chroma) / (power7(mean_chroma) + power7(25))));
  const double a1 = (1 + g) * one.a, a2 = (1 + g) * other.a;
  const double c1 = std::hypot(a1, one.b), c2 = std::hypot(a2, other.b);
  const double h1 = hue_of(a1, one.b), h2 = hue_of(a2, other.b);
  const double lightness = other.l - one.l, chroma = c2 - c1;
  const double hue =
      2 * std::sqrt(c1 * c2) * std::sin(hue_difference(h1, h2, c1 * c2) / 2 * kDegree);
  const double l = (one.l + other.l) / 2, c = (c1 + c2) / 2, h = mean_hue(h1, h2, c1 * c2);
  const double t = 1 - 0.17 * std::cos((h - 30) * kDegree) + 0.24 * std::cos(2 * h * kDegree) +
                   0.32 * std::cos((3 * h + 6) * kDegree) - 0.20 * std::cos((4 * h - 63) * kDegree);
  const double turn = 30 * std::exp(-std::pow((h - 275) / 25, 2));
  const double rc = 2 * std::sqrt(power7(c) / (power7(c) + power7(25)));
  const double from_middle = (l - 50) * (l - 50);
  const double sl = 1 + 0.015 * from_middle / std::sqrt(20 + from_middle);
  const double sc = 1 + 0.045 * c, sh = 1 + 0.015 * c * t;
  const double rt = -std::sin(2 * turn * kDegree) * rc;
  const double x = lightness / sl, y = chroma / sc, z = hue / sh;
  return std::sqrt(x * x + y * y + z * z + rt * y * z);
}

}  // namespace raystage::calibrate
