// SPDX-License-Identifier: Apache-2.0
// Reads rendered frames by FFmpeg and OpenImageIO, and compares the pixels with those that OpenEXR
// reads.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <vector>

#include "images/exr_reader.h"
#include "testing/test_folder.h"
#include "tests/end_to_end/run_command.h"

namespace raystage {
namespace {

using testing::CommandResult;
using testing::run;

struct Written {
  const char* compression;
  const char* layout;
};

/// Renders a mesh in front of a light field, with all AOVs.
class ExrReaders : public ::testing::TestWithParam<Written> {
 protected:
  void SetUp() override {
    const CommandResult made = here(
        "raystage simulate stage -q --rows 2 --columns 2 --width 96 --height 72 --fps 10 "
        "--seconds 1.2 --truth-views 0 -o take && raystage sync -q take");
    ASSERT_EQ(made.exit_code, 0) << made.err;
    testing::write_text(folder_.path() / "plane.obj",
                        "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nf 1 2 3 4\n");
    testing::write_text(folder_.path() / "shot.json", std::string(R"({
"schema": "raystage/shot/3", "name": "s", "width": 101, "height": 67, "fps": 24,
"first_frame": 1, "last_frame": 1,
"camera": {"keys": [{"frame": 1, "position": [0, 0, 0], "horizontal_fov_deg": 50}]},
"layers": [{"take": "take", "method": "focal_plane", "focal_plane": {"depth_m": 4}},
           {"geometry": {"file": "plane.obj",
                         "keys": [{"frame": 1, "position": [0.3, 0, -3], "scale": 0.4}]}}],
"output": {"compression": ")") + GetParam().compression + R"(", "layout": ")" +
                                                          GetParam().layout + "\"}}");
    const CommandResult rendered = here("raystage render -q shot.json -o f.####.exr");
    ASSERT_TRUE(rendered.exit_code == 0 || rendered.exit_code == 4) << rendered.err;
  }
  CommandResult here(const std::string& command) const {
    return run("cd '" + folder_.path().string() + "' && " + command);
  }
  /// Returns channels as OpenEXR reads them.
  std::vector<float> channels(const std::string& file,
                              std::vector<images::ExrChannel> names) const {
    return images::read_exr_channels(folder_.path() / file, names, "").values;
  }
  testing::TestFolder folder_;
};

TEST_P(ExrReaders, FFmpegDecodesThePicture) {
  if (run("ffmpeg -version").exit_code != 0) GTEST_SKIP() << "there is no ffmpeg";
  const CommandResult decoded =
      here("ffmpeg -v error -i f.0001.exr -f rawvideo -pix_fmt gbrapf32le pixels");
  ASSERT_EQ(decoded.exit_code, 0) << decoded.err;
  EXPECT_EQ(decoded.err, "");
  const std::string bytes = testing::read_text(folder_.path() / "pixels");
  const std::vector<float> expected = channels("f.0001.exr", {{"G"}, {"B"}, {"R"}, {"A"}});
  ASSERT_EQ(bytes.size(), expected.size() * sizeof(float));
  std::vector<float> planes(expected.size());
  std::memcpy(planes.data(), bytes.data(), bytes.size());
  const std::size_t pixels = expected.size() / 4;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    ASSERT_EQ(planes[i % 4 * pixels + i / 4], expected[i]) << "value " << i;
  }
}

TEST_P(ExrReaders, OpenImageIoDecodesEveryPart) {
  if (run("oiiotool --version").exit_code != 0) GTEST_SKIP() << "there is no oiiotool";
  const CommandResult copied = here("oiiotool -a f.0001.exr --compression none -o copy.exr");
  ASSERT_EQ(copied.exit_code, 0) << copied.err;
  for (const char* name : {"R", "G", "B", "A", "Z", "P.X", "P.Y", "P.Z", "N.X", "N.Y", "N.Z",
                           "albedo.R", "albedo.G", "albedo.B", "coverage.V"}) {
    EXPECT_EQ(channels("copy.exr", {{name}}), channels("f.0001.exr", {{name}})) << name;
  }
}

INSTANTIATE_TEST_SUITE_P(Files, ExrReaders,
                         ::testing::Values(Written{"zip", "standard"}, Written{"zips", "standard"},
                                           Written{"zip", "single"}, Written{"none", "single"},
                                           Written{"piz", "standard"}),
                         [](const auto& written) {
                           return std::string(written.param.compression) + "_" +
                                  written.param.layout;
                         });

}  // namespace
}  // namespace raystage
