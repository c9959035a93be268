// SPDX-License-Identifier: Apache-2.0
#include "store/processing/sync/resync_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "store/processing/sync/node_offsets.h"
#include "testing/store/simulated_stamps.h"

namespace raystage::store {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::SimulatedStamps;

struct Verdict : ::testing::Test {
  SimulatedStamps truth{{.seed = 2, .drop = 0}};
  std::vector<CameraTimestamps> cameras = testing::cameras_of(truth);
};

TEST_F(Verdict, SaysWhatIsTheMatter) {
  auto& stamps = cameras[11].stamps;
  stamps.erase(stamps.begin() + 400, stamps.begin() + 403);
  cameras[40].stamps.resize(300);
  const ResyncResult resync = resynchronise(cameras, {}, "test");
  const auto verdict = resync_findings(resync, std::nullopt);
  EXPECT_THAT(verdict[0], HasSubstr("All 64 cameras run at 15.000 Hz"));
  EXPECT_THAT(verdict, Contains(HasSubstr("node2's clock stepped ahead by 40.")));
  EXPECT_THAT(verdict, Contains(HasSubstr("at 31.2 s")));
  EXPECT_THAT(verdict, Contains("Camera c11 lost 3 frames, none recorded in the journal."));
  EXPECT_THAT(verdict, Contains(HasSubstr("Start-up lasts until 4.0")));
  EXPECT_THAT(verdict, Contains(HasSubstr("Ended early: c40 at")));

  const auto json = nlohmann::json::parse(resync_report_json(resync, std::nullopt));
  EXPECT_EQ(json["cameras"].size(), 64u);
  EXPECT_EQ(json["cameras"][11]["dropped"], 3);
  EXPECT_EQ(json["cameras"][11]["dropped_unrecorded"], 3);
  EXPECT_NEAR(json["cameras"][11]["rate_hz"].get<double>(), 15, 0.01);
  EXPECT_EQ(json["clock_steps"][0]["node"], "node2");
  EXPECT_EQ(json["verdict"].size(), verdict.size());
  EXPECT_TRUE(json["flash"].is_null());
}

TEST_F(Verdict, OneCameraCannotTellItsClockFromItself) {
  std::vector<CameraTimestamps> one{cameras[3]};
  for (std::size_t i = 500; i < one[0].stamps.size(); ++i) one[0].stamps[i] += 20'000'000;
  const auto verdict = resync_findings(resynchronise(one, {}, "test"), std::nullopt);
  EXPECT_THAT(verdict, Contains(HasSubstr("restarted or its clock stepped")));
}

TEST_F(Verdict, PageStandsAlone) {
  cameras[7].id = "<script>alert(1)</script>";
  const ResyncResult resync = resynchronise(cameras, {}, "test");
  FlashOffsets flash;
  flash.groups = {{"node0", 0, 0, 16, 1}, {"node1", 12'340'000, 4'000'000, 16, 1}};
  flash.flashes = {5'000'000'000};
  const std::string page = resync_report_html(resync, flash, "a & b");
  EXPECT_THAT(page, HasSubstr("<title>a &amp; b"));
  EXPECT_THAT(page, Not(HasSubstr("<script")));
  EXPECT_THAT(page, Not(HasSubstr("://")));
  EXPECT_THAT(page, HasSubstr("node1 +12.3 ms (+-4.0)"));
  std::size_t charts = 0, lines = 0;
  for (std::size_t at = page.find("<svg"); at != std::string::npos;
       at = page.find("<svg", at + 1)) {
    ++charts;
  }
  for (std::size_t at = page.find("<polyline"); at != std::string::npos;
       at = page.find("<polyline", at + 1)) {
    ++lines;
  }
  EXPECT_EQ(charts, 4u);
  EXPECT_EQ(lines, 64u + 1);
  for (const char* number : {"nan", "inf"}) {
    EXPECT_THAT(page, Not(HasSubstr(">" + std::string(number)))) << number;
    EXPECT_THAT(page, Not(HasSubstr("\"" + std::string(number)))) << number;
  }
}

TEST(VerdictOf, AStillTake) {
  const ResyncResult resync =
      resynchronise({{"a", "", {5}, {}}, {"b", "", {}, {}}}, {.nominal_fps = 15}, "test");
  EXPECT_THAT(resync_findings(resync, std::nullopt)[0], HasSubstr("too few frames"));
  EXPECT_THAT(resync_report_html(resync, std::nullopt, "still"), HasSubstr("</html>"));
  EXPECT_EQ(nlohmann::json::parse(resync_report_json(resync, std::nullopt))["ticks"], 1);
}

TEST(NodeOffsets, OfNodesAndCameras) {
  const std::vector<CameraTimestamps> cameras{
      {"a", "n0", {}, {}}, {"b", "n0", {}, {}}, {"c", "n1", {}, {}}};
  EXPECT_EQ(parse_node_offsets(R"({"a": 1, "n0": -2.5})", "x", cameras),
            (std::vector<Nanoseconds>{1'000'000, -2'500'000, 0}));
  for (const char* text : {"[]", R"({"n2": 1})", R"({"n0": "1"})", R"({"n0": 1e12})", "{"}) {
    EXPECT_THROW(parse_node_offsets(text, "x", cameras), Error) << text;
  }
}

TEST(VerdictOf, NamesCamerasThatNoTickHolds) {
  std::vector<CameraTimestamps> cameras;
  for (int c = 0; c < 5; ++c) {
    CameraTimestamps camera{"c" + std::to_string(c), "", {}, {}};
    for (int i = 0; i < 60; ++i) {
      camera.stamps.push_back((c == 4 ? 9'000'000'000LL : 0) + c * 7'000'000LL + i * 66'666'667LL);
    }
    cameras.push_back(std::move(camera));
  }
  const auto verdict = resync_findings(resynchronise(cameras, {}, "test"), std::nullopt);
  EXPECT_THAT(verdict, ::testing::Contains(::testing::StartsWith("In no tick: c4;")));
}

}  // namespace
}  // namespace raystage::store
