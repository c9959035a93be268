// SPDX-License-Identifier: Apache-2.0
// Rigs and import manifests: what their cameras may be.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "schemas/document_examples.h"
#include "schemas/import_manifest.h"
#include "schemas/projection_names.h"
#include "schemas/rig_document.h"

namespace raystage::schemas {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

TEST(ImportManifest, ACameraThatLooksBackIsRefusedByName) {
  json document = example_document("import");
  document["cameras"].push_back(example_camera("c", 0.2));
  document["cameras"][2]["frames"] = document["cameras"][0]["frames"];
  // OpenCV's axes: half a turn about x.
  document["cameras"][2]["world_from_camera"] = {
      {1, 0, 0, 0.2}, {0, -1, 0, 0}, {0, 0, -1, 0}, {0, 0, 0, 1}};
  EXPECT_EQ(refusal_of("import", document), "accepted");  // without a depth range: a ring, perhaps
  document["depth_range_m"] = {1, 5};
  EXPECT_THAT(refusal_of("import", document),
              AllOf(StartsWith("f.json#/cameras/2/world_from_camera:"),
                    HasSubstr("camera \"c\" looks 180.0 degrees away"), HasSubstr("OpenCV")));
}

TEST(ImportManifest, ACameraBeyondTheNearestPlaneIsRefusedByName) {
  json document = example_document("import");
  document["depth_range_m"] = {1, 5};
  // The centre of the array is at half of that.
  document["cameras"][1]["world_from_camera"][2][3] = -1.9;
  EXPECT_EQ(refusal_of("import", document), "accepted");
  document["cameras"][1]["world_from_camera"][2][3] = -2.1;
  EXPECT_THAT(refusal_of("import", document),
              AllOf(StartsWith("f.json#/cameras/1/world_from_camera:"),
                    HasSubstr("camera \"b\" is 1.05 m in front")));
}

TEST(ImportManifest, ARingWithADepthRangeIsRefused) {
  json document = example_document("import");
  document["cameras"][1]["world_from_camera"] = {
      {-1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, -1, 0}, {0, 0, 0, 1}};
  document["depth_range_m"] = {1, 5};
  EXPECT_THAT(refusal_of("import", document), HasSubstr("have no mean viewing direction"));
}

/// Returns a manifest of eight cameras on a circle of 0.3 m in the plane y = 0 that look outwards.
json outward_ring() {
  json document = example_document("import");
  document["schema"] = "raystage/import/2";
  json cameras = json::array();
  for (int i = 0; i < 8; ++i) {
    json member = document["cameras"][0];
    const double angle = i * std::numbers::pi / 4, c = std::cos(angle), s = std::sin(angle);
    member["id"] = "ring" + std::to_string(i);
    // -z of the camera is (s, 0, -c).
    member["world_from_camera"] = {
        {c, 0, -s, 0.3 * s}, {0, 1, 0, 0}, {s, 0, c, -0.3 * c}, {0, 0, 0, 1}};
    cameras.push_back(member);
  }
  document["cameras"] = cameras;
  return document;
}

TEST(ImportManifest, CamerasThatLookOutwardsMayHaveADepthRange) {
  json document = outward_ring();
  document["depth_range_m"] = {1, 5};
  EXPECT_EQ(refusal_of("import", document), "accepted");
  for (std::size_t i = 0; i < 4; ++i) document["cameras"].erase(0);  // half a ring
  EXPECT_EQ(refusal_of("import", document), "accepted");
  document["depth_range_m"] = {0.2, 5};
  EXPECT_THAT(refusal_of("import",
                         outward_ring().patch(json::array(
                             {{{"op", "add"}, {"path", "/depth_range_m"}, {"value", {0.2, 5}}}}))),
              AllOf(HasSubstr("camera \"ring0\" is 0.3 m in front"), HasSubstr("0.2 m")));
}

TEST(ImportManifest, FisheyesMayLookBackWithADepthRange) {
  json document = example_document("import");
  document["schema"] = "raystage/import/2";
  document["cameras"].push_back(example_camera("c", 0.2));
  document["cameras"][2]["frames"] = document["cameras"][0]["frames"];
  document["cameras"][2]["world_from_camera"] = {
      {1, 0, 0, 0.2}, {0, -1, 0, 0}, {0, 0, -1, 0}, {0, 0, 0, 1}};
  document["depth_range_m"] = {1, 5};
  EXPECT_THAT(refusal_of("import", document), HasSubstr("OpenCV"));
  for (json& member : document["cameras"]) {
    member["intrinsics"] = {
        {"fx", 30}, {"fy", 30}, {"cx", 16}, {"cy", 12}, {"projection", "fisheye"}};
  }
  EXPECT_EQ(refusal_of("import", document), "accepted");
}

TEST(ImportManifest, MoviesWithoutTimesNeedVersion2) {
  json document = example_document("import");
  const auto written_version = [&] {
    return json::parse(rewritten_document("import", document.dump()))
        .at("schema")
        .get<std::string>();
  };
  document["cameras"][1].erase("frames");
  document["cameras"][1].update({{"movie", "b.mp4"}, {"times_ns", {1, 2}}});
  EXPECT_EQ(written_version(), "raystage/import/1");
  document["cameras"][1].erase("times_ns");
  EXPECT_EQ(written_version(), "raystage/import/2");
}

TEST(RigDocument, FisheyesAndRollingShuttersNeedVersion2) {
  json document = example_document("rig");
  const auto written_version = [&] {
    return json::parse(rewritten_document("rig", document.dump())).at("schema").get<std::string>();
  };
  EXPECT_EQ(written_version(), "raystage/rig/1");
  document["schema"] = "raystage/rig/2";
  EXPECT_EQ(written_version(), "raystage/rig/1");
  document["cameras"][1]["line_time_us"] = -12.5;
  EXPECT_EQ(written_version(), "raystage/rig/2");
  document["cameras"][0]["intrinsics"] = {{"fx", 300},
                                          {"fy", 301},
                                          {"cx", 320},
                                          {"cy", 240},
                                          {"projection", "equisolid"},
                                          {"radial_distortion", {0.1, -0.02}},
                                          {"half_angle", 1.6}};
  const RigDocument rig = parse_rig(document.dump(), "f.json");
  EXPECT_EQ(rig.cameras[0].geometry.intrinsics,
            (Intrinsics{300, 301, 320, 240, {}, Projection::kEquisolid, {0.1, -0.02, 0, 0}, 1.6}));
  EXPECT_EQ(rig.cameras[0].geometry.line_time_us, 0);
  EXPECT_EQ(rig.cameras[1].geometry.line_time_us, -12.5);
  EXPECT_EQ(parse_rig(format_rig(rig), "f.json").cameras[0].geometry, rig.cameras[0].geometry);
  document["schema"] = "raystage/rig/1";
  EXPECT_THAT(refusal_of("rig", document), HasSubstr("unknown property"));
}

TEST(CameraDocuments, MayHaveEveryProjection) {
  for (const Projection projection : projections()) {
    for (const std::string& kind : {std::string("rig"), std::string("import")}) {
      json document = example_document(kind);
      document["schema"] = "raystage/" + kind + "/2";
      json& lens = document["cameras"][0]["intrinsics"];
      lens = {{"fx", 30}, {"fy", 30}, {"cx", 16}, {"cy", 12}};
      lens["projection"] = name_of(projection);
      EXPECT_EQ(refusal_of(kind, document), "accepted") << name_of(projection);
      lens["projection"] = "no " + std::string(name_of(projection));
      EXPECT_THAT(refusal_of(kind, document), HasSubstr("intrinsics/projection: found"));
    }
  }
}

TEST(RigDocument, ALensHasOneKindOfDistortion) {
  json document = example_document("rig");
  document["schema"] = "raystage/rig/2";
  json& lens = document["cameras"][0]["intrinsics"];
  lens["half_angle"] = 1.5;
  EXPECT_THAT(refusal_of("rig", document),
              StartsWith("f.json#/cameras/0/intrinsics/half_angle: a pinhole has this property"));
  lens["projection"] = "fisheye";
  EXPECT_EQ(refusal_of("rig", document), "accepted");
  lens["distortion"] = {{"model", "brown_conrady"}, {"k1", 0.1}};
  EXPECT_THAT(refusal_of("rig", document), HasSubstr("has the distortion of a pinhole"));
  lens.erase("distortion");
  for (const json& damage : {json(0), json(3.15), json("wide")}) {
    lens["half_angle"] = damage;
    EXPECT_THAT(refusal_of("rig", document), HasSubstr("half_angle"));
  }
}

TEST(ImportManifest, ReadsEveryField) {
  json document = example_document("import");
  document["scale"] = "arbitrary";
  document["depth_range_m"] = {1.5, nullptr};
  document["cameras"][0].update({{"row", 2}, {"col", 3}});
  document["cameras"][0]["intrinsics"]["distortion"] = {
      {"model", "brown_conrady"}, {"k1", 1}, {"k2", 2}, {"p1", 3}, {"p2", 4}, {"k3", 5}};
  const ImportManifest manifest = parse_import_manifest(document.dump(), "f");
  EXPECT_EQ(manifest.name, "test");
  EXPECT_EQ(manifest.epoch_utc, parse_utc("2026-01-01T00:00:00Z"));
  EXPECT_EQ(manifest.nominal_fps, 15);
  EXPECT_TRUE(manifest.arbitrary_scale);
  EXPECT_EQ(manifest.depth_range->near, 1.5);
  EXPECT_TRUE(std::isinf(manifest.depth_range->far));
  const auto& [a, b] = std::tie(manifest.cameras.at(0), manifest.cameras.at(1));
  EXPECT_EQ(a.geometry.row, 2);
  EXPECT_EQ(a.geometry.column, 3);
  EXPECT_EQ(a.geometry.intrinsics, (Intrinsics{500.5, 501, 320, 240, Distortion{1, 2, 3, 4, 5}}));
  EXPECT_EQ(a.frames.at(1).file, "b.jpg");
  EXPECT_EQ(a.frames.at(1).time_ns, 5);
  EXPECT_EQ(b.movie, "b.mp4");
  EXPECT_EQ(b.times_ns, (std::vector<Nanoseconds>{1, 2}));
  EXPECT_EQ(b.geometry.world_from_camera[3], 0.1);
  EXPECT_EQ(b.geometry.row, std::nullopt);
}

}  // namespace
}  // namespace raystage::schemas
