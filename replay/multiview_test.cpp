// SPDX-License-Identifier: Apache-2.0
#include "replay/multiview.h"

#include <gtest/gtest.h>

namespace raystage::replay {
namespace {

using Arrangement = schemas::ViewerMessage::Arrangement;

compose::ShotCamera shot_camera(bool stereo) {
  schemas::ShotDocument shot;
  shot.width = 64;
  shot.height = 48;
  shot.camera.keys = {{.frame = 1, .position = {{0, 0, 0}}, .focal_length_mm = 36, .focus_m = 2}};
  if (stereo) shot.camera.stereo = {.interaxial_m = 0.1, .convergence_m = 3};
  return {shot, "shot.json"};
}

ArrangedViews arranged(Arrangement arrangement, bool stereo = false) {
  const compose::ShotCamera camera = shot_camera(stereo);
  return arrange_views(camera, camera.state(1), compose::Eye::kBoth,
                       {arrangement, {800, 600}, 0.42});
}

/// Returns the column, in widths of the picture, at which a state sees a point on the axis of the
/// shot's camera.
double column_of(const compose::CameraState& state, double distance) {
  const render::VirtualCamera view = compose::make_virtual_camera(state, 1000, 750);
  return (view.intrinsics.cx - view.intrinsics.fx * state.pose.position.x() / distance) / 1000;
}

TEST(Multiview, OneViewFillsThePicture) {
  const ArrangedViews views = arranged(Arrangement::kSingle);
  ASSERT_EQ(views.views.size(), 1U);
  EXPECT_EQ(views.view_size.width, 800);
  EXPECT_EQ(views.view_size.height, 600);
}

TEST(Multiview, EyesAre65MillimetresApartAndMeetAtTheFocalPlane) {
  const ArrangedViews views = arranged(Arrangement::kSideBySide);
  ASSERT_EQ(views.views.size(), 2U);
  EXPECT_EQ(views.view_size.width, 400);
  const auto &left = views.views[0].state, &right = views.views[1].state;
  EXPECT_NEAR(right.pose.position.x() - left.pose.position.x(), 0.065, 1e-12);
  EXPECT_NEAR(column_of(left, 2), 0.5, 1e-12);
  EXPECT_NEAR(column_of(right, 2), 0.5, 1e-12);
  // What is nearer is crossed: the left eye sees it farther to the right.
  EXPECT_GT(column_of(left, 1), column_of(right, 1));
}

TEST(Multiview, AStereoShotHasItsOwnEyes) {
  const ArrangedViews views = arranged(Arrangement::kAnaglyph, true);
  ASSERT_EQ(views.views.size(), 2U);
  EXPECT_EQ(views.views[0].eye, compose::Eye::kLeft);
  EXPECT_EQ(views.views[1].eye, compose::Eye::kRight);
  EXPECT_EQ(views.view_size.width, 800);
}

TEST(Multiview, AQuiltSpreadsOverTheArray) {
  const ArrangedViews views = arranged(Arrangement::kQuilt);
  ASSERT_EQ(views.views.size(), 48U);
  EXPECT_NEAR(views.views.front().state.pose.position.x(), -0.189, 1e-12);
  EXPECT_NEAR(views.views.back().state.pose.position.x(), 0.189, 1e-12);
  for (const EyeView& view : views.views) EXPECT_NEAR(column_of(view.state, 2), 0.5, 1e-12);
}

TEST(Multiview, PicturesAreAssembled) {
  store::RgbImage red(2, 1, std::uint8_t{0}), blue(2, 1, std::uint8_t{0});
  red.at(0, 0, 0) = red.at(1, 0, 0) = 200;
  blue.at(0, 0, 2) = blue.at(1, 0, 2) = 100;
  const store::RgbImage pair = assemble_picture({Arrangement::kSideBySide, {4, 1}, 0}, {red, blue});
  EXPECT_EQ(pair.width, 4);
  EXPECT_EQ(pair.at(1, 0, 0), 200);
  EXPECT_EQ(pair.at(2, 0, 2), 100);
  const store::RgbImage both = assemble_picture({Arrangement::kAnaglyph, {2, 1}, 0}, {red, blue});
  EXPECT_EQ(both.at(0, 0, 0), 200);
  EXPECT_EQ(both.at(0, 0, 2), 100);
  std::vector<store::RgbImage> views;
  for (std::uint8_t i = 0; i < 48; ++i) views.emplace_back(2, 1, i);
  const store::RgbImage quilt = assemble_picture({Arrangement::kQuilt, {16, 6}, 0}, views);
  EXPECT_EQ(quilt.width, 16);
  EXPECT_EQ(quilt.height, 6);
  EXPECT_EQ(quilt.at(0, 5), 0);  // the first view: lower left
  EXPECT_EQ(quilt.at(15, 5), 7);
  EXPECT_EQ(quilt.at(15, 0), 47);  // the last: upper right
}

}  // namespace
}  // namespace raystage::replay
