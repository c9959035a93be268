// SPDX-License-Identifier: Apache-2.0
#include "compose/geometry/textures.h"

#include <OpenEXR/ImfRgbaFile.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <fstream>
#include <functional>
#include <numbers>

#include "base/atomic_file.h"
#include "base/base64.h"
#include "base/error.h"
#include "base/transfer_function.h"
#include "compose/geometry/geometry_scene.h"
#include "testing/compose/test_meshes.h"
#include "testing/test_folder.h"

namespace raystage::compose {
namespace {

using ::testing::HasSubstr;

class TextureFiles : public ::testing::Test {
 protected:
  using Code = std::array<unsigned char, 3>;
  /// Writes a PPM file with 8-bit codes.
  std::filesystem::path write_ppm(int width, int height, const std::function<Code(int, int)>& at) {
    const auto file = folder_.path() / "texture.ppm";
    std::ofstream stream(file, std::ios::binary);
    stream << "P6 " << width << " " << height << " 255\n";
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const Code code = at(x, y);
        stream.write(reinterpret_cast<const char*>(code.data()), 3);
      }
    }
    return file;
  }
  std::filesystem::path write_exr(int width, int height,
                                  const std::function<Imf::Rgba(int, int)>& at) {
    const auto file = folder_.path() / "texture.exr";
    std::vector<Imf::Rgba> pixels;
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) pixels.push_back(at(x, y));
    }
    Imf::RgbaOutputFile out(file.c_str(), width, height, Imf::WRITE_RGB);
    out.setFrameBuffer(pixels.data(), 1, static_cast<std::size_t>(width));
    out.writePixels(height);
    return file;
  }
  testing::TestFolder folder_;
  Textures textures_{std::size_t{16} << 20, std::size_t{64} << 20};
};

TEST_F(TextureFiles, CodesAreSrgbAndTheFirstRowIsTheTop) {
  const auto texture = textures_.open(write_ppm(64, 64, [](int x, int y) -> Code {
    return {static_cast<unsigned char>(x < 32 ? 200 : 20),
            static_cast<unsigned char>(y < 32 ? 128 : 0), 255};
  }));
  const auto upper_left = textures_.color(texture, 0.25F, 0.75F, 0);
  EXPECT_NEAR(upper_left.x(), linear_from_srgb(200 / 255.0), 1e-4);
  EXPECT_NEAR(upper_left.y(), linear_from_srgb(128 / 255.0), 1e-4);
  EXPECT_NEAR(upper_left.z(), 1, 1e-4);
  const auto lower_right = textures_.color(texture, 1.75F, -0.75F, 0);  // it repeats
  EXPECT_NEAR(lower_right.x(), linear_from_srgb(20 / 255.0), 1e-4);
  EXPECT_NEAR(lower_right.y(), 0, 1e-4);
}

TEST_F(TextureFiles, ImagesOfMeshFilesAreReadFromMemory) {
  const auto png = std::make_shared<const EmbeddedImage>(
      EmbeddedImage{"box.glb#image 0", "png", *decode_base64(testing::kQuarteredPng)});
  const auto texture = textures_.open(png);
  EXPECT_EQ(textures_.open(png), texture);
  const auto upper_left = textures_.color(texture, 0.25F, 0.75F, 0);
  EXPECT_NEAR(upper_left.x(), linear_from_srgb(200 / 255.0), 1e-4);
  EXPECT_NEAR(upper_left.y(), linear_from_srgb(128 / 255.0), 1e-4);
  EXPECT_NEAR(textures_.color(texture, 0.75F, 0.25F, 0).y(), 0, 1e-4);

  const auto file = write_exr(64, 64, [](int, int) { return Imf::Rgba(8, 1, 0.25F); });
  const auto exr = textures_.open(
      std::make_shared<const EmbeddedImage>(EmbeddedImage{"b#image 0", "exr", read_file(file)}));
  EXPECT_NEAR(textures_.color(exr, 0.5F, 0.5F, 0).x(), 8, 1e-3);
}

/// glTF ignores alpha unless a material blends.
TEST_F(TextureFiles, AlphaDoesNotDarkenColours) {
  const auto texture = textures_.open(std::make_shared<const EmbeddedImage>(
      EmbeddedImage{"box.glb#image 0", "png", *decode_base64(testing::kTransparentPng)}));
  EXPECT_NEAR(textures_.color(texture, 0.25F, 0.5F, 0).x(), linear_from_srgb(200 / 255.0), 1e-4);
  EXPECT_NEAR(textures_.color(texture, 0.75F, 0.5F, 0).x(), linear_from_srgb(200 / 255.0), 1e-4);
}

/// The cache of OpenImageIO holds files and embedded images.
TEST_F(TextureFiles, EmbeddedImagesOfOneNameAreNotConfused) {
  const auto image = [](const char* name, const char* text) {
    return std::make_shared<const EmbeddedImage>(EmbeddedImage{name, "png", *decode_base64(text)});
  };
  const auto first = textures_.open(image("a.glb#image 0", testing::kQuarteredPng));
  const auto second = textures_.open(image("b.glb#image 0", testing::kTransparentPng));
  EXPECT_NEAR(textures_.color(first, 0.25F, 0.5F, 0).z(), 1, 1e-4);
  EXPECT_NEAR(textures_.color(second, 0.25F, 0.5F, 0).z(), 0, 1e-4);
}

TEST_F(TextureFiles, DamagedImagesOfMeshFilesAreNamed) {
  std::string bytes = *decode_base64(testing::kQuarteredPng);
  bytes.resize(20);
  try {
    textures_.open(
        std::make_shared<const EmbeddedImage>(EmbeddedImage{"box.glb#image 0 wood", "png", bytes}));
    FAIL() << "a cut image was opened";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("box.glb#image 0 wood"));
    EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
  }
}

TEST_F(TextureFiles, FloatsAreLinearAndWidePlacesAreBlurred) {
  const auto texture = textures_.open(write_exr(
      256, 256, [](int x, int y) { return Imf::Rgba((x + y) % 2 == 0 ? 8 : 0, 1, 0.25F); }));
  EXPECT_NEAR(textures_.color(texture, 0.5F / 256, 1 - 0.5F / 256, 0).x(), 8, 1e-3);
  EXPECT_NEAR(textures_.color(texture, 0.3F, 0.3F, 0.1F).x(), 4, 0.05);
  EXPECT_NEAR(textures_.color(texture, 0.3F, 0.3F, 0.1F).z(), 0.25, 1e-4);
}

TEST_F(TextureFiles, WhatIsBlurredIsLightNotCodes) {
  const auto texture = textures_.open(write_ppm(256, 256, [](int x, int y) -> Code {
    const auto code = static_cast<unsigned char>((x + y) % 2 == 0 ? 255 : 0);
    return {code, 128, code};
  }));
  const auto blurred = textures_.color(texture, 0.3F, 0.3F, 0.1F);
  EXPECT_NEAR(blurred.x(), 0.5, 0.01);
  EXPECT_NEAR(blurred.y(), linear_from_srgb(128 / 255.0), 1e-3);
  // Also halfway between two texels.
  EXPECT_NEAR(textures_.color(texture, 1.0F / 256, 1 - 0.5F / 256, 0).x(), 0.5, 0.01);
}

TEST_F(TextureFiles, AroundIsLatitudeByLongitude) {
  const auto texture = textures_.open(write_exr(
      256, 128, [](int x, int y) { return Imf::Rgba((x + 0.5F) / 256, (y + 0.5F) / 128, 1); }));
  const auto seen = [&](double x, double y, double z) {
    return textures_.environment_color(texture, Eigen::Vector3d(x, y, z).normalized(), 0);
  };
  EXPECT_NEAR(seen(0, 0, -1).x(), 0.5, 0.01);
  EXPECT_NEAR(seen(0, 0, -1).y(), 0.5, 0.01);
  EXPECT_NEAR(seen(1, 0, 0).x(), 0.75, 0.01);
  EXPECT_NEAR(seen(-1, 0, 0).x(), 0.25, 0.01);
  EXPECT_NEAR(seen(0, 1, -1e-3).y(), 0, 0.01);
  EXPECT_NEAR(seen(0, -1, -1e-3).y(), 1, 0.01);
  EXPECT_NEAR(seen(0, 1, -1).y(), 0.25, 0.01);
}

TEST_F(TextureFiles, ColourASurface) {
  using testing::make_material;
  const auto texture = textures_.open(write_ppm(64, 64, [](int x, int) -> Code {
    return x < 32 ? Code{255, 0, 0} : Code{0, 0, 255};
  }));
  const EmbreeMesh scene(testing::square(1, make_material(Material::Kind::kDiffuse, 0.5F)),
                         "square");
  const std::array<Textures::Handle, 1> of_materials{texture};
  GeometryScene geometry{{testing::make_instance(scene, {0, 0, -4})}, &textures_, {}};
  geometry.meshes[0].textures = of_materials;
  geometry.lights.ambient.setOnes();
  const LayerImage image =
      render_geometry(geometry, 0, render::virtual_camera_with_fov(40, 40, 0.5, rig::Pose{}), 4);
  const auto* left = &image.rgba[4 * (20 * 40 + 15)];
  const auto* right = &image.rgba[4 * (20 * 40 + 25)];
  EXPECT_NEAR(left[0], 0.5, 1e-3);
  EXPECT_NEAR(left[2], 0, 1e-3);
  EXPECT_NEAR(right[0], 0, 1e-3);
  EXPECT_NEAR(right[2], 0.5, 1e-3);
  EXPECT_NEAR(image.aovs[2].values[3 * (20 * 40 + 15)], 0.5, 1e-3);
}

TEST_F(TextureFiles, SayWhatIsWrong) {
  const auto refusal = [&](const std::filesystem::path& file) -> std::string {
    try {
      textures_.open(file);
    } catch (const Error& error) {
      return error.what();
    }
    return "none";
  };
  EXPECT_THAT(refusal(folder_.path() / "none.png"), HasSubstr("the texture file does not exist"));
  std::ofstream(folder_.path() / "text.png") << "hello";
  EXPECT_THAT(refusal(folder_.path() / "text.png"), HasSubstr("cannot be read"));
}

}  // namespace
}  // namespace raystage::compose
