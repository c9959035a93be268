// SPDX-License-Identifier: Apache-2.0
// Damaged documents are refused at the right JSON pointer.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "schemas/document_examples.h"
#include "schemas/rig_document.h"

namespace raystage::schemas {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

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
  json document = example_document(damage.kind);
  document[json::json_pointer(damage.pointer)] = damage.value;
  EXPECT_THAT(
      refusal_of(damage.kind, document),
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
    json rig = example_document("rig");
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

}  // namespace
}  // namespace raystage::schemas
