// SPDX-License-Identifier: Apache-2.0
#include "tests/attack/attack_scene.h"

#include <fmt/format.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <stdexcept>

#include "base/atomic_file.h"
#include "images/png_file.h"
#include "store/jpeg/encode.h"
#include "store/jpeg/rgb_image.h"
#include "testing/textured_fbx.h"
#include "tests/end_to_end/run_command.h"

namespace raystage::testing {
namespace {

namespace fs = std::filesystem;

constexpr const char* kLightField =
    R"({"name": "set", "take": "take", "method": "focal_plane", "focal_plane": {"depth_m": 4}})";

/// Returns a shot of one frame with the layers and, optionally, more members.
std::string shot(const std::string& layers, const std::string& more = "",
                 const std::string& camera = R"("keys": [{"frame": 1, "position": [0, 0, 0],
      "target": [0, 0, -4], "horizontal_fov_deg": 50}])") {
  return fmt::format(
      R"({{"schema": "raystage/shot/3", "name": "attacked", "width": 32, "height": 24,
    "fps": 10, "first_frame": 1, "last_frame": 1, "camera": {{{}}}, {} "layers": [{}]}})",
      camera, more, layers);
}

std::string mesh_shot(const std::string& file) {
  return shot(fmt::format(
      R"({{"name": "mesh", "geometry": {{"file": "{}", "material": {{"kind": "diffuse"}},
      "keys": [{{"frame": 1, "position": [0, 0, -3]}}]}}}})",
      file));
}

std::string plate_shot(const std::string& file) {
  return shot(fmt::format(R"({{"name": "plate", "plate": {{"file": "{}"}}}})", file));
}

const std::string kObj =
    "mtllib mesh.mtl\nv -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
    "vn 0 0 1\nusemtl red\nf 1/1/1 2/2/1 3/3/1 4/4/1\n";
const std::string kMtl = "newmtl red\nKa 0 0 0\nKd 1 0 0\nKs 0 0 0\nmap_Kd texture.png\n";
const std::string kPly =
    "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float "
    "z\n"
    "element face 2\nproperty list uchar int vertex_indices\nend_header\n-1 -1 0\n1 -1 0\n1 1 0\n"
    "-1 1 0\n3 0 1 2\n3 0 2 3\n";
const std::string kGltf =
    R"({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"name": "n",
    "children": [1], "translation": [0, 0, 0]}, {"mesh": 0, "rotation": [0, 0, 0, 1]}], "meshes": [{
    "primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}], "materials": [{
    "pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 1]}}], "accessors": [{"bufferView": 0,
    "componentType": 5126, "count": 3, "type": "VEC3", "min": [-1, -1, 0], "max": [1, 1, 0]}, {
    "bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"}], "bufferViews": [{
    "buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 6}], "buffers": [{
    "byteLength": 42, "uri": "mesh.bin"}]})";
const std::string kOcio =
    "ocio_profile_version: 2\nsearch_path: .\nroles:\n  default: lin_srgb\ndisplays:\n  tv:\n"
    "    - !<View> {name: Film, colorspace: film}\ncolorspaces:\n  - !<ColorSpace>\n"
    "    name: lin_srgb\n  - !<ColorSpace>\n    name: film\n    from_scene_reference: "
    "!<FileTransform> {src: curve.spi1d, interpolation: linear}\n"
    "  - !<ColorSpace>\n    name: half\n    from_scene_reference: !<MatrixTransform> {matrix: "
    "[0.5, 0, 0, 0, 0, 0.5, 0, 0, 0, 0, 0.5, 0, 0, 0, 0, 1]}\n";
const std::string kCurve = "Version 1\nFrom 0.0 1.0\nLength 3\nComponents 1\n{\n0.0\n0.7\n1.0\n}\n";

/// Returns the buffer of kGltf: three corners (float) and their numbers (16 bits).
std::string triangle_bytes() {
  constexpr std::array<float, 9> kCorners{-1, -1, 0, 1, -1, 0, 0, 1, 0};
  constexpr std::array<std::uint16_t, 3> kNumbers{0, 1, 2};
  std::string bytes(sizeof kCorners + sizeof kNumbers, '\0');
  std::memcpy(bytes.data(), kCorners.data(), sizeof kCorners);
  std::memcpy(bytes.data() + sizeof kCorners, kNumbers.data(), sizeof kNumbers);
  return bytes;
}

std::string binary_ply() {
  constexpr std::array<std::int32_t, 3> kNumbers{0, 1, 2};
  std::string face(1 + sizeof kNumbers, '\3');
  std::memcpy(face.data() + 1, kNumbers.data(), sizeof kNumbers);
  return "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float "
         "y\n"
         "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n" +
         triangle_bytes().substr(0, 36) + face;
}

void write_jpeg(const fs::path& file) {
  store::RgbImage image(32, 24);
  for (std::size_t i = 0; i < image.values.size(); ++i) {
    image.values[i] = static_cast<std::uint8_t>(i * 37 % 251);
  }
  const std::vector<std::byte> bytes = store::encode_jpeg(image, {});
  write_file_atomically(file, bytes);
}

std::string table_of_detections() {
  std::string table = "camera,frame,u,v\n";
  for (int frame = 0; frame < 12; ++frame) {
    for (int camera = 0; camera < 3; ++camera) {
      table += fmt::format("c{},{},{},{}\n", camera, frame, 100 + frame * 31 % 400 - camera * 9,
                           80 + frame * 53 % 300);
    }
  }
  return table;
}

}  // namespace

std::string all_of(const std::vector<std::string>& commands) {
  std::string text = "(worst=0; ";
  for (const std::string& command : commands) {
    text += command + "; code=$?; [ $code -le $worst ] || worst=$code; ";
  }
  return text + "exit $worst)";
}

void run_or_throw(const fs::path& folder, const std::string& command) {
  const CommandResult result = run("cd '" + folder.string() + "' && " + command);
  if (result.exit_code != 0) throw std::runtime_error(command + ": " + result.err + result.out);
}

void write_attack_scene(const fs::path& folder) {
  const auto write = [&](const std::string& name, const std::string& text) {
    write_text(folder / name, text);
  };
  const auto must = [&](const std::string& command) { run_or_throw(folder, command); };
  must(
      "raystage simulate stage -q --rows 2 --columns 2 --width 48 --height 36 --fps 10 --seconds "
      "0.8 --startup-loss-seconds 0 --truth-views 1 -o take && raystage sync -q take");
  for (const auto& camera : fs::directory_iterator(folder / "take" / "archive")) {
    if (camera.path().extension() != ".mkv") continue;
    for (int frame = 0; frame < 8; ++frame) {
      const fs::path matte =
          folder / "take" / "mattes" / camera.path().stem() / fmt::format("{:06}.png", frame);
      fs::create_directories(matte.parent_path());
      images::write_png(store::RgbImage(48, 36, std::vector<std::uint8_t>(48 * 36 * 3, 255)),
                        matte);
    }
  }
  write("obj.json", mesh_shot("mesh.obj"));
  write("ply.json", mesh_shot("mesh.ply"));
  write("proxy_ply.json", mesh_shot("binary.ply"));
  write("glb.json", mesh_shot("proxy.glb"));
  write("gltf.json", mesh_shot("mesh.gltf"));
  write("fbx.json", mesh_shot("mesh.fbx"));
  write("mesh.fbx", textured_fbx("texture.png"));
  write("mesh.gltf", kGltf);
  write("mesh.bin", triangle_bytes());
  write("binary.ply", binary_ply());
  write("mesh.obj", kObj);
  write("mesh.mtl", kMtl);
  write("mesh.ply", kPly);
  write("exr.json", plate_shot("plate.0001.exr"));
  write("png.json", plate_shot("plate.0001.png"));
  write("jpg.json", plate_shot("plate.jpg"));
  write("shot.json", shot(kLightField));
  write("depth.json", shot(R"({"name": "set", "take": "take", "method": "depth"})"));
  write("hull.json", shot(R"({"name": "set", "take": "take", "method": "visual_hull"})"));
  write("objects.json", shot(R"({"name": "set", "take": "take", "method": "focal_plane",
             "options": {"objects": "../planes.json"}, "focal_plane": {"depth_m": 4}})"));
  write("planes.json", R"({"schema": "raystage/planes/1", "planes": [{"id": "wall",
        "corners": [[-1, -1, -3], [1, -1, -3], [1, 1, -3], [-1, 1, -3]]}]})");
  write("chan.json",
        shot(kLightField, "", R"("film_back_mm": 36, "file": {"path": "camera.chan"})"));
  write("gltf_camera.json", shot(kLightField, "", R"("file": {"path": "camera.gltf"})"));
  write("config.ocio", kOcio);
  write("curve.spi1d", kCurve);
  write("cameras.json", R"({"schema": "raystage/detections/1", "cameras": [
        {"id": "c0", "width": 640, "height": 480}, {"id": "c1", "width": 640, "height": 480},
        {"id": "c2", "width": 640, "height": 480}]})");
  write("table.csv", table_of_detections());
  write("array.json", R"({"schema": "raystage/array_specification/1",
        "views": {"width_px": 320, "height_px": 240, "least_fov_deg": 40, "largest_fov_deg": 50},
        "positions": [{"x_m": -0.2, "y_m": 0, "depth_m": 0}, {"x_m": 0.2, "y_m": 0.1, "depth_m": -1}],
        "depth_range_m": [2, 8], "largest_error_px": 8, "fps": 15, "minutes": 10,
        "cameras": [{"id": "a", "width_px": 640, "height_px": 480, "sensor_width_mm": 4.8,
                     "focal_lengths_mm": [4, 6], "price": 100}],
        "node": {"cameras": 8, "megabytes_per_s": 200, "price": 1000},
        "disk": {"gigabytes": 500, "megabytes_per_s": 100, "price": 50}})");
  write("trade.json", R"({"schema": "raystage/trade/1", "rows": [{"label": "one",
        "method": "focal_plane", "psnr_db": 24, "seconds_per_frame": 3, "on_psnr_front": true}]})");
  write("record.json", R"({"schema": "raystage/record/1", "name": "attacked", "node": "one",
        "memory_mb": 20, "cameras": [
        {"id": "a", "ffmpeg": {"url": "lavfi:testsrc=size=32x24:rate=30,realtime"}},
        {"id": "b", "ffmpeg": {"url": "lavfi:testsrc=size=48x32:rate=20,realtime"}}]})");
  must("raystage render -q depth.json -o out/plate.####.exr && mv out/plate.0001.exr .");
  must("raystage preview -q plate.####.exr -o plate.####.png && cp plate.0001.png texture.png");
  write_jpeg(folder / "plate.jpg");
  must("raystage camera shot.json -o camera.chan && raystage camera shot.json -o camera.gltf");
  must(
      "raystage proxy -q take -o proxy.glb "
      "--width 32");
  must("raystage verify -q --manifest write take");
  must("raystage record record.json -o recorded --status none --duration 0.4");
}

std::vector<AttackedFormat> attacked_formats(const fs::path& folder) {
  const auto only = [&](const std::string& below, const std::string& ending) {
    for (const fs::path& file : find_files(folder / below, ending)) {
      return file.lexically_relative(folder).string();
    }
    throw std::runtime_error("no file " + ending + " below " + below);
  };
  const std::string render = "raystage render -q -j 1 --memory 0.5 -o out/f.####.exr ";
  const std::string inspect = all_of({"raystage info take", "raystage verify -q --decode take",
                                      "raystage sync -q take -o out/take"}) +
                              "; code=$?; [ $code -le 4 ] || exit $code; ";
  const std::string archive = only("take/archive", ".mkv"), journal = only("take", ".journal");
  std::vector<AttackedFormat> formats{
      {"shot", "shot.json", true, render + "shot.json"},
      {"take", "take/take.json", true, inspect + render + "shot.json"},
      {"rig", "take/rig.json", true, inspect + render + "shot.json"},
      {"timeline", "take/timeline.zst", false, inspect + render + "shot.json"},
      {"archive", archive, false, inspect + render + "depth.json"},
      {"journal", journal, false, inspect + render + "shot.json"},
      {"archive to repair", archive, false,
       "cp -r take out/t && " + all_of({"raystage repair -q out/t", "raystage verify -q out/t"})},
      {"depth", only("take/depth", ".zst"), false, render + "depth.json"},
      {"matte", only("take/mattes", "000000.png"), false, render + "hull.json"},
      {"recording", "recorded/recording/one.json", true,
       all_of({"raystage info recorded", "raystage verify -q recorded"})},
      {"resumed journal", only("recorded/archive", "a.journal"), false,
       "cp -r recorded out/r && raystage record record.json -o out/r --resume --status none "
       "--duration 0.1"},
      {"record config", "record.json", true,
       "raystage record record.json -o out/new --status none --duration 0.1"},
      {"manifest", "take/manifest.sha256", true, "raystage verify -q --manifest check take"},
      {"views", "take/views.json", true,
       "raystage evaluate -q take take/views.json --method focal_plane"},
      {"object planes", "planes.json", true, render + "objects.json"},
      {"chan", "camera.chan", true, render + "chan.json"},
      {"glTF camera", "camera.gltf", true, render + "gltf_camera.json"},
      {"glTF mesh", "mesh.gltf", true, render + "gltf.json"},
      {"glb", "proxy.glb", false, render + "glb.json"},
      {"fbx", "mesh.fbx", true, render + "fbx.json"},
      {"obj", "mesh.obj", true, render + "obj.json"},
      {"mtl", "mesh.mtl", true, render + "obj.json"},
      {"ply", "mesh.ply", true, render + "ply.json"},
      {"binary ply", "binary.ply", false, render + "proxy_ply.json"},
      {"texture", "texture.png", false, render + "obj.json"},
      {"EXR plate", "plate.0001.exr", false, render + "exr.json"},
      {"PNG plate", "plate.0001.png", false, render + "png.json"},
      {"JPEG plate", "plate.jpg", false, render + "jpg.json"},
      {"EXR of an earlier run", "plate.0001.exr", false,
       "mkdir -p out && cp plate.0001.exr out/f.0001.exr && " + render +
           "depth.json --existing skip",
       0, true},
      {"preview", "plate.0001.exr", false, "raystage preview -q plate.####.exr -o out/p.####.png"},
      {"OpenColorIO", "config.ocio", true, render + "shot.json --ocio config.ocio"},
      {"lookup table", "curve.spi1d", true,
       "raystage preview -q plate.####.exr --ocio config.ocio --display tv --view Film -o "
       "out/p.####.png"},
      {"detections", "table.csv", true, "raystage calibrate geometry -q table.csv -o out/rig.json",
       1},
      {"array specification", "array.json", true,
       "raystage plan array array.json --report out/a.html --rig out/rig.json"},
      {"bench result", "trade.json", true, "raystage plan check shot.json --bench trade.json"},
      {"rig to plan with", "take/rig.json", true,
       "raystage plan resolution take --report out/r.html; code=$?; [ $code -le 4 ] || exit $code; "
       "raystage plan epi -q take --report out/e.html"},
      {"cameras of detections", "cameras.json", true,
       "raystage calibrate geometry -q table.csv -o out/rig.json", 1},
  };
  return formats;
}

}  // namespace raystage::testing
