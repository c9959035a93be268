// SPDX-License-Identifier: Apache-2.0
#include "store/processing/mattes/take_matte.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <png.h>

#include <cmath>
#include <optional>

#include "base/error.h"
#include "base/resources.h"
#include "base/transfer_function.h"
#include "store/jpeg/encode.h"
#include "store/processing/frames/frame_cache.h"
#include "store/processing/mattes/matte_file.h"
#include "testing/child_limits.h"
#include "testing/png_bomb.h"
#include "testing/test_folder.h"

namespace raystage::store::take_matte_test {
namespace {

using ::testing::HasSubstr;

constexpr int kWidth = 96, kHeight = 64;

/// Returns a picture that is grey on the left and blue on the right.
RgbImage picture(bool with_actor) {
  RgbImage image{kWidth, kHeight, std::vector<std::uint8_t>()};
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const bool actor = with_actor && x < kWidth / 2;
      for (const int code : actor ? std::array{150, 140, 130} : std::array{50, 90, 200}) {
        image.values.push_back(static_cast<std::uint8_t>(code));
      }
    }
  }
  return image;
}

class TakeMattes : public ::testing::Test {
 protected:
  TakeMattes() {
    write("take", picture(true), kWidth);
    write("empty", picture(false), kWidth);
    take_.emplace(folder_.path() / "take");
  }

  void write(const std::string& name, const RgbImage& image, int width,
             const std::string& camera_id = "c0") {
    schemas::TakeDocument take;
    take.name = take.created_by = "test";
    take.nominal_fps = 10;
    take.color_space = "srgb_texture";
    schemas::RigDocument rig;
    rig.name = "one";
    schemas::RigDocument::Camera camera;
    camera.geometry.id = camera_id;
    camera.geometry.width = width;
    camera.geometry.height = kHeight;
    camera.geometry.intrinsics = {60, 60, width / 2.0, kHeight / 2.0, {}};
    rig.cameras.push_back(camera);
    take.cameras.push_back({camera_id, "", "", ""});
    TakeWriter writer(folder_.path() / name, take, rig);
    JpegEncodeOptions jpeg;
    jpeg.quality = 100;
    for (int frame = 0; frame < 2; ++frame) {
      writer.archive(0).append(encode_jpeg(image, jpeg), frame * 100'000'000LL);
    }
    writer.commit();
  }

  struct Pixel {
    double r, g, b, a;
  };
  Pixel keyed(const schemas::MatteSettings& settings, int x, int y = 30) const {
    FrameCache cache(*take_, 1 << 20, BlendSpace::kPerceptual,
                     std::make_shared<TakeMatte>(*take_, settings, folder_.path()));
    EXPECT_TRUE(cache.has_matte());
    std::int64_t decoded = 0;
    const auto frame = cache.fetch(0, 0, {}, decoded);
    const std::uint16_t* p = &frame->rgba[4 * static_cast<std::size_t>(y * kWidth + x)];
    return {p[0] / 65535.0, p[1] / 65535.0, p[2] / 65535.0, p[3] / 65535.0};
  }

  testing::TestFolder folder_;
  std::optional<Take> take_;
};

TEST_F(TakeMattes, AScreenIsFoundInTheTakeStatedOrSeenEmpty) {
  schemas::MatteSettings found, stated, empty;
  stated.screen_color = {
      {linear_from_srgb(50 / 255.0), linear_from_srgb(90 / 255.0), linear_from_srgb(200 / 255.0)}};
  empty.clean_plate_take = "empty";
  for (const schemas::MatteSettings& settings : {found, stated, empty}) {
    const Pixel actor = keyed(settings, 20), screen = keyed(settings, 80);
    EXPECT_EQ(actor.a, 1);
    EXPECT_NEAR(actor.r, 150 / 255.0, 0.01);
    EXPECT_NEAR(actor.b, 130 / 255.0, 0.01);
    EXPECT_EQ(screen.a, 0);
    EXPECT_EQ(screen.b, 0);
  }
}

TEST_F(TakeMattes, DifferencesFromTheEmptyTake) {
  schemas::MatteSettings settings;
  settings.kind = schemas::MatteSettings::Kind::kDifference;
  settings.clean_plate_take = "empty";
  EXPECT_EQ(keyed(settings, 20).a, 1);
  EXPECT_NEAR(keyed(settings, 20).g, 140 / 255.0, 0.01);
  EXPECT_EQ(keyed(settings, 80).a, 0);
}

TEST_F(TakeMattes, FilesOfOthers) {
  schemas::MatteSettings settings;
  settings.kind = schemas::MatteSettings::Kind::kFiles;
  EXPECT_THROW(keyed(settings, 20), Error);
  const auto file = matte_file(*take_, 0, 0).path();
  EXPECT_EQ(TakeMatte(*take_, settings, "").input_files(0, 0), std::vector{file});
  std::filesystem::create_directories(file.parent_path());
  std::vector<std::uint8_t> codes(kWidth * kHeight, 51);
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = kWidth;
  image.height = kHeight;
  image.format = PNG_FORMAT_GRAY;
  ASSERT_NE(png_image_write_to_file(&image, file.c_str(), 0, codes.data(), 0, nullptr), 0);
  const Pixel actor = keyed(settings, 20);
  EXPECT_NEAR(actor.a, 0.2, 1e-4);
  EXPECT_NEAR(actor.r, 0.2 * 150 / 255, 0.005);  // premultiplied codes
}

/// A file of a hundred bytes can state any size.
TEST_F(TakeMattes, FilesThatStateToBeHugeCostNothing) {
  const auto file = matte_file(*take_, 0, 0);
  std::filesystem::create_directories(file.path().parent_path());
  testing::write_png_that_states(file.path(), 16384, 16384);
  const MatteReader reader;
  try {
    reader.read(file, kWidth, kHeight);
    ADD_FAILURE() << "the matte has another size";
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
    EXPECT_THAT(error.what(), HasSubstr("the matte has 16384x16384 pixels, its camera 96x64"));
  }
  if (!testing::kDecodersHaveLimits) GTEST_SKIP() << "decoders have no limits in this build";
  EXPECT_GT(testing::largest_data_limit_of_decoders(), std::uint64_t{64} << 20);
  EXPECT_LT(testing::largest_data_limit_of_decoders(), std::uint64_t{128} << 20);
  // A rig states any size, too.
  EXPECT_THROW(reader.read(file, 65535, 65535), Error);
  EXPECT_LT(testing::largest_data_limit_of_decoders(),
            available_memory() / 2 + (std::uint64_t{1} << 30));
}

TEST_F(TakeMattes, BoxesOfTheWorldThrowAway) {
  schemas::MatteSettings settings;
  settings.keep = {{{{-0.2, -9, -2}, {9, 9, -1}}}};  // x >= -0.2 at 1 m: from pixel 36 on
  EXPECT_EQ(keyed(settings, 10).a, 0);
  EXPECT_EQ(keyed(settings, 40).a, 1);
  settings.keep.clear();
  settings.garbage = {{{{-0.2, -9, -2}, {9, 9, -1}}}};
  EXPECT_EQ(keyed(settings, 10).a, 1);
  EXPECT_EQ(keyed(settings, 40).a, 0);
}

TEST_F(TakeMattes, PartsOfAFrameAreKeyedAsTheWhole) {
  const auto matte = std::make_shared<TakeMatte>(*take_, schemas::MatteSettings{}, folder_.path());
  FrameCache whole(*take_, 1 << 20, BlendSpace::kPerceptual, matte);
  FrameCache parts(*take_, 1 << 20, BlendSpace::kPerceptual, matte);
  std::int64_t decoded = 0;
  const auto all = whole.fetch(0, 0, {}, decoded);
  const auto layout = parts.layout(0, 0);
  ASSERT_TRUE(layout->regions_decodable());
  const FrameCache::FetchGroup look = parts.new_fetch_group();
  McuMask wanted(static_cast<std::size_t>(layout->mcu_count()), 0);
  for (const std::size_t mcu : {5U, 6U, 40U, 7U}) {
    wanted[mcu] = 1;
    const auto part = parts.fetch(0, 0, wanted, decoded, look);
    const int x = static_cast<int>(mcu) % layout->mcus_per_row * layout->mcu_width + 3;
    const int y = static_cast<int>(mcu) / layout->mcus_per_row * layout->mcu_height + 3;
    for (std::size_t c = 0; c < 4; ++c) {
      const std::size_t at = 4 * static_cast<std::size_t>(y * kWidth + x) + c;
      EXPECT_EQ(part->rgba[at], all->rgba[at]) << mcu;
    }
  }
}

TEST_F(TakeMattes, RefuseEmptyTakesOfOtherArrays) {
  write("wide", picture(false), kWidth, "other");
  schemas::MatteSettings settings;
  settings.clean_plate_take = "wide";
  EXPECT_THROW(TakeMatte(*take_, settings, folder_.path()), Error);
  settings.clean_plate_take = "nowhere";
  EXPECT_THROW(TakeMatte(*take_, settings, folder_.path()), Error);
}

TEST_F(TakeMattes, TellWhatTheyAreFoundFrom) {
  schemas::MatteSettings settings;
  const std::string found = TakeMatte(*take_, settings, folder_.path()).sources();
  EXPECT_FALSE(found.empty());
  settings.clean_plate_take = "empty";
  EXPECT_NE(TakeMatte(*take_, settings, folder_.path()).sources(), found);
  settings.clean_plate_take.clear();
  settings.screen_color = {{0, 0, 1}};
  EXPECT_TRUE(TakeMatte(*take_, settings, folder_.path()).sources().empty());
}

}  // namespace
}  // namespace raystage::store::take_matte_test
