// SPDX-License-Identifier: Apache-2.0
#include "compose/draft_shot.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace raystage::compose {
namespace {

using schemas::ShotDocument;
using ::testing::HasSubstr;

ShotDocument shot_of_layers() {
  ShotDocument shot;
  shot.width = 1921;
  shot.height = 1080;
  shot.output.overscan = {40, 3};
  shot.layers.resize(3);
  shot.layers[0].name = "stage";
  shot.layers[0].take = "take";
  shot.layers[0].method = "plane_sweep";
  shot.layers[0].options = {{"near", 2.0}, {"planes", 64.0}};
  shot.layers[1].geometry = ShotDocument::Geometry{.file = "ball.glb"};
  shot.layers[2].name = "actor";
  shot.layers[2].take = "actor";
  shot.layers[2].method = "depth";
  return shot;
}

std::string refusal(const DraftOptions& draft) {
  try {
    draft_of_shot(shot_of_layers(), draft, "shot.json");
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
    return error.what();
  }
  return "none";
}

TEST(DraftShot, WithoutOptionsItIsTheShot) {
  EXPECT_FALSE(DraftOptions{}.is_draft());
  EXPECT_EQ(schemas::format_shot(draft_of_shot(shot_of_layers(), {}, "")),
            schemas::format_shot(shot_of_layers()));
}

TEST(DraftShot, ScalesThePictureAndItsOverscan) {
  const ShotDocument draft = draft_of_shot(shot_of_layers(), {.scale = 0.25}, "");
  EXPECT_EQ(draft.width, 480);
  EXPECT_EQ(draft.height, 270);
  EXPECT_EQ(draft.output.overscan, (std::array{10, 1}));
  EXPECT_EQ(draft_of_shot(shot_of_layers(), {.scale = 1e-9}, "").width, 1);
}

TEST(DraftShot, AnotherMethodKeepsTheDepthRangeOnly) {
  const ShotDocument draft =
      draft_of_shot(shot_of_layers(), {.method = "depth", .options = {{"temporal", true}}}, "");
  EXPECT_EQ(draft.layers[0].method, "depth");
  EXPECT_EQ(draft.layers[0].options, (schemas::OptionValues{{"near", 2.0}, {"temporal", true}}));
  EXPECT_EQ(draft.layers[2].options, (schemas::OptionValues{{"temporal", true}}));
  const ShotDocument options = draft_of_shot(shot_of_layers(), {.options = {{"planes", 8.0}}}, "");
  EXPECT_EQ(options.layers[0].method, "plane_sweep");
  EXPECT_EQ(options.layers[0].options, (schemas::OptionValues{{"near", 2.0}, {"planes", 8.0}}));
}

TEST(DraftShot, ShowsTheSelectedLayers) {
  const ShotDocument draft = draft_of_shot(shot_of_layers(), {.layers = {"actor", "1"}}, "");
  EXPECT_EQ(draft.layers[0].opacity, 0);
  EXPECT_EQ(draft.layers[1].opacity, 1);
  EXPECT_EQ(draft.layers[2].opacity, 1);
  EXPECT_THAT(refusal({.layers = {"Actor"}}), HasSubstr("the shot has no layer \"Actor\""));
  EXPECT_THAT(refusal({.layers = {"3"}}), HasSubstr("from 0, or by its name: stage, actor"));
}

TEST(DraftShot, RefusesOtherScales) {
  EXPECT_EQ(parse_scale("1/4"), 0.25);
  EXPECT_EQ(parse_scale("0.5"), 0.5);
  EXPECT_EQ(parse_scale("1"), 1);
  for (const char* text : {"", "0", "2", "-1", "1/0", "4/1", "/", "a", "nan", "1/4/2"}) {
    EXPECT_THROW(parse_scale(text), Error) << text;
  }
  EXPECT_THAT(refusal({.scale = 1.5}), HasSubstr("the scale is 1.5"));
}

}  // namespace
}  // namespace raystage::compose
