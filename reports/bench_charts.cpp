// SPDX-License-Identifier: Apache-2.0
#include "reports/bench_charts.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "charts/html_page.h"
#include "charts/svg_chart.h"

namespace raystage::reports {
namespace {

/// Returns the rows of a chart of error against time: first camera step, most threads, no failure.
std::vector<const evaluation::BenchRow*> charted(const evaluation::BenchResult& trade) {
  int threads = 0;
  for (const evaluation::BenchRow& row : trade.rows) threads = std::max(threads, row.threads);
  std::vector<const evaluation::BenchRow*> rows;
  for (const evaluation::BenchRow& row : trade.rows) {
    if (row.threads == threads && row.camera_step == trade.rows.front().camera_step &&
        row.failure.empty()) {
      rows.push_back(&row);
    }
  }
  return rows;
}

struct Measure {
  const char *name, *unit;
  double (*of)(const evaluation::BenchRow&);
  bool evaluation::BenchRow::*front;
  double margin;  ///< of the axis, on both sides, in its unit
  int digits;
};

constexpr Measure kPsnr{
    "PSNR",
    "PSNR, dB",
    [](const evaluation::BenchRow& row) { return row.evaluation.mean.quality.psnr_db; },
    &evaluation::BenchRow::on_psnr_front,
    0.6,
    2};
constexpr Measure kSsim{
    "SSIM",
    "SSIM",
    [](const evaluation::BenchRow& row) { return row.evaluation.mean.quality.ssim; },
    &evaluation::BenchRow::on_ssim_front,
    0.01,
    4};

double seconds_with_preparation(const evaluation::BenchRow& row) {
  return row.seconds_per_frame() + row.evaluation.prepare_ms / 1e3;
}

/// Returns the row with this row's pictures, which do not depend on the number of threads.
std::size_t pictured_row(const evaluation::BenchResult& trade, const evaluation::BenchRow& row) {
  const auto same = std::ranges::find_if(trade.rows, [&](const evaluation::BenchRow& other) {
    return other.setting.label == row.setting.label && other.camera_step == row.camera_step;
  });
  return static_cast<std::size_t>(same - trade.rows.begin());
}

std::string range_text(const schemas::DepthRange& range) {
  return std::isinf(range.far) ? fmt::format("{:.3g} to infinity", range.near)
                               : fmt::format("{:.3g} to {:.3g}", range.near, range.far);
}

}  // namespace

MethodColours::MethodColours(const evaluation::BenchResult& trade) {
  for (const evaluation::BenchRow& row : trade.rows) {
    if (std::ranges::find(methods_, row.setting.method) == methods_.end()) {
      methods_.push_back(row.setting.method);
    }
  }
}

std::string MethodColours::of(const std::string& method) const {
  constexpr int kColours = 9;
  return fmt::format("c{}", (std::ranges::find(methods_, method) - methods_.begin()) % kColours);
}

std::string MethodColours::key() const {
  std::string text = "<span class=\"key\">";
  for (const std::string& method : methods_) {
    text +=
        fmt::format("<span class=\"{}\"><i></i>{}</span>", of(method), charts::escape_html(method));
  }
  return text + "</span>";
}

std::string bench_chart(const evaluation::BenchResult& trade, QualityMeasure shown,
                        const MethodColours& colours) {
  const Measure& measure = shown == QualityMeasure::kPsnr ? kPsnr : kSsim;
  std::vector<const evaluation::BenchRow*> rows = charted(trade);
  std::erase_if(rows, [&](const evaluation::BenchRow* row) {
    return !std::isfinite(measure.of(*row)) || !(row->seconds_per_frame() > 0);
  });
  if (rows.empty()) return "<p>Nothing could be measured.</p>\n";
  double fast = std::numeric_limits<double>::infinity(), slow = 0, low = fast, high = -fast;
  for (const evaluation::BenchRow* row : rows) {
    fast = std::min(fast, row->seconds_per_frame());
    slow = std::max(slow, seconds_with_preparation(*row));
    low = std::min(low, measure.of(*row));
    high = std::max(high, measure.of(*row));
  }
  charts::SvgChart chart(fmt::format("{} against seconds per frame", measure.name),
                         {fast / 1.6, slow * 2.2, "seconds per frame, logarithmic", true, true},
                         {low - measure.margin, high + measure.margin, measure.unit, true});
  std::ranges::sort(rows, {}, &evaluation::BenchRow::seconds_per_frame);
  std::vector<charts::SvgChart::Point> stairs;
  for (const evaluation::BenchRow* row : rows) {
    if (!(row->*measure.front)) continue;
    const double x = row->seconds_per_frame();
    if (!stairs.empty()) stairs.push_back({x, stairs.back().y});
    stairs.push_back({x, measure.of(*row)});
  }
  chart.line(stairs, "stairs");
  for (const evaluation::BenchRow* row : rows) {
    const std::string colour = colours.of(row->setting.method);
    const charts::SvgChart::Point at{row->seconds_per_frame(), measure.of(*row)};
    if (row->evaluation.prepare_ms > 0) {
      const std::vector<charts::SvgChart::Point> once{at, {seconds_with_preparation(*row), at.y}};
      chart.line(once, "prepare " + colour);
    }
    const bool front = row->*measure.front;
    chart.dot({at.x, at.y,
               fmt::format("{}{} row{}", colour, front ? " front" : "", pictured_row(trade, *row)),
               row->setting.label,
               fmt::format("{}: {} {:.{}f}, {:.4g} s", row->setting.label, measure.name, at.y,
                           measure.digits, at.x),
               front});
  }
  return chart.str();
}

std::string spacing_section(const evaluation::BenchResult& trade, const MethodColours& colours) {
  std::map<int, const evaluation::BenchRow*> steps;
  std::map<std::string, std::vector<charts::SvgChart::Point>> courses;
  std::map<std::string, std::string> colour;
  int threads = 0;
  for (const evaluation::BenchRow& row : trade.rows) threads = std::max(threads, row.threads);
  double low = std::numeric_limits<double>::infinity(), high = -low, narrow = low, wide = 0;
  for (const evaluation::BenchRow& row : trade.rows) {
    const double psnr = kPsnr.of(row);
    if (row.threads != threads || !row.failure.empty() || !row.predicted || !std::isfinite(psnr) ||
        !(row.predicted->spacing > 0)) {
      continue;
    }
    steps.emplace(row.camera_step, &row);
    const double millimetres = row.predicted->spacing * 1e3;
    courses[row.setting.label].push_back({millimetres, psnr});
    colour[row.setting.label] = colours.of(row.setting.method);
    low = std::min(low, psnr);
    high = std::max(high, psnr);
    narrow = std::min(narrow, millimetres);
    wide = std::max(wide, millimetres);
  }
  if (steps.size() < 2) return "";
  charts::SvgChart chart("PSNR against camera spacing",
                         {narrow / 1.2, wide * 1.8, "camera spacing, mm, logarithmic", true, true},
                         {low - kPsnr.margin, high + kPsnr.margin, kPsnr.unit, true});
  for (auto& [label, points] : courses) {
    std::ranges::sort(points, {}, &charts::SvgChart::Point::x);
    chart.line(points, "course " + colour[label]);
    for (const charts::SvgChart::Point& point : points) {
      const bool last = &point == &points.back();
      chart.dot({point.x, point.y, colour[label], last ? label : "",
                 fmt::format("{}: {:.2f} dB at {:.4g} mm", label, point.y, point.x), false});
    }
  }
  std::string table =
      "<div class=\"wide\"><table><thead><tr><th>cameras</th><th>spacing, mm</th>"
      "<th>disparity of the depth range, px</th><th>focal planes by eq. 2.1</th>"
      "<th>depths without ghosting with one plane, m</th></tr></thead><tbody>\n";
  for (const auto& [step, row] : steps) {
    table += fmt::format(
        "<tr><td>{}</td><td>{:.4g}</td><td>{:.2f}</td><td>{:.0f}</td><td>{}</td></tr>\n",
        row->evaluation.cameras, row->predicted->spacing * 1e3, row->predicted->disparity_px,
        row->predicted->planes, range_text(row->predicted->alias_free));
  }
  return charts::html_section(
      "Error against camera spacing",
      "Every n-th row and column of cameras. The table shows the prediction of the sampling "
      "theorem "
      "(thesis, eq. 2.1): one focal plane suffices if the disparity between neighbouring cameras "
      "varies by at most two pixels over the scene's depths. With a larger disparity it shows "
      "ghosting, and methods that estimate depth are more accurate.",
      chart.str() + table + "</tbody></table></div>\n");
}

}  // namespace raystage::reports
