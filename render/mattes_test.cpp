// SPDX-License-Identifier: Apache-2.0
// Tests of light fields with alpha, with every method.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "render/methods.h"
#include "render/renderer.h"
#include "rig/rig.h"
#include "testing/render/synthetic_take.h"
#include "testing/render/test_function_matte.h"

namespace raystage::render {
namespace {

using testing::FunctionMatte;

struct Tried {
  std::string method;
  schemas::OptionValues options;
};

class LightFieldsWithMattes : public ::testing::TestWithParam<Tried> {
 protected:
  LightFieldsWithMattes() {
    settings_.cameras = testing::camera_grid(4, 4, 0.1, 96, 72, {-0.05, 0.01, 0, 0, 0});
    settings_.jpeg.quality = 98;
    testing::write_synthetic_take(settings_, folder_.path() / "take");
    take_.emplace(folder_.path() / "take");
    timeline_.frame.assign(16, 0);
    timeline_.difference.assign(16, 0);
    view_.width = 80;
    view_.height = 60;
    view_.intrinsics = {70, 70, 40, 30, {}};
    view_.pose.position = {0.02, -0.03, 0.1};
    how_.method = GetParam().method;
    how_.options = GetParam().options;
    how_.focal_plane = {0, 0, 1, settings_.plane_depth};
  }

  RenderedView render(std::shared_ptr<const store::FrameMatte> matte,
                      bool reference = false) const {
    RendererOptions settings;
    settings.matte = std::move(matte);
    settings.reference = reference;
    settings.use_take_folder = false;
    return LightFieldRenderer(*take_, settings).render(view_, timeline_, how_);
  }

  /// Returns the alpha at a position on the painted plane: 0 on its left, 1 on its right.
  double alpha_at(double x) const { return std::clamp(0.5 + x / 1.5, 0.0, 1.0); }

  /// Returns this alpha as a matte of each camera.
  std::shared_ptr<const store::FrameMatte> matte_of_plane() const {
    return std::make_shared<FunctionMatte>([this](int camera, double x, double y) {
      const rig::Rig::Camera& source = take_->rig().cameras[camera];
      const auto direction = source.model.unproject({x, y});
      if (!direction) return 0.0;
      const Eigen::Vector3d ray = source.pose.world_from_camera_rotation * *direction;
      const double along = (-settings_.plane_depth - source.pose.position.z()) / ray.z();
      return alpha_at(source.pose.position.x() + along * ray.x());
    });
  }

  /// Expects equal values, but for few pixels where the choice of cameras or planes differs.
  static void expect_same(std::span<const float> a, std::span<const float> b) {
    double sum = 0;
    std::size_t off = 0;
    for (std::size_t i = 0; i < a.size(); ++i) {
      const double difference = std::abs(static_cast<double>(a[i]) - static_cast<double>(b[i]));
      sum += difference;
      off += difference > 4e-3 ? 1 : 0;
      ASSERT_LT(difference, 0.02) << i;
    }
    EXPECT_LT(sum / static_cast<double>(a.size()), 1e-3);
    EXPECT_LT(static_cast<double>(off) / static_cast<double>(a.size()), 0.05);
  }

  testing::SyntheticTake settings_;
  testing::TestFolder folder_;
  std::optional<store::Take> take_;
  store::FrameSelection timeline_;
  VirtualCamera view_;
  ReconstructionOptions how_;
};

TEST_P(LightFieldsWithMattes, AMatteOfOneValueIsAFactor) {
  const RenderedView opaque = render(nullptr);
  const RenderedView half =
      render(std::make_shared<FunctionMatte>([](int, double, double) { return 0.5; }));
  PixelValues expected = opaque.rgba;
  for (float& value : expected) value *= 0.5F;
  expect_same(half.rgba, expected);
  EXPECT_GT(*std::ranges::max_element(half.rgba), 0.49F);
}

TEST_P(LightFieldsWithMattes, NothingIsLeftOfWhatIsTransparent) {
  const RenderedView none =
      render(std::make_shared<FunctionMatte>([](int, double, double) { return 0.0; }));
  for (const float value : none.rgba) ASSERT_EQ(value, 0);
  for (const float z : none.z) ASSERT_EQ(z, std::numeric_limits<float>::infinity());
}

TEST_P(LightFieldsWithMattes, AlphaStandsWhereItsSurfaceStands) {
  const RenderedView opaque = render(nullptr);
  const RenderedView keyed = render(matte_of_plane());
  int mixed = 0;
  for (int y = 0; y < view_.height; ++y) {
    for (int x = 0; x < view_.width; ++x) {
      const auto at = static_cast<std::size_t>(4 * (y * view_.width + x));
      if (opaque.rgba[at + 3] < 1) continue;  // near the border of the area that the array sees
      const double depth = settings_.plane_depth + view_.pose.position.z();
      const double world_x =
          view_.pose.position.x() + depth * (x + 0.5 - view_.intrinsics.cx) / view_.intrinsics.fx;
      const double alpha = alpha_at(world_x);
      ASSERT_NEAR(keyed.rgba[at + 3], alpha, 0.03) << x << ' ' << y;
      mixed += alpha > 0.1 && alpha < 0.9 ? 1 : 0;
      if (alpha < 0.05) continue;
      for (std::size_t c = 0; c < 3; ++c) {
        ASSERT_NEAR(keyed.rgba[at + c] / keyed.rgba[at + 3], opaque.rgba[at + c], 0.03F)
            << x << ' ' << y;
      }
    }
  }
  EXPECT_GT(mixed, 500);
}

TEST_P(LightFieldsWithMattes, TheReferenceSaysTheSame) {
  const RenderedView fast = render(matte_of_plane()), slow = render(matte_of_plane(), true);
  expect_same(fast.rgba, slow.rgba);
}

std::vector<Tried> every_method() {
  std::vector<Tried> all{{"plane_sweep", {{"step_px", 2.0}, {"outlier_cameras", 1.0}}}};
  for (const Method* method : methods()) {
    // A visual hull needs mattes of its own, and `auto` renders with one of the others.
    if (method->shows_foreground_only() || method->chooses_by_measuring()) continue;
    schemas::OptionValues options;
    if (method->has_lens()) options["radius"] = 0.15;
    if (method->name() == "plane_sweep") options["step_px"] = 2.0;
    all.push_back({std::string(method->name()), options});
  }
  return all;
}

INSTANTIATE_TEST_SUITE_P(Every, LightFieldsWithMattes, ::testing::ValuesIn(every_method()),
                         [](const auto& test) {
                           return test.param.method +
                                  (test.param.options.contains("outlier_cameras") ? "_fewer" : "");
                         });

}  // namespace
}  // namespace raystage::render
