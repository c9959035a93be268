// SPDX-License-Identifier: Apache-2.0
#include "schemas/former_names.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "schemas/embedded_schemas.h"
#include "schemas/rig_document.h"

namespace raystage::schemas::former_names_test {
namespace {

using ::testing::HasSubstr;
using Json = nlohmann::json;

const Json kSchema = Json::parse(R"({
  "properties": {
    "new": {"formerly": ["old", "older"]},
    "list": {"items": {"oneOf": [{"const": 1}, {"$ref": "#/$defs/item"}]}}},
  "$defs": {"item": {"properties": {"kept": {}, "inner": {"formerly": ["within"]}}}}})");

Json replaced(Json document) {
  replace_former_names(kSchema, document, "f");
  return document;
}

TEST(FormerNames, AreReplacedAtEveryDepth) {
  EXPECT_EQ(replaced({{"old", 1}}), (Json{{"new", 1}}));
  EXPECT_EQ(replaced({{"older", 1}, {"x_old", 2}}), (Json{{"new", 1}, {"x_old", 2}}));
  EXPECT_EQ(replaced({{"list", {1, {{"within", 2}, {"kept", 3}}}}}),
            (Json{{"list", {1, {{"inner", 2}, {"kept", 3}}}}}));
  EXPECT_EQ(replaced({{"new", {{"old", 1}}}}), (Json{{"new", {{"old", 1}}}})) << "not its place";
  EXPECT_EQ(replaced(Json::array({1})), Json::array({1}));
}

TEST(FormerNames, AreRejectedNextToTheNewOne) {
  try {
    replaced({{"list", {{{"within", 2}, {"inner", 3}}}}});
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.where(), "f#/list/0/within");
    EXPECT_THAT(error.what(), HasSubstr("is the former name of \"inner\""));
  }
}

TEST(FormerNames, OfReportsAreWrittenNextToTheNewOnes) {
  constexpr FormerName kNames[] = {{"inliers", "kept"}};
  nlohmann::ordered_json report{{"inliers", 1}, {"list", {{{"inliers", {2}}}, 3}}};
  add_former_names(report, kNames);
  EXPECT_EQ(report.dump(), R"({"inliers":1,"list":[{"inliers":[2],"kept":[2]},3],"kept":1})");
}

TEST(FormerNames, OfDocumentsAreStillRead) {
  RigDocument rig;
  rig.name = "r";
  RigDocument::Camera& camera = rig.cameras.emplace_back();
  camera.geometry.id = "a";
  camera.geometry.width = 8;
  camera.geometry.height = 6;
  camera.geometry.intrinsics = {8, 8, 4, 3, {}};
  camera.photometric.hot_pixels = {{1, 2, {0.25, 0, 0}}};
  std::string text = format_rig(rig);
  const std::size_t at = text.find("\"hot_pixels\"");
  ASSERT_NE(at, std::string::npos);
  text.replace(at, std::string_view("\"hot_pixels\"").size(), "\"dark_pixels\"");
  EXPECT_EQ(parse_rig(text, "rig.json").cameras[0].photometric.hot_pixels.size(), 1U);
}

}  // namespace
}  // namespace raystage::schemas::former_names_test
