// SPDX-License-Identifier: Apache-2.0
#include "schemas/document_examples.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "schemas/array_specification.h"
#include "schemas/bench_document.h"
#include "schemas/import_manifest.h"
#include "schemas/imported_depths_document.h"
#include "schemas/planes_document.h"
#include "schemas/rig_document.h"
#include "schemas/shot_document.h"
#include "schemas/take_document.h"
#include "schemas/views_document.h"

namespace raystage::schemas {

using nlohmann::json;

json example_camera(const std::string& id, double x) {
  return {{"id", id},
          {"width", 640},
          {"height", 480},
          {"intrinsics", {{"fx", 500.5}, {"fy", 501}, {"cx", 320}, {"cy", 240}}},
          {"world_from_camera", {{1, 0, 0, x}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}}}};
}

json example_document(const std::string& kind) {
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
    document["views"] = {example_camera("a", 0), example_camera("b", 0.1)};
    document["views"][0].update({{"file", "truth/a.png"}, {"time_ns", 233333333}});
    return document;
  }
  document["name"] = "test";
  if (kind == "rig") {
    document["cameras"] = {example_camera("a", 0), example_camera("b", 0.1)};
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
  document["cameras"] = {example_camera("a", 0), example_camera("b", 0.1)};
  document["cameras"][0]["frames"] = {{{"file", "a.jpg"}, {"time_ns", 0}},
                                      {{"file", "b.jpg"}, {"time_ns", 5}}};
  document["cameras"][1].update({{"movie", "b.mp4"}, {"times_ns", {1, 2}}});
  return document;
}

std::string rewritten_document(const std::string& kind, const std::string& text) {
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

std::string refusal_of(const std::string& kind, const json& document) {
  try {
    rewritten_document(kind, document.dump());
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
    EXPECT_FALSE(error.what_to_do().empty());
    return error.what();
  }
  return "accepted";
}

}  // namespace raystage::schemas
