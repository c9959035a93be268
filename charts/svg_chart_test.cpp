// SPDX-License-Identifier: Apache-2.0
#include "charts/svg_chart.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <regex>

#include "charts/html_page.h"

namespace raystage::charts {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

TEST(SvgChart, MarksWhatItIsGiven) {
  SvgChart chart("a \"chart\"", {0, 10, "x", true}, {0, 0.2, "y", true});
  chart.bar(1, 2, 0, 0.1, "fill", "one");
  const std::string svg = chart.str();
  EXPECT_THAT(svg, HasSubstr("a &quot;chart&quot;"));
  EXPECT_THAT(svg, HasSubstr("<title>one</title>"));
  EXPECT_THAT(svg, HasSubstr(">0.05<"));
  EXPECT_THAT(svg, HasSubstr(">10<"));
}

/// Returns the x of the circles in the order in which they are drawn.
std::vector<double> circle_places(const std::string& svg) {
  std::vector<double> places;
  const std::regex circle("cx=\"([0-9.]+)\"");
  for (std::sregex_iterator it(svg.begin(), svg.end(), circle), end; it != end; ++it) {
    places.push_back(std::stod((*it)[1]));
  }
  return places;
}

TEST(SvgChart, EqualRatiosAreEqualStepsOnALogarithmicAxis) {
  SvgChart chart("c", {0.001, 10, "s", true, true}, {0, 1, "dB"});
  for (const double x : {0.01, 0.1, 1.0}) chart.dot({x, 0.5, "one", "", "", true});
  const std::string svg = chart.str();
  const auto places = circle_places(svg);
  ASSERT_EQ(places.size(), 3U);
  EXPECT_NEAR(places[1] - places[0], places[2] - places[1], 0.11);
  EXPECT_GT(places[1], places[0] + 100);
  for (const char* tick : {">0.001<", ">0.02<", ">5<", ">10<"}) EXPECT_THAT(svg, HasSubstr(tick));
  EXPECT_THAT(svg, Not(HasSubstr(">20<")));
}

TEST(SvgChart, NamesThatMustBeShownAreAndOthersOnlyWhereThereIsRoom) {
  SvgChart chart("c", {0, 10, "x"}, {0, 1, "y"});
  for (int i = 0; i < 30; ++i) chart.dot({5, 0.5, "one", "crowd" + std::to_string(i), "", false});
  chart.dot({5, 0.5, "one", "<must>", "a & b", true});
  const std::string svg = chart.str();
  EXPECT_THAT(svg, HasSubstr(">&lt;must&gt;<"));
  EXPECT_THAT(svg, HasSubstr("<title>a &amp; b</title>"));
  EXPECT_EQ(circle_places(svg).size(), 31U);
  EXPECT_THAT(svg, HasSubstr(">crowd0<"));
  EXPECT_THAT(svg, Not(HasSubstr(">crowd29<")));
}

TEST(HtmlPage, LoadsNothing) {
  const std::string page = html_page("a < b", "c & d", "<p>body</p>", "p { color:red }");
  EXPECT_THAT(page, HasSubstr("<title>a &lt; b</title>"));
  EXPECT_THAT(page, HasSubstr("c &amp; d"));
  EXPECT_THAT(page, HasSubstr("default-src 'none'"));
  EXPECT_THAT(page, Not(HasSubstr("://")));
}

}  // namespace
}  // namespace raystage::charts
