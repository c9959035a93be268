// SPDX-License-Identifier: Apache-2.0
#include "compose/frame_range.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <algorithm>
#include <set>

#include "base/error.h"
#include "compose/sequence_name.h"

namespace raystage::compose {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::string refusal(std::string_view text) {
  try {
    parse_frame_range(text);
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
    return error.what();
  }
  ADD_FAILURE() << text << " was accepted";
  return "";
}

TEST(FrameRange, ReadsFramesRangesAndSteps) {
  EXPECT_THAT(parse_frame_range("7"), ElementsAre(7));
  EXPECT_THAT(parse_frame_range("1-4"), ElementsAre(1, 2, 3, 4));
  EXPECT_THAT(parse_frame_range("1-8x3"), ElementsAre(1, 4, 7));
  EXPECT_THAT(parse_frame_range("1,5,10-15x2"), ElementsAre(1, 5, 10, 12, 14));
  EXPECT_THAT(parse_frame_range(" 1 , 3-4 "), ElementsAre(1, 3, 4));
  EXPECT_THAT(parse_frame_range("5-5x9"), ElementsAre(5));
}

TEST(FrameRange, ReadsNegativeFrames) {
  EXPECT_THAT(parse_frame_range("-5--1"), ElementsAre(-5, -4, -3, -2, -1));
  EXPECT_THAT(parse_frame_range("-2-2x2"), ElementsAre(-2, 0, 2));
  EXPECT_THAT(parse_frame_range("-3"), ElementsAre(-3));
}

TEST(FrameRange, SortsAndMerges) {
  EXPECT_THAT(parse_frame_range("5-7,1,6,5-6"), ElementsAre(1, 5, 6, 7));
}

TEST(FrameRange, IsCountedWithoutAList) {
  EXPECT_EQ(frame_range_size("7"), 1);
  EXPECT_EQ(frame_range_size("1,5,10-15x2"), 5);
  EXPECT_EQ(frame_range_size("5-7,6"), 4) << "duplicates count twice";
  EXPECT_EQ(frame_range_size("1-99999999x100"), 1'000'000);
  EXPECT_THROW(frame_range_size("1-99999999"), Error);
  EXPECT_THROW(frame_range_size("1-"), Error);
}

TEST(FrameRange, RefusesTheAmbiguousColonAndSaysWhy) {
  const std::string message = refusal("1-10:5");
  EXPECT_THAT(message, HasSubstr("two different things"));
  EXPECT_THAT(message, HasSubstr("@4"));
  EXPECT_THAT(message, HasSubstr("1-48x2"));
}

TEST(FrameRange, RefusesWhatIsNoRange) {
  for (const char* text : {"", ",", "1,", "1-", "a", "1-4x", "1-4x0", "1-4x-2", "4-1", "1-10y3",
                           "1 2", "1.5", "1--", "99999999999999999999", "1-99999999", "--1"}) {
    EXPECT_NE(refusal(text), "") << text;
  }
}

TEST(FrameRange, FormattedTextReadsBackToTheSameFrames) {
  EXPECT_EQ(format_frame_range(parse_frame_range("1-48")), "1-48");
  EXPECT_EQ(format_frame_range(parse_frame_range("1-9x2,20")), "1-9x2,20");
  EXPECT_EQ(format_frame_range(parse_frame_range("-5--1")), "-5--1");
  EXPECT_EQ(format_frame_range(parse_frame_range("1,5")), "1,5");
  EXPECT_TRUE(rc::check("round trip", [] {
    const auto set = *rc::gen::container<std::set<int>>(rc::gen::inRange(-40, 60));
    const std::vector<int> frames(set.begin(), set.end());
    RC_PRE(!frames.empty());
    RC_ASSERT(parse_frame_range(format_frame_range(frames)) == frames);
  }));
}

TEST(SequenceName, KnowsTheTokensOfTheTrade) {
  EXPECT_EQ(SequenceName("out/a.####.exr").path(7), "out/a.0007.exr");
  EXPECT_EQ(SequenceName("a.#.exr").path(7), "a.0007.exr");
  EXPECT_EQ(SequenceName("a.##.exr").path(7), "a.07.exr");
  EXPECT_EQ(SequenceName("a.@@@.exr").path(7), "a.007.exr");
  EXPECT_EQ(SequenceName("a.@.exr").path(7), "a.7.exr");
  EXPECT_EQ(SequenceName("a.%04d.exr").path(7), "a.0007.exr");
  EXPECT_EQ(SequenceName("a.%d.exr").path(1234567), "a.1234567.exr");
  EXPECT_EQ(SequenceName("a.####.exr").path(-5), "a.-005.exr");
  EXPECT_EQ(SequenceName("a.####.exr").path(123456), "a.123456.exr");
  EXPECT_EQ(SequenceName("my@home/a.####.exr").path(1), "my@home/a.0001.exr");
}

TEST(SequenceName, OneFrameNeedsNoToken) {
  const SequenceName name("still.exr");
  EXPECT_FALSE(name.has_frame_token());
  EXPECT_EQ(name.path(9), "still.exr");
  EXPECT_EQ(name.folder(), ".");
}

TEST(SequenceName, FindsTheFrameOfAFile) {
  const SequenceName name("x/a.####.exr");
  EXPECT_EQ(name.frame_from_file_name("a.0012.exr"), 12);
  EXPECT_EQ(name.frame_from_file_name("a.-012.exr"), -12);
  EXPECT_EQ(name.frame_from_file_name("a.12345.exr"), 12345);
  EXPECT_EQ(name.frame_from_file_name("a.12.exr"), std::nullopt) << "padding differs";
  EXPECT_EQ(name.frame_from_file_name("b.0012.exr"), std::nullopt);
  EXPECT_EQ(name.frame_from_file_name("a.00x2.exr"), std::nullopt);
  EXPECT_EQ(name.frame_from_file_name("a..exr"), std::nullopt);
  EXPECT_TRUE(rc::check("path and frame_of are inverse", [] {
    const int frame = *rc::gen::inRange(-99999, 99999);
    const int padding = *rc::gen::inRange(2, 8);
    const SequenceName other("d/s." + std::string(static_cast<std::size_t>(padding), '#') + ".exr");
    RC_ASSERT(other.frame_from_file_name(other.path(frame).filename().string()) == frame);
  }));
}

TEST(SequenceName, HasOthersBesideIt) {
  EXPECT_EQ(SequenceName("x/a.####.exr").with("deep").path(7), "x/a.deep.0007.exr");
  EXPECT_EQ(SequenceName("x/a.%03d.exr").with("deep").path(7), "x/a.deep.007.exr");
  EXPECT_EQ(SequenceName("x/a_@@.exr").with("deep").path(7), "x/a_deep.07.exr");
  EXPECT_EQ(SequenceName("x.y/a.exr").with("deep").path(7), "x.y/a.deep.exr");
  EXPECT_EQ(SequenceName("x/a.####.exr").with("deep").frame_from_file_name("a.0007.exr"),
            std::nullopt);
}

TEST(SequenceName, RefusesTwoPlacesAndUnknownTokens) {
  EXPECT_THROW(SequenceName("a.####.@@.exr"), Error);
  EXPECT_THROW(SequenceName("a.%V.####.exr"), Error);
  EXPECT_THROW(SequenceName("a.%4d.exr"), Error);
  EXPECT_THROW(SequenceName("a.%"), Error);
  EXPECT_THROW(SequenceName("shot.####/a.exr"), Error);
  EXPECT_THROW(SequenceName("out/"), Error);
  EXPECT_THROW(SequenceName(""), Error);
}

}  // namespace
}  // namespace raystage::compose
