// SPDX-License-Identifier: Apache-2.0
#include "reports/quality_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <vector>

#include "charts/html_page.h"
#include "evaluation/number_format.h"
#include "evaluation/region_columns.h"
#include "reports/row_name.h"

namespace raystage::reports {
namespace {

struct QualityColumn {
  std::string heading;
  int decimals;
  double scale;
  bool larger_is_better;
  std::function<double(const evaluation::ViewEvaluation&)> of;

  double shown(const evaluation::BenchRow& row) const { return scale * of(row.evaluation.mean); }
  std::string text(const evaluation::BenchRow& row) const {
    return evaluation::format_number_or_dash(shown(row), decimals);
  }
};

/// Returns the columns; without those in which no row has a number.
std::vector<QualityColumn> quality_columns(const std::vector<const evaluation::BenchRow*>& rows) {
  using evaluation::ViewEvaluation;
  std::vector<QualityColumn> columns{
      {"PSNR dB", 2, 1, true, [](const ViewEvaluation& view) { return view.quality.psnr_db; }},
      {"SSIM", 4, 1, true, [](const ViewEvaluation& view) { return view.quality.ssim; }},
      {"covered %", 1, 100, true, [](const ViewEvaluation& view) { return view.quality.covered; }}};
  for (const evaluation::RegionColumn& region : evaluation::kRegionColumns) {
    columns.push_back({region.heading, region.decimals, region.scale, region.larger_is_better,
                       [of = region.of](const ViewEvaluation& view) {
                         return view.regions ? of(*view.regions)
                                             : std::numeric_limits<double>::quiet_NaN();
                       }});
  }
  std::erase_if(columns, [&](const QualityColumn& column) {
    return std::ranges::all_of(
        rows, [&](const evaluation::BenchRow* row) { return std::isnan(column.shown(*row)); });
  });
  return columns;
}

/// Returns whether no comparable row with the same cameras has a better number, and one has
/// another.
bool is_best(const evaluation::BenchRow& row, const QualityColumn& column,
             const std::vector<const evaluation::BenchRow*>& rows,
             const evaluation::BenchResult& trade) {
  if (std::isnan(column.shown(row)) || !has_comparable_coverage(row, trade.rows)) return false;
  bool is_distinct = false;
  for (const evaluation::BenchRow* other : rows) {
    if (other->camera_step != row.camera_step || std::isnan(column.shown(*other)) ||
        !has_comparable_coverage(*other, trade.rows) || column.text(*other) == column.text(row)) {
      continue;
    }
    is_distinct = true;
    if ((column.shown(*other) > column.shown(row)) == column.larger_is_better) return false;
  }
  return is_distinct;
}

}  // namespace

std::string quality_section(const evaluation::BenchResult& trade, const MethodColours& colours) {
  std::vector<const evaluation::BenchRow*> rows;  // errors do not depend on threads
  for (const evaluation::BenchRow& row : trade.rows) {
    if (row.failure.empty() && row.threads == trade.rows.front().threads) rows.push_back(&row);
  }
  if (rows.empty()) return "";
  const std::vector<QualityColumn> columns = quality_columns(rows);
  std::string table = "<div class=\"wide quality\"><table><thead><tr><th>setting</th>";
  for (const QualityColumn& column : columns) {
    table += fmt::format("<th>{}</th>", charts::escape_html(column.heading));
  }
  table += "</tr></thead><tbody>\n";
  for (const evaluation::BenchRow* row : rows) {
    table += fmt::format("<tr><td class=\"{}\">{}</td>", colours.of(row->setting.method),
                         charts::escape_html(row_name(*row, trade)));
    for (const QualityColumn& column : columns) {
      table +=
          fmt::format("<td{}>{}</td>", is_best(*row, column, rows, trade) ? " class=\"best\"" : "",
                      column.text(*row));
    }
    table += "</tr>\n";
  }
  const bool has_regions = std::ranges::any_of(rows, [](const evaluation::BenchRow* row) {
    return row->evaluation.mean.regions.has_value();
  });
  return charts::html_section(
      "Errors by setting",
      std::string(
          "Means over the views; <b class=\"best\">marked</b>: the best among settings with "
          "the same cameras, except those that cover much less. ") +
          (has_regions
               ? "Edges: within 8 px of an edge of depth. Thin: structures at most 6 px wide. Bad "
                 "depths: wrong by more than 0.5 or 1 px of disparity between neighbouring "
                 "cameras. "
                 "Planes: that error on flat surfaces. Alpha: where a pixel shows two surfaces."
               : ""),
      table + "</tbody></table></div>\n");
}

}  // namespace raystage::reports
