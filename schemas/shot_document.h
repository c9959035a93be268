// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/frame_rate.h"
#include "base/time.h"
#include "schemas/hole_fill.h"
#include "schemas/matte_settings.h"
#include "schemas/option_values.h"

namespace raystage::schemas {

/// Schema "raystage/shot/3": what to render. Shots of versions 1 and 2 are converted when read.
struct ShotDocument {
  /// A value that a key does not state is interpolated from neighbouring keys.
  struct CameraKey {
    double frame = 0;
    std::optional<std::array<double, 3>> position = {};     ///< world, metres
    std::optional<std::array<double, 4>> orientation = {};  ///< world_from_camera: w, x, y, z
    /// Full angle in degrees, (0, 180). Either this or a focal length is given.
    std::optional<double> horizontal_fov_deg = {};
    std::optional<double> focal_length_mm = {};
    /// Lens shift in film back widths: the picture's centre is right of or above the optical axis.
    std::optional<double> shift_x = {}, shift_y = {};
    std::optional<std::array<double, 3>> target = {};  ///< at the picture's centre; world, metres
    std::optional<double> roll_deg = {}, orbit_deg = {}, focus_m = {}, f_number = {},
                          shutter_deg = {};
    /// How much the motion slows down near the key, [0, 1]; 1: it stops. Tension acts on both
    /// sides, ease on the motion towards the key (in) and away from it (out).
    double tension = 0, ease_in = 0, ease_out = 0;
  };
  /// A camera exported from another program.
  struct CameraFile {
    std::string path = {};  ///< .chan, .gltf or .glb, relative to the shot's folder
    std::string camera_name = {}, rotation_order = "ZXY";
    double frame_offset = 0;
    std::optional<FrameRate> fps = {};  ///< glTF: frame of time t is t x fps; none: see the file
    /// .chan: film back height of its vertical field of view; none: by the picture's aspect ratio.
    std::optional<double> film_back_height_mm = {};
  };
  struct Orbit {
    std::array<double, 3> center{0, 0, 0}, axis{0, 1, 0};
  };
  struct DollyZoom {
    std::array<double, 3> target{0, 0, 0};
    std::optional<double> frame = {};  ///< frame whose lens is that of the keys; nullopt: the first
  };
  struct Stereo {
    double interaxial_m = 0.065;
    std::optional<double> convergence_m = {};  ///< nullopt: parallel views
  };
  struct Camera {
    enum class Projection {
      kPerspective,
      kEquirectangular  ///< all directions; lens and film back have no effect
    } projection = Projection::kPerspective;
    double film_back_mm = 36;          ///< width of the film back
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
      kCamera,  ///< at the shot camera's focus distance, perpendicular to its axis
      kKeys     ///< like kDepth, animated
    } kind = Kind::kBest;
    struct Key {
      double frame = 0;
      double depth = 0;  ///< metres in front of the array
    };
    double depth = 0;                            ///< kDepth: metres in front of the array
    std::array<double, 4> equation{0, 0, 0, 1};  ///< kEquation: a x + b y + c z + d = 0, world
    std::vector<Key> keys = {};                  ///< kKeys: by increasing frame
  };
  /// A layer of constant colour.
  struct Solid {
    std::array<double, 3> color{0, 0, 0};  ///< scene-linear, not premultiplied
    double alpha = 1;
    std::optional<double> depth_m = {};  ///< along the view's axis; nullopt: behind everything
  };
  /// A picture or picture sequence from another program.
  struct Plate {
    std::string file;      ///< EXR, PNG or JPEG, as a sequence name; relative to the shot's folder
    int frame_offset = 0;  ///< frame n shows file n + frame_offset
    /// Metres along the view's axis; nullopt: the file's Z, otherwise behind everything.
    std::optional<double> depth_m = {};
    std::string space = {};  ///< colour space; empty: the file's, otherwise linear or sRGB
  };
  /// A rectangle: fractions of the picture's width and height from the top left.
  struct ScreenRegion {
    double left = 0, right = 1, top = 0, bottom = 1;
  };
  /// The region to which a layer is clipped: one side of a plane, a box or a part of the picture.
  struct Clip {
    std::optional<std::array<double, 4>> plane = {};  ///< a x + b y + c z + d = 0, world
    std::optional<std::array<std::array<double, 3>, 2>> box = {};  ///< min. and max. corner, world
    ScreenRegion screen = {};  ///< used if there is neither a plane nor a box
    double feather = 0;        ///< metres; for `screen` a fraction of the picture's width
    bool inverted = false;
  };
  /// A material that overrides that of a mesh's file.
  struct Material {
    std::string kind = "diffuse";                     ///< diffuse | mirror | glossy
    std::optional<std::array<double, 3>> color = {};  ///< scene-linear; nullopt: the file's
    std::string texture = {};                         ///< relative to the shot's folder
    double roughness = 0.2;                           ///< of glossy materials, (0, 1]
  };
  struct TransformKey {
    double frame = 0;
    std::optional<std::array<double, 3>> position = {};     ///< world, metres
    std::optional<std::array<double, 4>> orientation = {};  ///< world_from_object: w, x, y, z
    std::optional<double> scale = {};                       ///< metres per unit of the file
  };
  struct Geometry {
    std::string file;  ///< glTF, OBJ, PLY ..., relative to the shot's folder
    std::optional<Material> material = {};
    std::vector<TransformKey> keys = {};  ///< by increasing frame; empty: as in the file
    bool is_animated = true;              ///< whether nodes move as a glTF file states
    std::optional<FrameRate> fps = {};    ///< of the program that wrote the file
    double frame_offset = 0;              ///< frames by which the file's animation is delayed
    bool applies_unit = true;             ///< whether a unit that the file states (FBX) counts
    int samples = 16;                     ///< rays per pixel, a square number
  };
  /// A light on geometry: exactly one of ambient, direction, position, environment, light_field.
  struct Light {
    std::optional<std::array<double, 3>> ambient = {};    ///< radiance from everywhere
    std::optional<std::array<double, 3>> direction = {};  ///< direction of propagation, world
    double angle_deg = 0;                                 ///< diameter of a distant light
    std::optional<std::array<double, 3>> position = {};   ///< of a sphere's centre, world, metres
    double radius_m = 0;                                  ///< of a sphere; 0: a point
    /// Radiance of a white diffuse surface that faces it; of a sphere: at 1 m from its centre.
    std::array<double, 3> color{1, 1, 1};
    bool shadows = true;
    std::string environment = {};  ///< panorama file, relative to the shot's folder
    double rotation_deg = 0;       ///< of the environment about the y axis, counter-clockwise
    std::string light_field = {};  ///< layer that supplies radiance for rays that it recorded
    double strength = 1;           ///< of the environment or light field
    int rays = 0;                  ///< per sample, with which diffuse surfaces gather the light
  };
  /// How a light field layer receives shadows of geometry.
  struct ReceivedShadows {
    double strength = 1;                ///< fraction of the shadow that is applied
    double occlusion_distance_m = 0.5;  ///< within which meshes occlude ambient light
    int rays = 64;                      ///< per pixel, for ambient occlusion; 0: none
  };
  struct Layer {
    std::string name;
    /// Folder of the take, relative to the shot's folder. Empty: not a light field layer.
    std::string take;
    std::optional<Solid> solid = {};
    std::optional<Geometry> geometry = {};
    std::optional<Plate> plate = {};
    std::vector<Clip> clips = {};
    bool holdout = false;  ///< removes what is behind it without being visible
    double opacity = 1;
    std::optional<int> first_frame = {}, last_frame = {};  ///< visible only within these frames
    bool is_light_field() const { return !take.empty(); }

    std::string method = "focal_plane";
    OptionValues options;  ///< of the method; the renderer defines them
    FocalPlane focal_plane;
    HoleFill fill = HoleFill::kNone;
    std::optional<MatteSettings> matte = {};  ///< of the take's frames; nullopt: all is visible
    struct TimeKey {
      double frame = 0;
      double seconds = 0;  ///< time in the take, since its first tick
    };
    double start_seconds = 0;  ///< time in the take at first_frame, since its first tick
    double speed = 1;          ///< take seconds per shot second; 0: frozen, negative: backwards
    /// Which instant of the take a frame shows.
    enum class Time {
      kTick,  ///< the nearest tick, as it was recorded
      kExact  ///< the time of the frame: pictures are interpolated along motion
    };
    Time time = Time::kTick;
    /// By increasing frame; with keys, start_seconds and speed are not used.
    std::vector<TimeKey> time_keys = {};
    /// Takes around a volume share its name; each ray is taken from the take that faces it.
    std::string volume = {};
    std::optional<ReceivedShadows> shadows = {};  ///< of geometry; nullopt: no shadows are received
  };
  struct Color {
    std::string color_space = "lin_rec709_scene";  ///< of the output files: linear light
    /// OpenColorIO config, relative to the shot's folder; empty: the built-in one.
    std::string config = {};
    std::string rec709_space = {};  ///< the config's name of linear Rec.709; empty: searched
    /// Colour space in which layers are merged and in which the shot's colours are given:
    /// lin_rec709_scene or lin_ap1_scene.
    std::string working_space = "lin_rec709_scene";
  };
  struct Output {
    std::string compression = "zip";  ///< none | rle | zips | zip | piz
    std::string data_compression;     ///< of data parts; empty: same as `compression`
    /// standard | single | nuke; empty: single with Cryptomatte, else standard.
    std::string layout;
    bool cryptomatte = false;  ///< writes object IDs
    /// Additional channels of the files, by EXR name, from the layers that have them.
    std::vector<std::string> aovs{"lf.coverage", "P", "N", "albedo"};
    Color color = {};
    /// Pixels beyond the picture: on the left and right each, on the top and bottom each.
    std::array<int, 2> overscan{0, 0};
    /// Most pictures of which a frame is averaged while the shutter is open; 1: no motion blur.
    int motion_samples = 33;
  };
  std::string name;
  int width = 0, height = 0;
  double fps = 24;
  int fps_numerator = 24, fps_denominator = 1;  ///< fps as the exact ratio
  int first_frame = 1, last_frame = 1;
  Camera camera;
  /// The order in which layers cover each other.
  enum class Merge {
    kLayerOrder,  ///< each layer covers those before it
    kDepth        ///< at each pixel the nearer layer covers the farther one
  };
  std::vector<Layer> layers;  ///< rearmost first; at least one
  std::vector<Light> lights;  ///< on all geometry
  Merge merge = Merge::kLayerOrder;
  Output output;
};

ShotDocument read_shot(const std::filesystem::path& file);
void write_shot(const ShotDocument& shot, const std::filesystem::path& file);

/// Parses and formats the document in memory; errors use `name` as the file name.
ShotDocument parse_shot(std::string_view text, std::string_view name);
std::string format_shot(const ShotDocument& shot);

}  // namespace raystage::schemas
