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
#include "images/exr_reader.h"
#include "testing/compose/sequence_test_data.h"
#include "testing/render/synthetic_take.h"
#include "testing/render/test_depth.h"

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

/// Compares a deep file, flattened by OpenImageIO, with the picture of the flat file, and returns
/// the numbers of samples of pixels.
std::set<int> compare_flattened(const ExrImage& ours, const OIIO::ImageBuf& deep) {
  const OIIO::ImageBuf flat = OIIO::ImageBufAlgo::flatten(deep);
  EXPECT_FALSE(flat.has_error()) << flat.geterror();
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
  return counts;
}

TEST_F(DeepSequence, FlattensToOurPictureInAnotherReader) {
  ASSERT_EQ(run().rendered, 1);
  const OIIO::ImageBuf deep(SequenceName(options_.output).with("deep").path(101).string());
  ASSERT_TRUE(deep.deep()) << deep.geterror();
  EXPECT_GE(compare_flattened(read_exr(file(101)), deep).size(), 3U)
      << "pixels with few samples, and with many";
}

// A wall at 2.5 m covers a part of the pixels at its edge. A sheet at 3.5 m is seen behind that
// part, and hides what is behind the wall.
TEST_F(DeepSequence, HasASampleOfEachSurfaceAtAnEdge) {
  testing::SyntheticTake settings;
  settings.cameras = testing::camera_grid(3, 3, 0.15, 160, 120);
  settings.scene = testing::step_scene;
  settings.depth_range = schemas::DepthRange{2.2, 7};
  testing::write_synthetic_take(settings, folder_.path() / "steps");
  store::write_timeline(store::build_timeline(store::Take(folder_.path() / "steps"), 15, 0),
                        folder_.path() / "steps");
  std::ofstream(folder_.path() / "sheet.obj")
      << "o sheet\nv -9 -9 0\nv 9 -9 0\nv 9 9 0\nv -9 9 0\nf 1 2 3 4\n";
  shot_.layers[2].geometry->file = "sheet.obj";
  shot_.layers[2].geometry->keys = {{.frame = 101, .position = {{0, 0, -3.5}}}};
  shot_.layers[1].take = "steps";
  shot_.layers[1].method = "depth";
  shot_.layers[1].opacity = 1;
  shot_.layers.pop_back();  // the glass
  shot_.camera.keys = {testing::camera_key(101, {0.02, 0.013, 0.03}, 40)};
  shot_.width = 100;  // as fine as the cameras
  shot_.height = 75;
  ASSERT_EQ(run().rendered, 1);
  const ExrImage ours = read_exr(file(101));
  const OIIO::ImageBuf deep(SequenceName(options_.output).with("deep").path(101).string());
  compare_flattened(ours, deep);
  const int alpha = deep.spec().channelindex("A"), depth = deep.spec().channelindex("Z");
  const images::ExrChannel z_channel[] = {{"Z"}};
  const std::vector<float> flat_z = images::read_exr_channels(file(101), z_channel, "").values;
  int edges = 0;
  for (int y = 0; y < ours.height; ++y) {
    for (int x = 0; x < ours.width; ++x) {
      // The wall and the sheet, which hides all else.
      const float share = deep.deep_value(x, y, 0, alpha, 0);
      if (deep.deep_samples(x, y) < 2 || deep.deep_value(x, y, 0, depth, 0) > 3) continue;
      if (share > 0.9F) continue;
      ++edges;
      EXPECT_GT(share, 0);
      EXPECT_NEAR(deep.deep_value(x, y, 0, depth, 1), 3.5, 0.1);
      EXPECT_EQ(deep.deep_samples(x, y), 2);
      const auto pixel = static_cast<std::size_t>(y * ours.width + x);
      EXPECT_NEAR(flat_z[pixel], deep.deep_value(x, y, 0, depth, share >= 0.5F ? 0 : 1), 1e-3);
    }
  }
  EXPECT_GT(edges, 10);
}

}  // namespace
}  // namespace raystage::compose
