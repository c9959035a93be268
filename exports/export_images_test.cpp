// SPDX-License-Identifier: Apache-2.0
// Exported image sequences as oiiotool and our own import read them.
#include "exports/export_images.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfInputFile.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <half.h>

#include <cmath>
#include <fstream>

#include "base/error.h"
#include "base/transfer_function.h"
#include "exports/exr_color_space.h"
#include "rig/photometric_model.h"
#include "schemas/import_manifest.h"
#include "store/jpeg/decode.h"
#include "testing/exports/export_test_data.h"

namespace raystage::exports::export_images_test {
namespace {

using testing::ExportTake;
using testing::output_of_program;

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr Nanoseconds kEpoch = 1'767'225'600 * kNanosecondsPerSecond;

std::string text_of(const std::vector<std::byte>& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

ImageExportOptions constant(const std::filesystem::path& output, const char* format) {
  ImageExportOptions options;
  options.output = output;
  options.format = &image_format(format);
  options.frames.times = FrameTimes::kConstant;
  options.frames.absent = AbsentFrames::kGap;
  return options;
}

/// Returns R, G, B of an EXR file of half channels.
Image<half, 3> read_halves(const std::filesystem::path& path) {
  Imf::InputFile file(path.c_str());
  const auto window = file.header().dataWindow();
  Image<half, 3> image(window.max.x + 1, window.max.y + 1);
  Imf::FrameBuffer buffer;
  const std::size_t pixel = 3 * sizeof(half);
  int channel = 0;
  for (const char* name : {"R", "G", "B"}) {
    EXPECT_NE(file.header().channels().findChannel(name), nullptr);
    buffer.insert(
        name, Imf::Slice(Imf::HALF, reinterpret_cast<char*>(image.values.data() + channel++), pixel,
                         pixel * static_cast<std::size_t>(image.width)));
  }
  file.setFrameBuffer(buffer);
  file.readPixels(0, window.max.y);
  return image;
}

TEST(ExportImages, JpegFilesAreTheRecordedFramesOfEachTick) {
  const ExportTake data;
  const ExportReport report = export_images(data.take(), constant(data.out("out"), "jpeg"), {});
  EXPECT_EQ(report.exit_code(), ExitCode::kSuccess);
  EXPECT_EQ(report.frames(), 21);
  EXPECT_EQ(report.cameras[2].absent, 2);
  for (int camera = 0; camera < ExportTake::kCameras; ++camera) {
    for (int frame = 0; frame < ExportTake::kFrames; ++frame) {
      const auto file = data.out("out") / ("c" + std::to_string(camera)) /
                        ("00000" + std::to_string(frame + 1) + ".jpg");
      ASSERT_EQ(std::filesystem::exists(file), ExportTake::has_frame(camera, frame)) << file;
      if (!ExportTake::has_frame(camera, frame)) continue;
      EXPECT_TRUE(read_file(file) == text_of(ExportTake::jpeg(camera, frame))) << file;
    }
  }
  // import.json has every file with its own time.
  const auto manifest = schemas::read_import_manifest(data.out("out") / "import.json");
  ASSERT_EQ(manifest.cameras.size(), 3);
  EXPECT_EQ(manifest.cameras[2].frames[4].file, "c2/000007.jpg");
  EXPECT_EQ(manifest.cameras[2].frames[4].time_ns, ExportTake::time_of(2, 6));
  EXPECT_EQ(manifest.epoch_utc, kEpoch);
}

TEST(ExportImages, PngFilesHaveTheDecodedCodes) {
  const ExportTake data;
  ImageExportOptions options = constant(data.out("out"), "png");
  options.frames.times = FrameTimes::kRecorded;
  options.frames.cameras = {"c1"};
  export_images(data.take(), options, {});
  store::JpegDecoder decoder;
  for (const auto& [number, frame] : {std::pair{1, 0}, std::pair{4, 4}}) {  // frame 3 is lost
    const auto file = data.out("out") / "c1" / ("00000" + std::to_string(number) + ".png");
    output_of_program({"ffmpeg", "-nostdin", "-v", "error", "-y", "-i", file.string(), "-f",
                       "rawvideo", "-pix_fmt", "rgb24", data.out("raw").string()});
    const store::RgbImage expected = decoder.decode(ExportTake::jpeg(1, frame), "frame");
    const std::string raw = read_file(data.out("raw"));
    ASSERT_EQ(raw.size(), expected.values.size());
    EXPECT_TRUE(std::equal(raw.begin(), raw.end(), expected.values.begin(), [](char a, auto b) {
      return static_cast<unsigned char>(a) == b;
    })) << file;
  }
}

TEST(ExportImages, ExrFilesHaveSceneLinearLightTimesAndMatrices) {
  schemas::RigDocument rig = ExportTake::default_rig();
  schemas::RigDocument::Camera& camera = rig.cameras[1];
  camera.photometric.contrast = {1.25, 0.9, 1.1};
  camera.photometric.brightness = {0.01, 0, -0.005};
  camera.photometric.vignetting = schemas::Vignetting{24, 16, {0.3, 0.05, 0}};
  camera.geometry.intrinsics.distortion.k1 = -0.125;
  camera.geometry.line_time_us = 12.5;
  const ExportTake data(true, rig);
  const store::Take take = data.take();
  ImageExportOptions options = constant(data.out("out"), "exr");
  options.exr.program_version = "test";
  export_images(take, options, {});
  const auto file = data.out("out") / "c1" / "000003.exr";
  const Image<half, 3> image = read_halves(file);
  ASSERT_EQ(image.width, ExportTake::kWidth);
  const store::RgbImage codes = store::JpegDecoder().decode(ExportTake::jpeg(1, 2), "frame");
  const schemas::PhotometricResponse& response = take.rig().cameras[1].photometric;
  double worst = 0;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      schemas::Rgb shown{};
      for (int c = 0; c < 3; ++c) shown[c] = linear_from_srgb(codes.at(x, y, c) / 255.0);
      const schemas::Rgb light =
          rig::apply_photometric_correction(response, {image.width, image.height}, x, y, shown);
      for (int c = 0; c < 3; ++c) {
        const double expected = std::max(0.0, light[c]);
        worst = std::max(worst, std::abs(image.at(x, y, c) - expected) / (expected + 1e-3));
      }
    }
  }
  EXPECT_LT(worst, 1.5e-3);  // half has 11 bits, the correction 16 on the sRGB curve

  const std::string info = output_of_program({"oiiotool", "--info", "-v", file.string()});
  for (const char* expected :
       {"48 x   32, 3 channel, half openexr", "colorInteropID: \"lin_rec709_scene\"",
        "imageCounter: 3", "framesPerSecond: 15/1 (15)", "lf:camera: \"c1\"",
        "lf:lensProjection: \"pinhole\"", "lf:lensIntrinsics: \"40 40 24.5 15.5\"",
        "lf:lensDistortion: \"-0.125 0 0 0 0\"", "lf:lineTimeUs: \"12.5\"",
        "lf:timestampEvent: \"exposure_middle\"", "lf:sourceFrame: 2", "reelName: \"test\"",
        // The camera is at x = 0.06; x is negated in a left-handed space only along z.
        "worldToCamera: 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, -1, 0, -0.06, 0, 0, 1", "worldToNDC: "}) {
    EXPECT_THAT(info, HasSubstr(expected));
  }
  EXPECT_THAT(info,
              HasSubstr("lf:frameTimeNs: \"" + std::to_string(ExportTake::time_of(1, 2)) + "\""));
  EXPECT_THAT(info, HasSubstr("lf:captureTimeNs: \"" +
                              std::to_string(kEpoch + ExportTake::time_of(1, 2)) + "\""));
  EXPECT_THAT(info, Not(HasSubstr("coveredShare")));
}

TEST(ExportImages, ExrFilesHaveTheColourSpaceOfAConfigAsOiiotoolConvertsThem) {
  const ExportTake data(true);
  const store::Take take = data.take();
  const auto config = data.out("show.ocio");
  std::ofstream(config)
      << "ocio_profile_version: 1\nroles:\n  default: lin_srgb\n"
         "displays:\n  tv:\n    - !<View> {name: Raw, colorspace: lin_srgb}\n"
         "colorspaces:\n  - !<ColorSpace>\n    name: lin_srgb\n"
         "  - !<ColorSpace>\n    name: show\n    from_reference: !<MatrixTransform> {matrix: "
         "[0.6, 0.3, 0.1, 0, 0.1, 0.9, 0, 0, 0, 0.2, 0.8, 0, 0, 0, 0, 1]}\n"
         "  - !<ColorSpace>\n    name: film\n    from_reference: !<ExponentTransform> {value: "
         "[0.5, 0.5, 0.5, 1]}\n";
  ImageExportOptions options = constant(data.out("scene"), "exr");
  options.frames.frames = std::vector{1};
  export_images(take, options, {});
  options.output = data.out("show");
  options.exr.color = exr_color_space("show", config, "");
  EXPECT_FALSE(options.exr.color.is_scene_space());
  export_images(take, options, {});
  const std::string scene = (data.out("scene") / "c1" / "000001.exr").string(),
                    show = (data.out("show") / "c1" / "000001.exr").string(),
                    converted = data.out("converted.exr").string();
  output_of_program({"oiiotool", scene, "--colorconfig", config.string(), "--colorconvert",
                     "lin_srgb", "show", "-o", converted});
  // Half has 11 bits; the input of one of them is rounded, too.
  const std::string difference =
      output_of_program({"oiiotool", "--fail", "0.0015", show, converted, "--diff"});
  EXPECT_THAT(difference, HasSubstr("0 pixels (0%) over 0.0015"));
  EXPECT_NE(read_halves(scene), read_halves(show));
  const std::string info = output_of_program({"oiiotool", "--info", "-v", show});
  EXPECT_THAT(info, HasSubstr("colorInteropID: \"unknown\""));
  EXPECT_THAT(info, HasSubstr("lf:colorSpace: \"show\""));
  EXPECT_THAT(info, HasSubstr("show.ocio, "));
  // A manifest for import could not state the space.
  EXPECT_TRUE(std::filesystem::exists(data.out("scene") / "import.json"));
  EXPECT_FALSE(std::filesystem::exists(data.out("show") / "import.json"));

  options.output = data.out("aces");
  options.exr.color = exr_color_space("lin_ap1_scene", {}, "");
  export_images(take, options, {});
  EXPECT_THAT(output_of_program(
                  {"oiiotool", "--info", "-v", (data.out("aces") / "c1" / "000001.exr").string()}),
              HasSubstr("colorInteropID: \"lin_ap1_scene\""));
  for (const char* wrong : {"film", "no such space"}) {
    EXPECT_THROW(exr_color_space(wrong, config, ""), Error) << wrong;
  }
}

TEST(ExportImages, FisheyesHaveNoMatrixOfAWindow) {
  schemas::RigDocument rig = ExportTake::default_rig();
  for (auto& camera : rig.cameras) {
    camera.geometry.intrinsics = {20, 20, 24, 16, {}};
    camera.geometry.intrinsics.projection = schemas::Projection::kEquisolid;
    camera.geometry.intrinsics.radial_distortion = {0.01, 0, 0, 0};
    camera.geometry.intrinsics.half_angle = 1.25;
  }
  const ExportTake data(true, rig);
  ImageExportOptions options = constant(data.out("out"), "exr");
  options.frames.frames = std::vector{1};
  export_images(data.take(), options, {});
  const std::string info = output_of_program(
      {"oiiotool", "--info", "-v", (data.out("out") / "c2" / "000001.exr").string()});
  EXPECT_THAT(info, HasSubstr("lf:lensProjection: \"equisolid\""));
  EXPECT_THAT(info, HasSubstr("lf:lensDistortion: \"0.01 0 0 0\""));
  EXPECT_THAT(info, HasSubstr("lf:lensHalfAngle: \"1.25\""));
  EXPECT_THAT(info, HasSubstr("worldToCamera"));
  EXPECT_THAT(info, Not(HasSubstr("worldToNDC")));
}

}  // namespace
}  // namespace raystage::exports::export_images_test
