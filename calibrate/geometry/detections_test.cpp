// SPDX-License-Identifier: Apache-2.0
#include "calibrate/geometry/detections.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "testing/test_folder.h"

namespace raystage::calibrate {
namespace {

using ::testing::HasSubstr;

const schemas::DetectionsDocument kTwo{{{"left", 640, 480}, {"right", 320, 240}}};

std::string refusal(std::string_view table) {
  try {
    parse_detections(table, "table.csv", kTwo);
  } catch (const Error& error) {
    return error.what();
  }
  return "none";
}

TEST(DetectionTables, ComeInAnyOrderAndBackInOne) {
  const Detections read = parse_detections(
      "camera,frame,u,v,quality\nright,3,10.25,0.5,x\r\n\nleft,3, 1e1 ,-2.5\nleft,0,639.75,479\n",
      "f", kTwo);
  ASSERT_EQ(read.detections.size(), 3U);
  EXPECT_EQ(read.detections[0].point, 0);
  EXPECT_EQ(read.detections[1].camera, 0);
  EXPECT_EQ(read.detections[1].pixel, Eigen::Vector2d(10, -2.5));
  EXPECT_EQ(read.detections[2].camera, 1);
  const std::string text = format_detections(read);
  EXPECT_EQ(text, "camera,frame,u,v\nleft,0,639.75,479\nleft,3,10,-2.5\nright,3,10.25,0.5\n");
  EXPECT_EQ(format_detections(parse_detections(text, "f", kTwo)), text);
  const testing::TestFolder folder;
  write_detections(read, folder.path() / "d.csv");
  EXPECT_EQ(format_detections(read_detections(folder.path() / "d.csv", kTwo)), text);
  EXPECT_TRUE(parse_detections("camera,frame,u,v\n", "f", kTwo).detections.empty());
}

TEST(DetectionTables, SayWhichLineIsWrong) {
  const std::string header = "camera,frame,u,v\n";
  EXPECT_THAT(refusal("left,0,1,2\n"), HasSubstr("table.csv:1: found no header"));
  EXPECT_THAT(refusal(header + "middle,0,1,2\n"), HasSubstr("table.csv:2: the camera \"middle\""));
  for (const char* line : {"left,0,1", "left,-1,1,2", "left,0.5,1,2", "left,0,nan,2",
                           "left,0,1,inf", "left,0,1x,2", "left,99999999999,1,2"}) {
    EXPECT_THAT(refusal(header + "left,7,1,2\n" + line), HasSubstr("table.csv:3: ")) << line;
  }
  EXPECT_THAT(refusal(header + "right,0,641,2\n"), HasSubstr("320 x 240 pixels"));
  EXPECT_THAT(refusal(header + "left,5,1,2\nright,5,1,2\nleft,5,3,4\n"),
              HasSubstr("camera left has two detections in frame 5"));
}

TEST(DetectionTables, CamerasStandInADocument) {
  const std::string text = schemas::format_detections_document(kTwo);
  const schemas::DetectionsDocument again = schemas::parse_detections_document(text, "f");
  ASSERT_EQ(again.cameras.size(), 2U);
  EXPECT_EQ(again.cameras[1].id, "right");
  EXPECT_EQ(again.cameras[1].height, 240);
  EXPECT_EQ(schemas::format_detections_document(again), text);
  EXPECT_THROW(
      schemas::parse_detections_document(
          R"({"schema": "raystage/detections/1", "cameras": [{"id": "a", "width": 0, "height": 1}]})",
          "f"),
      Error);
  EXPECT_THROW(
      schemas::parse_detections_document(
          R"({"schema": "raystage/detections/1", "cameras": [{"id": "a", "width": 1, "height": 1},
              {"id": "a", "width": 1, "height": 1}]})",
          "f"),
      Error);
}

}  // namespace
}  // namespace raystage::calibrate
