// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/time.h"
#include "schemas/geometry.h"
#include "schemas/pixel_encoding.h"

namespace raystage {
struct ContainedPath;
}

namespace raystage::schemas {

/// Schema "raystage/take/2" (TAKE/take.json): a recording. Camera i is camera i of rig.json. Takes
/// whose frames all are JPEG are written as version 1, which differs only in Camera::pixels.
struct TakeDocument {
  struct Camera {
    std::string id;
    std::string archive;  ///< Matroska file, relative to the take, e.g. "archive/r0c0.mkv"
    std::string journal;  ///< e.g. "archive/r0c0.journal"
    std::string node;     ///< ingest node that time-stamped the frames; may be empty
    /// Time 0 of the archive, since 1970, within kMaxArchiveTime of the take's; nullopt: the
    /// take's.
    std::optional<Nanoseconds> archive_epoch_utc = {};
    /// Of frames that are JPEG XL pictures of their own; nullopt: frames are JPEG, maybe packed.
    std::optional<PixelEncoding> pixels = {};
  };
  /// The origin of a take that was derived from another take.
  struct Derived {
    std::string take;  ///< name of the other take
    std::string by;    ///< the operation, e.g. "retime flow"
  };
  std::string name;
  std::string created_by;  ///< program and version
  std::optional<Derived> derived_from;
  Nanoseconds epoch_utc = 0;   ///< time 0 of every archive, since 1970; see kMaxTakeEpoch
  double nominal_fps = 0;      ///< 0: unknown
  std::string color_space;     ///< of JPEG codes: "srgb_texture"
  std::string clock = "host";  ///< "host" | "device" | "simulated" | "manifest"
  std::string timestamp_event = "unknown";  ///< "exposure_start|middle|end", "arrival", "unknown"
  bool arbitrary_scale = false;
  std::optional<DepthRange> depth_range;
  std::vector<Camera> cameras;

  bool has_deep_pixels() const;  ///< whether a camera has Camera::pixels
};

TakeDocument read_take(const std::filesystem::path& file);
TakeDocument read_take(const ContainedPath& file);
void write_take(const TakeDocument& take, const std::filesystem::path& file);

/// Parses and formats the document in memory; errors use `name` as the file name.
TakeDocument parse_take(std::string_view text, std::string_view name);
std::string format_take(const TakeDocument& take);

}  // namespace raystage::schemas
