// SPDX-License-Identifier: Apache-2.0
#include "compose/exr_header.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfChromaticities.h>
#include <OpenEXR/ImfFloatAttribute.h>
#include <OpenEXR/ImfIntAttribute.h>
#include <OpenEXR/ImfRationalAttribute.h>
#include <OpenEXR/ImfStandardAttributes.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <OpenEXR/ImfStringVectorAttribute.h>
#include <OpenEXR/ImfVecAttribute.h>
#include <fmt/format.h>

#include <array>
#include <chrono>
#include <cmath>
#include <utility>

#include "schemas/error.h"

namespace raystage {
namespace {

// A virtual camera has no film; compositors that want one get that of a full-frame still camera.
constexpr double kFilmBackWidthMm = 36;
constexpr double kNdcNear = 0.01;  // metres; only shapes the z of worldToNDC, which readers discard

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

/// M for column vectors, turned into Imath's order for row vectors.
Imath::M44f imath_from_columns(const Eigen::Matrix4d& m) {
  Imath::M44f result;
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 4; ++column) {
      result[column][row] = static_cast<float>(m(row, column)) + 0.0F;  // no -0
    }
  }
  return result;
}

Eigen::Matrix4d forward_camera_from_world(const Pose& pose) {
  Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
  const Eigen::Matrix3d rotation = pose.world_from_camera_rotation.transpose();
  m.topLeftCorner<3, 3>() = rotation;
  m.topRightCorner<3, 1>() = -(rotation * pose.position);
  m.row(2) = -m.row(2);
  return m;
}

/// "YYYY:MM:DD hh:mm:ss" in UTC.
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

void add_perspective(Imf::Header& header, const VirtualCamera& camera) {
  const Intrinsics& k = camera.intrinsics;
  addWorldToCamera(header, exr_world_to_camera(camera.pose));
  addWorldToNDC(header, exr_world_to_ndc(camera));
  header.pixelAspectRatio() = static_cast<float>(k.fy / k.fx);
  header.screenWindowWidth() = static_cast<float>(camera.width / k.fx);
  // The screen window's x axis points to the camera's left (OpenEXR, Technical Introduction).
  header.screenWindowCenter() = Imath::V2f(static_cast<float>((k.cx - camera.width / 2.0) / k.fx),
                                           static_cast<float>((k.cy - camera.height / 2.0) / k.fy));
  const double film_height = kFilmBackWidthMm * (camera.height / k.fy) / (camera.width / k.fx);
  header.insert("pinholeFocalLength",
                Imf::FloatAttribute(static_cast<float>(kFilmBackWidthMm * k.fx / camera.width)));
  header.insert("sensorOverallDimensions",
                Imf::V2fAttribute(Imath::V2f(static_cast<float>(kFilmBackWidthMm),
                                             static_cast<float>(film_height))));
}

}  // namespace

void check_exr_compression(const std::string& name) { compression_named(name); }

Imath::M44f exr_world_to_camera(const Pose& pose) {
  return imath_from_columns(forward_camera_from_world(pose));
}

Imath::M44f exr_world_to_ndc(const VirtualCamera& camera) {
  const Intrinsics& k = camera.intrinsics;
  Eigen::Matrix4d ndc_from_camera;
  ndc_from_camera << k.fx / camera.width, 0, k.cx / camera.width, 0,  //
      0, -k.fy / camera.height, k.cy / camera.height, 0,              //
      0, 0, 1, -kNdcNear,                                             //
      0, 0, 1, 0;
  return imath_from_columns(ndc_from_camera * forward_camera_from_world(camera.pose));
}

Imf::Header exr_header(int width, int height, const ExrMetadata& metadata) {
  Imf::Header header(width, height);
  header.compression() = compression_named(metadata.compression);
  for (const char* name : {"R", "G", "B", "A"}) {
    header.channels().insert(name, Imf::Channel(Imf::HALF));
  }
  header.channels().insert("Z", Imf::Channel(Imf::FLOAT));
  // pLinear stays false: coverage is data, and must not be treated as light.
  header.channels().insert("lf.coverage", Imf::Channel(Imf::FLOAT));
  if (metadata.coverage_measures) {
    header.channels().insert("lf.cameras", Imf::Channel(Imf::FLOAT));
    header.channels().insert("lf.nearest", Imf::Channel(Imf::FLOAT));
  }

  add_perspective(header, metadata.camera);
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
    addChromaticities(header, Imf::Chromaticities());  // the default is Rec.709
  } else {
    add_string(header, "colorInteropID", "lin_rec709_scene");
  }
  if (!metadata.absent_cameras.empty()) {
    header.insert("lf:absentCameras", Imf::StringVectorAttribute(metadata.absent_cameras));
  }
  add_string(header, "lf:method", metadata.method);
  if (!metadata.method_options.empty()) {
    add_string(header, "lf:methodOptions", metadata.method_options);
  }
  if (!metadata.notes.empty()) {
    header.insert("lf:notes", Imf::StringVectorAttribute(metadata.notes));
  }
  add_string(header, "lf:fingerprint", metadata.fingerprint);
  add_string(header, "lf:version", metadata.program_version);
  add_string(header, "software", "Raystage " + metadata.program_version);
  return header;
}

}  // namespace raystage
