// SPDX-License-Identifier: Apache-2.0
#include "tests/attack/attack_archives.h"

#include <fmt/format.h>

#include "tests/end_to_end/run_command.h"

namespace raystage::testing {
namespace {

namespace fs = std::filesystem;

const std::string kRender = "raystage render -q -j 1 --memory 0.5 -o out/f.####.exr ";

/// Returns a shot of one frame of a take.
std::string shot_of(const std::string& take, const std::string& method) {
  return fmt::format(
      R"({{"schema": "raystage/shot/3", "name": "attacked", "width": 32, "height": 24, "fps": 10,
      "first_frame": 1, "last_frame": 1, "camera": {{"keys": [{{"frame": 1, "position": [0, 0, 0],
      "target": [0, 0, -4], "horizontal_fov_deg": 50}}]}},
      "layers": [{{"name": "set", "take": "{}", "method": "{}"}}]}})",
      take, method);
}

/// Returns the command for an archive whose frames come from a stranger, together with hashes that
/// fit: the journal is lost, `repair` makes a new one, and the decoders get the frames.
std::string without_journal(const std::string& take, const std::string& camera) {
  return "cp -r " + take + " out/t && rm out/t/archive/" + camera + ".journal && " +
         all_of({"raystage verify -q --decode out/t", "raystage repair -q out/t",
                 "raystage sync -q out/t", "raystage verify -q --decode out/t",
                 kRender + "deep.json"});
}

void write_rigs(const fs::path& folder) {
  write_text(folder / "google" / "models.json", R"([{"name": "camera_0001", "width": 48.0,
      "height": 36.0, "focal_length": 20.5, "principal_point": [23.5, 18],
      "radial_distortion": [0.01, -0.002], "orientation": [0.3, -1.2, 0.4],
      "position": [0.1, -0.2, 0.3], "projection_type": "fisheye"}])");
  run_or_throw(folder,
               "cp take_frames/r0c0/000001.jpg google/camera_0001.jpg && "
               "raystage export rig take --format facebook360 -o fb/rig.json && "
               "cp take_movies/*.mov fb/");
}

}  // namespace

void write_attack_archives(const fs::path& folder) {
  const auto must = [&](const std::string& command) { run_or_throw(folder, command); };
  must("raystage bag -q take -o bag");
  write_text(folder / "bag" / "fetch.txt",
             fmt::format("https://example.org/take.json {} data/take.json\n",
                         fs::file_size(folder / "bag/data/take.json")));
  must(
      "mkdir shelf && cp -r take shelf/a && cp -r take shelf/b && "
      "raystage verify -q --catalogue shelf --catalogue-file catalogue.json");
  must("raystage pack -q take -o packed");
  must("raystage pack -q --temporal hevc --group 4 take -o hevc");
  must("raystage pack -q --temporal av1 --group 4 take -o av1");
  must("raystage pack -q --temporal hevc --references cameras --group 4 take -o hevc_cameras");
  must("raystage pack -q --temporal av1 --references cameras --group 4 take -o av1_cameras");
  must(
      "raystage simulate stage -q --hdr --rows 2 --columns 2 --width 48 --height 36 --fps 10 "
      "--seconds 0.4 --startup-loss-seconds 0 --truth-views 0 -o high && raystage sync -q high");
  write_text(folder / "deep.json", shot_of("out/t", "focal_plane"));
  write_text(folder / "imported.json", shot_of("mapped", "depth"));
  must(
      "raystage export depth -q take -o maps --frames 1 && "
      "raystage export depth -q take -o codes --frames 1 --format png && "
      "cp -r take mapped && raystage import -q --depth mapped maps");
  must(
      "raystage export images -q take -o take_frames --times recorded && "
      "raystage export images -q high -o high_frames --format exr --times recorded && "
      "raystage export images -q take -o png_frames --format png --times recorded && "
      "raystage export movies -q take -o take_movies && mkdir fb google && "
      "raystage export model -q take -o model");
  write_rigs(folder);
  write_text(folder / "offsets.json", R"({"r0c0": 1.5, "r0c1": -2})");
  write_text(folder / "settings.json", R"({"schema": "raystage/bench/1", "settings": [
      {"label": "one", "method": "focal_plane"}]})");
  must(
      "raystage farm submit -q shot.json -o queue/g.####.exr --engine local --no-queue "
      "--no-measure");
}

std::vector<AttackedFormat> attacked_archives(const fs::path& folder) {
  const auto only = [&](const std::string& below, const std::string& ending) {
    for (const fs::path& file : find_files(folder / below, ending)) {
      return file.lexically_relative(folder).string();
    }
    throw std::runtime_error("no file " + ending + " below " + below);
  };
  const std::string check =
      all_of({"raystage bag -q --check quick bag", "raystage bag -q --check completeness bag",
              "raystage bag -q --check checksums bag"});
  const std::string import_maps = "cp -r take out/t && raystage import -q --depth out/t ";
  const auto import = [](const std::string& source) {
    return all_of({"raystage import -q --rig-only " + source + " -o out/rig.json",
                   "raystage import -q " + source + " -o out/t"});
  };
  return {
      {"bag declaration", "bag/bagit.txt", true, check},
      {"bag information", "bag/bag-info.txt", true, check},
      {"bag manifest", "bag/manifest-sha256.txt", true, check},
      {"bag tag manifest", "bag/tagmanifest-sha256.txt", true, check},
      {"bag fetch list", "bag/fetch.txt", true, check},
      {"event log", "take/events.jsonl", true,
       all_of({"raystage bag -q take -o out/bag", "raystage pack -q take -o out/t"})},
      {"fixity catalogue", "catalogue.json", true,
       "raystage verify -q --catalogue shelf --catalogue-file catalogue.json"},
      {"packed archive", "packed/archive/r0c1.mkv", false, without_journal("packed", "r0c1"), 3},
      {"packed archive to unpack", "packed/archive/r0c0.mkv", false,
       "raystage unpack -q packed -o out/t"},
      {"HEVC archive", "hevc/archive/r0c1.mkv", false, without_journal("hevc", "r0c1"), 3},
      {"AV1 archive", "av1/archive/r0c1.mkv", false, without_journal("av1", "r0c1"), 3},
      {"HEVC archive across cameras", "hevc_cameras/archive/r0c1.mkv", false,
       without_journal("hevc_cameras", "r0c1"), 3},
      {"AV1 archive across cameras", "av1_cameras/archive/r0c1.mkv", false,
       without_journal("av1_cameras", "r0c1"), 3},
      {"archive of deep pictures", "high/archive/r0c1.mkv", false, without_journal("high", "r0c1"),
       3},
      {"take of deep pictures", "high/take.json", true,
       "cp -r high out/t && " + all_of({"raystage info out/t", kRender + "deep.json"})},
      {"list of imported depths", "mapped/imported_depth/maps.json", true,
       all_of({"raystage info mapped", kRender + "imported.json"})},
      {"imported depths", only("mapped/imported_depth/r0c1", ".zst"), false,
       kRender + "imported.json"},
      {"EXR depth map", "maps/r0c1/000001.exr", false, import_maps + "maps"},
      {"PNG depth map", "codes/r0c1/000001.png", false,
       import_maps + "codes --depth-near 1.8 --depth-far 9"},
      {"OpenColorIO of exports", "config.ocio", true,
       "raystage export images -q take --format exr --frames 2 --ocio config.ocio "
       "--color-space half --rec709-space lin_srgb -o out/exported"},
      {"import manifest", "take_frames/import.json", true, import("take_frames")},
      {"imported PNG", "png_frames/r0c0/000001.png", false, import("png_frames")},
      {"imported JPEG", "take_frames/r0c0/000001.jpg", false, import("take_frames")},
      {"imported EXR", "high_frames/r0c0/000001.exr", false, import("high_frames")},
      {"imported movie", "fb/r0c0.mov", false, import("fb")},
      {"facebook360 rig", "fb/rig.json", true, import("fb")},
      {"Google model", "google/models.json", true, import("google")},
      {"COLMAP cameras", "model/sparse/0/cameras.txt", true, import("model/sparse/0")},
      {"COLMAP images", "model/sparse/0/images.txt", true, import("model/sparse/0")},
      {"NeRF model", "model/transforms.json", true, import("model/transforms.json")},
      {"rig to compare", "mapped/rig.json", true,
       "raystage calibrate compare take/rig.json mapped/rig.json"},
      {"clock offsets", "offsets.json", true,
       "cp -r take out/t && raystage sync -q out/t --node-offsets offsets.json"},
      {"bench settings", "settings.json", true,
       "raystage bench -q take take/views.json --settings settings.json --repeat 1 --images 0 -j "
       "1"},
      {"truth image", "take/truth/view000.png", false,
       "raystage evaluate -q take take/views.json --method focal_plane"},
      {
          "farm job",
          "queue/g.farm/job-0001/job.json",
          true,
          "raystage farm status queue/g.farm",
      },
      {"farm round", "queue/g.farm/job-0001/rounds/1.json", true,
       "raystage farm status queue/g.farm"},
  };
}

}  // namespace raystage::testing
