// SPDX-License-Identifier: Apache-2.0
#include "ingest/import_take.h"

#include <OpenImageIO/imageio.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <array>
#include <atomic>
#include <cmath>
#include <csignal>
#include <limits>

#include "base/error.h"
#include "base/half_float.h"
#include "base/transfer_function.h"
#include "images/image_file.h"
#include "store/take.h"
#include "testing/ingest/import_test_data.h"
#include "testing/test_folder.h"
#include "testing/test_permissions.h"

namespace raystage::ingest {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::picture;

class ImportTake : public ::testing::Test {
 protected:
  ImportTake() { create_folder(outputs()); }

  const std::filesystem::path& inputs() const { return folder_.path(); }
  std::filesystem::path outputs() const { return folder_.path() / "out"; }
  std::filesystem::path take() const { return outputs() / "take"; }

  ImportSummary run(const schemas::ImportManifest& manifest, const ImportOptions& options = {}) {
    return import_take(manifest, inputs(), take(), options);
  }
  /// Returns the error message, and checks that no take was written.
  std::string refusal(const schemas::ImportManifest& manifest, ExitCode exit_code) {
    std::string message = "accepted";
    try {
      run(manifest);
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), exit_code) << error.what();
      message = error.what();
    }
    EXPECT_TRUE(std::filesystem::is_empty(outputs()));
    return message;
  }
  schemas::ImportManifest one_image(const std::string& file, int width = 48,
                                    int height = 40) const {
    schemas::ImportManifest manifest = testing::empty_manifest();
    manifest.cameras.push_back(testing::camera("a", width, height));
    manifest.cameras[0].frames.push_back({file, 0});
    return manifest;
  }
  store::RgbImage decoded(int camera, int frame) const {
    return store::JpegDecoder().decode(store::Take(take()).archive(camera).jpeg(frame), "frame");
  }

  testing::TestFolder folder_;
};

double largest_difference(const store::RgbImage& a, const store::RgbImage& b) {
  double worst = a.values.size() == b.values.size() ? 0 : 1000;
  for (std::size_t i = 0; i < std::min(a.values.size(), b.values.size()); ++i) {
    worst = std::max(worst, std::abs(double{1} * a.values[i] - b.values[i]));
  }
  return worst;
}

TEST_F(ImportTake, StoresJpegByteForByte) {
  schemas::ImportManifest manifest = testing::write_two_cameras(inputs());
  manifest.depth_range = schemas::DepthRange{1, std::numeric_limits<double>::infinity()};
  manifest.arbitrary_scale = true;
  manifest.cameras[1].geometry.row = 0;
  manifest.cameras[1].geometry.column = 1;
  manifest.cameras[1].geometry.world_from_camera[3] = 0.1;
  const ImportSummary summary = run(manifest, {.created_by = "test 1"});
  EXPECT_EQ(summary.cameras, 2);
  EXPECT_EQ(summary.frames, 6);
  EXPECT_EQ(summary.copied, 6);

  const store::Take read(take());
  std::uint64_t bytes = 0;
  for (int c = 0; c < 2; ++c) {
    ASSERT_EQ(read.archive(c).frames().size(), 3u);
    EXPECT_TRUE(read.archive(c).was_closed());
    for (int i = 0; i < 3; ++i) {
      const auto& frame = manifest.cameras[c].frames[i];
      EXPECT_EQ(testing::bytes_to_string(read.archive(c).jpeg(i)),
                read_file(inputs() / frame.file));
      EXPECT_EQ(read.archive(c).frames()[i].time_ns, frame.time_ns);
      bytes += read.archive(c).jpeg(i).size();
    }
  }
  EXPECT_EQ(summary.jpeg_bytes, bytes);
  EXPECT_EQ(read.document().name, "test");
  EXPECT_EQ(read.document().created_by, "test 1");
  EXPECT_EQ(read.document().epoch_utc, 5);
  EXPECT_EQ(read.document().clock, "manifest");
  EXPECT_TRUE(read.document().arbitrary_scale);
  EXPECT_EQ(read.document().depth_range, manifest.depth_range);
  EXPECT_EQ(schemas::read_rig(take() / "rig.json").cameras[1].geometry,
            manifest.cameras[1].geometry);
}

TEST_F(ImportTake, RestartMarkersChangeNoPixel) {
  const schemas::ImportManifest manifest = testing::write_two_cameras(inputs());
  const ImportSummary summary = run(manifest, {.restart_markers = -1});
  EXPECT_EQ(summary.rewritten, 6);
  const store::Take read(take());
  store::JpegDecoder decoder;
  for (int c = 0; c < 2; ++c) {
    for (int i = 0; i < 3; ++i) {
      const auto jpeg = read.archive(c).jpeg(i);
      EXPECT_TRUE(store::parse_jpeg_layout(jpeg, "").regions_decodable());
      const auto& frame = manifest.cameras[c].frames[i];
      const std::string original = read_file(inputs() / frame.file);
      EXPECT_EQ(decoder.decode(jpeg, ""), decoder.decode(std::as_bytes(std::span(original)), ""));
    }
  }
}

TEST_F(ImportTake, OtherImagesAreEncodedOnceAndWell) {
  const store::RgbImage image = picture(48, 40, 1);
  images::write_image(image, inputs() / "a.png");
  const ImportSummary summary = run(one_image("a.png"));
  EXPECT_EQ(summary.encoded, 1);
  EXPECT_LE(largest_difference(decoded(0, 0), image), 6);
  const store::JpegLayout layout =
      store::parse_jpeg_layout(store::Take(take()).archive(0).jpeg(0), "");
  EXPECT_TRUE(layout.regions_decodable());
  EXPECT_EQ(layout.h[0], layout.h[1]);  // 4:4:4
}

TEST_F(ImportTake, QualityAndChromaAreAsAsked) {
  images::write_image(picture(48, 40, 1), inputs() / "a.png");
  ImportOptions options;
  options.encode = {.quality = 30, .chroma = store::JpegEncodeOptions::Chroma::k420};
  const ImportSummary summary = run(one_image("a.png"), options);
  const store::JpegLayout layout =
      store::parse_jpeg_layout(store::Take(take()).archive(0).jpeg(0), "");
  EXPECT_EQ(layout.h[0], 2 * layout.h[1]);
  std::filesystem::remove_all(take());
  EXPECT_LT(summary.jpeg_bytes, run(one_image("a.png")).jpeg_bytes);
}

void write_with_oiio(const std::filesystem::path& file, int width, int height, int channels,
                     const OIIO::TypeDesc& type, const std::vector<float>& values) {
  const auto output = OIIO::ImageOutput::create(file.string());
  ASSERT_TRUE(output);
  ASSERT_TRUE(output->open(file.string(), OIIO::ImageSpec(width, height, channels, type)));
  ASSERT_TRUE(output->write_image(OIIO::TypeDesc::FLOAT, values.data()));
  ASSERT_TRUE(output->close());
}

TEST_F(ImportTake, SixteenBitsAreRounded) {
  const std::vector<float> values(std::size_t{16 * 16 * 3}, 100.4F / 255);
  write_with_oiio(inputs() / "a.png", 16, 16, 3, OIIO::TypeDesc::UINT16, values);
  run(one_image("a.png", 16, 16), {.keep_depth = false});
  EXPECT_NEAR(decoded(0, 0).values[100], 100, 1);
}

TEST_F(ImportTake, SixteenBitsKeepTheirCodes) {
  std::vector<float> values;
  for (int i = 0; i < 16 * 16 * 3; ++i) values.push_back(static_cast<float>(i * 85 + 3) / 65535.0F);
  write_with_oiio(inputs() / "a.png", 16, 16, 3, OIIO::TypeDesc::UINT16, values);
  const ImportSummary summary = run(one_image("a.png", 16, 16));
  EXPECT_EQ(summary.deep, 1);
  EXPECT_EQ(summary.encoded, 0);
  const store::Take read(take());
  const schemas::PixelEncoding& pixels = read.document().cameras[0].pixels.value();
  EXPECT_EQ(pixels.samples, schemas::PixelEncoding::Samples::kInteger);
  EXPECT_EQ(pixels.bits, 16);
  EXPECT_EQ(pixels.transfer, schemas::PixelEncoding::Transfer::kSrgb);
  EXPECT_NEAR(pixels.peak, linear_from_srgb((16 * 16 * 3 - 1) * 85.0 / 65535 + 3.0 / 65535), 1e-6);
  const store::DeepPicture picture = read.archive(0).picture(0);
  ASSERT_EQ(picture.samples.size(), values.size());
  for (std::size_t i = 0; i < values.size(); ++i) EXPECT_EQ(picture.samples[i], i * 85 + 3);
  std::filesystem::remove_all(take());
  EXPECT_EQ(run(one_image("a.png", 16, 16), {.keep_depth = false}).encoded, 1);
  EXPECT_FALSE(store::Take(take()).document().has_deep_pixels());
}

TEST_F(ImportTake, FloatsBecomeHalfFloatsWithTheirPrimaries) {
  constexpr std::array<float, 8> kAp1{0.713F, 0.293F, 0.165F,   0.83F,
                                      0.128F, 0.044F, 0.32168F, 0.33767F};
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  std::vector<float> values;
  for (int i = 0; i < 16 * 16; ++i) {
    values.insert(values.end(), {0.25F, 37.5F, i == 7 ? kInfinity : -0.125F});
  }
  OIIO::ImageSpec spec(16, 16, 3, OIIO::TypeDesc::FLOAT);
  spec.attribute("chromaticities", OIIO::TypeDesc(OIIO::TypeDesc::FLOAT, 8), kAp1.data());
  const auto output = OIIO::ImageOutput::create((inputs() / "a.exr").string());
  ASSERT_TRUE(output && output->open((inputs() / "a.exr").string(), spec));
  ASSERT_TRUE(output->write_image(OIIO::TypeDesc::FLOAT, values.data()));
  ASSERT_TRUE(output->close());
  schemas::ImportManifest manifest = one_image("a.exr", 16, 16);
  manifest.color_space = "lin_rec709_scene";
  const ImportSummary summary = run(manifest);
  EXPECT_EQ(summary.deep, 1);
  EXPECT_EQ(summary.not_finite, 1);
  const store::Take read(take());
  const schemas::PixelEncoding& pixels = read.document().cameras[0].pixels.value();
  EXPECT_EQ(pixels.samples, schemas::PixelEncoding::Samples::kHalf);
  EXPECT_EQ(pixels.peak, 37.5) << "of the finite samples";
  ASSERT_TRUE(pixels.chromaticities.has_value());
  EXPECT_NEAR((*pixels.chromaticities)[0], 0.713, 1e-6);
  const store::DeepPicture picture = read.archive(0).picture(0);
  EXPECT_EQ(float_from_half(picture.samples[0]), 0.25F);
  EXPECT_EQ(float_from_half(picture.samples[1]), 37.5F);
  EXPECT_EQ(float_from_half(picture.samples[2]), -0.125F);
  EXPECT_EQ(float_from_half(picture.samples[3 * 7 + 2]), kLargestHalf);
}

TEST_F(ImportTake, OneCameraHasOneDepth) {
  const std::vector<float> values(std::size_t{48 * 40 * 3}, 0.4F);
  write_with_oiio(inputs() / "a.png", 48, 40, 3, OIIO::TypeDesc::UINT16, values);
  images::write_image(picture(48, 40, 1), inputs() / "b.png");
  write_file_atomically(inputs() / "c.jpg", testing::jpeg_as_string(picture(48, 40, 1)));
  for (const auto& [first, second] :
       {std::pair{"b.png", "a.png"}, std::pair{"c.jpg", "a.png"}, std::pair{"a.png", "c.jpg"}}) {
    schemas::ImportManifest manifest = one_image(first);
    manifest.cameras[0].frames.push_back({second, 1000});
    EXPECT_THAT(refusal(manifest, ExitCode::kBadInput), HasSubstr("more than 8 bits")) << first;
  }
}

TEST_F(ImportTake, GreyWithAlphaBecomesGrey) {
  std::vector<float> values;
  for (int i = 0; i < 16 * 16; ++i) values.insert(values.end(), {0.5F, 1.0F});
  write_with_oiio(inputs() / "a.png", 16, 16, 2, OIIO::TypeDesc::UINT8, values);
  run(one_image("a.png", 16, 16));
  for (const std::uint8_t code : decoded(0, 0).values) EXPECT_NEAR(code, 128, 1);
}

TEST_F(ImportTake, LinearImagesBecomeSrgb) {
  std::vector<float> values;
  for (int i = 0; i < 16 * 16; ++i) {
    values.insert(values.end(), {0.2F, 5.0F, std::numeric_limits<float>::quiet_NaN()});
  }
  write_with_oiio(inputs() / "a.exr", 16, 16, 3, OIIO::TypeDesc::FLOAT, values);
  schemas::ImportManifest manifest = one_image("a.exr", 16, 16);
  manifest.color_space = "lin_rec709_scene";
  run(manifest, {.keep_depth = false});
  const store::RgbImage image = decoded(0, 0);
  EXPECT_NEAR(image.values[0], srgb_from_linear(0.2) * 255, 2);
  EXPECT_NEAR(image.values[1], 255, 2);
  EXPECT_NEAR(image.values[2], 0, 2);
  EXPECT_EQ(store::Take(take()).document().color_space, "srgb_texture");
}

TEST_F(ImportTake, FloatingPointWithoutLinearLightIsRefused) {
  write_with_oiio(inputs() / "a.exr", 16, 16, 3, OIIO::TypeDesc::HALF,
                  std::vector<float>(16 * 16 * 3, 0.5F));
  EXPECT_THAT(refusal(one_image("a.exr", 16, 16), ExitCode::kBadInput),
              AllOf(HasSubstr("a.exr"), HasSubstr("floating-point")));
}

TEST_F(ImportTake, LinearJpegIsRefused) {
  schemas::ImportManifest manifest = testing::write_two_cameras(inputs());
  manifest.color_space = "lin_rec709_scene";
  EXPECT_THAT(refusal(manifest, ExitCode::kBadInput), HasSubstr("but a JPEG is not linear"));
}

TEST_F(ImportTake, MissingFilesAreNamedFirst) {
  schemas::ImportManifest manifest = testing::write_two_cameras(inputs());
  manifest.cameras[1].frames[2].file = "gone.jpg";
  EXPECT_THAT(refusal(manifest, ExitCode::kBadInput),
              AllOf(HasSubstr("gone.jpg"), HasSubstr("\"cam1\" was not found")));
  manifest.cameras[1].frames[2].file = "out";  // a folder
  EXPECT_THAT(refusal(manifest, ExitCode::kBadInput), HasSubstr("\"cam1\" is a folder"));
}

TEST_F(ImportTake, MoreCamerasThanFilesMayBeOpenAreRefusedFirst) {
  schemas::ImportManifest manifest = testing::write_two_cameras(inputs());
  rlimit limit{};
  ASSERT_EQ(getrlimit(RLIMIT_NOFILE, &limit), 0);
  rlimit low = limit;
  low.rlim_cur = 131;  // two cameras may need 132
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &low), 0);
  EXPECT_THAT(refusal(manifest, ExitCode::kFailed),
              AllOf(HasSubstr("2 cameras need up to 132"), HasSubstr("ulimit -n")));
  low.rlim_cur = 132;
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &low), 0);
  EXPECT_NO_THROW(run(manifest));
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &limit), 0);
}

TEST_F(ImportTake, ATruncatedJpegIsRefused) {
  const schemas::ImportManifest manifest = testing::write_two_cameras(inputs());
  const auto file = inputs() / manifest.cameras[1].frames[1].file;
  const std::string whole = read_file(file);
  for (const std::size_t size :
       {std::size_t{2}, std::size_t{20}, whole.size() / 2, whole.size() - 1}) {
    write_file_atomically(file, whole.substr(0, size));
    EXPECT_THAT(refusal(manifest, ExitCode::kBadInput), HasSubstr("1_1.jpg")) << size;
  }
}

TEST_F(ImportTake, FilesThatAreNoImagesAreRefused) {
  for (const std::string text : {"", "hello", "\x89PNG\r\n"}) {
    write_file_atomically(inputs() / "a.png", text);
    EXPECT_THAT(refusal(one_image("a.png"), ExitCode::kBadInput), HasSubstr("a.png"));
  }
}

TEST_F(ImportTake, AnImageOfTheWrongSizeIsRefused) {
  schemas::ImportManifest manifest = testing::write_two_cameras(inputs());
  manifest.cameras[0].geometry.width = 47;
  EXPECT_THAT(refusal(manifest, ExitCode::kBadInput),
              AllOf(HasSubstr("0_"), HasSubstr("the image is 48x40, but its camera is 47x40")));
  images::write_image(picture(48, 40, 1), inputs() / "a.png");
  EXPECT_THAT(refusal(one_image("a.png", 48, 41), ExitCode::kBadInput), HasSubstr("48x41"));
}

TEST_F(ImportTake, AnExistingTakeIsLeftAlone) {
  const schemas::ImportManifest manifest = testing::write_two_cameras(inputs());
  run(manifest);
  const std::string before = read_file(take() / "take.json");
  try {
    run(manifest, {.created_by = "other"});
    FAIL() << "overwritten";
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
    EXPECT_EQ(error.where(), take().string());
  }
  EXPECT_EQ(read_file(take() / "take.json"), before);
}

TEST_F(ImportTake, AFullDiskLeavesNothing) {
  const schemas::ImportManifest manifest = testing::write_two_cameras(inputs());
  // Limits files of this process to a few bytes, as on a full disk.
  auto* const handler = std::signal(SIGXFSZ, SIG_IGN);
  rlimit old{};
  getrlimit(RLIMIT_FSIZE, &old);
  const rlimit small{1500, old.rlim_max};
  setrlimit(RLIMIT_FSIZE, &small);
  const std::string message = refusal(manifest, ExitCode::kFailed);
  setrlimit(RLIMIT_FSIZE, &old);
  std::signal(SIGXFSZ, handler);
  EXPECT_NE(message, "accepted");
}

TEST_F(ImportTake, AFolderWithoutPermissionIsRefused) {
  const schemas::ImportManifest manifest = testing::write_two_cameras(inputs());
  testing::make_world_writable(inputs());
  const std::string closed = testing::unprivileged_access_error(inputs());
  if (!closed.empty()) GTEST_SKIP() << closed;
  const testing::ReadOnlyFolder locked(outputs());
  const std::string refused =
      testing::run_unprivileged([&]() -> std::string {  // before TBB's first thread
        try {
          run(manifest);
        } catch (const Error& error) {
          return "exit code " + std::to_string(static_cast<int>(error.exit_code())) + ", " +
                 error.what();
        }
        return "accepted";
      });
  EXPECT_THAT(refused, AllOf(HasSubstr("exit code 1, "), HasSubstr(take().string()),
                             HasSubstr("ermission denied")));
  EXPECT_TRUE(std::filesystem::is_empty(outputs()));
}

TEST_F(ImportTake, AStopLeavesNothing) {
  const schemas::ImportManifest manifest = testing::write_two_cameras(inputs());
  std::stop_source source;
  ImportOptions options;
  options.progress = [&](double) { source.request_stop(); };
  EXPECT_THROW(import_take(manifest, inputs(), take(), options, source.get_token()), Error);
  EXPECT_TRUE(std::filesystem::is_empty(outputs()));
}

TEST_F(ImportTake, ProgressEndsAtOne) {
  std::atomic<int> calls = 0, ends = 0;
  ImportOptions options;
  options.progress = [&](double done) {
    ++calls;
    if (done == 1) ++ends;
  };
  run(testing::write_two_cameras(inputs()), options);
  EXPECT_EQ(calls, 6);
  EXPECT_EQ(ends, 1);
}

}  // namespace
}  // namespace raystage::ingest
