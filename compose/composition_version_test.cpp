// SPDX-License-Identifier: Apache-2.0
// Pixels that kReconstructionVersion covers: meshes, lights, shadows, textures, merging.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "images/exr_reader.h"
#include "testing/compose/sequence_test_data.h"

namespace raystage::compose {
namespace {

class CompositionVersion : public testing::SequenceTest {
 protected:
  void write_files() const {
    std::ofstream picture(folder_.path() / "checks.ppm", std::ios::binary);
    picture << "P6 64 64 255\n";
    for (int i = 0; i < 64 * 64; ++i) {
      const bool dark = (i % 64 / 8 + i / 64 / 8) % 2 == 0;
      for (const int code : {dark ? 40 : 220, dark ? 90 : 200, 150}) {
        picture.put(static_cast<char>(code));
      }
    }
    std::ofstream(folder_.path() / "slant.obj")
        << "o slant\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nv -0.5 -0.5 0.3\nv 0.5 -0.5 -0.3\n"
           "v 0.5 0.5 -0.3\nv -0.5 0.5 0.3\nf 1/1 2/2 3/3 4/4\n";
  }
  static schemas::ShotDocument::Layer mesh(const schemas::ShotDocument::Material& material,
                                           double x, double z) {
    schemas::ShotDocument::Layer layer;
    layer.geometry =
        schemas::ShotDocument::Geometry{.file = "slant.obj",
                                        .material = material,
                                        .keys = {{.frame = 101, .position = {{x, 0, z}}}},
                                        .samples = 4};
    return layer;
  }
};

TEST_F(CompositionVersion, FourteenHasThesePixels) {
  static_assert(kReconstructionVersion == 14);
  write_files();
  shot_.layers[0].name = "wall";
  shot_.layers[0].shadows = schemas::ShotDocument::ReceivedShadows{};
  shot_.layers.push_back(mesh({.kind = "diffuse", .texture = "checks.ppm"}, -0.2, -2.2));
  shot_.layers.push_back(mesh({.kind = "glossy", .color = {{0.9, 0.7, 0.5}}}, 0.5, -2.4));
  schemas::ShotDocument::Layer glass;
  glass.solid = schemas::ShotDocument::Solid{{0.1, 0.3, 0.2}, 0.25, 2.3};
  glass.clips = {{.screen = {.left = 0.4}, .feather = 0.3}};
  shot_.layers.push_back(glass);
  shot_.merge = schemas::ShotDocument::Merge::kDepth;
  shot_.lights = {{.ambient = {{0.4, 0.5, 0.6}}},
                  {.direction = {{-0.4, -0.6, -1}}, .color = {1.2, 1.1, 0.9}},
                  {.light_field = "wall", .rays = 4}};
  options_.frames = {101};
  ASSERT_EQ(run().rendered, 1);
  constexpr images::ExrChannel kChannels[] = {{"R"}, {"G"}, {"B"}, {"A"}};
  constexpr images::ExrChannel kZ[] = {{"Z"}};
  const std::vector<float> rgba = images::read_exr_channels(file(101), kChannels, "").values;
  std::array<double, 6> found{};  // means of R, G, B, A, steps of G from pixel to pixel, 1 / Z
  for (std::size_t i = 0; i < rgba.size(); ++i) found[i % 4] += double{rgba[i]};
  for (std::size_t i = 5; i < rgba.size(); i += 4) {
    found[4] += std::abs(double{rgba[i]} - double{rgba[i - 4]});
  }
  for (const float z : images::read_exr_channels(file(101), kZ, "").values)
    found[5] += 1 / double{z};
  for (double& sum : found) sum /= static_cast<double>(rgba.size()) / 4;
  constexpr std::array<double, 6> kKnown{0.25879, 0.26489, 0.22110, 1, 0.05168, 0.43342};
  for (std::size_t i = 0; i < found.size(); ++i) {
    EXPECT_NEAR(found[i], kKnown[i], 1e-4) << i << fmt::format(": {:.5f}", fmt::join(found, ", "));
  }
}

}  // namespace
}  // namespace raystage::compose
