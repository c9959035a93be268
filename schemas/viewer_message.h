// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace raystage::schemas {

/// Schema "raystage/viewer_message/1": a message from the page of `raystage replay` to its server.
struct ViewerMessage {
  enum class Type {
    kView,       ///< render a view
    kShot,       ///< show the shot in `text`, which is or would be in `file`
    kFocus,      ///< find the distance of what a pixel shows
    kProbe,      ///< read a pixel of the view that was shown last
    kOpen,       ///< read the shot in `file`
    kSave,       ///< write `text` to `file`
    kSnapshot,   ///< render a frame into `file`, .exr or .png
    kExport,     ///< write the camera of the shown shot to `file`: .chan, .gltf or .nk
    kAutosave,   ///< keep `text` for the shot `file` until it is saved; without text, forget it
    kNotes,      ///< write the notes document `text` beside the shot `file`
    kCancel,     ///< end the refinement
    kMosaic,     ///< show the source frames of all cameras
    kSource,     ///< show the source frame of the camera `camera_id`
    kEpi,        ///< show the epipolar-plane image of the row of a pixel
    kFolder,     ///< list the takes and shots of the folder `file`
    kThumbnail,  ///< show a small picture of the take `file`
    kLive,       ///< show the newest instant of the take `file`, which is being recorded
    kKeys,       ///< find keys that follow the camera of the shown shot
  };
  enum class Quality {
    kMoving,   ///< by a fast method, with fewer pixels if necessary
    kPlaying,  ///< by a fast method
    kResting,  ///< by the methods of the shot
  };
  enum class Eye { kBoth, kLeft, kRight };
  /// How the views of several eyes share a picture.
  enum class Arrangement {
    kSingle,
    kSideBySide,  ///< the left eye's view left
    kAnaglyph,    ///< the left eye's red, the right eye's green and blue
    kQuilt,       ///< 8 x 6 views, the leftmost one at the lower left, for lenticular displays
  };
  /// What a resting view is compared with: exactly one is given.
  struct Comparison {
    std::string text;      ///< a shot document that is or would be in the shown shot's folder
    std::string file;      ///< a shot's file
    std::string sequence;  ///< rendered EXR files, as a sequence name
  };
  /// A camera that is not on the path of the shot.
  struct Camera {
    std::array<double, 3> position{};     ///< world, metres
    std::array<double, 4> orientation{};  ///< world_from_camera: w, x, y, z
    double focal_length_mm = 0, film_back_mm = 0;
    double shift_x = 0, shift_y = 0;  ///< lens shift, film back widths
    std::optional<double> focus_m, f_number;
  };
  /// How a picture is shown.
  struct Look {
    enum class Channel { kColor, kAlpha, kDepth, kCoverage, kConfidence } channel = Channel::kColor;
    double exposure = 0;        ///< stops
    std::string display, view;  ///< names in the colour config; empty: its defaults
    bool black = false;         ///< composited over black and not over a checkerboard
    bool peaking = false;       ///< sharp edges are marked
    bool operator==(const Look&) const = default;
  };

  /// What must be seen, for its range of motion: a cube that is parallel to the array.
  struct Subject {
    std::array<double, 3> point{};  ///< its middle: world, metres
    double size_m = 0;              ///< of its edges
    bool operator==(const Subject&) const = default;
  };

  Type type = Type::kView;
  std::int64_t id = 0;
  int frame = 0;
  std::optional<Camera> camera;  ///< none: that of the shot
  int width = 0, height = 0;     ///< pixels
  Eye eye = Eye::kBoth;
  Arrangement arrangement = Arrangement::kSingle;
  std::optional<Comparison> comparison;  ///< also rendered, after a resting view
  std::optional<Subject> subject;        ///< whose range of motion follows a resting view
  Quality quality = Quality::kMoving;
  Look look;
  std::array<double, 2> pixel{};  ///< column, row
  int layer = 0;                  ///< light field whose cameras are meant; else the first one
  std::string camera_id;
  bool mosaic = false;  ///< kLive: show all cameras and not a virtual view
  std::string file, text;
  std::string shot;      ///< kSave: shot from whose folder the paths in `text` start; empty: `file`
  std::string previous;  ///< kNotes: what the file must hold now; empty: there must be none
  bool replace = false;
};

/// Returns the `id` of a message that cannot be parsed, so that its sender learns which one it was;
/// nullopt: it states none.
std::optional<std::int64_t> find_viewer_message_id(std::string_view text);

/// Parses a message. Throws Error (bad input) if it is not valid, or lacks what its type needs.
ViewerMessage parse_viewer_message(std::string_view text, std::string_view name = "message");
std::string format_viewer_message(const ViewerMessage& message);

}  // namespace raystage::schemas
