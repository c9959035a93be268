// SPDX-License-Identifier: Apache-2.0
#include "replay/shot_paths.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "base/error.h"
#include "testing/test_paths.h"

namespace raystage::replay {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kMovedShot = R"({
  "camera": {"file": {"path": "path.chan"}, "x_note": "a/b"},
  "layers": [{"take": "."}, {"take": "../other/take/"}, {"take": "/absolute/take", "matte": {"clean_plate_take": "empty"}},
             {"plate": {"file": "plates/p.####.exr"}}, {"geometry": {"file": "ball.glb", "material": {"texture": "t.png"}}}],
  "lights": [{"environment": "sky.exr"}, {"ambient": [1, 1, 1]}],
  "output": {"color": {"config": "studio.ocio"}}, "comment": "kept"})";

TEST(ShotPaths, StartAtTheOtherFolder) {
  const Json moved = Json::parse(rebase_shot_paths(kMovedShot, "/set/take", "/set"));
  EXPECT_EQ(moved["camera"]["file"]["path"], "take/path.chan");
  EXPECT_EQ(moved["camera"]["x_note"], "a/b");
  EXPECT_EQ(moved["layers"][0]["take"], "take");
  EXPECT_EQ(moved["layers"][1]["take"], "other/take");
  EXPECT_EQ(moved["layers"][2]["take"], "/absolute/take");
  EXPECT_EQ(moved["layers"][2]["matte"]["clean_plate_take"], "take/empty");
  EXPECT_EQ(moved["layers"][3]["plate"]["file"], "take/plates/p.####.exr");
  EXPECT_EQ(moved["layers"][4]["geometry"]["file"], "take/ball.glb");
  EXPECT_EQ(moved["layers"][4]["geometry"]["material"]["texture"], "take/t.png");
  EXPECT_EQ(moved["lights"][0]["environment"], "take/sky.exr");
  EXPECT_EQ(moved["output"]["color"]["config"], "take/studio.ocio");
  EXPECT_EQ(moved["comment"], "kept");
  const Json back = Json::parse(rebase_shot_paths(moved.dump(), "/set", "/set/take"));
  EXPECT_EQ(back["layers"][0]["take"], ".");
  EXPECT_EQ(back["lights"], Json::parse(kMovedShot)["lights"]);
}

TEST(ShotPaths, OfTextsThatAreNoShotsAreRefused) {
  EXPECT_THROW(rebase_shot_paths("[", "/a", "/b"), Error);
  EXPECT_THROW(rebase_shot_paths("[1]", "/a", "/b"), Error);
  EXPECT_EQ(rebase_shot_paths(R"({"layers": 3, "camera": []})", "/a", "/b"),
            "{\n  \"layers\": 3,\n  \"camera\": []\n}\n");
}

TEST(ShotPaths, OfTextsThatAreNestedTooDeeplyAreRefused) {
  constexpr int kLevels = 100'000;
  std::string text = R"({"layers": )";
  text += std::string(kLevels, '[') + std::string(kLevels, ']') + "}";
  EXPECT_THROW(rebase_shot_paths(text, "/a", "/b"), Error);
}

TEST(ShotPaths, ThatJsonCannotHoldAreRefused) {
  constexpr const char* kShotText = R"({"layers": [{"take": "take"}]})";
  EXPECT_THROW(rebase_shot_paths(kShotText, "/caf\351", "/b"), Error);
  EXPECT_THROW(rebase_shot_paths("{\"comment\": \"\351\"}", "/a", "/b"), Error);
  EXPECT_EQ(Json::parse(rebase_shot_paths(kShotText, "/caf\xC3\xA9", "/b"))["layers"][0]["take"],
            "../caf\xC3\xA9/take");
}

int count_paths(const nlohmann::json& schema) {
  int count = 0;
  if (schema.is_object() && schema.contains("$ref") && schema["$ref"] == "#/$defs/path") ++count;
  for (const auto& member : schema) count += member.is_structured() ? count_paths(member) : 0;
  return count;
}

TEST(ShotPaths, AreAllThoseOfTheSchema) {
  const auto schema =
      nlohmann::json::parse(read_file(testing::source_folder() / "schemas/shot.schema.json"));
  EXPECT_EQ(count_paths(schema), 8) << "add a new path to kPaths in shot_paths.cpp";
}

}  // namespace
}  // namespace raystage::replay
