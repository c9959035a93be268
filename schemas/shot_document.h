// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/time.h"
#include "schemas/hole_fill.h"
#include "schemas/matte_settings.h"
#include "schemas/option_values.h"

namespace raystage {

/// schema "raystage/shot/2": what to render. Shots of version 1 are read as what they mean now.
struct ShotDocument {
  /// What a key does not say is left to its neighbours.
  struct CameraKey {
    double frame = 0;
    std::optional<std::array<double, 3>> position = {};     ///< world, metres
    std::optional<std::array<double, 4>> orientation = {};  ///< world_from_camera: w, x, y, z
    /// Full angle, (0, 180); this or a focal length.
    std::optional<double> horizontal_fov_deg = {};
    std::optional<double> focal_length_mm = {};
    std::optional<std::array<double, 3>> target = {};  ///< looked at; world, metres
    std::optional<double> roll_deg = {}, orbit_deg = {}, focus_m = {}, f_number = {},
                          shutter_deg = {};
  };
  /// Another program's camera.
  struct CameraFile {
    std::string path = {};  ///< .chan, .gltf or .glb, relative to the shot's folder
    std::string camera_name = {}, rotation_order = "ZXY";
    double frame_offset = 0;
  };
  struct Orbit {
    std::array<double, 3> center{0, 0, 0}, axis{0, 1, 0};
  };
  struct DollyZoom {
    std::array<double, 3> target{0, 0, 0};
    std::optional<double> frame = {};  ///< at which the lens is as the keys say; none: the first
  };
  struct Stereo {
    double interaxial_m = 0.065;
    std::optional<double> convergence_m = {};  ///< none: parallel
  };
  struct Camera {
    double film_back_mm = 36;          ///< width
    std::vector<CameraKey> keys = {};  ///< by increasing frame
    std::optional<CameraFile> file = {};
    std::optional<Orbit> orbit = {};
    std::optional<DollyZoom> dolly_zoom = {};
    std::optional<Stereo> stereo = {};
  };
  struct FocalPlane {
    enum class Kind {
      kBest,
      kDepth,
      kInfinity,
      kEquation,
      kCamera,  ///< at the shot camera's focus distance, across its axis
      kKeys     ///< as kDepth, changing
    } kind = Kind::kBest;
    struct Key {
      double frame = 0;
      double depth = 0;  ///< metres in front of the array
    };
    double depth = 0;                            ///< kDepth: metres in front of the array
    std::array<double, 4> equation{0, 0, 0, 1};  ///< kEquation: a x + b y + c z + d = 0, world
    std::vector<Key> keys = {};                  ///< kKeys: by increasing frame
  };
  /// One colour everywhere.
  struct Solid {
    std::array<double, 3> color{0, 0, 0};  ///< scene-linear, not premultiplied
    double alpha = 1;
    std::optional<double> depth_m = {};  ///< along the view's axis; none: behind everything
  };
  /// Pictures made elsewhere.
  struct Plate {
    std::string file;  ///< EXR, PNG or JPEG, as a sequence's name; relative to the shot's folder
    int frame_offset = 0;  ///< shown at a frame is the file of that frame plus this
    std::optional<double> depth_m =
        {};                  ///< along the view's axis; none: the file's Z, else behind all
    std::string space = {};  ///< of its colours; empty: as the file says, else linear or sRGB
  };
  /// Shares of the picture's width and height from the top left.
  struct ScreenRegion {
    double left = 0, right = 1, top = 0, bottom = 1;
  };
  /// What a layer is cut to: a plane's side, a box, or a part of the picture.
  struct Clip {
    std::optional<std::array<double, 4>> plane = {};  ///< a x + b y + c z + d = 0, world
    std::optional<std::array<std::array<double, 3>, 2>> box = {};  ///< least and most corner, world
    ScreenRegion screen = {};                                      ///< where there is neither
    double feather = 0;  ///< metres; of a screen a share of the picture's width
    bool inverted = false;
  };
  /// In place of what a mesh's file says of its surfaces.
  struct Material {
    std::string kind = "diffuse";                     ///< diffuse | mirror | glossy
    std::optional<std::array<double, 3>> color = {};  ///< scene-linear; none: the file's
    std::string texture = {};                         ///< relative to the shot's folder
    double roughness = 0.2;                           ///< of glossy ones, (0, 1]
  };
  struct TransformKey {
    double frame = 0;
    std::optional<std::array<double, 3>> position = {};     ///< world, metres
    std::optional<std::array<double, 4>> orientation = {};  ///< world_from_object: w, x, y, z
    std::optional<double> scale = {};                       ///< metres a unit of the file
  };
  struct Geometry {
    std::string file;  ///< glTF, OBJ, PLY ..., relative to the shot's folder
    std::optional<Material> material = {};
    std::vector<TransformKey> keys = {};  ///< by increasing frame; none: as in the file
    int samples = 16;                     ///< rays a pixel, a square number
  };
  /// What lights geometry; one of these.
  struct Light {
    std::optional<std::array<double, 3>> ambient = {};    ///< radiance from everywhere
    std::optional<std::array<double, 3>> direction = {};  ///< in which the light goes, world
    std::array<double, 3> color{1, 1, 1};  ///< what a white diffuse surface that faces it shows
    bool shadows = true;
    std::string environment = {};  ///< picture all around, relative to the shot's folder
    double rotation_deg = 0;       ///< of the environment about the y axis, counter-clockwise
    std::string light_field = {};  ///< name of a layer that answers rays where it saw them
    double strength = 1;           ///< of the environment or light field
    int rays = 0;                  ///< by which diffuse surfaces gather it, each sample
  };
  /// How what a light field shows receives the shadows of geometry.
  struct ReceivedShadows {
    double strength = 1;  ///< a share of what is taken away
    double occlusion_distance_m =
        0.5;        ///< within which meshes take away light that comes from everywhere
    int rays = 64;  ///< a pixel, for that; 0: it is not taken away
  };
  struct Layer {
    std::string name;
    /// A light field's: folder of the take, relative to the shot's folder. Empty: something else.
    std::string take;
    std::optional<Solid> solid = {};
    std::optional<Geometry> geometry = {};
    std::optional<Plate> plate = {};
    std::vector<Clip> clips = {};
    bool holdout = false;  ///< cuts what lies behind it, and shows nothing of itself
    double opacity = 1;
    std::optional<int> first_frame = {}, last_frame = {};  ///< shows in these alone
    bool is_light_field() const { return !take.empty(); }

    std::string method = "focal_plane";
    OptionValues options;  ///< of the method; which there are is the renderer's to say
    FocalPlane focal_plane;
    HoleFill fill = HoleFill::kNone;
    std::optional<MatteSettings> matte = {};  ///< what shows of the take's frames; none: all
    double start_seconds = 0;  ///< time in the take, since its first tick, shown at first_frame
    double speed = 1;          ///< take seconds per shot second: 0 freezes, negative runs backwards
    /// Of takes around one volume, the same name: each ray is answered by the one that faces where
    /// it goes.
    std::string volume = {};
    std::optional<ReceivedShadows> shadows = {};  ///< of geometry; none: it receives none
  };
  struct Color {
    std::string space = "lin_rec709_scene";  ///< of the files: linear light
    std::string config = {};                 ///< OpenColorIO's, relative to the shot's folder;
                                             ///< empty: the built-in one
    std::string rec709_space = {};           ///< the config's name of linear Rec.709; empty: found
    /// What layers are put together in, and the colours that the shot states are of:
    /// lin_rec709_scene or lin_ap1_scene.
    std::string working = "lin_rec709_scene";
  };
  struct Output {
    std::string compression = "piz";  ///< none | rle | zips | zip | piz
    std::string data_compression;     ///< of parts of data; empty: the same
    std::string layout = "standard";  ///< standard | single | nuke
    bool cryptomatte = false;         ///< object ids
    /// What the files tell beside the picture and its depth, as they name it; of layers that know.
    std::vector<std::string> aovs{"lf.coverage", "P", "N", "albedo"};
    Color color = {};
    std::array<int, 2> overscan{0, 0};  ///< pixels beyond the picture on its sides, above and below
  };
  std::string name;
  int width = 0, height = 0;
  double fps = 24;
  int fps_numerator = 24, fps_denominator = 1;  ///< fps as the exact ratio
  int first_frame = 1, last_frame = 1;
  Camera camera;
  /// How layers cover each other.
  enum class Merge {
    kLayerOrder,  ///< each those before it
    kDepth        ///< the nearer the farther, at every pixel
  };
  std::vector<Layer> layers;  ///< the rearmost first; at least one
  std::vector<Light> lights;  ///< of all geometry
  Merge merge = Merge::kLayerOrder;
  Output output;
};

ShotDocument read_shot(const std::filesystem::path& file);
void write_shot(const ShotDocument& shot, const std::filesystem::path& file);

/// The same in memory; `name` stands for the file in errors.
ShotDocument parse_shot(std::string_view text, std::string_view name);
std::string format_shot(const ShotDocument& shot);

}  // namespace raystage
