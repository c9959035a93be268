// SPDX-License-Identifier: Apache-2.0
// A copy of a shot elsewhere, whose paths are relative to the folder of the original.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "base/atomic_file.h"
#include "testing/compose/sequence_test_data.h"

namespace raystage::compose {
namespace {

using ::testing::HasSubstr;

/// A take, plate, mesh, camera file and colour config next to a shot, with a copy of the shot in
/// another folder, as in a job's snapshot.
class RelativeShot : public testing::SequenceTest {
 protected:
  void SetUp() override {
    SequenceTest::SetUp();
    const std::filesystem::path folder = folder_.path();
    std::ofstream(folder / "square.obj")
        << "o sign\nv -0.2 -0.2 0\nv 0.2 -0.2 0\nv 0.2 0.2 0\nv -0.2 0.2 0\nf 1 2 3 4\n";
    std::ofstream chan(folder / "move.chan");
    for (int frame = 101; frame <= 106; ++frame) {
      chan << frame << "\t0.03\t-0.03\t0\t0\t0\t0\t30\n";
    }
    std::ofstream(folder / "studio.ocio")
        << "ocio_profile_version: 1\nroles:\n  default: lin_rec709_scene\n"
           "displays: {screen: [!<View> {name: raw, colorspace: lin_rec709_scene}]}\n"
           "colorspaces:\n  - !<ColorSpace> {name: lin_rec709_scene}\n";
    options_.frames = {101, 102};
    const std::string output = options_.output;
    options_.output = (folder / "plate.####.exr").string();
    run();
    options_.output = output;
    schemas::ShotDocument::Layer square, plate;
    square.name = "square";
    square.geometry = schemas::ShotDocument::Geometry{
        .file = "square.obj", .keys = {{.frame = 101, .position = {{0.03, -0.03, -2}}}}};
    plate.plate = schemas::ShotDocument::Plate{.file = "plate.####.exr"};
    plate.opacity = 0.5;
    shot_.layers.insert(shot_.layers.end(), {square, plate});
    shot_.lights = {{.ambient = {{0.5, 0.9, 0.2}}}};
    shot_.camera = {};
    shot_.camera.file = schemas::ShotDocument::CameraFile{.path = "move.chan"};
    shot_.output.color.config = "studio.ocio";
    create_folder(snapshot().parent_path());
  }
  std::filesystem::path snapshot() const { return folder_.path() / "jobs" / "17" / "frozen.json"; }
  SequenceReport run_snapshot() {
    schemas::write_shot(shot_, snapshot());
    options_.folder = folder_.path();
    return render_sequence(snapshot(), options_, {});
  }
};

TEST_F(RelativeShot, HasTheSameFingerprintsAndBytes) {
  ASSERT_EQ(run().rendered, 2);
  options_.existing = ExistingFiles::kSkip;
  EXPECT_EQ(run_snapshot().skipped, 2);
  std::vector<std::string> original{read_file(file(101)), read_file(file(102))};
  options_.existing = ExistingFiles::kOverwrite;
  ASSERT_EQ(run_snapshot().rendered, 2);
  EXPECT_TRUE(read_file(file(101)) == original[0]);
  EXPECT_TRUE(read_file(file(102)) == original[1]);
}

TEST_F(RelativeShot, WithoutTheFolderNothingIsFound) {
  schemas::write_shot(shot_, snapshot());
  EXPECT_THROW(render_sequence(snapshot(), options_, {}), Error);
}

TEST_F(RelativeShot, ErrorsNameTheCopy) {
  shot_.layers[1].geometry->file = "none.obj";
  try {
    run_snapshot();
    FAIL() << "a mesh that is not there was rendered";
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
    EXPECT_THAT(error.what(), HasSubstr("none.obj"));
  }
  shot_.layers[1].geometry->file = "square.obj";
  shot_.layers[0].method = "no such";
  try {
    run_snapshot();
    FAIL() << "a method that there is not rendered";
  } catch (const Error& error) {
    EXPECT_THAT(error.where(), HasSubstr(snapshot().string()));
  }
}

TEST_F(RelativeShot, WithoutOutputFilesGoBesideTheCopy) {
  options_.output = "";
  ASSERT_EQ(run_snapshot().rendered, 2);
  EXPECT_TRUE(std::filesystem::exists(snapshot().parent_path() / "renders" / "sh.0101.exr"));
}

}  // namespace
}  // namespace raystage::compose
