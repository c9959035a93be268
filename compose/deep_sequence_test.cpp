// SPDX-License-Identifier: Apache-2.0
// Compares rendered deep files, flattened by OpenImageIO, with our flat files.
#include <OpenImageIO/imagebuf.h>
#include <OpenImageIO/imagebufalgo.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <set>

#include "compose/exr/exr_file.h"
#include "compose/sequence_name.h"
#include "testing/compose/sequence_test_data.h"

namespace raystage::compose {
namespace {

class DeepSequence : public testing::SequenceTest {
 protected:
  /// Makes a light field 3 m away, a mesh partly in front of it, and glass in front of both.
  void SetUp() override {
    SequenceTest::SetUp();
    std::ofstream(folder_.path() / "slant.obj")
        << "o slant\nv -0.6 -0.4 0.5\nv 0.6 -0.5 -0.7\nv 0.5 0.5 -0.6\nv -0.5 0.6 0.6\nf 1 2 3 4\n";
    schemas::ShotDocument::Layer mesh;
    mesh.name = "slant";
    mesh.geometry = schemas::ShotDocument::Geometry{
        .file = "slant.obj",
        .material = schemas::ShotDocument::Material{.color = {{0.9, 0.4, 0.1}}},
        .keys = {{.frame = 101, .position = {{0.03, -0.03, -3}}}},
        .samples = 9};
    schemas::ShotDocument::Layer glass;
    glass.solid = schemas::ShotDocument::Solid{{0.1, 0.3, 0.2}, 0.25, 1};
    glass.clips = {{.screen = {.left = 0.3}, .feather = 0.2}};
    schemas::ShotDocument::Layer far;
    far.solid = schemas::ShotDocument::Solid{{0.2, 0.2, 0.8}, 0.5, 9};
    shot_.layers.push_back(mesh);
    shot_.layers.push_back(glass);
    shot_.layers.insert(shot_.layers.begin(), far);
    shot_.layers[1].opacity = 0.9;
    shot_.lights = {{.ambient = {{0.5, 0.5, 0.5}}}, {.direction = {{-0.3, -0.5, -1}}}};
    shot_.merge = schemas::ShotDocument::Merge::kDepth;
    options_.frames = {101};
    options_.deep = true;
  }
};

TEST_F(DeepSequence, FlattensToOurPictureInAnotherReader) {
  ASSERT_EQ(run().rendered, 1);
  const ExrImage ours = read_exr(file(101));
  const OIIO::ImageBuf deep(SequenceName(options_.output).with("deep").path(101).string());
  ASSERT_TRUE(deep.deep()) << deep.geterror();
  const OIIO::ImageBuf flat = OIIO::ImageBufAlgo::flatten(deep);
  ASSERT_FALSE(flat.has_error()) << flat.geterror();
  const int channels[] = {flat.spec().channelindex("R"), flat.spec().channelindex("G"),
                          flat.spec().channelindex("B"), flat.spec().channelindex("A")};
  std::set<int> counts;
  float worst = 0;
  for (int y = 0; y < ours.height; ++y) {
    for (int x = 0; x < ours.width; ++x) {
      counts.insert(deep.deep_samples(x, y));
      const std::size_t pixel = static_cast<std::size_t>(y * ours.width + x);
      for (std::size_t c = 0; c < 4; ++c) {
        const float seen = flat.getchannel(x, y, 0, channels[c]);
        worst = std::max(worst, std::abs(seen - ours.rgba[4 * pixel + c]));
      }
    }
  }
  EXPECT_LT(worst, 1e-3F);  // halves
  EXPECT_GE(counts.size(), 3U) << "pixels with few samples, and with many";
}

}  // namespace
}  // namespace raystage::compose
