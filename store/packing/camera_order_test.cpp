// SPDX-License-Identifier: Apache-2.0
#include "store/packing/camera_order.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "schemas/rig_document.h"
#include "testing/store/take_test_data.h"

namespace raystage::store {
namespace {

using ::testing::ElementsAre;

TEST(CameraOrder, EverySecondRowOfAGridIsBackwards) {
  schemas::RigDocument document = testing::rig_document(6);
  for (int i = 0; i < 6; ++i) {
    document.cameras[static_cast<std::size_t>(i)].geometry.row = i / 3;
    document.cameras[static_cast<std::size_t>(i)].geometry.column = i % 3;
  }
  EXPECT_THAT(serpentine_order(rig::rig_from_document(document)), ElementsAre(0, 1, 2, 5, 4, 3));
}

TEST(CameraOrder, WithoutAGridTheNearestCameraFollows) {
  schemas::RigDocument document = testing::rig_document(4);
  const double places[] = {0.1, -0.4, 0.2, 0};
  for (std::size_t i = 0; i < 4; ++i) {
    document.cameras[i].geometry.world_from_camera[3] = places[i];
  }
  EXPECT_THAT(serpentine_order(rig::rig_from_document(document)), ElementsAre(1, 3, 0, 2));
}

TEST(CameraOrder, InstantsHaveTheFramesWithinHalfAnInterval) {
  const testing::TestFolder folder;
  // The second camera lost a frame, the third is half an interval and more behind.
  testing::write_take(folder.path() / "take", {{0, 100, 200, 300}, {7, 207, 290}, {60, 160, 260}});
  const Take take(folder.path() / "take");
  using Frames = std::vector<FrameRef>;
  EXPECT_THAT(frames_by_instant(take, {2, 0, 1}, 0, 1000),
              ElementsAre(Frames{{0, 0}, {1, 0}}, Frames{{2, 0}, {0, 1}},
                          Frames{{2, 1}, {0, 2}, {1, 1}}, Frames{{2, 2}, {0, 3}, {1, 2}}));
  EXPECT_THAT(frames_by_instant(take, {0, 1}, 7, 200),
              ElementsAre(Frames{{1, 0}}, Frames{{0, 1}}, Frames{{0, 2}}));
}

}  // namespace
}  // namespace raystage::store
