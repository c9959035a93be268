// SPDX-License-Identifier: Apache-2.0
#include "evaluation/bench.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <random>
#include <regex>

#include "base/atomic_file.h"
#include "base/error.h"
#include "render/methods.h"
#include "reports/bench_page.h"
#include "store/jpeg/decode.h"
#include "testing/render/synthetic_take.h"
#include "testing/test_folder.h"
#include "testing/test_paths.h"

namespace raystage::evaluation {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class MeasuredTake : public ::testing::Test {
 protected:
  void SetUp() override {
    testing::SyntheticTake settings;
    settings.cameras = testing::camera_grid(5, 5, 0.03, 640, 480);
    settings.depth_range = schemas::DepthRange{2, 8};
    write_synthetic_take(settings, folder_.path() / "take");
    plan_.common.focal_depth = 4;
    plan_.common.excluded_camera_ids = {"r1c1", "r2c2"};
    plan_.common.repeat = 1;
    plan_.settings = {parse_bench_setting("the <near> one:nearest"),
                      parse_bench_setting("focal_plane")};
  }
  BenchResult measure(std::stop_token stop = {}) {
    return measure_bench(
        store::Take(folder_.path() / "take"), {}, {}, plan_,
        [&](const BenchResult&) { ++rows_seen_; }, [](double) {}, stop);
  }
  testing::TestFolder folder_;
  BenchPlan plan_;
  int rows_seen_ = 0;
};

TEST_F(MeasuredTake, HasARowForEverySettingStepAndThreads) {
  plan_.camera_steps = {1, 2};
  plan_.threads = {1, 2};
  const BenchResult trade = measure();
  ASSERT_EQ(trade.rows.size(), 8U);
  EXPECT_EQ(rows_seen_, 8);
  EXPECT_TRUE(trade.complete);
  EXPECT_THAT(trade.views, ::testing::ElementsAre("r1c1", "r2c2"));
  for (const BenchRow& row : trade.rows) {
    EXPECT_EQ(row.failure, "");
    EXPECT_GT(row.seconds_per_frame(), 0);
    EXPECT_GT(row.evaluation.mean.quality.psnr_db, 25);
    EXPECT_EQ(row.evaluation.cameras, row.camera_step == 1 ? 23 : 8);
    ASSERT_TRUE(row.predicted);
    // The cameras around the excluded one are on the diagonal of a square of two steps.
    const double spacing = 0.03 * std::sqrt(2) * row.camera_step;
    EXPECT_NEAR(row.predicted->spacing, spacing, 1e-9);
    EXPECT_NEAR(row.predicted->disparity_px, 532.57 * spacing * (1 / 2.0 - 1 / 8.0), 0.01);
    EXPECT_EQ(row.predicted->planes, row.camera_step == 1 ? 5 : 9);
    EXPECT_LT(row.predicted->alias_free.near, 4);
    EXPECT_GT(row.predicted->alias_free.far, 4);
  }
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(trade.rows[i].setting, trade.rows[i + 4].setting);
    EXPECT_EQ(trade.rows[i].evaluation.mean.quality.psnr_db,
              trade.rows[i + 4].evaluation.mean.quality.psnr_db);
  }
  // Every group of cameras and threads has a best.
  for (std::size_t group = 0; group < 8; group += 2) {
    EXPECT_TRUE(trade.rows[group].on_psnr_front || trade.rows[group + 1].on_psnr_front);
    EXPECT_TRUE(trade.rows[group].on_ssim_front || trade.rows[group + 1].on_ssim_front);
  }
  // One view's pictures, for the rows of one number of threads.
  EXPECT_EQ(trade.pictures.views().size(), 1U);
  EXPECT_EQ(trade.pictures.pictures().size(), 4U);
  const store::RgbImage picture =
      store::JpegDecoder().decode(trade.pictures.pictures()[0].image, "picture");
  EXPECT_EQ(picture.width, 640);
  EXPECT_EQ(picture.height, 480);
}

TEST_F(MeasuredTake, CsvAndJsonSayTheSameAndAreDocumented) {
  const BenchResult trade = measure();
  const json document = json::parse(bench_as_json(trade));
  EXPECT_EQ(document["schema"], "raystage/trade/1");
  EXPECT_EQ(document["complete"], true);
  ASSERT_EQ(document["rows"].size(), 2U);
  EXPECT_EQ(document["rows"][0]["label"], "the <near> one");
  EXPECT_EQ(document["rows"][0]["psnr_db_by_view"].size(), 2U);
  EXPECT_NEAR(document["rows"][0]["spacing_m"].get<double>(), 0.03 * std::sqrt(2), 1e-9);
  const std::string csv = bench_as_csv(trade);
  const std::string heading = csv.substr(0, csv.find("\r\n"));
  const std::string documentation = read_file(testing::source_folder() / "docs/formats/trade.md");
  for (const auto& [name, value] : document["rows"][0].items()) {
    EXPECT_THAT(documentation, HasSubstr("`" + name + "`"));
    if (name == "psnr_db_by_view" || name == "notes") continue;  // lists
    EXPECT_THAT("," + heading + ",", HasSubstr("," + name + ","));
  }
  for (const auto& [name, value] : document.items()) {
    EXPECT_THAT(documentation, HasSubstr("\"" + name + "\""));
  }
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 3);
  const std::string table = bench_as_table(trade);
  EXPECT_THAT(table, AllOf(HasSubstr("| setting"), HasSubstr("| the <near> one ")));
}

TEST_F(MeasuredTake, CellsAreQuotedWhereTheyMustBe) {
  BenchResult trade;
  BenchRow row;
  row.setting = {"a \"b\", c", "nearest", {{"x", 1.0}, {"y", 2.0}}, {}};
  row.failure = "no";
  trade.rows.push_back(row);
  EXPECT_THAT(bench_as_csv(trade),
              HasSubstr("\r\n\"a \"\"b\"\", c\",nearest,\"x=1,y=2\",1,1,no,,"));
  trade.rows[0].setting.label = "=1+1";  // a spreadsheet would compute it
  trade.rows[0].failure = "the folder a\xFF is not UTF-8";
  EXPECT_THAT(bench_as_csv(trade), HasSubstr("\r\n'=1+1,nearest,"));
  EXPECT_THAT(bench_as_json(trade), HasSubstr("the folder a\xEF\xBF\xBD is"));
}

TEST_F(MeasuredTake, ThePageStandsAlone) {
  plan_.camera_steps = {1, 2};
  plan_.threads = {1, 2};
  const BenchResult trade = measure();
  const std::string page = reports::bench_as_page(trade);
  EXPECT_THAT(page, Not(HasSubstr("://")));
  EXPECT_THAT(page, Not(HasSubstr("<link")));
  EXPECT_THAT(page, Not(HasSubstr("@import")));
  EXPECT_THAT(page, Not(HasSubstr("url(")));
  EXPECT_THAT(page, Not(HasSubstr("<near>")));
  for (const std::regex& loads :
       {std::regex(R"(\ssrc\s*=\s*"(?!data:image/png;base64,))"), std::regex(R"(\shref\s*=)")}) {
    EXPECT_FALSE(std::regex_search(page, loads));
  }
  for (const char* number : {"nan", "inf<", "NaN"}) {
    EXPECT_THAT(page, Not(HasSubstr(">" + std::string(number)))) << number;
  }
  EXPECT_THAT(page, HasSubstr("Time against threads"));
  EXPECT_THAT(page, HasSubstr("Error against camera spacing"));
  // The script contains JSON with all pictures.
  const std::string begin = "<script type=\"application/json\" id=\"pictures\">";
  const std::size_t from = page.find(begin) + begin.size();
  const json data = json::parse(page.substr(from, page.find("</script>", from) - from));
  EXPECT_EQ(data["rows"].size(), 4U);
  EXPECT_EQ(data["rows"][0]["label"], "the <near> one, 23 cameras, 1 thread");
  const json& picture = data["rows"][3]["pictures"]["0"];
  EXPECT_GT(picture["difference"].get<std::string>().size(), 100U);
  const ViewEvaluation& shown = trade.rows[3].evaluation.views[1];  // the middle of two
  EXPECT_THAT(picture["numbers"].get<std::string>(),
              HasSubstr(fmt::format("{:.2f} dB", shown.quality.psnr_db)));
}

TEST_F(MeasuredTake, ThePageSaysWhatMethodsHaveToSay) {
  plan_.settings.resize(1);
  BenchResult trade = measure();
  trade.rows[0].evaluation.notes = {"near < far"};
  EXPECT_THAT(reports::bench_as_page(trade), HasSubstr("near &lt; far"));
  EXPECT_THAT(bench_as_table(trade), ::testing::EndsWith("|\n\n* the <near> one: near < far\n"));
}

TEST_F(MeasuredTake, SaysWhatAutoChoseForATarget) {
  plan_.settings.clear();
  for (const BenchSetting& setting : default_bench_settings()) {
    if (setting.method == "auto") plan_.settings.push_back(setting);
  }
  std::vector<std::string> labels;
  for (const BenchSetting& setting : plan_.settings) labels.push_back(setting.label);
  EXPECT_THAT(labels, ::testing::ElementsAre("auto", "auto 30 dB", "auto 50 ms"));
  plan_.settings.erase(plan_.settings.begin());  // depth, which is slow
  const BenchResult trade = measure();
  const std::string table = bench_as_table(trade);
  EXPECT_THAT(table, HasSubstr("\n* auto 30 dB: auto: focal_plane: "));
  EXPECT_THAT(table,
              HasSubstr("\n* auto 50 ms: auto: plane_sweep: the most accurate within 50 ms"));
}

TEST_F(MeasuredTake, AStopLeavesWhatIsFinished) {
  std::stop_source source;
  const BenchResult trade = measure_bench(
      store::Take(folder_.path() / "take"), {}, {}, plan_,
      [&](const BenchResult&) { source.request_stop(); }, [](double) {}, source.get_token());
  EXPECT_EQ(trade.rows.size(), 1U);
  EXPECT_FALSE(trade.complete);
  EXPECT_EQ(json::parse(bench_as_json(trade))["complete"], false);
  EXPECT_THAT(reports::bench_as_page(trade), HasSubstr("before it was stopped"));
}

TEST_F(MeasuredTake, WhatCannotBeMeasuredSaysWhy) {
  std::filesystem::remove_all(folder_.path() / "take");
  testing::SyntheticTake settings;
  settings.cameras = testing::camera_grid(5, 5, 0.03, 64, 48);
  settings.has_depth_range = false;
  write_synthetic_take(settings, folder_.path() / "take");
  plan_.common.focal_depth.reset();  // and the take has no depth range
  plan_.settings[0].focal_depth = 4;
  const BenchResult trade = measure();
  EXPECT_EQ(trade.rows[0].failure, "");
  EXPECT_FALSE(trade.rows[0].predicted);
  EXPECT_TRUE(json::parse(bench_as_json(trade))["rows"][0]["spacing_m"].is_null());
  EXPECT_THAT(trade.rows[1].failure, HasSubstr("no depth range"));
  EXPECT_FALSE(trade.rows[1].on_psnr_front);
  EXPECT_THAT(reports::bench_as_page(trade), HasSubstr("no depth range"));
  EXPECT_THAT(bench_as_table(trade), HasSubstr("failed"));
  plan_.settings[0].focal_depth.reset();
  EXPECT_THROW(measure(), Error);  // nothing at all
}

TEST_F(MeasuredTake, ARowThatShowsNothingHasDashesForNumbers) {
  plan_.settings.resize(1);
  BenchResult trade = measure();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  Evaluation& nothing = trade.rows[0].evaluation;
  nothing.mean.quality = {nan, nan, 0};
  nothing.temporal_stability = {nan, nan};
  for (ViewEvaluation& view : nothing.views) view.quality = nothing.mean.quality;
  for (const std::string& text : {bench_as_table(trade), reports::bench_as_page(trade)}) {
    EXPECT_FALSE(std::regex_search(text, std::regex("[> -]nan\\b"))) << text;
  }
  EXPECT_THAT(bench_as_table(trade), HasSubstr(" - |"));
  EXPECT_THAT(reports::bench_as_page(trade), HasSubstr("- dB"));
}

TEST_F(MeasuredTake, ThePageMarksTheBestOfComparableRows) {
  BenchResult trade = measure();
  trade.rows.push_back(trade.rows[0]);
  trade.rows[2].setting.label = "third";
  const double psnr_db[] = {31, 32, 33}, covered[] = {1, 0.9, 0.5};
  for (std::size_t i = 0; i < 3; ++i) {
    trade.rows[i].evaluation.mean.quality = {psnr_db[i], 0.5, covered[i]};
  }
  EXPECT_TRUE(has_comparable_coverage(trade.rows[1], trade.rows));
  EXPECT_FALSE(has_comparable_coverage(trade.rows[2], trade.rows));
  const std::string page = reports::bench_as_page(trade);
  EXPECT_THAT(page, HasSubstr("<td class=\"best\">32.00</td>"));
  EXPECT_THAT(page, HasSubstr("<td>33.00</td>")) << "it omits half of the pixels";
  EXPECT_THAT(page, HasSubstr("<td class=\"best\">100.0</td>"));
  EXPECT_THAT(page, Not(HasSubstr("<td class=\"best\">0.5000</td>"))) << "all are equal";
}

TEST_F(MeasuredTake, FrontsAreOfRowsWithTheSameCameras) {
  plan_.settings.resize(1);
  plan_.camera_steps = {1, 3};
  plan_.common.excluded_camera_ids = {"r1c1", "r3c3"};  // at step 3, r3c3 is outside the array
  const BenchResult trade = measure();
  ASSERT_EQ(trade.rows.size(), 2U);
  EXPECT_LT(trade.rows[1].evaluation.mean.quality.covered,
            trade.rows[0].evaluation.mean.quality.covered - 0.15);
  EXPECT_TRUE(trade.rows[0].on_psnr_front);
  EXPECT_TRUE(trade.rows[1].on_psnr_front);
}

TEST_F(MeasuredTake, ARowThatComesToNothingLeavesNoPictures) {
  plan_.pictures = 2;
  plan_.settings.resize(1);
  BenchResult trade = measure();
  ASSERT_FALSE(trade.pictures.pictures().empty());
  trade.pictures.remove(0);
  EXPECT_TRUE(trade.pictures.pictures().empty());
}

TEST_F(MeasuredTake, BadPlansAreRefusedBeforeAnythingIsRendered) {
  const BenchPlan good = plan_;
  plan_.settings[1].label = plan_.settings[0].label;
  EXPECT_THROW(measure(), Error);
  plan_ = good;
  plan_.settings[1].method = "no_method";
  EXPECT_THROW(measure(), Error);
  plan_ = good;
  plan_.settings[1].options["no_option"] = 1.0;
  EXPECT_THROW(measure(), Error);
  plan_ = good;
  plan_.settings.clear();
  EXPECT_THROW(measure(), Error);
  EXPECT_EQ(rows_seen_, 0);
}

TEST(TradeSettings, ComeFromTextAndFromTheMethods) {
  EXPECT_EQ(
      parse_bench_setting("fine:plane_sweep:planes=96,aggregation=box"),
      (BenchSetting{
          "fine", "plane_sweep", {{"planes", 96.0}, {"aggregation", std::string("box")}}, {}}));
  EXPECT_EQ(parse_bench_setting("a:nearest"), (BenchSetting{"a", "nearest", {}, {}}));
  EXPECT_EQ(parse_bench_setting("a:m:mesh=c:d").options,
            (schemas::OptionValues{{"mesh", std::string("c:d")}}));
  for (const char* text : {":nearest", "a::x=1", "a:nearest:x"}) {
    EXPECT_THROW(parse_bench_setting(text), Error) << text;
  }
  std::size_t all = 0;
  for (const render::Method* method : render::methods()) all += 1 + method->presets().size();
  EXPECT_EQ(default_bench_settings().size(), all);
}

TEST(BenchImages, AreScaledByArea) {
  const store::RgbImage image{4, 2, {0, 0, 0,  10, 20, 30, 100, 0, 0, 200, 0, 0,
                                     4, 8, 12, 10, 20, 30, 100, 0, 0, 200, 0, 0}};
  const store::RgbImage small = scaled_to_width(image, 2);
  EXPECT_EQ(small, (store::RgbImage{2, 1, {6, 12, 18, 150, 0, 0}}));
  EXPECT_EQ(scaled_to_width(image, 4), image);
  const store::RgbImage odd =
      scaled_to_width(store::RgbImage{7, 3, std::vector<std::uint8_t>(63, 9)}, 5);
  EXPECT_EQ(odd, (store::RgbImage{5, 2, std::vector<std::uint8_t>(30, 9)}));
}

TEST(BenchImages, ShowDifferencesWhereThereIsATruth) {
  const store::RgbImage image{2, 1, {10, 20, 200, 1, 2, 3}}, truth{2, 1, {12, 20, 100, 9, 9, 9}};
  const std::vector<std::uint8_t> covered{1, 0};
  EXPECT_EQ(difference_image(image, truth, covered, 4).values,
            (std::vector<std::uint8_t>{8, 0, 255, 48, 48, 48}));
}

TEST(BenchImages, StayWithinTheirBound) {
  store::RgbImage noise{480, 480, std::vector<std::uint8_t>(480 * 480 * 3)};
  std::mt19937 random(1);
  for (auto& code : noise.values) code = static_cast<std::uint8_t>(random());
  store::RgbImage truth = noise;
  for (auto& code : truth.values) code = static_cast<std::uint8_t>(random());
  const std::vector<std::uint8_t> covered(480 * 480, 1);
  BenchImages pictures;
  const std::string id = "v";
  for (std::size_t row = 0; row < 60; ++row) {
    pictures.add(row, {0, 1, id, noise, truth, covered}, 1);
    pictures.add(row, {0, 3, id, noise, truth, covered}, 1);  // not the one of three
  }
  std::size_t bytes = pictures.views()[0].truth.size();
  for (const auto& picture : pictures.pictures()) {
    bytes += picture.image.size() + picture.difference.size();
  }
  EXPECT_LE(bytes, BenchImages::kMaxBytes);
  EXPECT_GT(bytes, BenchImages::kMaxBytes / 2);
  EXPECT_EQ(pictures.pictures().size() + static_cast<std::size_t>(pictures.omitted_count()), 60U);
  EXPECT_GT(pictures.omitted_count(), 0);
}

}  // namespace
}  // namespace raystage::evaluation
