// SPDX-License-Identifier: Apache-2.0
// Which existing files are rendered again.
#include <OpenEXR/ImfInputFile.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <OpenEXR/ImfStringVectorAttribute.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "compose/exr/exr_file.h"
#include "schemas/rig_document.h"
#include "testing/compose/sequence_test_data.h"

namespace raystage::compose {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;

class SequenceExisting : public testing::SequenceTest {};

TEST_F(SequenceExisting, ExistingFilesStopTheRunUnlessToldOtherwise) {
  options_.frames = {101, 102};
  run();
  const auto time = std::filesystem::last_write_time(file(101));
  EXPECT_THAT(refusal(), HasSubstr("2 of 2 frames exist already (101-102)"));
  options_.existing = ExistingFiles::kSkip;
  const SequenceReport report = run();
  EXPECT_EQ(report.skipped, 2);
  EXPECT_EQ(report.rendered, 0);
  EXPECT_EQ(report.exit_code(), ExitCode::kSuccess);
  EXPECT_EQ(std::filesystem::last_write_time(file(101)), time);
  options_.existing = ExistingFiles::kOverwrite;
  EXPECT_EQ(run().rendered, 2);
}

TEST_F(SequenceExisting, SkipTrustsOnlyWholeFilesOfTheSameInputs) {
  run();
  options_.existing = ExistingFiles::kSkip;
  // A truncated copy.
  std::filesystem::resize_file(file(103), std::filesystem::file_size(file(103)) - 7);
  EXPECT_EQ(run().rendered, 1);
  // A change of the last key changes all frames but the first.
  (*shot_.camera.keys[1].position)[0] += 0.001;
  EXPECT_EQ(run().rendered, 5);
  shot_.layers[0].focal_plane = {schemas::ShotDocument::FocalPlane::Kind::kDepth, 3.5, {}};
  EXPECT_EQ(run().rendered, 6);
  options_.chromaticities = true;
  EXPECT_EQ(run().rendered, 6);
  // Another calibration.
  const auto rig = folder_.path() / "take" / "rig.json";
  schemas::RigDocument document = schemas::read_rig(rig);
  document.cameras[0].photometric.contrast[0] = 1.1;
  schemas::write_rig(document, rig);
  EXPECT_EQ(run().rendered, 6);
  EXPECT_EQ(run().skipped, 6);
  // A new resynchronisation with the same result changes nothing.
  const store::Take take(folder_.path() / "take");
  store::write_timeline(store::build_timeline(take, 10, 0), take.folder());
  EXPECT_EQ(run().skipped, 6);
}

TEST_F(SequenceExisting, SkipSurvivesAMoveOfTheProject) {
  run();
  const testing::TestFolder other;
  std::filesystem::copy(folder_.path(), other.path(), std::filesystem::copy_options::recursive);
  options_.output = (other.path() / "out" / "a.####.exr").string();
  options_.existing = ExistingFiles::kSkip;
  EXPECT_EQ(render_sequence(other.path() / "shot.json", options_, {}).skipped, 6);
}

TEST_F(SequenceExisting, FillColoursWhatNobodySawAndTheFingerprintKnows) {
  for (auto& key : shot_.camera.keys) (*key.position)[2] = 0.5;  // sees beyond the array
  options_.frames = {101};
  const auto transparent = [&] {
    const ExrImage image = read_exr(file(101));
    int count = 0;
    for (std::size_t i = 3; i < image.rgba.size(); i += 4) count += image.rgba[i] < 1 ? 1 : 0;
    return count;
  };
  run();
  EXPECT_GT(transparent(), 100);
  options_.existing = ExistingFiles::kSkip;
  options_.fill = schemas::HoleFill::kPushPull;
  EXPECT_EQ(run().rendered, 1);
  EXPECT_EQ(transparent(), 0);
  EXPECT_NEAR(read_exr(file(101)).rgba[0], grey(0), 0.005F);
  options_.fill.reset();
  shot_.layers[0].fill = schemas::HoleFill::kPushPull;
  EXPECT_EQ(run().skipped, 1);
}

TEST_F(SequenceExisting, ATargetTakesTheMethodsPlaceAndTheFileSaysWhatWasChosen) {
  options_.frames = {101};
  options_.target = {{"target_error", 20.0}};
  run();
  const Imf::InputFile input(file(101).c_str());
  const Imf::Header& header = input.header();
  EXPECT_EQ(header.typedAttribute<Imf::StringAttribute>("lf:method").value(), "auto");
  EXPECT_EQ(header.typedAttribute<Imf::StringAttribute>("lf:methodOptions").value(),
            "target_error=20");
  const auto notes = header.typedAttribute<Imf::StringVectorAttribute>("lf:notes").value();
  EXPECT_THAT(notes, Contains(HasSubstr("auto: ")));
  options_.existing = ExistingFiles::kSkip;
  EXPECT_EQ(run().skipped, 1);
  options_.target["target_error"] = 21.0;
  EXPECT_EQ(run().rendered, 1);
}

}  // namespace
}  // namespace raystage::compose
