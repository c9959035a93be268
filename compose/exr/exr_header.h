// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <ImathMatrix.h>

#include <optional>
#include <string>
#include <vector>

#include "base/time.h"
#include "compose/exr/exr_layout.h"
#include "render/common/view.h"

// OpenEXR's versioned namespace makes a forward declaration of Imf::Header unportable.
#include <OpenEXR/ImfHeader.h>

namespace raystage {

/// What the header of a rendered frame says besides its pixels; the attributes and their
/// conventions stand in docs/formats/exr.md.
struct ExrMetadata {
  int frame = 0;  ///< imageCounter, timeCode
  int fps_numerator = 24, fps_denominator = 1;
  /// Captures per second of the material, where one shot frame is one capture.
  std::optional<double> capture_rate;
  std::string take_name;                   ///< reelName; left out when empty
  std::optional<Nanoseconds> capture_utc;  ///< instant shown, since 1970; none: nothing was there
  std::vector<std::string> absent_cameras;
  std::string method, fingerprint, program_version;
  std::string method_options;      ///< NAME=VALUE,... as given; left out when empty
  std::vector<std::string> notes;  ///< RenderedView::notes
  /// Of Cryptomatte: attributes `cryptomatte/KEY/name`, `hash`, `conversion` and `manifest`; left
  /// out where the key is empty.
  std::string cryptomatte_key, cryptomatte_name, cryptomatte_manifest;
  ExrLayout layout = ExrLayout::kStandard;
  std::string compression = "piz";  ///< of colours: none | rle | zips | zip | piz
  std::string data_compression;     ///< of parts that hold data only; empty: the same
  /// Of colours: `colorInteropID` (ASWF ColorInterop), the name of the space and the config it is
  /// of; the latter are left out when empty.
  std::string color_interop_id = "lin_rec709_scene";
  std::string color_space, color_config;
  std::string working_space;  ///< where it is not linear Rec.709; left out when empty
  /// Writes `chromaticities` of the space for readers that do not know `colorInteropID`; the
  /// recommendation forbids both in one file.
  bool chromaticities = false;
};

/// The camera that a view was taken with, as its header tells it.
struct ExrCamera {
  VirtualCamera view;  ///< with what lies beyond the picture
  /// Pixels of it on either side of the picture, above and below it: the data window reaches
  /// beyond the display window by so much.
  int overscan_x = 0, overscan_y = 0;
  double film_back_mm = 36;  ///< width
  std::optional<double> focus_m = {}, f_number = {}, exposure_seconds = {};
};

/// The picture itself: the display window.
VirtualCamera without_overscan(const ExrCamera& camera);

/// OpenEXR's camera space: left-handed, x right, y up, z forward (ours: z backward). Imath
/// multiplies row vectors, so the translation stands in the last row.
Imath::M44f exr_world_to_camera(const Pose& pose);
/// World to (0,0) = upper left, (1,1) = lower right corner of the display window (the outer corners
/// of the corner pixels), y down, after division by w. Lens distortion is not part of it. Its z
/// runs from 0 at 1 cm in front of the camera to 1 at infinity.
Imath::M44f exr_world_to_ndc(const VirtualCamera& camera);

/// The header of a part, but for its channels: names, types and `view` as the layout has it. Throws
/// Error (bad input) for an unknown compression.
Imf::Header exr_header(const ExrPart& part, const ExrCamera& camera, const ExrMetadata& metadata);

/// "HH:MM:SS:FF": frame numbers counted from 00:00:00:00, as `timeCode` in headers.
std::string format_time_code(int frame, int fps_numerator, int fps_denominator);

/// Throws Error (bad input) naming the compressions there are, unless `name` is one.
void check_exr_compression(const std::string& name);

}  // namespace raystage
