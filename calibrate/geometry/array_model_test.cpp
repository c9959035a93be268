// SPDX-License-Identifier: Apache-2.0
#include "calibrate/geometry/array_model.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/parallel.h"

namespace raystage::calibrate {
namespace {

ArrayModel model_of(int cameras) {
  ArrayModel model;
  for (int c = 0; c < cameras; ++c) {
    model.cameras.push_back(
        {"c" + std::to_string(c), 640, 480, {600.0 + c, 600, 320, 240, {}}, {}});
  }
  return model;
}

TEST(CameraModels, AreThoseOfThePresentLenses) {
  ArrayModel model = model_of(3);
  EXPECT_EQ(camera_models(model).size(), 3U);
  model.cameras[1].intrinsics.fx = 500;
  model.cameras[2].width = 800;
  const CameraModels changed = camera_models(model);
  EXPECT_EQ(changed[0].intrinsics().fx, 600);
  EXPECT_EQ(changed[1].intrinsics().fx, 500);
  EXPECT_EQ(changed[2].width(), 800);
  model.cameras.pop_back();
  EXPECT_EQ(camera_models(model).size(), 2U);
  model.cameras.clear();
  EXPECT_EQ(camera_models(model).size(), 0U);
}

TEST(CameraModels, AreMadeOnceForALens) {
  ArrayModel model = model_of(2);
  const CameraModels first = camera_models(model);
  EXPECT_EQ(&camera_models(model)[0], &first[0]);
  const ArrayModel copy = model;
  EXPECT_EQ(&camera_models(copy)[1], &first[1]) << "copies know them, too";
  model.cameras[0].intrinsics.fy = 610;
  EXPECT_NE(&camera_models(model)[0], &first[0]);
  EXPECT_EQ(first[0].intrinsics().fy, 600) << "those in use stay";
  EXPECT_EQ(&camera_models(copy)[0], &first[0]);
}

TEST(CameraModels, RejectALensAndRecover) {
  ArrayModel model = model_of(2);
  camera_models(model);
  model.cameras[1].intrinsics.fx = -1;
  EXPECT_THROW(camera_models(model), Error);
  EXPECT_THROW(camera_models(model), Error);
  model.cameras[1].intrinsics.fx = 601;
  EXPECT_EQ(camera_models(model)[1].intrinsics().fx, 601);
}

TEST(CameraModels, MayBeRequestedByManyThreads) {
  const ArrayModel model = model_of(8);
  parallel_for(0, 64,
               [&](int i) { EXPECT_EQ(camera_models(model)[i % 8].intrinsics().fx, 600 + i % 8); });
}

}  // namespace
}  // namespace raystage::calibrate
