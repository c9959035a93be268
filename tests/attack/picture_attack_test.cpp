// SPDX-License-Identifier: Apache-2.0
#include <OpenImageIO/imageio.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <chrono>
#include <fstream>
#include <functional>
#include <optional>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "base/atomic_file.h"
#include "base/error.h"
#include "images/exr_reader.h"
#include "images/image_reader.h"
#include "images/image_session.h"
#include "ingest/movie_reader.h"
#include "testing/ingest/test_movie.h"
#include "testing/test_folder.h"
#include "tests/attack/mutation.h"

namespace raystage::testing {
namespace {

void write_picture(const std::filesystem::path& file, const OIIO::TypeDesc& type, bool has_tiles) {
  OIIO::ImageSpec spec(33, 21, 4, type);
  spec.attribute("compression", "zip");
  if (has_tiles) spec.tile_width = spec.tile_height = 16;
  std::vector<float> values(std::size_t{33} * 21 * 4);
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = static_cast<float>(i % 97) / 97;
  const auto output = OIIO::ImageOutput::create(file.string());
  ASSERT_TRUE(output);
  ASSERT_TRUE(output->open(file.string(), spec) &&
              output->write_image(OIIO::TypeDesc::FLOAT, values.data()) && output->close());
}

class PictureAttack : public ::testing::Test {
 protected:
  void attack(const std::string& extension, const std::string& seed,
              const std::function<void(const std::filesystem::path&)>& read) {
    std::mt19937 random(11);  // NOLINT: the same in every run
    const auto file = folder_.path() / ("attacked" + extension);
    int refused = 0;
    for (int i = 0; i < attack_case_count(); ++i) {
      SCOPED_TRACE(extension + " " + std::to_string(i));
      std::ofstream(file, std::ios::binary) << (i > 0 ? mutated_bytes(seed, random) : seed);
      const auto start = std::chrono::steady_clock::now();
      try {
        read(file);
      } catch (const Error& error) {
        ++refused;
        ASSERT_GT(i, 0) << error.what();  // the seed itself
        ASSERT_EQ(error.exit_code(), ExitCode::kBadInput) << error.what();
        ASSERT_NE(std::string(error.what()).find("attacked"), std::string::npos) << error.what();
      }
      ASSERT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(20));
    }
    EXPECT_LT(refused, attack_case_count());
    EXPECT_GT(refused, 0);
  }
  void TearDown() override {
    images_.reset();  // its decoders end
    if (bounds_memory_) expect_decoders_within_memory();
  }
  /// Expects that no process that has ended took more than a decoder of images may.
  static void expect_decoders_within_memory() {
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
    // See image_decoder_options(): 128 MiB and four times what is granted; and the libraries.
    constexpr std::size_t kBytesPerKib = 1024, kLibraries = 150'000'000;
    constexpr std::size_t kBound = (std::size_t{128} << 20) + 4 * kMemory + kLibraries;
    rusage usage{};
    ASSERT_EQ(getrusage(RUSAGE_CHILDREN, &usage), 0);
    const auto largest = static_cast<std::size_t>(usage.ru_maxrss) * kBytesPerKib;
    ASSERT_GT(largest, 0U) << "no decoder has ended";
    EXPECT_LT(largest, kBound);
    RecordProperty("largest_decoder_bytes", std::to_string(largest));
    std::printf("largest decoder so far %.0f MB\n", static_cast<double>(largest) / 1e6);
#endif
  }
  std::string seed_picture(const std::string& extension, const OIIO::TypeDesc& type,
                           bool has_tiles = false) {
    const auto file = folder_.path() / ("seed" + extension);
    write_picture(file, type, has_tiles);
    return read_file(file);
  }

  TestFolder folder_;
  bool bounds_memory_ = true;  ///< false: other decoders than those of images run, or ran before
  static constexpr std::size_t kMemory = 100'000'000;
  std::optional<images::ImageReader> images_{std::in_place, kMemory};
};

TEST_F(PictureAttack, PicturesThatOpenImageIoReads) {
  const auto read = [&](const std::filesystem::path& file) {
    const auto picture = images_->read_floats(file);
    ASSERT_EQ(picture.values.size(),
              picture.properties.pixels() * static_cast<std::size_t>(picture.properties.channels));
  };
  for (const char* extension : {".png", ".tif", ".tga", ".bmp", ".jpg", ".dpx", ".exr"}) {
    attack(extension, seed_picture(extension, OIIO::TypeDesc::UINT8), read);
  }
  attack(".tif", seed_picture(".tif", OIIO::TypeDesc::HALF, true), read);
  attack(".exr", seed_picture(".exr", OIIO::TypeDesc::HALF, true), read);
}

TEST_F(PictureAttack, Plates) {
  const images::ImageReader png = images::ImageReader::of_png_plates(kMemory);
  attack(".png", seed_picture(".png", OIIO::TypeDesc::UINT8),
         [&](const std::filesystem::path& file) { png.read_codes(file); });
  const images::ExrReader exr(kMemory);
  constexpr images::ExrChannel kChannels[] = {{"R"}, {"G"}, {"B"}, {"A", 1.0F}};
  attack(".exr", seed_picture(".exr", OIIO::TypeDesc::HALF),
         [&](const std::filesystem::path& file) {
           exr.size(file, kChannels, "");
           const auto pixels = exr.read(file, kChannels, "");
           ASSERT_EQ(pixels.values.size(), std::size_t{4} * pixels.width * pixels.height);
         });
}

TEST_F(PictureAttack, Textures) {
  images::ImageSession session(kMemory);
  for (const char* extension : {".png", ".jpg"}) {
    attack(extension, seed_picture(extension, OIIO::TypeDesc::UINT8),
           [&](const std::filesystem::path& file) {
             const images::ImageSession::Image image = session.open(file);
             const images::ImageProperties& size = image.properties;
             std::vector<float> row(static_cast<std::size_t>(size.width) *
                                    static_cast<std::size_t>(size.channels));
             const auto bytes = std::as_writable_bytes(std::span(row));
             const int last = size.y + size.height - 1;
             session.read_rows(image, 0, 0, last, last + 1, images::PixelType::kFloat, bytes);
             for (const float value : row) ASSERT_TRUE(value >= 0 && value <= 1) << value;
             session.close(image);
           });
  }
}

TEST_F(PictureAttack, Movies) {
  bounds_memory_ = false;
  const auto file = folder_.path() / "seed.mkv";
  write_movie(file, {.width = 48, .height = 40, .frames = 3});
  attack(".mkv", read_file(file), [](const std::filesystem::path& movie) {
    ingest::MovieReader reader(movie);
    ingest::MovieFrame frame;
    while (reader.next(frame)) {
    }
  });
}

}  // namespace
}  // namespace raystage::testing
