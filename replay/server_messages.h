// SPDX-License-Identifier: Apache-2.0
// The messages from the server to the page, see docs/formats/viewer.md.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "compose/camera/shot_camera.h"
#include "compose/shot_plan.h"
#include "replay/epipolar_image.h"
#include "replay/folder_listing.h"
#include "replay/live/live_status.h"
#include "replay/measurements.h"
#include "replay/nested_ranges.h"
#include "replay/picture.h"
#include "replay/ranges_of_motion.h"
#include "replay/source_pictures.h"
#include "replay/take_shot.h"
#include "schemas/shot_document.h"

namespace raystage::replay {

/// What the page must know about a shot.
struct ShotMessage {
  std::int64_t id = 0;
  std::string_view file, text;
  const compose::ShotPlan& plan;
  const schemas::ShotDocument& shot;
  const compose::ShotCamera& camera;
  bool is_opened = false;      ///< from its file; false: an edit of the shown one
  std::string notes = {};      ///< the notes document beside the shot; empty: none
  std::string recovered = {};  ///< an autosaved text that is newer than the file; empty: none
  std::vector<MethodMeasurement> measurements = {};
};

/// What a picture shows.
enum class PictureContent { kView, kComparison, kMosaic, kSource, kEpi, kThumbnail, kLive };

/// A rendered picture, in front of its JPEG.
struct PictureMessage {
  PictureContent content = PictureContent::kView;  ///< or kComparison
  std::int64_t id = 0;
  int frame = 0, width = 0, height = 0;
  std::string_view quality;              ///< "moving", "playing" or "resting"
  std::string method;                    ///< that replaced those of the layers; empty: none
  bool is_final = true;                  ///< false: a better picture of this request follows
  double uncovered_share = 0;            ///< of the pixels: seen by no camera
  double render_ms = 0, picture_ms = 0;  ///< reconstruction; display and JPEG
  std::optional<compose::InverseDepthSpan> false_colors;
  std::optional<compose::CameraState> camera;  ///< of a live view
  std::vector<std::string> absent_cameras;
  bool is_held = false;  ///< the nearest instant replaces a missing one
  std::vector<std::string> notes;
  std::vector<RangesOfMotion::Range> ranges;  ///< of the view's orientation and lens
};

/// A picture of source frames, in front of its JPEG.
struct SourcePictureMessage {
  PictureContent content = PictureContent::kSource;
  std::int64_t id = 0;
  int frame = 0, width = 0, height = 0;
  std::string camera_id = {};          ///< kSource
  const Mosaic* mosaic = nullptr;      ///< kMosaic and kLive
  const EpipolarImage* epi = nullptr;  ///< kEpi
};

struct ProbeMessage {
  /// A camera from which the pixel is blended.
  struct Source {
    std::string camera_id;
    double share = 0;
  };
  std::int64_t id = 0;
  std::array<float, 4> rgba{};  ///< scene-linear, premultiplied
  std::array<std::uint8_t, 3> display{};
  double z = 0;  ///< metres along the optical axis; infinite: unknown
  std::optional<double> coverage;
  std::vector<Source> sources;
};

/// What a page shows first: a shot, the contents of a folder, or a recording.
struct FirstView {
  std::optional<ShotText> shot;
  std::string folder;  ///< relative to the viewer's folder; without a shot
  std::string live;    ///< a take that is being recorded, relative likewise; empty: none
};
std::string hello_message(std::string_view program_version, std::string_view folder,
                          const FirstView& first);
std::string shot_message(const ShotMessage& message);
std::string error_message(std::int64_t id, const Error& error);
/// The request was not handled, because a newer one replaced it.
std::string dropped_message(std::int64_t id);
std::string focus_message(std::int64_t id, double distance_m);
std::string probe_message(const ProbeMessage& message);
/// `share`: of the depths of the instant that are estimated, [0, 1].
std::string progress_message(std::int64_t id, double share);
/// The ranges of motion of the view that the request showed.
std::string ranges_message(std::int64_t id, std::span<const NestedRange> ranges);
/// `shot`: whose camera has keys of position, orientation and lens.
std::string keys_message(std::int64_t id, const schemas::ShotDocument& shot);
std::string live_message(std::int64_t id, const LiveStatus& status);
std::string folder_message(std::int64_t id, std::string_view folder,
                           const std::vector<FolderEntry>& entries);
/// `text`: what was written, if it is not the text of the request; else empty.
std::string saved_message(std::int64_t id, std::string_view file, std::string_view text);
/// The notes were changed by another page, to `text`.
std::string notes_message(std::int64_t id, std::string_view text);
/// `what`: "written", "kept" or "noted".
std::string file_message(std::int64_t id, std::string_view what, std::string_view file);

std::vector<std::byte> source_picture_message(const SourcePictureMessage& header,
                                              std::span<const std::byte> jpeg);

/// Returns a picture: the length of the header (4 bytes, little-endian), the header (JSON), the
/// JPEG.
std::vector<std::byte> picture_message(const PictureMessage& header,
                                       std::span<const std::byte> jpeg);

}  // namespace raystage::replay
