// SPDX-License-Identifier: Apache-2.0
#include "replay/source_pictures.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <set>
#include <string>

#include "base/error.h"
#include "replay/epipolar_image.h"
#include "schemas/rig_document.h"
#include "store/jpeg/decode.h"
#include "testing/render/synthetic_take.h"
#include "testing/test_folder.h"

namespace raystage::replay {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr double kSpacing = 0.06, kDepth = 4;

class SourcePicturesTest : public ::testing::Test {
 protected:
  /// Writes a take of 2 x 3 cameras before a painted plane; camera 4 has no frame.
  void SetUp() override {
    testing::SyntheticTake synthetic;
    synthetic.cameras = testing::camera_grid(2, 3, kSpacing, 96, 64);
    synthetic.plane_depth = kDepth;
    synthetic.absent = {{4, 0}};
    testing::write_synthetic_take(synthetic, folder_.path() / "take");
    take_.emplace(folder_.path() / "take");
    frames_.frame = {0, 0, 0, 0, -1, 0};
  }

  SourceFrames source() const { return {*take_, frames_}; }
  /// Returns a view from the middle of the array.
  render::VirtualCamera view() const {
    render::VirtualCamera camera;
    camera.width = 96;
    camera.height = 64;
    camera.intrinsics = {80, 80, 48, 32, {}};
    camera.pose.position = take_->rig().centre();
    camera.pose.position.y() = take_->rig().cameras[0].pose.position.y() - 0.001;
    return camera;
  }

  testing::TestFolder folder_;
  std::optional<store::Take> take_;
  store::FrameSelection frames_;
};

TEST_F(SourcePicturesTest, AMosaicHasACellForEachCameraWhereItIsInTheArray) {
  const Mosaic mosaic = make_mosaic(source(), 300, 200);
  ASSERT_EQ(mosaic.cells.size(), 6U);
  const auto& cameras = take_->rig().cameras;
  for (std::size_t i = 0; i < 6; ++i) {
    const MosaicCell& cell = mosaic.cells[i];
    EXPECT_EQ(cell.camera_id, cameras[i].id);
    EXPECT_EQ(cell.is_absent, i == 4);
    EXPECT_NEAR(static_cast<double>(cell.width) / cell.height, 1.5, 0.05);
    for (std::size_t j = 0; j < 6; ++j) {
      // Right of another camera: right of it in the mosaic. Above: above.
      const Eigen::Vector3d offset = cameras[j].pose.position - cameras[i].pose.position;
      if (offset.x() > kSpacing / 2) {
        EXPECT_GE(mosaic.cells[j].x, cell.x + cell.width);
      }
      if (offset.y() > kSpacing / 2) {
        EXPECT_LE(mosaic.cells[j].y + cell.height, cell.y);
      }
    }
  }
}

TEST_F(SourcePicturesTest, ACellShowsItsCamera) {
  const Mosaic mosaic = make_mosaic(source(), 300, 200);
  store::JpegDecoder decoder;
  for (const std::size_t i : {0U, 5U}) {
    const MosaicCell& cell = mosaic.cells[i];
    const auto camera = static_cast<int>(i);
    const store::RgbImage frame = decoder.decode(take_->archive(camera).jpeg(0), "frame");
    double difference = 0;
    for (int y = 0; y < cell.height; ++y) {
      for (int x = 0; x < cell.width; ++x) {
        const int shown = mosaic.picture.at(cell.x + x, cell.y + y, 1);
        difference += std::abs(
            shown - frame.clamped(static_cast<int>((x + 0.5) * frame.width / cell.width),
                                  static_cast<int>((y + 0.5) * frame.height / cell.height), 1));
      }
    }
    EXPECT_LT(difference / (cell.width * cell.height), 4) << cell.camera_id;
  }
  const MosaicCell& absent = mosaic.cells[4];
  EXPECT_EQ(mosaic.picture.at(absent.x + absent.width / 2, absent.y + absent.height / 2, 1), 24);
}

TEST_F(SourcePicturesTest, MosaicsOfAnySizeStayInside) {
  for (const auto& [width, height] : {std::pair(1, 1), {7, 300}, {300, 7}, {2000, 40}}) {
    const Mosaic mosaic = make_mosaic(source(), width, height);
    for (const MosaicCell& cell : mosaic.cells) {
      EXPECT_GE(cell.x, 0);
      EXPECT_LE(cell.x + cell.width, width);
      EXPECT_GE(cell.y, 0);
      EXPECT_LE(cell.y + cell.height, height);
    }
  }
}

TEST_F(SourcePicturesTest, ACameraIsShownAtItsSizeOrSmaller) {
  EXPECT_EQ(source_picture(source(), 0, 1000, 1000).width, 96);
  const store::RgbImage small = source_picture(source(), 0, 24, 1000);
  EXPECT_EQ(small.width, 24);
  EXPECT_EQ(small.height, 16);
  EXPECT_THROW(source_picture(source(), 4, 100, 100), Error);
}

TEST_F(SourcePicturesTest, TheEpipolarRowIsTheOneAtTheHeightOfTheView) {
  const std::vector<int> row = camera_row_near(take_->rig(), view());
  ASSERT_EQ(row.size(), 3U);
  for (const int camera : row) {
    EXPECT_NEAR(take_->rig().cameras[camera].pose.position.y(),
                take_->rig().cameras[0].pose.position.y(), 1e-9);
  }
  for (std::size_t i = 0; i + 1 < row.size(); ++i) {
    EXPECT_LT(take_->rig().cameras[row[i]].pose.position.x(),
              take_->rig().cameras[row[i + 1]].pose.position.x());
  }
}

TEST_F(SourcePicturesTest, APointInFocusIsAtItsColumnInEachCamera) {
  const EpipolarImage epi = make_epipolar_image(source(), view(), {48, 32}, kDepth, {192, 30});
  ASSERT_EQ(epi.focus_columns.size(), epi.camera_ids.size());
  std::set<int> colors;
  for (std::size_t i = 0; i < epi.camera_ids.size(); ++i) {
    ASSERT_TRUE(epi.focus_columns[i]);
    // The cameras are evenly spaced, so the point moves by f * spacing / depth from one to the
    // next.
    const rig::Rig::Camera& camera =
        take_->rig().cameras[static_cast<std::size_t>(take_->camera_index(epi.camera_ids[i]))];
    const double expected = (camera.model.intrinsics().cx +
                             camera.model.intrinsics().fx *
                                 (view().pose.position.x() - camera.pose.position.x()) / kDepth) *
                            2;
    EXPECT_NEAR(*epi.focus_columns[i], expected, 0.01);
    const int line = static_cast<int>((static_cast<double>(i) + 0.5) * 30 /
                                      static_cast<double>(epi.camera_ids.size()));
    colors.insert(epi.picture.clamped(static_cast<int>(*epi.focus_columns[i]), line, 1));
  }
  // The painted plane is in focus: all cameras see the same there.
  EXPECT_LE(*colors.rbegin() - *colors.begin(), 12);
}

TEST_F(SourcePicturesTest, AViewInThePlaneOfTheCamerasIsALevelLine) {
  const EpipolarImage epi = make_epipolar_image(source(), view(), {48, 32}, kDepth, {192, 30});
  ASSERT_GT(epi.view_line.size(), 10U);
  for (const auto& [x, y] : epi.view_line) EXPECT_NEAR(y, 15, 0.01);
  render::VirtualCamera ahead = view();
  ahead.pose.position.z() -= 0.05;
  const EpipolarImage slanted = make_epipolar_image(source(), ahead, {48, 32}, kDepth, {192, 30});
  ASSERT_GT(slanted.view_line.size(), 10U);
  EXPECT_GT(slanted.view_line.front()[1], slanted.view_line.back()[1]);
}

TEST_F(SourcePicturesTest, RowsOfPixelsThatAreNoEpipolarLinesAreAnError) {
  const auto refusal = [&](const std::function<void(schemas::CameraGeometry&)>& change) {
    const std::filesystem::path file = folder_.path() / "take" / "rig.json";
    const schemas::RigDocument original = schemas::read_rig(file);
    schemas::RigDocument rig = original;
    change(rig.cameras[2].geometry);
    schemas::write_rig(rig, file);
    take_.emplace(folder_.path() / "take");
    std::string what = "none";
    try {
      make_epipolar_image(source(), view(), {48, 32}, kDepth, {192, 30});
    } catch (const Error& error) {
      what = error.what();
    }
    schemas::write_rig(original, file);
    return what;
  };
  EXPECT_EQ(refusal([](schemas::CameraGeometry&) {}), "none");
  EXPECT_THAT(refusal([](schemas::CameraGeometry& camera) {
                camera.intrinsics.projection = schemas::Projection::kFisheye;
              }),
              HasSubstr("fisheye"));
  EXPECT_THAT(refusal([](schemas::CameraGeometry& camera) {
                auto& pose = camera.world_from_camera;  // turned by 90 degrees
                pose[0] = pose[10] = 0;
                pose[2] = 1;
                pose[8] = -1;
              }),
              HasSubstr("another direction"));
}

TEST_F(SourcePicturesTest, ARowWithoutFramesIsAnError) {
  frames_.frame.assign(6, -1);
  try {
    make_epipolar_image(source(), view(), {48, 32}, kDepth, {192, 30});
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("no camera of this row"));
  }
}

}  // namespace
}  // namespace raystage::replay
