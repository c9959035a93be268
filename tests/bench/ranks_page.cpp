// SPDX-License-Identifier: Apache-2.0
// Draws the results of tests/bench/ranks.sh next to figures 4-5 and 4-7 of the thesis. Reads lines
// "traffic CAMERAS SAMPLES_PER_PIXEL BAR" and "latency MILLISECONDS NAME"; writes a page of HTML.
#include <fmt/format.h>

#include <algorithm>
#include <iostream>
#include <sstream>
#include <string>
#include <vector>

#include "charts/html_page.h"
#include "charts/svg_chart.h"

namespace raystage {
namespace {

constexpr std::string_view kStyle = R"(
svg .measured{fill:none;stroke:#3b82c4;stroke-width:2}
svg .limit{fill:none;stroke:#999;stroke-width:1.5;stroke-dasharray:5 4}
svg circle{fill:#3b82c4}
svg circle.limit{fill:#999}
svg rect.stage{fill:#3b82c4})";

struct Traffic {
  double cameras = 0, samples = 0, bar = 0;
};
struct Stage {
  double ms = 0;
  std::string name;
};

std::string traffic_chart(const std::vector<Traffic>& rows) {
  charts::SvgChart chart("Samples that cross between ranks over the number of cameras",
                         {3, 100, "cameras", true, true},
                         {0, 3.5, "samples per pixel of the view"});
  std::vector<charts::SvgChart::Point> measured, bars;
  for (const Traffic& row : rows) {
    measured.push_back({row.cameras, row.samples});
    bars.push_back({row.cameras, row.bar});
  }
  chart.line(bars, "limit");
  chart.line(measured, "measured");
  for (const Traffic& row : rows) {
    chart.dot({row.cameras, row.bar, "limit", fmt::format("at most {:g}", row.bar), "", true});
    chart.dot({row.cameras, row.samples, "measured", fmt::format("{:.2f}", row.samples), "", true});
  }
  return chart.str();
}

std::string latency_chart(const std::vector<Stage>& stages) {
  double most = 1;
  for (const Stage& stage : stages) most = std::max(most, 1.15 * stage.ms);
  charts::SvgChart chart("What a view's latency is made of",
                         {0, static_cast<double>(stages.size()), "", false},
                         {0, most, "milliseconds"});
  for (std::size_t i = 0; i < stages.size(); ++i) {
    const auto x = static_cast<double>(i);
    chart.bar(x + 0.15, x + 0.85, 0, stages[i].ms, "stage", stages[i].name);
    chart.x_label(x + 0.5, fmt::format("{}: {:.1f}", stages[i].name, stages[i].ms), false);
  }
  return chart.str();
}

void run() {
  std::vector<Traffic> traffic;
  std::vector<Stage> stages;
  for (std::string line; std::getline(std::cin, line);) {
    std::istringstream words(line);
    std::string kind;
    words >> kind;
    if (kind == "traffic") {
      Traffic row;
      words >> row.cameras >> row.samples >> row.bar;
      traffic.push_back(row);
    } else if (kind == "latency") {
      Stage stage;
      words >> stage.ms >> std::ws;
      std::getline(words, stage.name);
      stages.push_back(stage);
    }
  }
  std::string body;
  if (!traffic.empty()) {
    body += charts::html_section(
        "Samples sent between four ranks",
        "As figure 4-7 of the thesis, per pixel of the view, before compression: "
        "<code>focal_plane</code>, cameras in a square of the same size, a "
        "quarter of them on each rank. Dashed: the bars.",
        traffic_chart(traffic));
  }
  if (!stages.empty()) {
    body += charts::html_section(
        "Latency of a view",
        "As figure 4-5 of the thesis, from the request to the encoded file: two "
        "ranks of one thread, a processor each. Messages: until requests and "
        "fragments have arrived, with waits for a time slice.",
        latency_chart(stages));
  }
  fmt::print("{}", charts::html_page("Distributed rendering by MPI ranks", "tests/bench/ranks.sh",
                                     body, kStyle));
}

}  // namespace
}  // namespace raystage

int main() {
  raystage::run();
  return 0;
}
