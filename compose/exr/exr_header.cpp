// SPDX-License-Identifier: Apache-2.0
#include "compose/exr/exr_header.h"

#include <OpenEXR/ImfChromaticities.h>
#include <OpenEXR/ImfDoubleAttribute.h>
#include <OpenEXR/ImfFloatAttribute.h>
#include <OpenEXR/ImfIntAttribute.h>
#include <OpenEXR/ImfPartType.h>
#include <OpenEXR/ImfRationalAttribute.h>
#include <OpenEXR/ImfStandardAttributes.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <OpenEXR/ImfStringVectorAttribute.h>
#include <OpenEXR/ImfVecAttribute.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <utility>

#include "base/error.h"

namespace raystage::compose {
namespace {

constexpr double kNdcNear = 0.01;  // metres; only for z of worldToNDC, which readers ignore

constexpr std::array<std::pair<const char*, Imf::Compression>, 5> kCompressions{
    {{"none", Imf::NO_COMPRESSION},
     {"rle", Imf::RLE_COMPRESSION},
     {"zips", Imf::ZIPS_COMPRESSION},
     {"zip", Imf::ZIP_COMPRESSION},
     {"piz", Imf::PIZ_COMPRESSION}}};

Imf::Compression compression_named(const std::string& name) {
  for (const auto& [known, compression] : kCompressions) {
    if (name == known) return compression;
  }
  throw Error::bad_input("the EXR compression \"" + name + "\" is unknown", "shot output",
                         "Use none, rle, zips, zip or piz (all lossless)");
}

/// Converts a matrix for column vectors to Imath's convention of row vectors.
Imath::M44f imath_from_columns(const Eigen::Matrix4d& m) {
  Imath::M44f result;
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 4; ++column) {
      result[column][row] = static_cast<float>(m(row, column)) + 0.0F;  // no -0
    }
  }
  return result;
}

Eigen::Matrix4d forward_camera_from_world(const rig::Pose& pose) {
  Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
  const Eigen::Matrix3d rotation = pose.world_from_camera_rotation.transpose();
  m.topLeftCorner<3, 3>() = rotation;
  m.topRightCorner<3, 1>() = -(rotation * pose.position);
  m.row(2) = -m.row(2);
  return m;
}

/// Returns "YYYY:MM:DD hh:mm:ss" in UTC.
std::string exr_date(Nanoseconds since_1970) {
  using std::chrono::floor;
  const std::chrono::sys_time<std::chrono::nanoseconds> time{std::chrono::nanoseconds(since_1970)};
  const auto seconds = floor<std::chrono::seconds>(time);
  const auto day = floor<std::chrono::days>(seconds);
  const std::chrono::year_month_day date(day);
  const std::chrono::hh_mm_ss clock(seconds - day);
  return fmt::format("{:04}:{:02}:{:02} {:02}:{:02}:{:02}", static_cast<int>(date.year()),
                     static_cast<unsigned>(date.month()), static_cast<unsigned>(date.day()),
                     clock.hours().count(), clock.minutes().count(), clock.seconds().count());
}

void add_string(Imf::Header& header, const char* name, const std::string& text) {
  if (!text.empty()) header.insert(name, Imf::StringAttribute(text));
}

constexpr int kMaxTimeCodeRate = 30;  // of SMPTE ST 12-1 and Imf::TimeCode, frames/s

int rounded_rate(int fps_numerator, int fps_denominator) {
  return static_cast<int>((std::int64_t{fps_numerator} + fps_denominator / 2) / fps_denominator);
}

/// Returns hours, minutes, seconds and frames of a frame, with frame 0 at 0.
std::array<int, 4> counted_time(int frame, int fps_numerator, int fps_denominator) {
  const int fps = std::clamp(rounded_rate(fps_numerator, fps_denominator), 1, 1000);
  // Frames before 0 are on the day before.
  const int of_day = fps * 24 * 3600, counted = (frame % of_day + of_day) % of_day;
  const int seconds = counted / fps;
  return {seconds / 3600, seconds / 60 % 60, seconds % 60, counted % fps};
}

/// Returns the chromaticities by SMPTE ST 2065-1 (AP0), AMPAS S-2014-004 (AP1) or ITU-R BT.709, or
/// nullopt.
std::optional<Imf::Chromaticities> chromaticities_of(const std::string& interop_id) {
  if (interop_id == "lin_rec709_scene") return Imf::Chromaticities();
  const Imath::V2f aces_white(0.32168F, 0.33767F);
  if (interop_id == "lin_ap1_scene") {
    return Imf::Chromaticities({0.713F, 0.293F}, {0.165F, 0.830F}, {0.128F, 0.044F}, aces_white);
  }
  if (interop_id == "lin_ap0_scene") {
    return Imf::Chromaticities({0.7347F, 0.2653F}, {0, 1}, {0.0001F, -0.0770F}, aces_white);
  }
  return std::nullopt;
}

void add_lens(Imf::Header& header, const ExrCamera& camera, const render::VirtualCamera& picture) {
  const schemas::Intrinsics& k = picture.intrinsics;
  const double width = camera.film_back_mm;
  const double height = width * (picture.height / k.fy) / (picture.width / k.fx);
  header.insert("pinholeFocalLength",
                Imf::FloatAttribute(static_cast<float>(width * k.fx / picture.width)));
  header.insert(
      "sensorOverallDimensions",
      Imf::V2fAttribute(Imath::V2f(static_cast<float>(width), static_cast<float>(height))));
  if (camera.focus_m) addFocus(header, static_cast<float>(*camera.focus_m));
  if (camera.f_number) addAperture(header, static_cast<float>(*camera.f_number));
  if (camera.exposure_seconds) addExpTime(header, static_cast<float>(*camera.exposure_seconds));
}

void add_perspective(Imf::Header& header, const render::VirtualCamera& camera) {
  const schemas::Intrinsics& k = camera.intrinsics;
  addWorldToCamera(header, exr_world_to_camera(camera.pose));
  addWorldToNDC(header, exr_world_to_ndc(camera));
  header.pixelAspectRatio() = static_cast<float>(k.fy / k.fx);
  header.screenWindowWidth() = static_cast<float>(camera.width / k.fx);
  // The screen window's x axis points to the camera's left (OpenEXR, Technical Introduction).
  header.screenWindowCenter() = Imath::V2f(static_cast<float>((k.cx - camera.width / 2.0) / k.fx),
                                           static_cast<float>((k.cy - camera.height / 2.0) / k.fy));
}

}  // namespace

void check_exr_compression(const std::string& name) { compression_named(name); }

void add_overscan(ExrCamera& camera, std::array<int, 2> overscan) {
  camera.overscan_x = overscan[0];
  camera.overscan_y = overscan[1];
  camera.view.width += 2 * overscan[0];
  camera.view.height += 2 * overscan[1];
  camera.view.intrinsics.cx += overscan[0];
  camera.view.intrinsics.cy += overscan[1];
}

render::VirtualCamera without_overscan(const ExrCamera& camera) {
  render::VirtualCamera picture = camera.view;
  picture.width -= 2 * camera.overscan_x;
  picture.height -= 2 * camera.overscan_y;
  picture.intrinsics.cx -= camera.overscan_x;
  picture.intrinsics.cy -= camera.overscan_y;
  return picture;
}

Imath::M44f exr_world_to_camera(const rig::Pose& pose) {
  return imath_from_columns(forward_camera_from_world(pose));
}

Imath::M44f exr_world_to_ndc(const render::VirtualCamera& camera) {
  const schemas::Intrinsics& k = camera.intrinsics;
  Eigen::Matrix4d ndc_from_camera;
  ndc_from_camera << k.fx / camera.width, 0, k.cx / camera.width, 0,  //
      0, -k.fy / camera.height, k.cy / camera.height, 0,              //
      0, 0, 1, -kNdcNear,                                             //
      0, 0, 1, 0;
  return imath_from_columns(ndc_from_camera * forward_camera_from_world(camera.pose));
}

std::string format_time_code(int frame, int fps_numerator, int fps_denominator) {
  const auto [hours, minutes, seconds, frames] =
      counted_time(frame, fps_numerator, fps_denominator);
  return fmt::format("{:02}:{:02}:{:02}:{:02}", hours, minutes, seconds, frames);
}

Imf::Header exr_header(const ExrPart& part, const ExrCamera& camera, const ExrMetadata& metadata) {
  const render::VirtualCamera picture = without_overscan(camera);
  Imf::Header header(picture.width, picture.height);
  header.dataWindow() = {
      {-camera.overscan_x, -camera.overscan_y},
      {picture.width + camera.overscan_x - 1, picture.height + camera.overscan_y - 1}};
  const bool same = part.is_colour || metadata.data_compression.empty();
  header.compression() = compression_named(same ? metadata.compression : metadata.data_compression);
  if (!part.name.empty()) {
    header.setName(part.name);
    header.setType(Imf::SCANLINEIMAGE);
  }
  if (!part.view.empty()) header.setView(part.view);

  if (picture.is_equirectangular) {
    addWorldToCamera(header, exr_world_to_camera(picture.pose));
    addEnvmap(header, Imf::ENVMAP_LATLONG);
  } else {
    add_perspective(header, picture);
    add_lens(header, camera, picture);
  }
  if (rounded_rate(metadata.fps_numerator, metadata.fps_denominator) <= kMaxTimeCodeRate) {
    const auto [hours, minutes, seconds, frames] =
        counted_time(metadata.frame, metadata.fps_numerator, metadata.fps_denominator);
    addTimeCode(header, {hours, minutes, seconds, frames});
  }
  addFramesPerSecond(header, Imf::Rational(metadata.fps_numerator,
                                           static_cast<unsigned>(metadata.fps_denominator)));
  header.insert("imageCounter", Imf::IntAttribute(metadata.frame));
  if (metadata.capture_rate) {
    header.insert("captureRate", Imf::RationalAttribute(Imf::Rational(*metadata.capture_rate)));
  }
  add_string(header, "reelName", metadata.take_name);
  if (metadata.capture_utc) {
    addCapDate(header, exr_date(*metadata.capture_utc));
    addUtcOffset(header, 0.0F);
    add_string(header, "lf:captureTimeNs", fmt::format("{}", *metadata.capture_utc));
  }
  if (metadata.chromaticities) {
    if (const auto chromaticities = chromaticities_of(metadata.color_interop_id)) {
      addChromaticities(header, *chromaticities);
    }
  } else {
    add_string(header, "colorInteropID", part.is_colour ? metadata.color_interop_id : "data");
  }
  const bool has_geometry = std::ranges::any_of(part.channels, [](const ExrPartChannel& channel) {
    return channel.name.starts_with("P.") || channel.name.starts_with("N.");
  });
  if (has_geometry) add_string(header, "lf:geometrySpace", "world, metres");
  if (part.is_colour) {
    add_string(header, "lf:colorSpace", metadata.color_space);
    add_string(header, "lf:colorConfig", metadata.color_config);
    add_string(header, "lf:workingSpace", metadata.working_space);
  }
  if (!metadata.absent_cameras.empty()) {
    header.insert("lf:absentCameras", Imf::StringVectorAttribute(metadata.absent_cameras));
  }
  if (!metadata.rotten_cameras.empty()) {
    header.insert("lf:rottenCameras", Imf::StringVectorAttribute(metadata.rotten_cameras));
  }
  header.insert("lf:coveredShare", Imf::DoubleAttribute(metadata.covered_share));
  add_string(header, "lf:method", metadata.method);
  if (!metadata.method_options.empty()) {
    add_string(header, "lf:methodOptions", metadata.method_options);
  }
  if (!metadata.notes.empty()) {
    header.insert("lf:notes", Imf::StringVectorAttribute(metadata.notes));
  }
  if (!metadata.cryptomatte_key.empty()) {
    const std::string prefix = "cryptomatte/" + metadata.cryptomatte_key + "/";
    add_string(header, (prefix + "name").c_str(), metadata.cryptomatte_name);
    add_string(header, (prefix + "hash").c_str(), "MurmurHash3_32");
    add_string(header, (prefix + "conversion").c_str(), "uint32_to_float32");
    add_string(header, (prefix + "manifest").c_str(), metadata.cryptomatte_manifest);
  }
  add_string(header, "lf:fingerprint", metadata.fingerprint);
  add_string(header, "lf:version", metadata.program_version);
  add_string(header, "software", "Raystage " + metadata.program_version);
  return header;
}

}  // namespace raystage::compose
