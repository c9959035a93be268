// SPDX-License-Identifier: Apache-2.0
// Every document: reading, writing, and rejection at the right JSON pointer.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>

#include "base/atomic_file.h"
#include "base/error.h"
#include "schemas/array_specification.h"
#include "schemas/bench_document.h"
#include "schemas/import_manifest.h"
#include "schemas/imported_depths_document.h"
#include "schemas/planes_document.h"
#include "schemas/projection_names.h"
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
using ::testing::StartsWith;

json camera(const std::string& id, double x) {
  return {{"id", id},
          {"width", 640},
          {"height", 480},
          {"intrinsics", {{"fx", 500.5}, {"fy", 501}, {"cx", 320}, {"cy", 240}}},
          {"world_from_camera", {{1, 0, 0, x}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}}}};
}

json good(const std::string& kind) {
  json document{{"schema", "raystage/" + kind + "/1"}};
  if (kind == "shot") {
    document.update({{"width", 960},
                     {"height", 640},
                     {"fps", "24000/1001"},
                     {"first_frame", 1},
                     {"last_frame", 48}});
    for (const int frame : {1, 48}) {
      document["camera"].push_back({{"frame", frame},
                                    {"position", {0.01, 0, -0.2}},
                                    {"orientation", {2, 0, 0, 0}},
                                    {"horizontal_fov_deg", 50}});
    }
    document["layers"] = {{{"take", "../take"}, {"focal_plane", {{"depth_m", 8.69}}}}};
    return document;
  }
  if (kind == "bench") {
    document["settings"] = {
        {{"label", "one plane"}, {"method", "focal_plane"}, {"focal_depth_m", 8.69}},
        {{"label", "sweep"},
         {"method", "plane_sweep"},
         {"options", {{"planes", 96}, {"aggregation", "box"}, {"subplane_refinement", true}}}}};
    return document;
  }
  if (kind == "array_specification") {
    document.update({{"name", "wall"},
                     {"views",
                      {{"width_px", 640},
                       {"height_px", 480},
                       {"least_fov_deg", 30},
                       {"largest_fov_deg", 45.5},
                       {"max_yaw_deg", 5}}},
                     {"positions",
                      {{{"x_m", -0.5}, {"y_m", 0}, {"depth_m", -1}},
                       {{"x_m", 0.5}, {"y_m", 0}, {"depth_m", 1}, {"yaw_deg", 3}}}},
                     {"depth_range_m", {2, nullptr}},
                     {"subject", {{"depth_m", 3}, {"radius_m", 0.5}}},
                     {"fps", 24},
                     {"minutes", 10},
                     {"cameras",
                      {{{"id", "a"},
                        {"width_px", 640},
                        {"height_px", 480},
                        {"sensor_width_mm", 4.8},
                        {"focal_lengths_mm", {4, 6}},
                        {"max_fps", 30},
                        {"price", 100}}}},
                     {"node", {{"cameras", 8}, {"megabytes_per_s", 200}, {"price", 1000}}},
                     {"disk", {{"gigabytes", 500}, {"megabytes_per_s", 100}, {"price", 50}}}});
    return document;
  }
  if (kind == "planes") {
    document["planes"] = {
        {{"id", "door"}, {"corners", {{0, 0, -3}, {1, 0, -3}, {1, 2.5, -3}, {0, 2.5, -3}}}},
        {{"id", "sail"}, {"corners", {{640, 0, -3}, {1, 0.1, -3}, {1, 2, -4}}}}};
    return document;
  }
  if (kind == "imported_depths") {
    document["imports"] = {{{"utc", "2026-01-01T00:00:00Z"},
                            {"by", "raystage"},
                            {"folder", "/maps"},
                            {"encoding", "EXR, planar depth, 1 m a unit"}}};
    const json map{{"frame", 0},
                   {"frame_xxh3", "0123456789abcdef"},
                   {"file", "a/000000.0123456789abcdef.zst"},
                   {"quantity", "inverse_depth"},
                   {"width", 640},
                   {"height", 480},
                   {"unknown_share", 0.25},
                   {"import", 0},
                   {"source", "a/000001.exr"},
                   {"source_sha256", std::string(64, 'a')}};
    document["cameras"] = {{{"id", "a"}, {"maps", {map, map}}},
                           {{"id", "b"}, {"maps", json::array()}}};
    document["cameras"][0]["maps"][1].update({{"frame", 7}, {"quantity", "inverse_distance"}});
    return document;
  }
  if (kind == "views") {
    document["color_space"] = "srgb_texture";
    document["views"] = {camera("a", 0), camera("b", 0.1)};
    document["views"][0].update({{"file", "truth/a.png"}, {"time_ns", 233333333}});
    return document;
  }
  document["name"] = "test";
  if (kind == "rig") {
    document["cameras"] = {camera("a", 0), camera("b", 0.1)};
    document["cameras"][1]["photometric"] = {
        {"contrast", {1, 1.5, 1}},
        {"brightness", {0, 0.1, 0}},
        {"curve", {{0, 0.4, 1}, {0, 1}, {0, 1}}},
        {"vignetting", {{"cx", 3.5}, {"cy", 2}, {"a", {0.3, 0.1, 0}}}},
        {"gain_map", {{"columns", 2}, {"rows", 2}, {"gain", std::vector<Rgb>(4, {1, 1.5, 2})}}},
        {"matrix", {{1.5, -0.5, 0}, {0, 1, 0}, {0, 0, 1}}},
        {"hot_pixels", {{1, 0, 0.5, 0, 0}, {0, 1, 0.25, 0, 0}}}};
    return document;
  }
  document.update({{"epoch_utc", "2026-01-01T00:00:00Z"},
                   {"nominal_fps", 15},
                   {"color_space", "srgb_texture"}});
  if (kind == "take") {
    for (const std::string id : {"a", "b"}) {
      document["cameras"].push_back({{"id", id},
                                     {"archive", "archive/" + id + ".mkv"},
                                     {"journal", "archive/" + id + ".journal"}});
    }
    return document;
  }
  document["cameras"] = {camera("a", 0), camera("b", 0.1)};
  document["cameras"][0]["frames"] = {{{"file", "a.jpg"}, {"time_ns", 0}},
                                      {{"file", "b.jpg"}, {"time_ns", 5}}};
  document["cameras"][1].update({{"movie", "b.mp4"}, {"times_ns", {1, 2}}});
  return document;
}

/// Returns a document of any kind, read and written again.
std::string rewritten(const std::string& kind, const std::string& text) {
  if (kind == "rig") return format_rig(parse_rig(text, "f.json"));
  if (kind == "take") return format_take(parse_take(text, "f.json"));
  if (kind == "shot") return format_shot(parse_shot(text, "f.json"));
  if (kind == "bench") return format_bench(parse_bench(text, "f.json"));
  if (kind == "array_specification") {
    return format_array_specification(parse_array_specification(text, "f.json"));
  }
  if (kind == "imported_depths") {
    return format_imported_depths(parse_imported_depths(text, "f.json"));
  }
  if (kind == "planes") return format_planes(parse_planes(text, "f.json"));
  if (kind == "views") return format_views(parse_views(text, "f.json"));
  return format_import_manifest(parse_import_manifest(text, "f.json"));
}

std::string refusal(const std::string& kind, const json& document) {
  try {
    rewritten(kind, document.dump());
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
    EXPECT_FALSE(error.what_to_do().empty());
    return error.what();
  }
  return "accepted";
}

class EveryDocument : public ::testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Kinds, EveryDocument,
                         ::testing::Values("rig", "take", "shot", "import", "views", "bench",
                                           "planes", "array_specification", "imported_depths"));

TEST_P(EveryDocument, ComesBackTheSame) {
  const std::string once = rewritten(GetParam(), good(GetParam()).dump());
  EXPECT_EQ(rewritten(GetParam(), once), once);
}

TEST_P(EveryDocument, NewerVersionsAreRefusedWithAdvice) {
  json document = good(GetParam());
  const std::string kind = GetParam();
  const int newest = kind == "shot"                                        ? 3
                     : kind == "rig" || kind == "import" || kind == "take" ? 2
                                                                           : 1;
  document["schema"] = std::string("raystage/") + GetParam() + "/" + std::to_string(newest + 1);
  document["a_future_property"] = 1;
  EXPECT_THAT(
      refusal(GetParam(), document),
      AllOf(StartsWith("f.json#/schema: the file has version " + std::to_string(newest + 1) +
                       ", but this program reads up to " + std::to_string(newest)),
            HasSubstr("Update Raystage")));
  document["schema"] = std::string("raystage/") + GetParam() + "/99999999999999";
  EXPECT_THAT(refusal(GetParam(), document), HasSubstr("the file has version 99999999999999"));
}

TEST_P(EveryDocument, OtherDocumentsAreRefused) {
  json document = good(GetParam());
  for (const json& schema : {json("raystage/other/1"), json("raystage/"), json(1), json("")}) {
    document["schema"] = schema;
    EXPECT_THAT(refusal(GetParam(), document), HasSubstr("f.json#/schema: found"));
  }
  document.erase("schema");
  EXPECT_THAT(refusal(GetParam(), document), HasSubstr("\"schema\" is missing"));
  EXPECT_THAT(refusal(GetParam(), json::array()), HasSubstr("found an array of 0"));
}

TEST_P(EveryDocument, UnknownPropertiesAreRefusedRemarksAreNot) {
  json document = good(GetParam());
  document["x_tool"] = {{"any", "thing"}};
  document["comment"] = "hello";
  EXPECT_EQ(refusal(GetParam(), document), "accepted");
  document["fsp"] = 1;
  EXPECT_THAT(refusal(GetParam(), document), HasSubstr("f.json#/fsp: found the unknown property"));
}

TEST(Documents, CamerasAreLimited) {
  for (const char* kind : {"rig", "take", "import"}) {
    json document = good(kind);
    document["cameras"] = json(10'001, document["cameras"][0]);
    EXPECT_THAT(refusal(kind, document), HasSubstr("10000")) << kind;
  }
}

TEST_P(EveryDocument, SurvivesTheLossOfAnyRequiredProperty) {
  const json whole = good(GetParam());
  for (const auto& [key, ignored] : whole.items()) {
    json document = whole;
    document.erase(key);
    const std::string verdict = refusal(GetParam(), document);
    if (verdict == "accepted") continue;  // it has a default
    EXPECT_THAT(verdict, HasSubstr("\"" + key + "\" is missing"));
  }
}

TEST_P(EveryDocument, NonFiniteNumbersAreRefused) {
  std::string text = good(GetParam()).dump();
  for (const char* number : {"1e999", "-1e999", "NaN", "Infinity"}) {
    std::string bad = text;
    const std::size_t at = bad.find("640");
    if (at == bad.npos) continue;
    bad.replace(at, 3, number);
    EXPECT_THROW(rewritten(GetParam(), bad), Error) << number;
  }
}

struct Damage {
  const char* kind;
  const char* pointer;  ///< what is replaced
  json value;
  const char* where;  ///< the pointer in the error
  const char* message;
};

void PrintTo(const Damage& damage, std::ostream* stream) {
  *stream << damage.kind << damage.pointer << " = " << damage.value.dump();
}

class DamagedDocument : public ::testing::TestWithParam<Damage> {};

TEST_P(DamagedDocument, IsRefusedAtThePlace) {
  const Damage& damage = GetParam();
  json document = good(damage.kind);
  document[json::json_pointer(damage.pointer)] = damage.value;
  EXPECT_THAT(
      refusal(damage.kind, document),
      AllOf(StartsWith(std::string("f.json#") + damage.where + ":"), HasSubstr(damage.message)));
}

const json kMirrored = {{-1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}};
const json kScaled = {{2, 0, 0, 0}, {0, 2, 0, 0}, {0, 0, 2, 0}, {0, 0, 0, 1}};
const json kByColumns = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {5, 0, 0, 1}};
constexpr const char* kPose = "/cameras/1/world_from_camera";

INSTANTIATE_TEST_SUITE_P(
    Cameras, DamagedDocument,
    ::testing::Values(
        Damage{"rig", "/cameras", json::array(), "/cameras", "an array of 1 to 10000"},
        Damage{"rig", "/cameras/1/id", "a", "/cameras/1/id", "the id \"a\" is used twice"},
        Damage{"rig", "/cameras/1/id", "../a", "/cameras/1/id", "found \"../a\""},
        Damage{"rig", "/cameras/1/id", ".a", "/cameras/1/id", "found \".a\""},
        Damage{"rig", "/cameras/1/id", "", "/cameras/1/id", "found \"\""},
        Damage{"rig", "/cameras/1/id", "a b", "/cameras/1/id", "found \"a b\""},
        Damage{"rig", "/cameras/1/id", "a\n", "/cameras/1/id", "found \"a\\n\""},
        Damage{"rig", "/cameras/1/id", std::string(200'000, 'a'), "/cameras/1/id", "found \"aaa"},
        Damage{"rig", "/cameras/1/width", 0, "/cameras/1/width", "an integer from 1 up to 65535"},
        Damage{"rig", "/cameras/1/width", 65536, "/cameras/1/width", "found 65536"},
        Damage{"rig", "/cameras/1/height", 1.5, "/cameras/1/height", "found 1.5"},
        Damage{"rig", "/cameras/1/intrinsics/fx", 0, "/cameras/1/intrinsics/fx", "greater than 0"},
        Damage{"rig", "/cameras/1/intrinsics/fy", -5, "/cameras/1/intrinsics/fy", "greater than 0"},
        Damage{"rig", "/cameras/1/intrinsics/cx", nullptr, "/cameras/1/intrinsics/cx",
               "found null"},
        Damage{"rig",
               "/cameras/1/intrinsics/distortion",
               {{"model", "fisheye"}},
               "/cameras/1/intrinsics/distortion/model",
               "allowed: \"brown_conrady\""},
        Damage{"rig",
               "/cameras/1/intrinsics/distortion",
               {{"k1", 0.1}},
               "/cameras/1/intrinsics/distortion",
               "\"model\" is missing"},
        Damage{"rig", kPose, kMirrored, kPose, "is a reflection"},
        Damage{"rig", kPose, kScaled, kPose, "not rigid"},
        Damage{"rig", kPose, kByColumns, "/cameras/1/world_from_camera/3", "[0, 0, 0, 1]"},
        Damage{"rig", "/cameras/1/world_from_camera/0/0", 1.001, kPose, "not rigid"},
        Damage{"rig", "/cameras/1/world_from_camera/0/0", "1", "/cameras/1/world_from_camera/0/0",
               "found \"1\""},
        Damage{"rig", "/cameras/1/row", 3, "/cameras/1", "only one of \"row\" and \"col\""},
        Damage{"rig", "/topology", "ring", "/topology", "\"auto\" or \"grid\""},
        Damage{"rig",
               "/cameras/0/photometric",
               {{"contrast", {1, 0, 1}}, {"brightness", {0, 0, 0}}},
               "/cameras/0/photometric/contrast/1",
               "greater than 0"}));

TEST(Documents, PhotometricDamageIsToldWhereItIs) {
  struct Case {
    const char *property, *value, *where, *message;
  };
  for (const Case& wrong : {
           Case{"curve", "[[0, 1], [0, 0.5, 0.5], [0, 1]]", "/1/2", "does not increase"},
           Case{"curve", "[[0, 1], [0, 1]]", "", "array of 2"},
           Case{"vignetting", R"({"cx": 2, "cy": 2, "a": [-1, 0, 0]})", "", "greater than 0"},
           Case{"gain_map",
                R"({"columns": 2, "rows": 3, "gain": [[1,1,1],[1,1,1],[1,1,1],[1,1,1]]})", "/gain",
                "columns * rows = 6"},
           Case{"matrix", "[[1, 0, 0], [0, 1, 0]]", "", "array of 2"},
           Case{"hot_pixels", "[[1, 1, 0, 0, 0], [70000, 0, 0, 0, 0]]", "/1/0", "65535"},
           Case{"hot_pixels", "[[60000, 0, 0, 0, 0]]", "/0", "in the picture"},
           Case{"hot_pixels", "[[0.5, 0, 0, 0, 0]]", "/0", "whole numbers"},
           Case{"hot_pixels", "[[1, 0, 0, 0, 0], [1, 0, 1, 1, 1]]", "/1", "is not sorted after"},
       }) {
    json rig = good("rig");
    rig["cameras"][0]["photometric"] = {{"contrast", {1, 1, 1}}, {"brightness", {0, 0, 0}}};
    rig["cameras"][0]["photometric"][wrong.property] = json::parse(wrong.value);
    try {
      parse_rig(rig.dump(), "f");
      ADD_FAILURE() << wrong.property << wrong.value;
    } catch (const Error& error) {
      EXPECT_THAT(error.what(),
                  HasSubstr(std::string("/cameras/0/photometric/") + wrong.property + wrong.where));
      EXPECT_THAT(error.what(), HasSubstr(wrong.message));
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    Takes, DamagedDocument,
    ::testing::Values(
        Damage{"take", "/epoch_utc", "2026-01-01 00:00:00", "/epoch_utc", "found \"2026"},
        Damage{"take", "/epoch_utc", "2026-13-01T00:00:00Z", "/epoch_utc", "no such date"},
        Damage{"take", "/epoch_utc", "1678-01-01T00:00:00Z", "/epoch_utc", "allowed: 1830-"},
        Damage{"take", "/epoch_utc", "2261-01-01T00:00:00Z", "/epoch_utc", "to 2109-"},
        Damage{"take", "/cameras/1/archive_epoch_utc", "2025-09-18T00:00:00Z",
               "/cameras/1/archive_epoch_utc", "within 104 days"},
        Damage{"take", "/cameras/1/archive_epoch_utc", "2026-04-16T00:00:00Z",
               "/cameras/1/archive_epoch_utc", "within 104 days"},
        Damage{"take", "/nominal_fps", 1e-300, "/nominal_fps", "0, or at least 1e-09"},
        Damage{"take", "/color_space", "sRGB", "/color_space", "allowed: \"srgb_texture\""},
        Damage{"take", "/clock", "ptp", "/clock", "\"host\" or \"device\""},
        Damage{"take", "/timestamp_event", "middle", "/timestamp_event", "\"exposure_middle\""},
        Damage{"take", "/cameras/1/id", "a", "/cameras/1/id", "is used twice"},
        Damage{"take", "/cameras/1/archive", "/etc/passwd", "/cameras/1/archive",
               "inside the take"},
        Damage{"take", "/cameras/1/journal", "a/../../b", "/cameras/1/journal", "inside the take"},
        Damage{"take", "/cameras/1/journal", std::string("a\0b", 3), "/cameras/1/journal",
               "control character"},
        Damage{
            "take", "/depth_range_m", {3, 2.5}, "/depth_range_m", "nearest and then the farthest"},
        Damage{"take", "/depth_range_m", {nullptr, 3}, "/depth_range_m", "nearest"},
        Damage{"take", "/depth_range_m", {0, 3}, "/depth_range_m/0", "greater than 0"}));

INSTANTIATE_TEST_SUITE_P(
    Imports, DamagedDocument,
    ::testing::Values(
        Damage{"import", "/cameras", json::array(), "/cameras", "an array of 1 to 10000"},
        Damage{"import", "/cameras/1/id", "a", "/cameras/1/id", "is used twice"},
        Damage{"import", "/nominal_fps", 0, "/nominal_fps", "greater than 0"},
        Damage{"import", "/cameras/0/frames", json::array(), "/cameras/0/frames", "at least 1"},
        Damage{"import", "/cameras/0/frames/1/time_ns", 0, "/cameras/0/frames/1/time_ns",
               "found 0 after 0, allowed: increasing times"},
        Damage{"import", "/cameras/0/frames/1/time_ns", -5, "/cameras/0/frames/1/time_ns",
               "found -5"},
        Damage{"import", "/cameras/0/frames/1/time_ns", 104LL * 86400 * 1'000'000'000 + 1,
               "/cameras/0/frames/1/time_ns", "up to 8985600000000000"},
        Damage{"import", "/cameras/0/frames/1/file", "", "/cameras/0/frames/1/file", "found \"\""},
        Damage{"import", "/cameras/1/times_ns/1", 1, "/cameras/1/times_ns/1", "increasing"},
        Damage{"import", "/cameras/0/movie", "a.mp4", "/cameras/0", "either \"frames\""},
        Damage{"import", "/cameras/0/times_ns", {1}, "/cameras/0", "either \"frames\""},
        Damage{"import", "/scale", "feet", "/scale", "\"metres\" or \"arbitrary\""}));

INSTANTIATE_TEST_SUITE_P(
    ShotsAndViews, DamagedDocument,
    ::testing::Values(
        Damage{"shot", "/camera", json::array(), "/camera", "at least 1"},
        Damage{"shot", "/camera/1/frame", 1, "/camera/1/frame", "increasing frames"},
        Damage{"shot", "/camera/1/horizontal_fov_deg", 180, "/camera/1/horizontal_fov_deg",
               "less than 180"},
        Damage{"shot", "/camera/1/horizontal_fov_deg", 0, "/camera/1/horizontal_fov_deg",
               "greater than 0"},
        Damage{"shot", "/camera/1/orientation", {0, 0, 0, 0}, "/camera/1/orientation", "length 0"},
        Damage{
            "shot", "/camera/1/orientation", {1, 0, 0}, "/camera/1/orientation", "an array of 4"},
        Damage{"shot", "/last_frame", 0, "/last_frame", "at least first_frame, which is 1"},
        Damage{"shot", "/fps", 0, "/fps", "found 0"},
        Damage{"shot", "/fps", "24/0", "/fps", "found \"24/0\""},
        Damage{"shot", "/fps", "fast", "/fps", "found \"fast\""},
        Damage{"shot", "/layers", json::array(), "/layers", "an array of 1"},
        Damage{"shot", "/layers/0/focal_plane", "near", "/layers/0/focal_plane",
               "\"best\" or \"infinity\" or an object with \"depth_m\""},
        Damage{"shot",
               "/layers/0/focal_plane",
               {{"depth_m", -1}},
               "/layers/0/focal_plane/depth_m",
               "greater than 0"},
        Damage{"shot",
               "/layers/0/focal_plane",
               {{"equation", {0, 0, 0, 1}}},
               "/layers/0/focal_plane/equation",
               "without a normal"},
        Damage{"shot",
               "/layers/0/focal_plane",
               {{"depth_m", 1}, {"equation", {0, 0, 1, 1}}},
               "/layers/0/focal_plane",
               "found an object"},
        Damage{"shot",
               "/output",
               {{"compression", "dwaa"}},
               "/output/compression",
               "\"none\" or \"rle\""},
        Damage{"views", "/views", json::array(), "/views", "at least 1"},
        Damage{"views", "/views/1/id", "a", "/views/1/id", "is used twice"},
        Damage{"views", "/views/1/time_ns", -1, "/views/1/time_ns", "found -1"}));

TEST(ImportManifest, ACameraThatLooksBackIsRefusedByName) {
  json document = good("import");
  document["cameras"].push_back(camera("c", 0.2));
  document["cameras"][2]["frames"] = document["cameras"][0]["frames"];
  // OpenCV's axes: half a turn about x.
  document["cameras"][2]["world_from_camera"] = {
      {1, 0, 0, 0.2}, {0, -1, 0, 0}, {0, 0, -1, 0}, {0, 0, 0, 1}};
  EXPECT_EQ(refusal("import", document), "accepted");  // without a depth range: a ring, perhaps
  document["depth_range_m"] = {1, 5};
  EXPECT_THAT(refusal("import", document),
              AllOf(StartsWith("f.json#/cameras/2/world_from_camera:"),
                    HasSubstr("camera \"c\" looks 180.0 degrees away"), HasSubstr("OpenCV")));
}

TEST(ImportManifest, ACameraBeyondTheNearestPlaneIsRefusedByName) {
  json document = good("import");
  document["depth_range_m"] = {1, 5};
  // The centre of the array is at half of that.
  document["cameras"][1]["world_from_camera"][2][3] = -1.9;
  EXPECT_EQ(refusal("import", document), "accepted");
  document["cameras"][1]["world_from_camera"][2][3] = -2.1;
  EXPECT_THAT(refusal("import", document), AllOf(StartsWith("f.json#/cameras/1/world_from_camera:"),
                                                 HasSubstr("camera \"b\" is 1.05 m in front")));
}

TEST(ImportManifest, ARingWithADepthRangeIsRefused) {
  json document = good("import");
  document["cameras"][1]["world_from_camera"] = {
      {-1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, -1, 0}, {0, 0, 0, 1}};
  document["depth_range_m"] = {1, 5};
  EXPECT_THAT(refusal("import", document), HasSubstr("have no mean viewing direction"));
}

/// Returns a manifest of eight cameras on a circle of 0.3 m in the plane y = 0 that look outwards.
json outward_ring() {
  json document = good("import");
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
  EXPECT_EQ(refusal("import", document), "accepted");
  for (std::size_t i = 0; i < 4; ++i) document["cameras"].erase(0);  // half a ring
  EXPECT_EQ(refusal("import", document), "accepted");
  document["depth_range_m"] = {0.2, 5};
  EXPECT_THAT(
      refusal("import", outward_ring().patch(json::array(
                            {{{"op", "add"}, {"path", "/depth_range_m"}, {"value", {0.2, 5}}}}))),
      AllOf(HasSubstr("camera \"ring0\" is 0.3 m in front"), HasSubstr("0.2 m")));
}

TEST(ImportManifest, FisheyesMayLookBackWithADepthRange) {
  json document = good("import");
  document["schema"] = "raystage/import/2";
  document["cameras"].push_back(camera("c", 0.2));
  document["cameras"][2]["frames"] = document["cameras"][0]["frames"];
  document["cameras"][2]["world_from_camera"] = {
      {1, 0, 0, 0.2}, {0, -1, 0, 0}, {0, 0, -1, 0}, {0, 0, 0, 1}};
  document["depth_range_m"] = {1, 5};
  EXPECT_THAT(refusal("import", document), HasSubstr("OpenCV"));
  for (json& member : document["cameras"]) {
    member["intrinsics"] = {
        {"fx", 30}, {"fy", 30}, {"cx", 16}, {"cy", 12}, {"projection", "fisheye"}};
  }
  EXPECT_EQ(refusal("import", document), "accepted");
}

TEST(ImportManifest, MoviesWithoutTimesNeedVersion2) {
  json document = good("import");
  const auto written_version = [&] {
    return json::parse(rewritten("import", document.dump())).at("schema").get<std::string>();
  };
  document["cameras"][1].erase("frames");
  document["cameras"][1].update({{"movie", "b.mp4"}, {"times_ns", {1, 2}}});
  EXPECT_EQ(written_version(), "raystage/import/1");
  document["cameras"][1].erase("times_ns");
  EXPECT_EQ(written_version(), "raystage/import/2");
}

TEST(RigDocument, FisheyesAndRollingShuttersNeedVersion2) {
  json document = good("rig");
  const auto written_version = [&] {
    return json::parse(rewritten("rig", document.dump())).at("schema").get<std::string>();
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
  EXPECT_THAT(refusal("rig", document), HasSubstr("unknown property"));
}

TEST(CameraDocuments, MayHaveEveryProjection) {
  for (const Projection projection : projections()) {
    for (const std::string& kind : {std::string("rig"), std::string("import")}) {
      json document = good(kind);
      document["schema"] = "raystage/" + kind + "/2";
      json& lens = document["cameras"][0]["intrinsics"];
      lens = {{"fx", 30}, {"fy", 30}, {"cx", 16}, {"cy", 12}};
      lens["projection"] = name_of(projection);
      EXPECT_EQ(refusal(kind, document), "accepted") << name_of(projection);
      lens["projection"] = "no " + std::string(name_of(projection));
      EXPECT_THAT(refusal(kind, document), HasSubstr("intrinsics/projection: found"));
    }
  }
}

TEST(RigDocument, ALensHasOneKindOfDistortion) {
  json document = good("rig");
  document["schema"] = "raystage/rig/2";
  json& lens = document["cameras"][0]["intrinsics"];
  lens["half_angle"] = 1.5;
  EXPECT_THAT(refusal("rig", document),
              StartsWith("f.json#/cameras/0/intrinsics/half_angle: a pinhole has this property"));
  lens["projection"] = "fisheye";
  EXPECT_EQ(refusal("rig", document), "accepted");
  lens["distortion"] = {{"model", "brown_conrady"}, {"k1", 0.1}};
  EXPECT_THAT(refusal("rig", document), HasSubstr("has the distortion of a pinhole"));
  lens.erase("distortion");
  for (const json& damage : {json(0), json(3.15), json("wide")}) {
    lens["half_angle"] = damage;
    EXPECT_THAT(refusal("rig", document), HasSubstr("half_angle"));
  }
}

TEST(ImportManifest, ReadsEveryField) {
  json document = good("import");
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

TEST(TakeDocument, TheFarthestDistanceMayBeLeftOut) {
  json document = good("take");
  for (const json& range : {json::array({3}), json::array({3, nullptr})}) {
    document["depth_range_m"] = range;
    const TakeDocument take = parse_take(document.dump(), "f");
    EXPECT_EQ(take.depth_range, (DepthRange{3, std::numeric_limits<double>::infinity()}));
    EXPECT_EQ(parse_take(format_take(take), "f").depth_range, take.depth_range);
  }
}

TEST(TakeDocument, ADepthRangeMayBeOneDepth) {
  json document = good("take");
  document["depth_range_m"] = {3, 3};
  EXPECT_EQ(parse_take(document.dump(), "f").depth_range, (DepthRange{3, 3}));
}

TEST(ShotDocument, ReadsEveryField) {
  const ShotDocument shot = parse_shot(good("shot").dump(), "f");
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
  json document = good("shot");
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
  const BenchDocument bench = parse_bench(good("bench").dump(), "f");
  ASSERT_EQ(bench.settings.size(), 2U);
  EXPECT_EQ(bench.settings[0].focal_depth, 8.69);
  EXPECT_EQ(
      bench.settings[1],
      (BenchDocument::Setting{
          "sweep",
          "plane_sweep",
          {{"planes", 96.0}, {"aggregation", std::string("box")}, {"subplane_refinement", true}},
          {}}));
  json document = good("bench");
  document["settings"][1]["label"] = "one plane";
  EXPECT_THAT(refusal("bench", document),
              AllOf(HasSubstr("#/settings/1/label"), HasSubstr("is used already")));
  document = good("bench");
  document["settings"][1]["options"]["planes"] = json::array({1});
  EXPECT_THAT(refusal("bench", document), HasSubstr("#/settings/1/options/planes"));
}

TEST(Documents, WhatCannotBeReadAgainIsNotWritten) {
  const testing::TestFolder folder;
  RigDocument rig = parse_rig(good("rig").dump(), "f");
  write_rig(rig, folder.path() / "rig.json");
  const std::string before = read_file(folder.path() / "rig.json");
  rig.cameras[1].geometry.intrinsics.fx = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(write_rig(rig, folder.path() / "rig.json"), Error);
  EXPECT_EQ(read_file(folder.path() / "rig.json"), before);
}

TEST(Documents, DoublesComeBackExactly) {
  const testing::TestFolder folder;
  RigDocument rig = parse_rig(good("rig").dump(), "f");
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
