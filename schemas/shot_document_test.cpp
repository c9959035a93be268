// SPDX-License-Identifier: Apache-2.0
// The additions of version 2 of a shot; documents_test.cpp tests the rest.
#include "schemas/shot_document.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "base/error.h"

namespace raystage::schemas {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

json shot_of_today() {
  return {{"schema", "raystage/shot/3"},
          {"width", 960},
          {"height", 540},
          {"fps", 24},
          {"first_frame", 1},
          {"last_frame", 48},
          {"camera",
           {{"keys",
             {{{"frame", 1},
               {"position", {0, 1, 0}},
               {"target", {0, 1, -5}},
               {"focal_length_mm", 35},
               {"orbit_deg", -10},
               {"roll_deg", 1}},
              {{"frame", 48},
               {"orbit_deg", 10},
               {"focus_m", 4},
               {"f_number", 2},
               {"shutter_deg", 180},
               {"tension", 0.25},
               {"ease_in", 0.5},
               {"ease_out", 1}}}},
            {"film_back_mm", 24.5},
            {"file", {{"path", "move.glb"}, {"camera_name", "main"}, {"frame_offset", 12}}},
            {"orbit", {{"center", {0, 1, -5}}, {"axis", {0, 2, 0}}}},
            {"dolly_zoom", {{"target", {0, 1, -5}}, {"frame", 20}}},
            {"stereo", {{"interaxial_m", 0.06}, {"convergence_m", 5}}}}},
          {"layers", {{{"take", "take"}}}}};
}

std::string refusal(const json& document) {
  try {
    parse_shot(document.dump(), "f");
  } catch (const Error& error) {
    return error.what();
  }
  return "none";
}

TEST(ShotCameraDocument, ReadsEveryField) {
  const ShotDocument::Camera camera = parse_shot(shot_of_today().dump(), "f").camera;
  EXPECT_EQ(camera.film_back_mm, 24.5);
  ASSERT_EQ(camera.keys.size(), 2U);
  EXPECT_EQ(camera.keys[0].target, (std::array<double, 3>{0, 1, -5}));
  EXPECT_EQ(camera.keys[0].focal_length_mm, 35);
  EXPECT_EQ(camera.keys[0].roll_deg, 1);
  EXPECT_FALSE(camera.keys[0].orientation.has_value());
  EXPECT_FALSE(camera.keys[1].position.has_value());
  EXPECT_EQ(camera.keys[1].orbit_deg, 10);
  EXPECT_EQ(camera.keys[1].focus_m, 4);
  EXPECT_EQ(camera.keys[1].f_number, 2);
  EXPECT_EQ(camera.keys[1].shutter_deg, 180);
  EXPECT_EQ(camera.keys[0].tension, 0);
  EXPECT_EQ(camera.keys[1].tension, 0.25);
  EXPECT_EQ(camera.keys[1].ease_in, 0.5);
  EXPECT_EQ(camera.keys[1].ease_out, 1);
  EXPECT_EQ(camera.file->path, "move.glb");
  EXPECT_EQ(camera.file->camera_name, "main");
  EXPECT_EQ(camera.file->rotation_order, "ZXY");
  EXPECT_EQ(camera.file->frame_offset, 12);
  EXPECT_EQ(camera.orbit->axis, (std::array<double, 3>{0, 2, 0}));
  EXPECT_EQ(camera.dolly_zoom->frame, 20);
  EXPECT_EQ(camera.stereo->convergence_m, 5);
}

TEST(ShotOutputDocument, ReadsTimeKeysInsteadOfStartAndSpeed) {
  json shot = shot_of_today();
  json& layer = shot["layers"][0];
  layer.erase("start_seconds");
  layer.erase("speed");
  layer["time_keys"] = {{{"frame", 1}, {"seconds", -0.5}}, {{"frame", 9.5}, {"seconds", 2}}};
  const ShotDocument read = parse_shot(shot.dump(), "f");
  ASSERT_EQ(read.layers[0].time_keys.size(), 2U);
  EXPECT_EQ(read.layers[0].time_keys[1].frame, 9.5);
  EXPECT_EQ(read.layers[0].time_keys[1].seconds, 2);
  EXPECT_EQ(format_shot(parse_shot(format_shot(read), "f")), format_shot(read));
  EXPECT_EQ(read.layers[0].time, ShotDocument::Layer::Time::kTick);
  layer["time"] = "exact";
  const ShotDocument exact = parse_shot(shot.dump(), "f");
  EXPECT_EQ(exact.layers[0].time, ShotDocument::Layer::Time::kExact);
  EXPECT_EQ(format_shot(parse_shot(format_shot(exact), "f")), format_shot(exact));
  layer["time"] = "exactly";
  EXPECT_THAT(refusal(shot), HasSubstr("#/layers/0/time"));
  layer.erase("time");
  layer["speed"] = 2;
  EXPECT_THAT(refusal(shot), HasSubstr("#/layers/0/speed"));
  layer.erase("speed");
  layer["time_keys"][1]["frame"] = 1;
  EXPECT_THAT(refusal(shot), HasSubstr("#/layers/0/time_keys/1/frame"));
  layer["time_keys"] = json::array();
  EXPECT_NE(refusal(shot), "none");
}

TEST(ShotOutputDocument, ReadsAovsWorkingSpaceAndFocusKeys) {
  json shot = shot_of_today();
  EXPECT_EQ(parse_shot(shot.dump(), "f").output.aovs,
            (std::vector<std::string>{"lf.coverage", "P", "N", "albedo"}));
  json every = shot;
  every["output"]["aovs"] = {"lf.coverage", "lf.confidence", "lf.cameras", "lf.nearest", "P",
                             "N",           "albedo",        "motion"};
  EXPECT_EQ(parse_shot(every.dump(), "f").output.aovs.size(), 8U);
  shot["output"] = {{"aovs", {"N", "lf.confidence"}},
                    {"color", {{"working_space", "lin_ap1_scene"}}}};
  shot["layers"][0]["focal_plane"] = {
      {"keys", {{{"frame", 1}, {"depth_m", 2}}, {{"frame", 9.5}, {"depth_m", 3}}}}};
  const ShotDocument read = parse_shot(shot.dump(), "f");
  EXPECT_EQ(read.output.aovs, (std::vector<std::string>{"N", "lf.confidence"}));
  EXPECT_EQ(read.output.color.working_space, "lin_ap1_scene");
  ASSERT_EQ(read.layers[0].focal_plane.keys.size(), 2U);
  EXPECT_EQ(read.layers[0].focal_plane.keys[1].frame, 9.5);
  EXPECT_EQ(read.layers[0].focal_plane.keys[1].depth, 3);
  EXPECT_EQ(format_shot(parse_shot(format_shot(read), "f")), format_shot(read));

  shot["layers"][0]["focal_plane"]["keys"][1]["frame"] = 1;
  EXPECT_THAT(refusal(shot), HasSubstr("#/layers/0/focal_plane/keys/1/frame"));
  shot["layers"][0]["focal_plane"]["keys"] = json::array();
  EXPECT_NE(refusal(shot), "none");
  shot["layers"][0].erase("focal_plane");
  shot["layers"][0]["clips"] = {{{"screen", {{"left", 0.7}, {"right", 0.3}}}}};
  EXPECT_THAT(refusal(shot), HasSubstr("found an empty part of the picture"));
  shot["layers"][0].erase("clips");
  shot["output"]["aovs"] = {"velocity"};
  EXPECT_THAT(refusal(shot), HasSubstr("#/output/aovs/0"));
  shot["output"] = {{"color", {{"working_space", "srgb_texture"}}}};
  EXPECT_THAT(refusal(shot), HasSubstr("#/output/color/working"));
}

TEST(ShotCameraDocument, ComesBackAsItWas) {
  const std::string once = format_shot(parse_shot(shot_of_today().dump(), "f"));
  EXPECT_EQ(format_shot(parse_shot(once, "f")), once);
  const json again = json::parse(once);
  EXPECT_EQ(again["camera"]["keys"], shot_of_today()["camera"]["keys"]);
  EXPECT_EQ(again["camera"]["stereo"], shot_of_today()["camera"]["stereo"]);
  EXPECT_EQ(again["camera"]["dolly_zoom"], shot_of_today()["camera"]["dolly_zoom"]);
}

TEST(ShotCameraDocument, VersionOneIsReadAndWrittenAsTheNewest) {
  json old = shot_of_today();
  old["schema"] = "raystage/shot/1";
  EXPECT_THAT(refusal(old), HasSubstr("#/camera"));  // a list in version 1
  old["camera"] = {{{"frame", 3},
                    {"position", {1, 2, 3}},
                    {"orientation", {1, 0, 0, 0}},
                    {"horizontal_fov_deg", 40}}};
  const ShotDocument shot = parse_shot(old.dump(), "f");
  ASSERT_EQ(shot.camera.keys.size(), 1U);
  EXPECT_EQ(shot.camera.keys[0].position, (std::array<double, 3>{1, 2, 3}));
  EXPECT_EQ(shot.camera.keys[0].horizontal_fov_deg, 40);
  EXPECT_EQ(shot.camera.film_back_mm, 36);
  const json written = json::parse(format_shot(shot));
  EXPECT_EQ(written["schema"], "raystage/shot/3");
  EXPECT_EQ(written["camera"]["keys"], old["camera"]);
  old["camera"][0]["roll_deg"] = 1;  // not known then
  EXPECT_THAT(refusal(old), HasSubstr("#/camera/0/roll_deg"));
}

TEST(ShotDocument, CompressionWasPizBeforeVersionThree) {
  json document = shot_of_today();
  document.erase("output");
  EXPECT_EQ(parse_shot(document.dump(), "f").output.compression, "zip");
  document["schema"] = "raystage/shot/2";
  ShotDocument shot = parse_shot(document.dump(), "f");
  EXPECT_EQ(shot.output.compression, "piz");
  shot = parse_shot(format_shot(shot), "f");  // written as version 3 it stays
  EXPECT_EQ(shot.output.compression, "piz");
}

TEST(ShotCameraDocument, TimeOfGltfBeganWithTheShotInVersionTwo) {
  json old = shot_of_today();
  old["schema"] = "raystage/shot/2";
  const int first = old["first_frame"];
  ShotDocument shot = parse_shot(old.dump(), "f");
  EXPECT_EQ(shot.camera.file->frame_offset, 12 + first);
  EXPECT_EQ(shot.camera.file->fps, (FrameRate{shot.fps_numerator, shot.fps_denominator}));
  shot = parse_shot(format_shot(shot), "f");  // written as version 3 it keeps its meaning
  EXPECT_EQ(shot.camera.file->frame_offset, 12 + first);

  old["camera"]["file"] = {{"path", "move.chan"}, {"frame_offset", 12}};
  shot = parse_shot(old.dump(), "f");
  EXPECT_EQ(shot.camera.file->frame_offset, 12);
  EXPECT_FALSE(shot.camera.file->fps);
  old["camera"]["file"]["fps"] = 24;  // not known then
  EXPECT_THAT(refusal(old), HasSubstr("#/camera/file/fps"));
}

TEST(ShotCameraDocument, ACameraFileMayStateItsRateAndFilmBack) {
  json document = shot_of_today();
  document["camera"]["file"]["fps"] = "24000/1001";
  document["camera"]["file"]["film_back_height_mm"] = 24;
  const ShotDocument shot = parse_shot(document.dump(), "f");
  EXPECT_EQ(shot.camera.file->fps, (FrameRate{24000, 1001}));
  EXPECT_EQ(shot.camera.file->film_back_height_mm, 24);
  document["camera"]["file"]["rotation_order"] = "ZXY";
  EXPECT_EQ(json::parse(format_shot(shot))["camera"]["file"], document["camera"]["file"]);
  for (const json& rate : {json(0), json("24/0"), json("fast"), json(1e6)}) {
    document["camera"]["file"]["fps"] = rate;
    EXPECT_THAT(refusal(document), HasSubstr("#/camera/file/fps: found"));
  }
}

TEST(ShotCameraDocument, RefusesContradictions) {
  json shot = shot_of_today();
  shot["camera"]["keys"][0]["horizontal_fov_deg"] = 40;
  EXPECT_THAT(refusal(shot), HasSubstr("#/camera/keys/0: found both"));
  shot = shot_of_today();
  shot["camera"]["keys"][1]["frame"] = 1;
  EXPECT_THAT(refusal(shot), HasSubstr("#/camera/keys/1/frame: found 1 after 1"));
  shot = shot_of_today();
  shot["camera"]["orbit"]["axis"] = {0, 0, 0};
  EXPECT_THAT(refusal(shot), HasSubstr("#/camera/orbit/axis: found an axis of length 0"));
  shot = shot_of_today();
  shot["camera"]["keys"][0]["orientation"] = {0, 0, 0, 0};
  EXPECT_THAT(refusal(shot), HasSubstr("#/camera/keys/0/orientation"));
  for (const char* newer : {"raystage/shot/4", "raystage/shot/02", "raystage/shot/0"}) {
    shot = shot_of_today();
    shot["schema"] = newer;
    EXPECT_THAT(refusal(shot), HasSubstr("#/schema")) << newer;
  }
}

TEST(ShotLayerDocument, LayersOfEveryKindComeBack) {
  json shot = shot_of_today();
  shot["merge"] = "depth";
  shot["layers"] = {
      {{"name", "sky"}, {"solid", {{"color", {0.1, 0.2, 0.9}}, {"depth_m", 90}}}},
      {{"take", "a"},
       {"clips",
        {{{"plane", {1, 0, 0, 2}}, {"feather", 0.1}},
         {{"box", {{-1, 0, -5}, {1, 2, -3}}}, {"invert", true}},
         {{"screen", {{"left", 0.5}}}}}},
       {"opacity", 0.5},
       {"first_frame", 3},
       {"last_frame", 9}},
      {{"take", "b"},
       {"holdout", true},
       {"receives_shadows", {{"strength", 0.5}, {"occlusion_distance_m", 2}, {"rays", 0}}}},
      {{"plate",
        {{"file", "p.####.exr"},
         {"frame_offset", -3},
         {"depth_m", 7},
         {"color_space", "ACEScg"}}}}};
  shot["output"] = {{"overscan", {16, 9}}, {"color", {{"color_space", "lin_ap1_scene"}}}};
  const ShotDocument document = parse_shot(shot.dump(), "f");
  EXPECT_EQ(document.merge, ShotDocument::Merge::kDepth);
  EXPECT_FALSE(document.layers[0].is_light_field());
  EXPECT_EQ(document.layers[0].solid->depth_m, 90);
  EXPECT_EQ(document.layers[0].solid->alpha, 1);
  EXPECT_EQ(document.layers[1].clips[0].plane->at(3), 2);
  EXPECT_EQ(document.layers[1].clips[1].box->at(1)[1], 2);
  EXPECT_TRUE(document.layers[1].clips[1].inverted);
  EXPECT_EQ(document.layers[1].clips[2].screen.left, 0.5);
  EXPECT_EQ(document.layers[1].clips[2].screen.right, 1);
  EXPECT_EQ(document.layers[1].last_frame, 9);
  EXPECT_TRUE(document.layers[2].holdout);
  EXPECT_FALSE(document.layers[1].shadows);
  EXPECT_EQ(document.layers[2].shadows->strength, 0.5);
  EXPECT_EQ(document.layers[2].shadows->occlusion_distance_m, 2);
  EXPECT_EQ(document.layers[2].shadows->rays, 0);
  EXPECT_EQ(document.layers[3].plate->frame_offset, -3);
  EXPECT_EQ(document.layers[3].plate->depth_m, 7);
  EXPECT_EQ(document.output.overscan, (std::array{16, 9}));
  EXPECT_EQ(document.output.color.color_space, "lin_ap1_scene");
  const std::string once = format_shot(document);
  EXPECT_EQ(format_shot(parse_shot(once, "f")), once);
}

TEST(ShotLayerDocument, ShowsTheSceneUnlessAMethodOrAFocalPlaneIsStated) {
  const auto method_of = [](int version, const std::string& properties) {
    const std::string camera = R"({"keys": [{"frame": 1, "position": [0, 0, 0],)"
                               R"( "orientation": [1, 0, 0, 0], "horizontal_fov_deg": 40}]})";
    const ShotDocument shot = parse_shot(
        R"({"schema": "raystage/shot/)" + std::to_string(version) +
            R"(", "width": 8, "height": 8, "fps": 24, "first_frame": 1, "last_frame": 1, "camera": )" +
            camera + R"(, "layers": [{"take": "t")" + properties + "}]}",
        "shot.json");
    const ShotDocument again = parse_shot(format_shot(shot), "again.json");
    EXPECT_EQ(again.layers[0].method, shot.layers[0].method) << "written as the newest version";
    return shot.layers[0].method;
  };
  EXPECT_EQ(method_of(3, ""), "plane_sweep");
  EXPECT_EQ(method_of(3, R"(, "focal_plane": {"depth_m": 4})"), "focal_plane");
  EXPECT_EQ(method_of(3, R"(, "method": "depth")"), "depth");
  EXPECT_EQ(method_of(3, R"(, "method": "aperture", "focal_plane": "best")"), "aperture");
  EXPECT_EQ(method_of(2, ""), "focal_plane");
  EXPECT_EQ(method_of(2, R"(, "method": "slabs")"), "slabs");
}

TEST(ShotLayerDocument, RefusesWhatIsNoLayer) {
  const auto of = [](const json& layer) {
    json shot = shot_of_today();
    shot["layers"] = {layer};
    return refusal(shot);
  };
  EXPECT_THAT(of({{"name", "none"}}), HasSubstr("#/layers/0: found 0 of \"take\""));
  EXPECT_THAT(of({{"take", "a"}, {"solid", {{"color", {0, 0, 0}}}}}), HasSubstr("found 2 of"));
  EXPECT_THAT(of({{"solid", {{"color", {0, 0, 0}}}}, {"speed", 0}}),
              HasSubstr("#/layers/0/speed: only light field layers have this property"));
  EXPECT_THAT(of({{"take", "a"}, {"first_frame", 9}, {"last_frame", 3}}),
              HasSubstr("#/layers/0/last_frame"));
  const auto clip = [&](const json& c) { return of({{"take", "a"}, {"clips", {c}}}); };
  EXPECT_THAT(clip({{"feather", 1}}), HasSubstr("#/layers/0/clips/0: found 0 of \"plane\""));
  EXPECT_THAT(clip({{"plane", {0, 0, 0, 1}}}), HasSubstr("#/layers/0/clips/0/plane"));
  EXPECT_THAT(clip({{"box", {{0, 0, 0}, {1, 0, 1}}}}), HasSubstr("found an empty box"));
}

TEST(ShotLayerDocument, LayersAroundAVolumeAreOnePicture) {
  const auto with = [](const std::vector<json>& layers) {
    json shot = shot_of_today();
    shot["layers"] = layers;
    return shot;
  };
  const json front = {{"take", "a"}, {"volume", "room"}},
             back = {{"take", "b"}, {"volume", "room"}};
  const json alone = {{"take", "c"}};
  const ShotDocument document = parse_shot(with({alone, front, back}).dump(), "f");
  EXPECT_EQ(document.layers[0].volume, "");
  EXPECT_EQ(document.layers[2].volume, "room");
  EXPECT_EQ(parse_shot(format_shot(document), "f").layers[1].volume, "room");
  EXPECT_THAT(refusal(with({front, alone, back})),
              HasSubstr("#/layers/2/volume: found another layer between"));
  json faded = back, cut = back;
  faded["opacity"] = 0.5;
  cut["holdout"] = true;
  EXPECT_THAT(refusal(with({front, faded})), HasSubstr("#/layers/1: the opacity or holdout"));
  EXPECT_THAT(refusal(with({front, cut})), HasSubstr("#/layers/1: the opacity or holdout"));
  const json solid = {{"solid", {{"color", {0, 0, 0}}}}, {"volume", "room"}};
  EXPECT_THAT(refusal(with({solid})),
              HasSubstr("#/layers/0/volume: only light field layers have this property"));
}

json shot_with_matte(const json& matte) {
  json shot = shot_of_today();
  shot["layers"] = {{{"take", "a"}, {"matte", matte}}};
  return shot;
}

TEST(ShotMatteDocument, EveryKindComesBack) {
  const json box = {{-1, 0, -5}, {1, 2, -3}};
  for (const json& matte :
       {json{{"kind", "blue_screen"},
             {"screen_color", {0.1, 0.1, 0.9}},
             {"balance", 0.3},
             {"despill", 0.8},
             {"black", 0.1},
             {"white", 0.8},
             {"keep", {box, box}},
             {"garbage", {box}}},
        json{{"kind", "green_screen"}, {"clean_plate_take", "empty"}},
        json{{"kind", "difference"}, {"clean_plate_take", "e"}, {"low", 4}, {"high", 9}},
        json{{"kind", "files"}}}) {
    const ShotDocument document = parse_shot(shot_with_matte(matte).dump(), "f");
    ASSERT_TRUE(document.layers[0].matte);
    const std::string once = format_shot(document);
    EXPECT_EQ(format_shot(parse_shot(once, "f")), once);
    const json written = json::parse(once)["layers"][0]["matte"];
    for (const auto& [word, value] : matte.items()) EXPECT_EQ(written[word], value) << word;
  }
  EXPECT_FALSE(parse_shot(shot_of_today().dump(), "f").layers[0].matte);
}

TEST(ShotMatteDocument, RefusesWhatMeansNothing) {
  const auto of = [](const json& matte) { return refusal(shot_with_matte(matte)); };
  EXPECT_THAT(of({{"kind", "luma"}}), HasSubstr("#/layers/0/matte/kind"));
  EXPECT_THAT(of({{"kind", "difference"}}), HasSubstr("needs \"clean_plate_take\""));
  EXPECT_THAT(of({{"kind", "files"}, {"despill", 1}}), HasSubstr("/matte/despill: only"));
  EXPECT_THAT(of({{"kind", "files"}, {"clean_plate_take", "e"}}),
              HasSubstr("/matte/clean_plate_take: only"));
  EXPECT_THAT(of({{"kind", "blue_screen"}, {"low", 1}}), HasSubstr("/matte/low: only"));
  EXPECT_THAT(of({{"kind", "blue_screen"}, {"white", 0.02}}), HasSubstr("allowed: above 0.05"));
  EXPECT_THAT(of({{"kind", "green_screen"}, {"screen_color", {0, 0, 1}}}),
              HasSubstr("the screen is not green"));
  EXPECT_THAT(of({{"kind", "blue_screen"}, {"screen_color", {0, 0, 1}}, {"clean_plate_take", "e"}}),
              HasSubstr("found both"));
  EXPECT_THAT(of({{"kind", "blue_screen"}, {"keep", {{{0, 0, 0}, {1, 0, 1}}}}}),
              HasSubstr("#/layers/0/matte/keep/0: found an empty box"));
  json filled = shot_with_matte({{"kind", "files"}});
  filled["layers"][0]["fill"] = "push_pull";
  EXPECT_THAT(refusal(filled), HasSubstr("#/layers/0/fill"));
  json solid = shot_of_today();
  solid["layers"] = {{{"solid", {{"color", {0, 0, 0}}}}, {"matte", {{"kind", "files"}}}}};
  EXPECT_THAT(refusal(solid),
              HasSubstr("#/layers/0/matte: only light field layers have this property"));
}

json shot_with_geometry() {
  json shot = shot_of_today();
  shot["layers"] = {{{"name", "room"}, {"take", "a"}},
                    {{"name", "ball"},
                     {"geometry",
                      {{"file", "meshes/ball.glb"},
                       {"samples", 25},
                       {"animated", false},
                       {"file_unit", false},
                       {"frame_offset", 1000},
                       {"fps", "24000/1001"},
                       {"material", {{"kind", "glossy"}, {"roughness", 0.3}, {"texture", "t.png"}}},
                       {"keys",
                        {{{"frame", 1}, {"position", {0, 1, -5}}, {"scale", 0.01}},
                         {{"frame", 48}, {"orientation", {1, 0, 0, 0}}}}}}}}};
  shot["lights"] = {
      {{"ambient", {0.1, 0.1, 0.2}}},
      {{"direction", {0, -1, 0}}, {"color", {2, 2, 1}}, {"shadows", false}, {"angle_deg", 0.53}},
      {{"position", {0, 2, -1}}, {"radius_m", 0.25}, {"color", {9, 9, 9}}},
      {{"environment", "sky.exr"}, {"rotation_deg", 90}, {"rays", 4}},
      {{"light_field", "room"}, {"strength", 0.5}}};
  return shot;
}

TEST(ShotGeometryDocument, MeshesAndLightsComeBack) {
  const ShotDocument document = parse_shot(shot_with_geometry().dump(), "f");
  ASSERT_TRUE(document.layers[1].geometry);
  const ShotDocument::Geometry& geometry = *document.layers[1].geometry;
  EXPECT_EQ(geometry.file, "meshes/ball.glb");
  EXPECT_EQ(geometry.samples, 25);
  EXPECT_EQ(geometry.material->kind, "glossy");
  EXPECT_EQ(geometry.material->roughness, 0.3);
  EXPECT_FALSE(geometry.material->color);
  EXPECT_EQ(geometry.keys[0].scale, 0.01);
  EXPECT_FALSE(geometry.keys[1].position);
  EXPECT_FALSE(geometry.is_animated);
  EXPECT_FALSE(geometry.applies_unit);
  EXPECT_EQ(geometry.frame_offset, 1000);
  EXPECT_EQ(geometry.fps, (FrameRate{24000, 1001}));
  ASSERT_EQ(document.lights.size(), 5U);
  EXPECT_EQ(document.lights[0].ambient->at(2), 0.2);
  EXPECT_FALSE(document.lights[1].shadows);
  EXPECT_EQ(document.lights[1].angle_deg, 0.53);
  EXPECT_EQ(document.lights[2].position, (std::array<double, 3>{0, 2, -1}));
  EXPECT_EQ(document.lights[2].radius_m, 0.25);
  EXPECT_EQ(document.lights[3].rays, 4);
  EXPECT_EQ(document.lights[4].light_field, "room");
  const std::string once = format_shot(document);
  EXPECT_EQ(format_shot(parse_shot(once, "f")), once);
}

TEST(ShotGeometryDocument, MeshesStoodStillBeforeVersionThree) {
  json old = shot_with_geometry();
  old["schema"] = "raystage/shot/2";
  old["camera"]["file"].erase("fps");
  old["lights"].clear();
  for (const char* key : {"fps", "file_unit", "frame_offset"}) {
    old["layers"][1]["geometry"].erase(key);
  }
  EXPECT_THAT(refusal(old), HasSubstr("/geometry/animated"));  // not known then
  old["layers"][1]["geometry"].erase("animated");
  const ShotDocument shot = parse_shot(old.dump(), "f");
  EXPECT_FALSE(shot.layers[1].geometry->is_animated);
  EXPECT_FALSE(shot.layers[1].geometry->applies_unit);
  EXPECT_FALSE(parse_shot(format_shot(shot), "f").layers[1].geometry->is_animated);
  EXPECT_FALSE(parse_shot(format_shot(shot), "f").layers[1].geometry->applies_unit);
  old["schema"] = "raystage/shot/3";
  EXPECT_TRUE(parse_shot(old.dump(), "f").layers[1].geometry->is_animated);
  EXPECT_TRUE(parse_shot(old.dump(), "f").layers[1].geometry->applies_unit);
}

TEST(ShotGeometryDocument, RefusesWhatMeansNothing) {
  const auto of = [](const json& geometry) {
    json shot = shot_with_geometry();
    shot["layers"][1]["geometry"] = geometry;
    return refusal(shot);
  };
  EXPECT_THAT(of({{"samples", 4}}), HasSubstr("file"));
  EXPECT_THAT(of({{"file", "a.obj"}, {"samples", 5}}), HasSubstr("/geometry/samples"));
  EXPECT_THAT(of({{"file", "a.obj"}, {"material", {{"roughness", 0.3}}}}),
              HasSubstr("only glossy materials"));
  EXPECT_THAT(of({{"file", "a.obj"}, {"keys", {{{"frame", 2}}, {{"frame", 2}}}}}),
              HasSubstr("/keys/1/frame: found 2 after 2"));
  const auto light = [](const json& one) {
    json shot = shot_with_geometry();
    shot["lights"] = {one};
    return refusal(shot);
  };
  EXPECT_THAT(light({{"strength", 1}}), HasSubstr("#/lights/0: found 0 of \"ambient\""));
  EXPECT_THAT(light({{"ambient", {1, 1, 1}}, {"rays", 4}}), HasSubstr("#/lights/0/rays: only"));
  EXPECT_THAT(light({{"direction", {0, 0, 0}}}), HasSubstr("length 0"));
  EXPECT_THAT(light({{"direction", {0, 1, 0}}, {"radius_m", 1}}),
              HasSubstr("#/lights/0/radius_m: only a light with \"position\""));
  EXPECT_THAT(light({{"position", {0, 1, 0}}, {"angle_deg", 1}}),
              HasSubstr("#/lights/0/angle_deg: only a light with \"direction\""));
  EXPECT_THAT(light({{"direction", {0, 1, 0}}, {"angle_deg", 180}}), HasSubstr("/angle_deg"));
  EXPECT_THAT(light({{"ambient", {1, -1, 1}}}), HasSubstr("#/lights/0/ambient"));
}

}  // namespace
}  // namespace raystage::schemas
