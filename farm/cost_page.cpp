// SPDX-License-Identifier: Apache-2.0
#include "farm/cost_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "charts/html_page.h"
#include "charts/svg_chart.h"

namespace raystage::farm {
namespace {

constexpr int kStepsPerDecade = 12;

constexpr std::string_view kStyle = R"(
svg .course{fill:none;stroke:#3b82c4;stroke-width:2}
svg circle{fill:#3b82c4}
pre{overflow-x:auto})";

std::string chart(const JobCosts& job, const SiteParameters& site, std::span<const int> nodes) {
  const double most = std::max(10, *std::ranges::max_element(nodes));
  charts::SvgChart chart("Efficiency over the number of nodes", {1, most, "nodes", true, true},
                         {0, 100, "efficiency relative to one node, %"});
  std::vector<charts::SvgChart::Point> points;
  const int steps = static_cast<int>(std::log10(most) * kStepsPerDecade);
  for (int i = 0; i <= steps; ++i) {
    const int count = static_cast<int>(std::lround(std::pow(10, double(i) / kStepsPerDecade)));
    points.push_back(
        {double(count), std::min(100.0, 100 * predict_scaling(job, site, count).efficiency)});
  }
  chart.line(points, "course");
  for (const int count : nodes) {
    const ScalingPrediction p = predict_scaling(job, site, count);
    chart.dot({double(count), std::min(100.0, 100 * p.efficiency), "node",
               fmt::format("{:.0f} s: {}", p.seconds, cost_limit_name(p.limit)),
               fmt::format("{} nodes, {:.1f} s, limited by {}", count, p.seconds,
                           cost_limit_name(p.limit)),
               true});
  }
  return chart.str();
}

}  // namespace

std::string cost_page(const JobCosts& job, const SiteParameters& site, std::span<const int> nodes,
                      std::string_view title) {
  const std::string body =
      charts::html_section(
          "How the job scales",
          "Each stage takes as long as the resource that saturates first. Predicted from "
          "the measured costs of one node.",
          chart(job, site, nodes)) +
      charts::html_section("Numbers", "",
                           "<pre>" + charts::escape_html(cost_text(job, site, nodes)) + "</pre>");
  return charts::html_page(
      title,
      fmt::format("{} cores per node, storage {:.0f} MB/s read, {:.0f} MB/s written, {:g} "
                  "task starts per second, {:.2g} s latency",
                  site.cores_per_node, site.storage_read_bytes_per_s * 1e-6,
                  site.storage_write_bytes_per_s * 1e-6, site.starts_per_s, site.start_latency_s),
      body, kStyle);
}

}  // namespace raystage::farm
