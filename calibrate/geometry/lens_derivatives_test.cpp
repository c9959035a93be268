// SPDX-License-Identifier: Apache-2.0
// The solvers' derivatives of the projections, by automatic differentiation, against central
// differences with 50 digits: at the axis, at the edge of the picture, beyond a hemisphere and
// nearly straight behind.
#include <gtest/gtest.h>

#include <boost/multiprecision/cpp_bin_float.hpp>
#include <cmath>
#include <numbers>
#include <vector>

#include "calibrate/geometry/lens_projection.h"

namespace raystage::calibrate::lens_derivatives_test {
namespace {

using schemas::Projection;
using Exact = boost::multiprecision::cpp_bin_float_50;

constexpr double kPi = std::numbers::pi;
constexpr int kUnknowns = 3 + kLensParameterCount;  // the point, then the lens
using Jet = ceres::Jet<double, kUnknowns>;
using Values = std::array<double, kUnknowns>;
using ExactValues = std::array<Exact, kUnknowns>;

std::array<Exact, 2> exact_pixel(Projection projection, const ExactValues& in) {
  const Exact* lens = in.data() + 3;
  Exact u, v;
  if (projection == Projection::kPinhole) {
    const Exact x = in[0] / -in[2], y = in[1] / in[2], s = x * x + y * y;
    const Exact factor = 1 + s * (lens[4] + s * (lens[5] + s * lens[8]));
    u = x * factor + 2 * lens[6] * x * y + lens[7] * (s + 2 * x * x);
    v = y * factor + lens[6] * (s + 2 * y * y) + 2 * lens[7] * x * y;
  } else {
    const Exact& x = in[0];
    const Exact y = -in[1], across = sqrt(x * x + y * y);
    const Exact angle = atan2(across, Exact(-in[2]));
    Exact r = angle;
    if (projection == Projection::kEquisolid) r = 2 * sin(angle / 2);
    if (projection == Projection::kOrthographic) r = sin(angle);
    const Exact s = r * r;
    const Exact distance = r * (1 + s * (lens[4] + s * (lens[5] + s * (lens[6] + s * lens[7]))));
    u = x * distance / across;
    v = y * distance / across;
  }
  return {lens[0] * u + lens[2], lens[1] * v + lens[3]};
}

struct DerivativesCase {
  Projection projection;
  std::vector<double> degrees;  // to the axis, besides those next to it
};

class LensDerivatives : public ::testing::TestWithParam<DerivativesCase> {};

TEST_P(LensDerivatives, AgreeWithFiftyDigits) {
  const DerivativesCase& test = GetParam();
  schemas::Intrinsics lens{210, 207, 322, 236, {}};
  lens.projection = test.projection;
  if (test.projection == Projection::kPinhole) {
    lens.distortion = {-0.05, 0.01, 0.001, -0.002, -0.001};
  } else {
    lens.radial_distortion = {-0.02, 0.003, -0.0004, 0.00002};
  }
  const LensParameters parameters = lens_parameters(lens);
  // 1e-8 radians is where the projections begin to differ from their tangent.
  std::vector<double> angles{1e-100, 1e-12, 0.999e-8, 1.001e-8, 1e-6, 1e-3};
  for (const double degrees : test.degrees) angles.push_back(degrees * kPi / 180);
  double worst = 0;
  for (std::size_t i = 0; i < angles.size(); ++i) {
    for (const double distance : {1e-3, 1.0, 1e4}) {
      const double angle = angles[i], around = 0.3 + static_cast<double>(i);
      Values values{distance * std::sin(angle) * std::cos(around),
                    distance * std::sin(angle) * std::sin(around), -distance * std::cos(angle)};
      std::copy(parameters.begin(), parameters.end(), values.begin() + 3);
      std::array<Jet, kUnknowns> jets;
      for (int k = 0; k < kUnknowns; ++k) {
        jets[static_cast<std::size_t>(k)] = Jet(values[static_cast<std::size_t>(k)], k);
      }
      const Eigen::Matrix<Jet, 3, 1> point(jets[0], jets[1], jets[2]);
      const auto pixel =
          project_to_pixel<Jet>(point, jets.data() + 3, fisheye_projection(lens), false);
      Eigen::Matrix<double, 2, kUnknowns> expected;
      for (std::size_t k = 0; k < kUnknowns; ++k) {
        const auto moved = [&](int sign) {
          ExactValues exact;
          for (std::size_t j = 0; j < kUnknowns; ++j) exact[j] = values[j];
          // The principal point would hide the differences of smaller numbers.
          if (k != 5 && k != 6) exact[5] = exact[6] = 0;
          // Of the point, small against the distance from the axis, too. Pixels are linear in the
          // lens: large steps keep the digits of terms that are far smaller than the pixel.
          const Exact step = k < 3   ? Exact(1e-15) * distance * std::min(angle, 1.0)
                             : k < 7 ? Exact(1)
                                     : Exact(1e200);
          exact[k] += sign * step;
          auto at = exact_pixel(test.projection, exact);
          for (Exact& coordinate : at) coordinate /= 2 * step;
          return at;
        };
        const auto ahead = moved(1), behind = moved(-1);
        for (std::size_t row = 0; row < 2; ++row) {
          expected(static_cast<Eigen::Index>(row), static_cast<Eigen::Index>(k)) =
              static_cast<double>(Exact(ahead[row] - behind[row]));
        }
      }
      // Of the point, all derivatives have one unit; those of the lens are alike for themselves.
      const double of_point = expected.leftCols<3>().norm();
      for (int k = 0; k < kUnknowns; ++k) {
        const Eigen::Vector2d found(pixel.x().v[k], pixel.y().v[k]);
        const double scale = k < 3 ? of_point : expected.col(k).norm();
        const double error = (found - expected.col(k)).norm();
        EXPECT_LE(error, 1e-14 * scale + 1e-290)
            << "unknown " << k << ", " << angle << " rad, " << distance << " m";
        if (scale > 0) worst = std::max(worst, error / scale);
      }
    }
  }
  RecordProperty("worst", std::to_string(worst * 1e16) + "e-16");
}

INSTANTIATE_TEST_SUITE_P(
    All, LensDerivatives,
    ::testing::Values(
        DerivativesCase{Projection::kPinhole, {20, 50}},
        DerivativesCase{Projection::kFisheye, {45, 89.999999, 90, 110, 179, 179.999999}},
        DerivativesCase{Projection::kFtheta, {45, 90, 110, 179.999999}},
        DerivativesCase{Projection::kEquisolid, {45, 89.999999, 90, 120, 179, 179.999999}},
        DerivativesCase{Projection::kOrthographic, {45, 80, 89, 89.999999}}));

}  // namespace
}  // namespace raystage::calibrate::lens_derivatives_test
