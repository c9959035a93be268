// SPDX-License-Identifier: Apache-2.0
#include "reports/bench_charts.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "charts/html_page.h"
#include "charts/svg_chart.h"

namespace raystage {
namespace {

/// What a chart of error against time shows: everything with the cameras asked for first, on the
/// most threads.
std::vector<const BenchRow*> charted(const BenchResult& trade) {
  int threads = 0;
  for (const BenchRow& row : trade.rows) threads = std::max(threads, row.threads);
  std::vector<const BenchRow*> rows;
  for (const BenchRow& row : trade.rows) {
    if (row.threads == threads && row.camera_step == trade.rows.front().camera_step &&
        row.failure.empty()) {
      rows.push_back(&row);
    }
  }
  return rows;
}

struct Measure {
  const char *name, *unit;
  double (*of)(const BenchRow&);
  bool BenchRow::*front;
  double margin;  ///< above and below, in its unit
  int digits;
};

constexpr Measure kPsnr{"PSNR",
                        "PSNR, dB",
                        [](const BenchRow& row) { return row.evaluation.mean.quality.psnr_db; },
                        &BenchRow::on_psnr_front,
                        0.6,
                        2};
constexpr Measure kSsim{"SSIM",
                        "SSIM",
                        [](const BenchRow& row) { return row.evaluation.mean.quality.ssim; },
                        &BenchRow::on_ssim_front,
                        0.01,
                        4};

double seconds_with_preparation(const BenchRow& row) {
  return row.seconds_per_frame() + row.evaluation.prepare_ms / 1e3;
}

/// The row whose pictures stand for this one: threads change no byte of them.
std::size_t pictured_row(const BenchResult& trade, const BenchRow& row) {
  const auto same = std::ranges::find_if(trade.rows, [&](const BenchRow& other) {
    return other.setting.label == row.setting.label && other.camera_step == row.camera_step;
  });
  return static_cast<std::size_t>(same - trade.rows.begin());
}

std::string range_text(const DepthRange& range) {
  return std::isinf(range.far) ? fmt::format("{:.3g} to infinity", range.near)
                               : fmt::format("{:.3g} to {:.3g}", range.near, range.far);
}

}  // namespace

MethodColours::MethodColours(const BenchResult& trade) {
  for (const BenchRow& row : trade.rows) {
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
    text += fmt::format("<span class=\"{}\"><i></i>{}</span>", of(method), escape_html(method));
  }
  return text + "</span>";
}

std::string bench_chart(const BenchResult& trade, QualityMeasure shown,
                        const MethodColours& colours) {
  const Measure& measure = shown == QualityMeasure::kPsnr ? kPsnr : kSsim;
  std::vector<const BenchRow*> rows = charted(trade);
  std::erase_if(rows, [&](const BenchRow* row) {
    return !std::isfinite(measure.of(*row)) || !(row->seconds_per_frame() > 0);
  });
  if (rows.empty()) return "<p>Nothing could be measured.</p>\n";
  double fast = std::numeric_limits<double>::infinity(), slow = 0, low = fast, high = -fast;
  for (const BenchRow* row : rows) {
    fast = std::min(fast, row->seconds_per_frame());
    slow = std::max(slow, seconds_with_preparation(*row));
    low = std::min(low, measure.of(*row));
    high = std::max(high, measure.of(*row));
  }
  SvgChart chart(fmt::format("{} against seconds per frame", measure.name),
                 {fast / 1.6, slow * 2.2, "seconds per frame, logarithmic", true, true},
                 {low - measure.margin, high + measure.margin, measure.unit, true});
  std::ranges::sort(rows, {}, &BenchRow::seconds_per_frame);
  std::vector<SvgChart::Point> stairs;
  for (const BenchRow* row : rows) {
    if (!(row->*measure.front)) continue;
    const double x = row->seconds_per_frame();
    if (!stairs.empty()) stairs.push_back({x, stairs.back().y});
    stairs.push_back({x, measure.of(*row)});
  }
  chart.line(stairs, "stairs");
  for (const BenchRow* row : rows) {
    const std::string colour = colours.of(row->setting.method);
    const SvgChart::Point at{row->seconds_per_frame(), measure.of(*row)};
    if (row->evaluation.prepare_ms > 0) {
      const std::vector<SvgChart::Point> once{at, {seconds_with_preparation(*row), at.y}};
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

std::string spacing_section(const BenchResult& trade, const MethodColours& colours) {
  std::map<int, const BenchRow*> steps;
  std::map<std::string, std::vector<SvgChart::Point>> courses;
  std::map<std::string, std::string> colour;
  int threads = 0;
  for (const BenchRow& row : trade.rows) threads = std::max(threads, row.threads);
  double low = std::numeric_limits<double>::infinity(), high = -low, narrow = low, wide = 0;
  for (const BenchRow& row : trade.rows) {
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
  SvgChart chart("PSNR against camera spacing",
                 {narrow / 1.2, wide * 1.8, "camera spacing, mm, logarithmic", true, true},
                 {low - kPsnr.margin, high + kPsnr.margin, kPsnr.unit, true});
  for (auto& [label, points] : courses) {
    std::ranges::sort(points, {}, &SvgChart::Point::x);
    chart.line(points, "course " + colour[label]);
    for (const SvgChart::Point& point : points) {
      const bool last = &point == &points.back();
      chart.dot({point.x, point.y, colour[label], last ? label : "",
                 fmt::format("{}: {:.2f} dB at {:.4g} mm", label, point.y, point.x), false});
    }
  }
  std::string table =
      "<div class=\"wide\"><table><thead><tr><th>cameras</th><th>spacing, mm</th>"
      "<th>disparity of the depth range, px</th><th>focal planes that eq. 2.1 asks for</th>"
      "<th>free of ghosts with one plane, m</th></tr></thead><tbody>\n";
  for (const auto& [step, row] : steps) {
    table += fmt::format(
        "<tr><td>{}</td><td>{:.4g}</td><td>{:.2f}</td><td>{:.0f}</td><td>{}</td></tr>\n",
        row->evaluation.cameras, row->predicted->spacing * 1e3, row->predicted->disparity_px,
        row->predicted->planes, range_text(row->predicted->alias_free));
  }
  return html_section(
      "Error against camera spacing",
      "Every n-th row and column of cameras. The table says what the sampling theorem predicts "
      "(thesis, eq. 2.1): one focal plane is enough where a point moves by at most two pixels of "
      "disparity between neighbouring cameras over the scene's depths; beyond, it shows ghosts, "
      "and "
      "methods that find depth are worth their time.",
      chart.str() + table + "</tbody></table></div>\n");
}

}  // namespace raystage
