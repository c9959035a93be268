// SPDX-License-Identifier: Apache-2.0
#include "compose/exr/exr_file.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfInputFile.h>
#include <OpenEXR/ImfIntAttribute.h>
#include <OpenEXR/ImfRationalAttribute.h>
#include <OpenEXR/ImfStandardAttributes.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <OpenEXR/ImfStringVectorAttribute.h>
#include <OpenImageIO/imageio.h>
#include <gtest/gtest.h>
#include <half.h>

#include <Eigen/Geometry>
#include <cmath>
#include <cstring>
#include <limits>
#include <numbers>

#include "base/atomic_file.h"
#include "base/error.h"
#include "rig/camera_model.h"
#include "testing/compose/test_exr_view.h"
#include "testing/test_folder.h"

namespace raystage::compose {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr int kWidth = 97, kHeight = 61;  // odd, and not a whole number of chunks

render::RenderedView synthetic_view() {
  render::RenderedView view;
  view.width = kWidth;
  view.height = kHeight;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const float alpha = x < 5 ? 0.0F : 1.0F;
      view.rgba.insert(view.rgba.end(),
                       {alpha * static_cast<float>(x) / kWidth,
                        alpha * static_cast<float>(y) / kHeight, alpha * 0.25F, alpha});
      view.coverage.push_back(alpha * 0.75F);
      view.z.push_back(x < 5 ? kInfinity : 3.1F + 0.001F * static_cast<float>(y));
    }
  }
  return view;
}

/// Returns a camera without symmetries.
render::VirtualCamera odd_camera() {
  render::VirtualCamera camera;
  camera.width = kWidth;
  camera.height = kHeight;
  camera.intrinsics = {83.5, 83.5, kWidth / 2.0, kHeight / 2.0, {}};
  camera.pose.world_from_camera_rotation =
      Eigen::AngleAxisd(0.7, Eigen::Vector3d(0.3, -1, 0.2).normalized()).toRotationMatrix();
  camera.pose.position = {1.25, -2.5, 14};
  return camera;
}

ExrMetadata synthetic_metadata() {
  ExrMetadata metadata;
  metadata.frame = 1012;
  metadata.fps_numerator = 24000;
  metadata.fps_denominator = 1001;
  metadata.capture_rate = 15;
  metadata.take_name = "shop";
  metadata.capture_utc = 1'767'225'600'123'456'789;  // 2026-01-01T00:00:00.123456789Z
  metadata.absent_cameras = {"r0c1", "r7c3"};
  metadata.method = "focal_plane";
  metadata.method_options = "objects=planes.json";
  metadata.notes = {"one", "two"};
  metadata.fingerprint = "00112233445566778899aabbccddeeff";
  metadata.program_version = "0.1.0";
  return metadata;
}

rig::CameraModel model_of(const render::VirtualCamera& camera) {
  schemas::CameraGeometry geometry;
  geometry.id = "view";
  geometry.width = camera.width;
  geometry.height = camera.height;
  geometry.intrinsics = camera.intrinsics;
  return rig::CameraModel(geometry);
}

/// Returns points at all positions of the view, near and far.
std::vector<Eigen::Vector3d> points_in_view(const render::VirtualCamera& camera) {
  const rig::CameraModel model = model_of(camera);
  std::vector<Eigen::Vector3d> points;
  for (const double depth : {0.3, 2.0, 50.0}) {
    for (double y = 0.5; y < camera.height; y += 12) {
      for (double x = 0.5; x < camera.width; x += 16) {
        const auto ray = model.unproject({x, y});
        EXPECT_TRUE(ray);
        points.push_back(camera.pose.world_from_camera(*ray * depth));
      }
    }
  }
  return points;
}

/// Expects the projection that compositing programs compute: row vector times matrix, divided by w.
/// `m`: row-major.
void expect_projects_like(const render::VirtualCamera& camera, const float* to_camera,
                          const float* to_ndc) {
  const rig::CameraModel model = model_of(camera);
  const auto transform = [](const Eigen::Vector3d& p, const float* m) {
    Eigen::Vector4d result = Eigen::Vector4d::Zero();
    const double row[] = {p.x(), p.y(), p.z(), 1};
    for (int i = 0; i < 4; ++i) {
      for (int j = 0; j < 4; ++j) result[j] += row[i] * static_cast<double>(m[i * 4 + j]);
    }
    return result;
  };
  for (const Eigen::Vector3d& point : points_in_view(camera)) {
    const auto pixel = model.project(camera.pose.camera_from_world(point));
    ASSERT_TRUE(pixel);
    const Eigen::Vector4d ndc = transform(point, to_ndc);
    EXPECT_NEAR(ndc.x() / ndc.w() * camera.width, pixel->x(), 0.01);
    EXPECT_NEAR(ndc.y() / ndc.w() * camera.height, pixel->y(), 0.01);

    const Eigen::Vector3d ours = camera.pose.camera_from_world(point);
    const Eigen::Vector4d theirs = transform(point, to_camera);
    EXPECT_NEAR(theirs.x(), ours.x(), 1e-4);
    EXPECT_NEAR(theirs.y(), ours.y(), 1e-4);
    EXPECT_NEAR(theirs.z(), -ours.z(), 1e-4) << "z points forward in OpenEXR";
    EXPECT_GT(theirs.z(), 0);
    EXPECT_NEAR(theirs.w(), 1, 1e-6);
  }
}

std::size_t write_frame(const render::RenderedView& view, const ExrMetadata& metadata,
                        const std::filesystem::path& file) {
  return testing::write_exr({{testing::exr_view(view)}}, {{ExrCamera{.view = odd_camera()}}},
                            metadata, file);
}

class ExrFile : public ::testing::Test {
 protected:
  testing::TestFolder folder_;
  std::filesystem::path file_ = folder_.path() / "frame.0001.exr";
};

TEST_F(ExrFile, MatricesProjectKnownPointsReadByOpenExr) {
  write_frame(synthetic_view(), synthetic_metadata(), file_);
  const Imf::InputFile input(file_.c_str());
  const Imath::M44f to_camera = Imf::worldToCamera(input.header());
  const Imath::M44f to_ndc = Imf::worldToNDC(input.header());
  expect_projects_like(odd_camera(), to_camera.getValue(), to_ndc.getValue());
  // Imath multiplies row vectors and divides by w.
  const Eigen::Vector3d point = odd_camera().pose.world_from_camera({0, 0, -5});
  Imath::V3f ndc;
  to_ndc.multVecMatrix(Imath::V3f(static_cast<float>(point.x()), static_cast<float>(point.y()),
                                  static_cast<float>(point.z())),
                       ndc);
  EXPECT_NEAR(ndc.x, 0.5, 1e-5);
  EXPECT_NEAR(ndc.y, 0.5, 1e-5);
  // The translation is in the last row.
  EXPECT_NEAR(to_camera[0][3], 0, 0);
  EXPECT_GT(Imath::V3f(to_camera[3][0], to_camera[3][1], to_camera[3][2]).length(), 1);
}

TEST_F(ExrFile, MatricesProjectKnownPointsReadByOpenImageIo) {
  write_frame(synthetic_view(), synthetic_metadata(), file_);
  const auto input = OIIO::ImageInput::open(file_.string());
  ASSERT_TRUE(input) << OIIO::geterror();
  const auto matrix = [&](const char* name) {
    const auto* attribute = input->spec().find_attribute(name, OIIO::TypeMatrix44);
    return attribute == nullptr ? nullptr : static_cast<const float*>(attribute->data());
  };
  const float* to_camera = matrix("worldtocamera");
  const float* to_ndc = matrix("worldtoNDC");
  ASSERT_NE(to_camera, nullptr);
  ASSERT_NE(to_ndc, nullptr);
  expect_projects_like(odd_camera(), to_camera, to_ndc);
}

TEST_F(ExrFile, ScreenWindowAndFilmBackAgreeWithTheProjection) {
  write_frame(synthetic_view(), synthetic_metadata(), file_);
  const Imf::InputFile input(file_.c_str());
  const Imf::Header& header = input.header();
  EXPECT_NEAR(header.screenWindowWidth(), kWidth / 83.5, 1e-6);
  EXPECT_EQ(header.screenWindowCenter(), Imath::V2f(0, 0));
  EXPECT_EQ(header.pixelAspectRatio(), 1.0F);
  EXPECT_EQ(header.displayWindow(), Imath::Box2i({0, 0}, {kWidth - 1, kHeight - 1}));
  EXPECT_EQ(header.dataWindow(), header.displayWindow());
  const auto* focal = header.findTypedAttribute<Imf::FloatAttribute>("pinholeFocalLength");
  const auto* sensor = header.findTypedAttribute<Imf::V2fAttribute>("sensorOverallDimensions");
  ASSERT_TRUE(focal && sensor);
  EXPECT_NEAR(focal->value() / sensor->value().x, 83.5 / kWidth, 1e-6);
  EXPECT_NEAR(sensor->value().x / sensor->value().y, double{kWidth} / kHeight, 1e-5);
}

TEST_F(ExrFile, AttributesReadBackByOpenExr) {
  write_frame(synthetic_view(), synthetic_metadata(), file_);
  const Imf::InputFile input(file_.c_str());
  const Imf::Header& header = input.header();
  const auto text = [&](const char* name) {
    const auto* attribute = header.findTypedAttribute<Imf::StringAttribute>(name);
    return attribute == nullptr ? std::string("absent") : attribute->value();
  };
  EXPECT_EQ(Imf::framesPerSecond(header).n, 24000);
  EXPECT_EQ(Imf::framesPerSecond(header).d, 1001U);
  EXPECT_EQ(header.typedAttribute<Imf::IntAttribute>("imageCounter").value(), 1012);
  EXPECT_EQ(header.typedAttribute<Imf::RationalAttribute>("captureRate").value().n, 15);
  EXPECT_EQ(text("reelName"), "shop");
  EXPECT_EQ(text("capDate"), "2026:01:01 00:00:00");
  EXPECT_EQ(Imf::utcOffset(header), 0.0F);
  EXPECT_EQ(text("lf:captureTimeNs"), "1767225600123456789");
  EXPECT_EQ(text("lf:method"), "focal_plane");
  EXPECT_EQ(text("lf:methodOptions"), "objects=planes.json");
  EXPECT_EQ(header.typedAttribute<Imf::StringVectorAttribute>("lf:notes").value(),
            (Imf::StringVector{"one", "two"}));
  EXPECT_EQ(text("lf:fingerprint"), "00112233445566778899aabbccddeeff");
  EXPECT_EQ(text("lf:version"), "0.1.0");
  EXPECT_EQ(text("software"), "Raystage 0.1.0");
  EXPECT_EQ(text("colorInteropID"), "lin_rec709_scene");
  EXPECT_FALSE(Imf::hasChromaticities(header));
  EXPECT_EQ(header.typedAttribute<Imf::StringVectorAttribute>("lf:absentCameras").value(),
            (Imf::StringVector{"r0c1", "r7c3"}));
  EXPECT_EQ(header.compression(), Imf::ZIP_COMPRESSION);
  const Imf::TimeCode time = Imf::timeCode(header);  // frame 1012 at a count of 24
  EXPECT_EQ(time.hours(), 0);
  EXPECT_EQ(time.seconds(), 42);
  EXPECT_EQ(time.frame(), 4);
  EXPECT_EQ(text("owner"), "absent");
}

// Time codes count 30 frames a second at most.
TEST_F(ExrFile, FastShotsHaveNoTimeCode) {
  for (const int fps : {30, 31, 48, 60, 120}) {
    ExrMetadata metadata = synthetic_metadata();
    metadata.frame = 47;
    metadata.fps_numerator = fps;
    metadata.fps_denominator = 1;
    const Imf::Header header =
        exr_header({}, {render::virtual_camera_with_fov(4, 4, 1, {})}, metadata);
    EXPECT_EQ(Imf::hasTimeCode(header), fps <= 30) << fps;
    EXPECT_EQ(Imf::framesPerSecond(header).n, fps);
  }
  EXPECT_EQ(format_time_code(47, 48, 1), "00:00:00:47");
  EXPECT_EQ(format_time_code(125, 60, 1), "00:00:02:05");
}

TEST_F(ExrFile, FrameRateAndPixelsReadBackByOpenImageIo) {
  const render::RenderedView view = synthetic_view();
  ExrMetadata metadata = synthetic_metadata();
  metadata.layout = ExrLayout::kSingle;
  write_frame(view, metadata, file_);
  const auto input = OIIO::ImageInput::open(file_.string());
  ASSERT_TRUE(input);
  const OIIO::ImageSpec& spec = input->spec();
  const auto* fps = spec.find_attribute("FramesPerSecond", OIIO::TypeRational);
  ASSERT_NE(fps, nullptr);
  EXPECT_EQ(static_cast<const int*>(fps->data())[0], 24000);
  EXPECT_EQ(static_cast<const int*>(fps->data())[1], 1001);
  EXPECT_EQ(spec.channelnames, (std::vector<std::string>{"R", "G", "B", "A", "Z", "coverage.V"}));
  std::vector<float> pixels(static_cast<std::size_t>(kWidth) * kHeight * 6);
  ASSERT_TRUE(input->read_image(0, 0, 0, 6, OIIO::TypeFloat, pixels.data()));
  for (std::size_t i = 0; i < view.z.size(); ++i) {
    for (std::size_t c = 0; c < 4; ++c) {
      ASSERT_EQ(pixels[i * 6 + c], static_cast<float>(half(view.rgba[i * 4 + c])));
    }
    ASSERT_EQ(pixels[i * 6 + 4], view.z[i]) << "float, not half";
    ASSERT_EQ(pixels[i * 6 + 5], view.coverage[i]);
  }
}

TEST_F(ExrFile, ChromaticitiesReplaceTheInteropId) {
  ExrMetadata metadata = synthetic_metadata();
  metadata.chromaticities = true;
  write_frame(synthetic_view(), metadata, file_);
  const Imf::InputFile input(file_.c_str());
  EXPECT_TRUE(Imf::hasChromaticities(input.header()));
  EXPECT_NEAR(Imf::chromaticities(input.header()).red.x, 0.64, 1e-6);
  EXPECT_EQ(input.header().find("colorInteropID"), input.header().end());
}

TEST_F(ExrFile, ExtremeValuesStayFinite) {
  render::RenderedView view = synthetic_view();
  view.rgba[0] = 1e9F;
  view.rgba[1] = -kInfinity;
  view.rgba[2] = std::nanf("");
  view.rgba[3] = 65519.9F;  // rounds to infinity in half
  view.z[0] = view.coverage[0] = std::nanf("");
  write_frame(view, synthetic_metadata(), file_);
  const ExrImage image = read_exr(file_);
  EXPECT_EQ(image.rgba[0], 65504.0F);
  EXPECT_EQ(image.rgba[1], -65504.0F);
  EXPECT_EQ(image.rgba[2], 0.0F);
  EXPECT_EQ(image.rgba[3], 65504.0F);
}

TEST_F(ExrFile, EveryCompressionIsLossless) {
  const render::RenderedView view = synthetic_view();
  ExrMetadata metadata = synthetic_metadata();
  std::vector<float> first;
  for (const char* name : {"none", "rle", "zips", "zip", "piz"}) {
    metadata.compression = name;
    write_frame(view, metadata, file_);
    EXPECT_TRUE(is_complete_exr(file_, metadata.fingerprint)) << name;
    const ExrImage image = read_exr(file_);
    EXPECT_EQ(image.fps_numerator, 24000);
    if (first.empty()) first = image.rgba;
    EXPECT_EQ(image.rgba, first) << name;
  }
  metadata.compression = "dwaa";
  EXPECT_THROW(write_frame(view, metadata, file_), Error);
}

TEST_F(ExrFile, SameInputSameBytes) {
  const auto encoded = [] {
    const render::RenderedView view = synthetic_view();
    return encode_exr({{testing::exr_view(view)}}, {{ExrCamera{.view = odd_camera()}}},
                      synthetic_metadata());
  };
  EXPECT_EQ(encoded(), encoded());
}

TEST_F(ExrFile, AFileCutAnywhereIsNotWhole) {
  for (const char* compression : {"piz", "zip", "none"}) {
    ExrMetadata metadata = synthetic_metadata();
    metadata.compression = compression;
    write_frame(synthetic_view(), metadata, file_);
    ASSERT_TRUE(is_complete_exr(file_, metadata.fingerprint));
    EXPECT_FALSE(is_complete_exr(file_, "another"));
    const std::string bytes = read_file(file_);
    for (std::size_t size = 0; size < bytes.size(); size += 1 + bytes.size() / 97) {
      write_file_atomically(file_, std::string_view(bytes).substr(0, size));
      EXPECT_FALSE(is_complete_exr(file_, metadata.fingerprint)) << compression << " " << size;
    }
    write_file_atomically(file_, std::string_view(bytes).substr(0, bytes.size() - 1));
    EXPECT_FALSE(is_complete_exr(file_, metadata.fingerprint));
    // An interrupted writer: the chunk table is reserved but not written.
    std::string unfinished = bytes;
    std::fill(unfinished.end() - static_cast<std::ptrdiff_t>(bytes.size() / 2), unfinished.end(),
              '\0');
    write_file_atomically(file_, unfinished);
    if (std::string_view(compression) == "none") {
      EXPECT_FALSE(is_complete_exr(file_, metadata.fingerprint));
    }
  }
  EXPECT_FALSE(is_complete_exr(folder_.path() / "nothing.exr", "x"));
  EXPECT_FALSE(is_complete_exr(folder_.path(), "x"));
}

TEST_F(ExrFile, ReadingRefusesWhatIsNoExrWithItsName) {
  write_file_atomically(file_, std::string_view("no picture"));
  try {
    read_exr(file_);
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.where(), file_.string());
    EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
  }
}

TEST_F(ExrFile, AFailedWriteLeavesNothing) {
  const auto missing = folder_.path() / "missing" / "a.exr";
  EXPECT_THROW(write_frame(synthetic_view(), synthetic_metadata(), missing), Error);
  EXPECT_TRUE(std::filesystem::is_empty(folder_.path()));
}

}  // namespace
}  // namespace raystage::compose
