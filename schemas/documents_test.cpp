// SPDX-License-Identifier: Apache-2.0
// Every document: reading and writing.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "base/error.h"
#include "schemas/bench_document.h"
#include "schemas/document_examples.h"
#include "schemas/import_manifest.h"
#include "schemas/rig_document.h"
#include "schemas/shot_document.h"
#include "schemas/take_document.h"
#include "schemas/views_document.h"
#include "testing/test_data.h"
#include "testing/test_folder.h"

namespace raystage::schemas {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;

class EveryDocument : public ::testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Kinds, EveryDocument,
                         ::testing::Values("rig", "take", "shot", "import", "views", "bench",
                                           "planes", "array_specification", "imported_depths"));

TEST_P(EveryDocument, ComesBackTheSame) {
  const std::string once = rewritten_document(GetParam(), example_document(GetParam()).dump());
  EXPECT_EQ(rewritten_document(GetParam(), once), once);
}

TEST_P(EveryDocument, NewerVersionsAreRefusedWithAdvice) {
  json document = example_document(GetParam());
  const std::string kind = GetParam();
  const int newest = kind == "shot"                                        ? 3
                     : kind == "rig" || kind == "import" || kind == "take" ? 2
                                                                           : 1;
  document["schema"] = std::string("raystage/") + GetParam() + "/" + std::to_string(newest + 1);
  document["a_future_property"] = 1;
  EXPECT_THAT(
      refusal_of(GetParam(), document),
      AllOf(StartsWith("f.json#/schema: the file has version " + std::to_string(newest + 1) +
                       ", but this program reads up to " + std::to_string(newest)),
            HasSubstr("Update Raystage")));
  document["schema"] = std::string("raystage/") + GetParam() + "/99999999999999";
  EXPECT_THAT(refusal_of(GetParam(), document), HasSubstr("the file has version 99999999999999"));
}

TEST_P(EveryDocument, OtherDocumentsAreRefused) {
  json document = example_document(GetParam());
  for (const json& schema : {json("raystage/other/1"), json("raystage/"), json(1), json("")}) {
    document["schema"] = schema;
    EXPECT_THAT(refusal_of(GetParam(), document), HasSubstr("f.json#/schema: found"));
  }
  document.erase("schema");
  EXPECT_THAT(refusal_of(GetParam(), document), HasSubstr("\"schema\" is missing"));
  EXPECT_THAT(refusal_of(GetParam(), json::array()), HasSubstr("found an array of 0"));
}

TEST_P(EveryDocument, UnknownPropertiesAreRefusedRemarksAreNot) {
  json document = example_document(GetParam());
  document["x_tool"] = {{"any", "thing"}};
  document["comment"] = "hello";
  EXPECT_EQ(refusal_of(GetParam(), document), "accepted");
  document["fsp"] = 1;
  EXPECT_THAT(refusal_of(GetParam(), document),
              HasSubstr("f.json#/fsp: found the unknown property"));
}

TEST(Documents, CamerasAreLimited) {
  for (const char* kind : {"rig", "take", "import"}) {
    json document = example_document(kind);
    document["cameras"] = json(10'001, document["cameras"][0]);
    EXPECT_THAT(refusal_of(kind, document), HasSubstr("10000")) << kind;
  }
}

TEST_P(EveryDocument, SurvivesTheLossOfAnyRequiredProperty) {
  const json whole = example_document(GetParam());
  for (const auto& [key, ignored] : whole.items()) {
    json document = whole;
    document.erase(key);
    const std::string verdict = refusal_of(GetParam(), document);
    if (verdict == "accepted") continue;  // it has a default
    EXPECT_THAT(verdict, HasSubstr("\"" + key + "\" is missing"));
  }
}

TEST_P(EveryDocument, NonFiniteNumbersAreRefused) {
  std::string text = example_document(GetParam()).dump();
  for (const char* number : {"1e999", "-1e999", "NaN", "Infinity"}) {
    std::string bad = text;
    const std::size_t at = bad.find("640");
    if (at == bad.npos) continue;
    bad.replace(at, 3, number);
    EXPECT_THROW(rewritten_document(GetParam(), bad), Error) << number;
  }
}
TEST(TakeDocument, TheFarthestDistanceMayBeLeftOut) {
  json document = example_document("take");
  for (const json& range : {json::array({3}), json::array({3, nullptr})}) {
    document["depth_range_m"] = range;
    const TakeDocument take = parse_take(document.dump(), "f");
    EXPECT_EQ(take.depth_range, (DepthRange{3, std::numeric_limits<double>::infinity()}));
    EXPECT_EQ(parse_take(format_take(take), "f").depth_range, take.depth_range);
  }
}

TEST(TakeDocument, ADepthRangeMayBeOneDepth) {
  json document = example_document("take");
  document["depth_range_m"] = {3, 3};
  EXPECT_EQ(parse_take(document.dump(), "f").depth_range, (DepthRange{3, 3}));
}

TEST(ShotDocument, ReadsEveryField) {
  const ShotDocument shot = parse_shot(example_document("shot").dump(), "f");
  EXPECT_EQ(shot.fps_numerator, 24000);
  EXPECT_EQ(shot.fps_denominator, 1001);
  EXPECT_EQ(shot.camera.keys.at(1).frame, 48);
  EXPECT_EQ(shot.camera.keys.at(1).orientation, (std::array<double, 4>{1, 0, 0, 0}));
  EXPECT_EQ(shot.layers.at(0).method, "focal_plane");
  EXPECT_EQ(shot.layers.at(0).speed, 1);
  EXPECT_EQ(shot.layers.at(0).fill, HoleFill::kNone);
  EXPECT_EQ(shot.layers.at(0).focal_plane.kind, ShotDocument::FocalPlane::Kind::kDepth);
  EXPECT_EQ(shot.layers.at(0).focal_plane.depth, 8.69);
  EXPECT_EQ(shot.output.compression, "piz");
}

TEST(ShotDocument, FillComesBack) {
  json document = example_document("shot");
  for (const auto& [word, fill] :
       {std::pair{"push_pull", HoleFill::kPushPull}, {"none", HoleFill::kNone}}) {
    document["layers"][0]["fill"] = word;
    const ShotDocument shot = parse_shot(document.dump(), "f");
    EXPECT_EQ(shot.layers[0].fill, fill);
    EXPECT_EQ(parse_shot(format_shot(shot), "f").layers[0].fill, fill);
  }
  document["layers"][0]["fill"] = "push-pull";
  EXPECT_THROW(parse_shot(document.dump(), "f"), Error);
}

TEST(Documents, BenchSettingsAreRead) {
  const BenchDocument bench = parse_bench(example_document("bench").dump(), "f");
  ASSERT_EQ(bench.settings.size(), 2U);
  EXPECT_EQ(bench.settings[0].focal_depth, 8.69);
  EXPECT_EQ(
      bench.settings[1],
      (BenchDocument::Setting{
          "sweep",
          "plane_sweep",
          {{"planes", 96.0}, {"aggregation", std::string("box")}, {"subplane_refinement", true}},
          {}}));
  json document = example_document("bench");
  document["settings"][1]["label"] = "one plane";
  EXPECT_THAT(refusal_of("bench", document),
              AllOf(HasSubstr("#/settings/1/label"), HasSubstr("is used already")));
  document = example_document("bench");
  document["settings"][1]["options"]["planes"] = json::array({1});
  EXPECT_THAT(refusal_of("bench", document), HasSubstr("#/settings/1/options/planes"));
}

TEST(Documents, WhatCannotBeReadAgainIsNotWritten) {
  const testing::TestFolder folder;
  RigDocument rig = parse_rig(example_document("rig").dump(), "f");
  write_rig(rig, folder.path() / "rig.json");
  const std::string before = read_file(folder.path() / "rig.json");
  rig.cameras[1].geometry.intrinsics.fx = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(write_rig(rig, folder.path() / "rig.json"), Error);
  EXPECT_EQ(read_file(folder.path() / "rig.json"), before);
}

TEST(Documents, DoublesComeBackExactly) {
  const testing::TestFolder folder;
  RigDocument rig = parse_rig(example_document("rig").dump(), "f");
  rig.cameras[0].geometry.intrinsics = {1.0 / 3, std::nextafter(1, 2), -0.0, 1e-300,
                                        Distortion{0.1, 0.2, 0.3, 1e-17, -1.0 / 7}};
  rig.cameras[0].geometry.world_from_camera[3] = std::sqrt(2);
  PhotometricResponse& response = rig.cameras[0].photometric;
  response.contrast = {1.1, 0.9, 1.0 / 3};
  response.curve = {{{0, 1.0 / 3, 1}, {-0.01, 1.1}, {0, 1}}};
  response.vignetting = Vignetting{0.1, 1.0 / 7, {0.3, 1e-17, -0.01}};
  response.gain_map = GainMap{2, 2, {{1, 2, 3}, {0.1, 1, 1}, {1, 1, 1}, {1, 1.0 / 3, 1}}};
  response.matrix = {{{1, 0.1, 0}, {0, 1, -1.0 / 3}, {0, 0, 1}}};
  response.hot_pixels = {{1, 0, {0.1, 0, 1.0 / 3}}, {0, 1, {0, 0, -0.1}}};
  write_rig(rig, folder.path() / "rig.json");
  const RigDocument read = read_rig(folder.path() / "rig.json");
  EXPECT_EQ(read.cameras[0].geometry, rig.cameras[0].geometry);
  EXPECT_EQ(read.cameras[0].photometric, rig.cameras[0].photometric);
}

TEST(Documents, MissingFilesAreBadInput) {
  try {
    read_take("/nowhere/take.json");
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
    EXPECT_EQ(error.where(), "/nowhere/take.json");
  }
}

TEST(Documents, RecordedLightFieldsAreReadAndComeBackTheSame) {
  if (!std::filesystem::exists(testing::test_data()))
    GTEST_SKIP() << "no data at " << testing::test_data();
  int manifests = 0, views = 0;
  for (const auto& entry : std::filesystem::directory_iterator(testing::test_data())) {
    if (const auto file = entry.path() / "import.json"; std::filesystem::exists(file)) {
      const ImportManifest manifest = read_import_manifest(file);
      const std::string once = format_import_manifest(manifest);
      EXPECT_EQ(json::parse(once), json::parse(read_file(file))) << file;
      ++manifests;
    }
    if (const auto file = entry.path() / "views.json"; std::filesystem::exists(file)) {
      EXPECT_EQ(json::parse(format_views(read_views(file))), json::parse(read_file(file))) << file;
      ++views;
    }
  }
  EXPECT_GE(manifests, 6);
  EXPECT_GE(views, 4);
}

}  // namespace
}  // namespace raystage::schemas
