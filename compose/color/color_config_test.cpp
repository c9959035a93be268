// SPDX-License-Identifier: Apache-2.0
#include "compose/color/color_config.h"

#include <OpenColorIO/OpenColorIO.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "base/error.h"
#include "base/transfer_function.h"
#include "compose/color/built_in_config.h"
#include "compose/color/ocio_config.h"
#include "testing/test_folder.h"

namespace raystage::compose {
namespace {

namespace OCIO = OCIO_NAMESPACE;
using ::testing::HasSubstr;

/// Returns patches from black to four times white, R, G, B, A.
std::vector<float> chart(float alpha) {
  std::vector<float> rgba;
  for (const float r : {0.0F, 0.02F, 0.18F, 0.5F, 1.0F, 4.0F}) {
    for (const float g : {0.0F, 0.18F, 0.9F, 4.0F}) {
      for (const float b : {0.0F, 0.3F, 1.0F}) {
        rgba.insert(rgba.end(), {alpha * r, alpha * g, alpha * b, alpha});
      }
    }
  }
  return rgba;
}

TEST(ColorConfigs, TheBuiltInOneTurnsRec709IntoAces) {
  const ColorConfig config = ColorConfig::built_in();
  std::vector<float> white{1, 1, 1, 1};
  const ColorTransform to_acescg = config.to_space("ACEScg");
  EXPECT_TRUE(to_acescg.is_linear());
  to_acescg.apply(white);
  for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(white[c], 1, 1e-5F);
  // The colour of red by the Bradford adaptation that is published with ACES.
  std::vector<float> red{1, 0, 0, 1};
  to_acescg.apply(red);
  EXPECT_NEAR(red[0], 0.6131F, 1e-4F);
  EXPECT_NEAR(red[1], 0.0702F, 1e-4F);
  EXPECT_NEAR(red[2], 0.0206F, 1e-4F);
  EXPECT_TRUE(config.to_space("lin_rec709_scene").is_no_op());
  EXPECT_FALSE(config.to_space("srgb_texture").is_linear());
  EXPECT_EQ(config.interop_id("ACEScg"), "lin_ap1_scene");
  EXPECT_EQ(config.interop_id("lin_ap0_scene"), "lin_ap0_scene");
  EXPECT_EQ(config.interop_id("srgb_texture"), "unknown");
}

TEST(ColorConfigs, AChartComesOutAsOpenColorIOItselfMakesIt) {
  const ColorConfig config = ColorConfig::built_in();
  const OCIO::ConstConfigRcPtr own = built_in_color_config();
  for (const char* space : {"lin_ap1_scene", "lin_ap0_scene", "srgb_texture"}) {
    const auto processor = own->getProcessor("lin_rec709_scene", space)->getDefaultCPUProcessor();
    for (const float alpha : {1.0F, 0.5F}) {
      std::vector<float> ours = chart(alpha);
      config.to_space(space).apply(ours);
      const std::vector<float> light = chart(1);
      for (std::size_t i = 0; i < light.size(); i += 4) {
        std::array<float, 3> rgb{light[i], light[i + 1], light[i + 2]};
        processor->applyRGB(rgb.data());
        for (std::size_t c = 0; c < 3; ++c) {
          ASSERT_NEAR(ours[i + c], alpha * rgb[c], 1e-5F * (1 + std::abs(rgb[c])))
              << space << ' ' << alpha << ' ' << i;
        }
        ASSERT_EQ(ours[i + 3], alpha);
      }
    }
  }
}

TEST(ColorConfigs, ThePlainViewOfSrgbIsItsCurve) {
  const ColorTransform shown =
      ColorConfig::built_in().to_display("lin_rec709_scene", "sRGB", "Plain");
  for (float light = 0; light <= 1; light += 0.01F) {
    std::vector<float> rgb{light, 0.5F * light, light};
    shown.apply_rgb(rgb);
    EXPECT_NEAR(rgb[0], srgb_from_linear(static_cast<double>(light)), 1e-4F);
    EXPECT_NEAR(rgb[1], srgb_from_linear(0.5 * static_cast<double>(light)), 1e-4F);
  }
  // Default names give the same.
  std::vector<float> grey{0.18F, 0.18F, 0.18F};
  ColorConfig::built_in().to_display("lin_rec709_scene", "", "").apply_rgb(grey);
  EXPECT_NEAR(grey[0], srgb_from_linear(0.18), 1e-4F);
  // The ACES view compresses highlights.
  std::vector<float> bright{4, 4, 4};
  ColorConfig::built_in().to_display("ACEScg", "sRGB", "ACES 1.0 SDR").apply_rgb(bright);
  EXPECT_GT(bright[0], 0.9F);
  EXPECT_LE(bright[0], 1);
}

class StudioConfigs : public ::testing::Test {
 protected:
  std::filesystem::path file(const std::string& rec709) {
    std::ofstream(folder_.path() / "studio.ocio")
        << "ocio_profile_version: 1\nroles:\n  default: " << rec709
        << "\ndisplays:\n  tv:\n    - !<View> {name: Film, colorspace: dim}\n"
           "colorspaces:\n"
           "  - !<ColorSpace>\n    name: "
        << rec709
        << "\n  - !<ColorSpace>\n    name: dim\n    from_reference: !<MatrixTransform> {matrix: "
           "[0.5, 0, 0, 0, 0, 0.25, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}\n";
    return folder_.path() / "studio.ocio";
  }
  testing::TestFolder folder_;
};

TEST_F(StudioConfigs, AreRead) {
  const ColorConfig config = ColorConfig::from_file(file("lin_srgb"), "");
  EXPECT_THAT(config.description(), HasSubstr("studio.ocio, "));
  std::vector<float> rgba{1, 1, 1, 1};
  config.to_space("dim").apply(rgba);
  EXPECT_EQ(rgba, (std::vector<float>{0.5F, 0.25F, 1, 1}));
  EXPECT_EQ(config.interop_id("dim"), "unknown");
  EXPECT_EQ(config.interop_id("lin_srgb"), "lin_rec709_scene");
  EXPECT_NE(config.description(), ColorConfig::from_file(file("lin_rec709"), "").description());
}

TEST_F(StudioConfigs, MayNameRec709AsTheyLike) {
  EXPECT_THROW(ColorConfig::from_file(file("ours"), ""), Error);
  EXPECT_NO_THROW(ColorConfig::from_file(file("ours"), "ours"));
  EXPECT_THROW(ColorConfig::from_file(file("ours"), "theirs"), Error);
  const ColorConfig ours = ColorConfig::from_file(file("ours"), "ours");
  EXPECT_TRUE(ours.to_space("lin_rec709_scene").is_no_op());
  EXPECT_EQ(ours.interop_id("ours"), "lin_rec709_scene");
}

TEST_F(StudioConfigs, AreRefusedWithWhatThereIs) {
  const auto refusal = [](const auto& what) -> std::string {
    try {
      what();
    } catch (const Error& error) {
      return error.what();
    }
    return "none";
  };
  const ColorConfig config = ColorConfig::from_file(file("lin_srgb"), "");
  EXPECT_THAT(refusal([&] { config.to_space("nowhere"); }), HasSubstr("lin_srgb, dim"));
  EXPECT_THAT(refusal([&] { config.to_display("lin_srgb", "tv", "none"); }),
              HasSubstr("tv / Film"));
  EXPECT_THAT(refusal([&] { ColorConfig::from_file(folder_.path() / "none.ocio", ""); }),
              HasSubstr("the colour config cannot be read"));
  std::ofstream(folder_.path() / "broken.ocio") << "ocio_profile_version: [\n";
  EXPECT_THAT(refusal([&] { ColorConfig::from_file(folder_.path() / "broken.ocio", ""); }),
              HasSubstr("the colour config cannot be read"));
}

/// A config with a curve in a file, which is no matrix.
class LookupConfigs : public StudioConfigs {
 protected:
  std::filesystem::path write(const std::string& lut_file) {
    std::filesystem::create_directories(folder_.path() / "config" / "luts");
    for (const char* name : {"config/luts/curve.spi1d", "outside.spi1d"}) {
      std::ofstream(folder_.path() / name)
          << "Version 1\nFrom 0.0 1.0\nLength 3\nComponents 1\n{\n0.0\n0.7\n1.0\n}\n";
    }
    const auto file = folder_.path() / "config" / "config.ocio";
    std::ofstream(file)
        << "ocio_profile_version: 2\nsearch_path: luts\nroles:\n  default: lin_srgb\n"
           "displays:\n  tv:\n    - !<View> {name: Film, colorspace: film}\n"
           "colorspaces:\n  - !<ColorSpace>\n    name: lin_srgb\n"
           "  - !<ColorSpace>\n    name: film\n    from_scene_reference: "
           "!<FileTransform> {src: "
        << lut_file << ", interpolation: linear}\n";
    return file;
  }
};

TEST_F(LookupConfigs, ConfinedProcessesApplyThemAsOpenColorIoDoesHere) {
  const auto file = write("curve.spi1d");
  const ColorConfig config = ColorConfig::from_file(file, "");
  const OcioTransform reference = OcioConfig::from_file(file, "").to_space("film");
  const ColorTransform film = config.to_space("film");
  EXPECT_FALSE(film.is_linear());
  std::vector<float> ours = chart(1), expected = chart(1);
  film.apply(ours);
  reference.apply(expected, 4);
  EXPECT_EQ(ours, expected);
  std::vector<float> rgb{0.25F, 0.5F, 1};
  config.to_display("lin_srgb", "tv", "Film").apply_rgb(rgb);
  EXPECT_NEAR(rgb[1], 0.7F, 1e-5F);
}

TEST_F(LookupConfigs, MatricesAreAppliedHereAsOpenColorIoDoes) {
  const ColorConfig config = ColorConfig::from_file(file("lin_srgb"), "");
  const OcioTransform reference = OcioConfig::from_file(file("lin_srgb"), "").to_space("dim");
  ASSERT_TRUE(reference.is_matrix());
  std::vector<float> ours = chart(1), expected = chart(1);
  config.to_space("dim").apply(ours);
  reference.apply(expected, 4);
  for (std::size_t i = 0; i < ours.size(); ++i) ASSERT_NEAR(ours[i], expected[i], 1e-6F);
}

TEST_F(LookupConfigs, FilesOutsideOfTheConfigsFolderAreNotOpened) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "sanitizers have no filter of system calls";
#endif
  const ColorConfig config =
      ColorConfig::from_file(write((folder_.path() / "outside.spi1d").string()), "");
  try {
    config.to_space("film");
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what_happened(), HasSubstr("reads a file outside of its folder, "));
    EXPECT_THAT(error.what_happened(), HasSubstr("outside.spi1d"));
    EXPECT_EQ(error.where(), (folder_.path() / "config" / "config.ocio").string());
    EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
  }
}

TEST_F(LookupConfigs, AConfigThatCrashesOpenColorIoIsAnErrorThatNamesIt) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "sanitizers end the process in their own way";
#endif
  const auto file = folder_.path() / "deep.ocio";
  std::ofstream(file) << "ocio_profile_version: 2\nroles: " << std::string(2'000'000, '[');
  try {
    ColorConfig::from_file(file, "");
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("deep.ocio"));
    EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
  }
}

}  // namespace
}  // namespace raystage::compose
