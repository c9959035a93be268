// SPDX-License-Identifier: Apache-2.0
#include "rig/camera_model.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <numbers>
#include <regex>
#include <sstream>
#include <string>
#include <vector>

#include "base/error.h"
#include "testing/test_data.h"

namespace raystage::rig {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

schemas::CameraGeometry camera(int width, int height, double focal,
                               const schemas::Distortion& distortion) {
  schemas::CameraGeometry geometry;
  geometry.id = "test";
  geometry.width = width;
  geometry.height = height;
  geometry.intrinsics = {focal, focal, width / 2.0, height / 2.0, distortion};
  return geometry;
}

double fov_focal(int width, double fov_deg) {
  return width / 2.0 / std::tan(fov_deg * std::numbers::pi / 360);
}

// Returns the number of pixels with a ray on a lattice over the image, and checks them to 1e-9 px.
int check_round_trip(const CameraModel& model) {
  int answered = 0;
  for (int row = 0; row <= 40; ++row) {
    for (int column = 0; column <= 40; ++column) {
      const Eigen::Vector2d pixel(model.width() * column / 40.0, model.height() * row / 40.0);
      const auto ray = model.unproject(pixel);
      if (!ray) continue;
      ++answered;
      EXPECT_EQ(ray->z(), -1);
      const auto back = model.project(*ray * 3.7);
      EXPECT_TRUE(back.has_value()) << pixel.transpose();
      if (back) {
        EXPECT_LE((*back - pixel).norm(), 1e-9) << pixel.transpose();
      }
    }
  }
  return answered;
}

TEST(CameraModel, ProjectsAsThePageSays) {
  const CameraModel model(camera(320, 240, 300, {}));
  // Right of and above the axis: right of and above the principal point, with y down.
  const auto pixel = model.project({0.2, 0.1, -1});
  ASSERT_TRUE(pixel);
  EXPECT_DOUBLE_EQ(pixel->x(), 160 + 60);
  EXPECT_DOUBLE_EQ(pixel->y(), 120 - 30);
  const auto ray = model.unproject({220, 90});
  ASSERT_TRUE(ray);
  EXPECT_NEAR((*ray - Eigen::Vector3d(0.2, 0.1, -1)).norm(), 0, 1e-15);
}

TEST(CameraModel, DistortsAsOpenCv) {
  const CameraModel model(camera(640, 480, 500, {-0.3, 0.1, 0.001, -0.002, 0.02}));
  // The formula of cv2.projectPoints for x = 0.3, y = -0.2 (y down).
  const double x = 0.3, y = -0.2, r2 = 0.13;
  const double factor = 1 - 0.3 * r2 + 0.1 * r2 * r2 + 0.02 * r2 * r2 * r2;
  const double xd = x * factor + 2 * 0.001 * x * y - 0.002 * (r2 + 2 * x * x);
  const double yd = y * factor + 0.001 * (r2 + 2 * y * y) + 2 * -0.002 * x * y;
  const auto pixel = model.project({2 * x, -2 * y, -2});
  ASSERT_TRUE(pixel);
  EXPECT_NEAR(pixel->x(), 500 * xd + 320, 1e-10);
  EXPECT_NEAR(pixel->y(), 500 * yd + 240, 1e-10);
}

TEST(CameraModel, NothingAtOrBehindTheCamerasPlane) {
  const CameraModel model(camera(320, 240, 300, {}));
  EXPECT_FALSE(model.project({0, 0, 0}));
  EXPECT_FALSE(model.project({0.1, 0, 1}));
  EXPECT_FALSE(model.project({0, 0, std::nan("")}));
  EXPECT_FALSE(model.project({std::nan(""), 0, -1}));
  EXPECT_FALSE(model.project({kInfinity, 0, -1}));
  EXPECT_FALSE(model.unproject({std::nan(""), 0}));
  EXPECT_TRUE(model.project({1e6, 0, -1e-3}));  // almost in the plane, far outside the image
}

TEST(CameraModel, RoundTripsRealWebcams) {
  const std::filesystem::path data = testing::test_data();
  std::ifstream file(data / "four_webcams" / "camera_array.toml");
  if (!file) GTEST_SKIP() << "no four_webcams/camera_array.toml in " << data;
  std::stringstream text;
  text << file.rdbuf();
  const std::string toml = text.str();
  const std::string number = R"(([-+.0-9e]+))";
  const std::regex matrix(R"(matrix = \[\[)" + number + R"(, 0\.0, )" + number + R"(\], \[0\.0, )" +
                          number + ", " + number + R"(\])" + R"([^\n]*\ndistortions = \[)" +
                          number + ", " + number + ", " + number + ", " + number + ", " + number);
  int cameras = 0;
  for (std::sregex_iterator match(toml.begin(), toml.end(), matrix), end; match != end; ++match) {
    const auto value = [&](std::size_t group) { return std::stod((*match)[group].str()); };
    schemas::CameraGeometry geometry = camera(1280, 720, 1, {});
    geometry.intrinsics = {value(1),
                           value(3),
                           value(2) + 0.5,
                           value(4) + 0.5,
                           {value(5), value(6), value(7), value(8), value(9)}};
    EXPECT_EQ(check_round_trip(CameraModel(geometry)), 41 * 41);
    ++cameras;
  }
  EXPECT_EQ(cameras, 4);
}

TEST(CameraModel, RoundTripsAWideLens) {
  // 120 degrees, with a barrel distortion that keeps growing over the whole image.
  const CameraModel model(camera(1920, 1080, fov_focal(1920, 120), {-0.05, 0.004, 0, 0, 0}));
  EXPECT_EQ(check_round_trip(model), 41 * 41);
}

TEST(CameraModel, EndsWhereTheDistortionFoldsBack) {
  // d/dr (r + k1 r^3) = 0 at r^2 = -1 / (3 k1), where r L = 2/3 r.
  const CameraModel model(camera(640, 480, 200, {-0.3, 0, 0, 0, 0}));
  EXPECT_NEAR(model.fold_radius_squared(), 1 / 0.9, 1e-12);
  const double fold = std::sqrt(1 / 0.9);
  EXPECT_TRUE(model.pixel_from_ideal({fold * 0.999999, 0}));
  EXPECT_FALSE(model.pixel_from_ideal({fold * 1.000001, 0}));
  EXPECT_TRUE(model.ideal_from_pixel({320 + 200 * fold * 2 / 3 - 1e-6, 240}));
  EXPECT_FALSE(model.ideal_from_pixel({320 + 200 * fold * 2 / 3 + 1e-6, 240}));
  const int answered = check_round_trip(model);
  EXPECT_GT(answered, 0);
  EXPECT_LT(answered, 41 * 41);
}

TEST(CameraModel, FindsTheFirstOfSeveralFolds) {
  // q(s) = (1 - s)(1 - s/2)(1 - s/3) has three roots; the first counts.
  const CameraModel model(camera(64, 64, 50, {-11 / 18.0, 1 / 5.0, 0, 0, -1 / 42.0}));
  EXPECT_NEAR(model.fold_radius_squared(), 1, 1e-9);
  // Never folds.
  EXPECT_EQ(CameraModel(camera(64, 64, 50, {0.1, 0.2, 0, 0, 0.3})).fold_radius_squared(),
            kInfinity);
  EXPECT_EQ(CameraModel(camera(64, 64, 50, {})).fold_radius_squared(), kInfinity);
  // q(s) = 1 - s + s^2 dips but stays positive.
  EXPECT_EQ(CameraModel(camera(64, 64, 50, {-1 / 3.0, 1 / 5.0, 0, 0, 0})).fold_radius_squared(),
            kInfinity);
}

TEST(CameraModel, RefusesWhatIsUnusable) {
  const auto refused = [](const schemas::CameraGeometry& geometry) {
    try {
      const CameraModel model(geometry);
    } catch (const Error& error) {
      return error.exit_code() == ExitCode::kBadInput && error.where() == "camera test";
    }
    return false;
  };
  schemas::CameraGeometry good = camera(320, 240, 300, {});
  EXPECT_FALSE(refused(good));
  for (const double bad : {std::nan(""), kInfinity, -kInfinity}) {
    schemas::CameraGeometry geometry = good;
    geometry.intrinsics.cx = bad;
    EXPECT_TRUE(refused(geometry));
    geometry = good;
    geometry.intrinsics.distortion.k3 = bad;
    EXPECT_TRUE(refused(geometry));
    geometry = good;
    geometry.world_from_camera[3] = bad;
    EXPECT_TRUE(refused(geometry));
  }
  for (const double bad : {0.0, -300.0, std::nan("")}) {
    schemas::CameraGeometry geometry = good;
    geometry.intrinsics.fy = bad;
    EXPECT_TRUE(refused(geometry));
  }
  schemas::CameraGeometry flat = good;
  flat.height = 0;
  EXPECT_TRUE(refused(flat));
  EXPECT_TRUE(refused(camera(320, 240, 300, {-1e12, 0, 0, 0, 0})));
}

TEST(CameraModel, ContainsItsBorder) {
  const CameraModel model(camera(320, 240, 300, {}));
  EXPECT_TRUE(model.contains({0, 0}));
  EXPECT_TRUE(model.contains({320, 240}));
  EXPECT_FALSE(model.contains({320.01, 100}));
  EXPECT_FALSE(model.contains({10, -0.01}));
}

double uniform(double low, double high) {
  return low + (high - low) * (*rc::gen::inRange(0, 1'000'001)) / 1e6;
}

TEST(CameraModelProperty, RoundTripsWhereverItAnswers) {
  EXPECT_TRUE(rc::check("project(unproject(p)) == p to 1e-9 px, on either side of a fold", [] {
    const bool extreme = *rc::gen::arbitrary<bool>();
    const double k = extreme ? 2.0 : 0.4, p = extreme ? 0.1 : 0.005;
    const schemas::Distortion distortion{uniform(-k, k), uniform(-k, k), uniform(-p, p),
                                         uniform(-p, p), uniform(-k, k)};
    const int width = *rc::gen::inRange(16, 8000);
    const CameraModel model(
        camera(width, width * 3 / 4, fov_focal(width, uniform(10, 150)), distortion));
    for (int i = 0; i < 20; ++i) {
      const Eigen::Vector2d pixel(uniform(0, model.width()), uniform(0, model.height()));
      const auto ideal = model.ideal_from_pixel(pixel);
      if (!ideal) continue;
      RC_ASSERT(ideal->squaredNorm() <= model.fold_radius_squared() * (1 + 1e-12));
      const auto back = model.pixel_from_ideal(*ideal);
      RC_ASSERT(back.has_value());
      RC_ASSERT((*back - pixel).norm() <= 1e-9);
    }
  }));
}

TEST(CameraModelProperty, AnswersWhateverItReaches) {
  EXPECT_TRUE(rc::check("a projected point is found again, and is the only one", [] {
    const double p = *rc::gen::arbitrary<bool>() ? 0.02 : 0.0;
    const schemas::Distortion distortion{uniform(-0.5, 0.5), uniform(-0.3, 0.3), uniform(-p, p),
                                         uniform(-p, p), uniform(-0.2, 0.2)};
    const CameraModel model(camera(1000, 1000, 600, distortion));
    const double limit = std::min(2.0, std::sqrt(model.fold_radius_squared()));
    for (int i = 0; i < 20; ++i) {
      // Just inside the fold, where the inverse has the slope of a square root.
      const double radius = uniform(0, 0.999) * limit, angle = uniform(0, 2 * std::numbers::pi);
      const Eigen::Vector2d ideal(radius * std::cos(angle), radius * std::sin(angle));
      const auto pixel = model.pixel_from_ideal(ideal);
      RC_ASSERT(pixel.has_value());
      const auto back = model.ideal_from_pixel(*pixel);
      RC_ASSERT(back.has_value());
      RC_ASSERT((*back - ideal).norm() <= 1e-9);
    }
  }));
}

}  // namespace
}  // namespace raystage::rig
