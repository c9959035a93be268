// SPDX-License-Identifier: Apache-2.0
#include "farm/render_log_parser.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "compose/sequence.h"
#include "store/rotten_frame.h"

namespace raystage::farm {
namespace {

TEST(RenderLogParser, ReadsWhatTheRendererReports) {
  compose::SequenceReport report;
  report.requested = 12;
  report.rendered = 10;
  report.failures = {{3, "x", false}, {4, "x", false}};
  report.seconds = 2.5;
  report.frames_in_flight = 4;
  report.milliseconds = {90, 10, 20, 920, 30, 0};  // of all ten frames
  report.decoding = {0.04, 3'100'000};
  RenderLogParser log;
  log.parse_line("Progress: 42%");
  log.parse_line("frame 3 failed: the disk is full");
  log.parse_line("frame 4 failed: the disk is full");
  log.parse_line(report.stages());
  log.parse_line(report.summary());
  ASSERT_TRUE(log.rendering);
  EXPECT_EQ(log.rendering->frames, 10);
  EXPECT_EQ(log.rendering->frames_in_flight, 4);
  EXPECT_DOUBLE_EQ(log.rendering->seconds, 2.5);
  EXPECT_DOUBLE_EQ(log.rendering->light_fields_s, 0.009);
  EXPECT_DOUBLE_EQ(log.rendering->geometry_s, 0.001);
  EXPECT_DOUBLE_EQ(log.rendering->merge_s, 0.002);
  EXPECT_DOUBLE_EQ(log.rendering->encode_s, 0.092);
  EXPECT_DOUBLE_EQ(log.rendering->write_s, 0.003);
  EXPECT_DOUBLE_EQ(log.rendering->decode_s, 0.004);
  EXPECT_DOUBLE_EQ(log.rendering->read_bytes, 310'000);
  EXPECT_EQ(log.failed_frames, (std::set<int>{3, 4}));
  EXPECT_EQ(log.reason(), "frame 3 failed: the disk is full");
}

TEST(RenderLogParser, RotIsNoOtherFailure) {
  const store::RottenFrame rot(
      Error::bad_input(fmt::format("frame 3 of camera \"c1\" {}", store::kRottenFrameText),
                       "c1.mkv", "Repair"),
      3);
  RenderLogParser log;
  EXPECT_FALSE(log.has_only_rot());
  log.parse_line(fmt::format("frame 7 failed: {}", rot.what()));
  EXPECT_TRUE(log.has_only_rot());
  log.parse_line("frame 8 failed: the disk is full");
  EXPECT_FALSE(log.has_only_rot());
  EXPECT_EQ(log.failed_frames, (std::set<int>{7, 8}));
}

TEST(RenderLogParser, FindsTheReasonAmongWhatMpirunSays) {
  RenderLogParser log;
  log.parse_line("raystage render 0.1.0 on n1, the first of 4 ranks: 1 threads, SHOT s.json");
  log.parse_line(
      "raystage render: take: no rank has the archives of 1 of 4 cameras: c2. Start ranks.");
  log.parse_line("-------------------------------------------------------");
  log.parse_line("mpirun detected that one or more processes exited with non-zero status");
  EXPECT_TRUE(log.reason().starts_with("raystage render: take: no rank"));
}

TEST(RenderLogParser, KnowsNoCostsWhereNothingWasRendered) {
  compose::SequenceReport report;
  report.requested = report.skipped = 4;
  RenderLogParser log;
  log.parse_line(report.stages());
  log.parse_line(report.summary());
  EXPECT_FALSE(log.rendering);
}

}  // namespace
}  // namespace raystage::farm
