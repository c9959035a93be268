// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <ImathMatrix.h>

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "base/time.h"
#include "compose/exr/exr_layout.h"
#include "render/common/view.h"

// OpenEXR's versioned namespace makes a forward declaration of Imf::Header unportable.
#include <OpenEXR/ImfHeader.h>

namespace raystage::compose {

/// Metadata of a rendered frame. For attributes and conventions see docs/formats/exr.md.
struct ExrMetadata {
  int frame = 0;  ///< imageCounter, timeCode
  int fps_numerator = 24, fps_denominator = 1;
  /// Captures per second of the take, if each shot frame is one capture.
  std::optional<double> capture_rate;
  double covered_share = 1;                ///< of the view, seen by cameras; the least of all views
  std::string take_name;                   ///< reelName; omitted if empty
  std::optional<Nanoseconds> capture_utc;  ///< instant shown, since 1970; none: no instant
  std::vector<std::string> absent_cameras;
  std::vector<std::string> rotten_cameras;  ///< absent, because their frames are not as recorded
  std::string method, fingerprint, program_version;
  std::string method_options;      ///< NAME=VALUE,... as given; omitted if empty
  std::vector<std::string> notes;  ///< RenderedView::notes
  /// Of Cryptomatte: attributes `cryptomatte/KEY/name`, `hash`, `conversion` and `manifest`;
  /// omitted if the key is empty.
  std::string cryptomatte_key, cryptomatte_name, cryptomatte_manifest;
  ExrLayout layout = ExrLayout::kStandard;
  std::string compression = "zip";  ///< of colours: none | rle | zips | zip | piz
  std::string data_compression;     ///< of parts that hold data only; empty: the same
  /// Of colours: `colorInteropID` (ASWF ColorInterop), name of the colour space, and its config;
  /// the last two are omitted if empty.
  std::string color_interop_id = "lin_rec709_scene";
  std::string color_space, color_config;
  std::string working_space;  ///< if it is not linear Rec.709; omitted if empty
  /// Writes `chromaticities` of the space for readers without `colorInteropID`; the recommendation
  /// forbids both in one file.
  bool chromaticities = false;
};

/// The views of the frames before and after one, with the same overscan.
struct AdjacentViews {
  render::VirtualCamera before, after;
};

/// The camera of a view, for its header.
struct ExrCamera {
  render::VirtualCamera view;  ///< with overscan
  /// Pixels by which the data window exceeds the display window, on each side.
  int overscan_x = 0, overscan_y = 0;
  double film_back_mm = 36;  ///< width
  std::optional<double> focus_m = {}, f_number = {}, exposure_seconds = {};
  std::optional<AdjacentViews> adjacent = {};  ///< only for motion vectors
};

/// Returns the camera of the display window.
render::VirtualCamera without_overscan(const ExrCamera& camera);
/// Adds pixels on the left and right, and at the top and bottom, to a camera without overscan.
void add_overscan(ExrCamera& camera, std::array<int, 2> overscan);

/// Returns the transform to OpenEXR's camera space: left-handed, x right, y up, z forward (ours: z
/// backward). Imath multiplies row vectors, so that the translation is in the last row.
Imath::M44f exr_world_to_camera(const rig::Pose& pose);
/// Returns the transform from world to the display window after division by w, y down. The point
/// (0,0) is the upper left and (1,1) the lower right corner: the outer corners of the corner
/// pixels. Lens distortion is ignored. z is 0 at 1 cm in front of the camera and 1 at infinity.
Imath::M44f exr_world_to_ndc(const render::VirtualCamera& camera);

/// Returns the header of a part without its channels: name, type and `view` follow the layout.
/// Throws Error (bad input) for an unknown compression.
Imf::Header exr_header(const ExrPart& part, const ExrCamera& camera, const ExrMetadata& metadata);

/// Returns "HH:MM:SS:FF", with frame 0 at 00:00:00:00, as `timeCode` in headers, which have none
/// above 30 frames/s.
std::string format_time_code(int frame, int fps_numerator, int fps_denominator);

/// Throws Error (bad input), which lists the compressions, if `name` is none of them.
void check_exr_compression(const std::string& name);

}  // namespace raystage::compose
