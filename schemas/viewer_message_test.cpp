// SPDX-License-Identifier: Apache-2.0
#include "schemas/viewer_message.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace raystage::schemas {
namespace {

using ::testing::HasSubstr;

std::string error_of(std::string_view text) {
  try {
    parse_viewer_message(text);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

std::string message(std::string_view members) {
  return R"({"schema": "raystage/viewer_message/1", "id": 3, )" + std::string(members) + "}";
}

constexpr std::string_view kCamera =
    R"("camera": {"position": [1, 2, 3], "orientation": [1, 0, 0, 0], "focal_length_mm": 35,
       "film_back_mm": 36, "focus_m": 2.5})";

TEST(ViewerMessages, AreReadAndWritten) {
  const ViewerMessage read = parse_viewer_message(
      message(R"("type": "view", "frame": 7, "width": 640, "height": 480, "quality": "resting",
                 "look": {"channel": "depth", "exposure": -1.5}, )" +
              std::string(kCamera)));
  EXPECT_EQ(read.type, ViewerMessage::Type::kView);
  EXPECT_EQ(read.id, 3);
  EXPECT_EQ(read.frame, 7);
  EXPECT_EQ(read.quality, ViewerMessage::Quality::kResting);
  EXPECT_EQ(read.look.channel, ViewerMessage::Look::Channel::kDepth);
  EXPECT_EQ(read.look.exposure, -1.5);
  ASSERT_TRUE(read.camera);
  EXPECT_EQ(read.camera->position[2], 3);
  EXPECT_EQ(read.camera->focus_m, 2.5);
  EXPECT_FALSE(read.camera->f_number);
  const std::string written = format_viewer_message(read);
  EXPECT_EQ(format_viewer_message(parse_viewer_message(written)), written);
}

TEST(ViewerMessages, StateWhatTheirTypeNeeds) {
  EXPECT_THAT(error_of(message(R"("type": "view", "frame": 1, "width": 640)")),
              HasSubstr("\"height\" is missing"));
  EXPECT_THAT(error_of(message(R"("type": "focus", "frame": 1, "width": 6, "height": 4)")),
              HasSubstr("\"pixel\" is missing"));
  EXPECT_THAT(error_of(message(R"("type": "save", "file": "a.json")")),
              HasSubstr("\"text\" is missing"));
}

TEST(ViewerMessages, AreComparedWithOneThing) {
  const std::string view = R"("type": "view", "frame": 1, "width": 640, "height": 480, )";
  EXPECT_EQ(error_of(message(view + R"("comparison": {"file": "b.json"})")), "");
  EXPECT_THAT(error_of(message(view + R"("comparison": {})")), HasSubstr("found 0 of text"));
  EXPECT_THAT(
      error_of(message(view + R"("comparison": {"file": "b.json", "sequence": "a.#.exr"})")),
      HasSubstr("found 2 of text"));
}

TEST(ViewerMessages, StateASubjectWithAPlaceAndASize) {
  const std::string view = R"("type": "view", "frame": 1, "width": 640, "height": 480, )";
  const ViewerMessage read =
      parse_viewer_message(message(view + R"("subject": {"point": [1, 2, -3], "size_m": 0.5})"));
  ASSERT_TRUE(read.subject);
  EXPECT_EQ(read.subject->point[2], -3);
  EXPECT_EQ(parse_viewer_message(format_viewer_message(read)).subject, read.subject);
  EXPECT_THAT(error_of(message(view + R"("subject": {"point": [1, 2, -3], "size_m": 0})")),
              HasSubstr("size_m"));
  EXPECT_THAT(error_of(message(view + R"("subject": {"size_m": 1})")), HasSubstr("point"));
}

TEST(ViewerMessages, ThatAreWrongStillStateWhichOneTheyAre) {
  EXPECT_EQ(find_viewer_message_id(message(R"("type": "nothing")")), 3);
  for (const char* text : {"", "{", "[3]", R"({"id": -3})", R"({"id": 1.5})", R"({"id": "3"})",
                           R"({"x": 3})", R"({"id": 9007199254740992})", R"({"id": 1e300})"}) {
    EXPECT_EQ(find_viewer_message_id(text), std::nullopt) << text;
  }
}

TEST(ViewerMessages, OutsideTheSchemaAreRejected) {
  const std::string view = R"("type": "view", "frame": 1, "height": 480, )";
  EXPECT_THAT(error_of(message(view + R"("width": 100000)")), HasSubstr("/width"));
  EXPECT_THAT(error_of(message(view + R"("width": 640, "method": "depth")")), HasSubstr("method"));
  EXPECT_THAT(error_of(message(R"("type": "delete", "file": "a")")), HasSubstr("/type"));
  EXPECT_THAT(error_of(message(view + R"("width": 640, "camera": {"position": [0, 0, 0],
      "orientation": [0.5, 0, 0, 0], "focal_length_mm": 35, "film_back_mm": 36})")),
              HasSubstr("not a unit"));
  EXPECT_THAT(error_of(message(R"("type": "view", "frame": 1, "width": 8192, "height": 8192)")),
              HasSubstr("2^24 pixels"));
  EXPECT_NE(error_of("{"), "");
  EXPECT_NE(error_of(""), "");
  EXPECT_NE(error_of(std::string(100'000, '[')), "");
  EXPECT_THAT(error_of(message(R"("type": "open", "file": "a\u0000b")")),
              HasSubstr("control character"));
}

}  // namespace
}  // namespace raystage::schemas
