// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>
#include <string_view>

#include "evaluation/bench.h"
#include "evaluation/number_format.h"
#include "evaluation/region_columns.h"
#include "evaluation/report_json.h"
#include "render/common/method_options.h"
#include "schemas/former_names.h"
#include "schemas/json_text.h"
#include "schemas/utf8_text.h"

namespace raystage::evaluation {
namespace {

using nlohmann::ordered_json;

ordered_json text_or_null(const std::string& text) {
  return text.empty() ? ordered_json(nullptr) : ordered_json(text);
}

/// Returns the fields of CSV and JSON: names and plain values, null if not measured.
ordered_json fields_of(const BenchRow& row) {
  const Evaluation& e = row.evaluation;
  ordered_json fields{{"label", row.setting.label},
                      {"method", row.setting.method},
                      {"options", render::options_to_text(row.setting.options)},
                      {"camera_step", row.camera_step},
                      {"threads", row.threads},
                      {"failure", text_or_null(schemas::utf8_text(row.failure, 4000))}};
  // Every row has every name, so that every row of the CSV has every column.
  const auto measured = [&](const char* name, double value) {
    fields[name] = row.failure.empty() ? json_number(value) : ordered_json(nullptr);
  };
  const double nothing = std::numeric_limits<double>::quiet_NaN();
  measured("focal_depth_m", e.focal_depth);
  measured("cameras", e.cameras);
  measured("views", static_cast<double>(e.views.size()));
  measured("psnr_db", e.mean.quality.psnr_db);
  measured("psnr_stddev_db", e.temporal_stability.stddev_db);
  measured("psnr_max_step_db", e.temporal_stability.max_step_db);
  measured("ssim", e.mean.quality.ssim);
  measured("coverage", e.mean.quality.covered);
  for (const RegionColumn& column : kRegionColumns) {
    measured(column.name, e.mean.regions ? column.of(*e.mean.regions) : nothing);
  }
  measured("seconds_per_frame", row.seconds_per_frame());
  measured("decode_ms", e.mean.decode_ms);
  measured("render_ms", e.mean.render_ms);
  measured("render_min_ms", e.mean.min_render_ms);
  measured("prepare_ms", e.prepare_ms);
  measured("peak_memory_bytes",
           row.peak_memory > 0 ? static_cast<double>(row.peak_memory) : nothing);
  measured("decoded_per_needed", e.mean.decoded_per_needed);
  const SpacingPrediction none{nothing, nothing, nothing, {nothing, nothing}};
  const SpacingPrediction predicted = row.predicted.value_or(none);
  measured("spacing_m", predicted.spacing);
  measured("disparity_px", predicted.disparity_px);
  measured("planes_needed", predicted.planes);
  measured("alias_free_near_m", predicted.alias_free.near);
  measured("alias_free_far_m", predicted.alias_free.far);
  fields["on_psnr_front"] = row.on_psnr_front;
  fields["on_ssim_front"] = row.on_ssim_front;
  constexpr schemas::FormerName kFormerNames[] = {{"psnr_stddev_db", "psnr_deviation_db"},
                                                  {"psnr_max_step_db", "psnr_largest_step_db"},
                                                  {"coverage", "covered"},
                                                  {"render_min_ms", "render_least_ms"}};
  schemas::add_former_names(fields, kFormerNames);
  return fields;
}

std::string csv_cell(const ordered_json& value) {
  if (value.is_null()) return "";
  if (value.is_number()) return fmt::format("{}", value.get<double>());
  if (!value.is_string()) return value.dump();
  auto text = value.get<std::string>();
  // Spreadsheets would compute what begins like a formula.
  if (!text.empty() && std::string_view("=+-@").find(text[0]) != std::string_view::npos) {
    text.insert(0, 1, '\'');
  }
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

}  // namespace

std::string bench_as_csv(const BenchResult& trade) {
  std::string text;
  for (const BenchRow& row : trade.rows) {
    const ordered_json fields = fields_of(row);
    std::string heading, line;
    for (const auto& [name, value] : fields.items()) {
      heading += (heading.empty() ? "" : ",") + name;
      line += (line.empty() ? "" : ",") + csv_cell(value);
    }
    if (text.empty()) text = heading + "\r\n";
    text += line + "\r\n";
  }
  return text;
}

std::string bench_as_json(const BenchResult& trade) {
  ordered_json document{
      {"schema", "raystage/trade/1"}, {"take", trade.take},     {"cpu", trade.cpu},
      {"complete", trade.complete},   {"repeat", trade.repeat}, {"exact_times", trade.exact_times},
      {"views", trade.views}};
  auto& rows = document["rows"] = ordered_json::array();
  for (const BenchRow& row : trade.rows) {
    ordered_json fields = fields_of(row);
    fields["options"] = json_options(row.setting.options);
    fields["notes"] = row.evaluation.notes;
    auto& by_view = fields["psnr_db_by_view"] = ordered_json::array();
    for (const ViewEvaluation& view : row.evaluation.views) {
      by_view.push_back(json_number(view.quality.psnr_db));
    }
    rows.push_back(std::move(fields));
  }
  return schemas::format_json(document);
}

namespace {

/// Returns the methods' notes on their rows, e.g. the choice of auto, as a list below the table.
std::string notes_of(const BenchResult& trade) {
  std::string text;
  for (const BenchRow& row : trade.rows) {
    std::string setting = row.setting.label;
    if (row.camera_step > 1) setting += fmt::format(", {} cameras", row.evaluation.cameras);
    for (const std::string& note : row.evaluation.notes) {
      const std::string line = fmt::format("* {}: {}\n", setting, note);
      if (text.find(line) == std::string::npos) text += line;  // equal for other threads
    }
  }
  return text.empty() ? text : "\n" + text;
}

}  // namespace

std::string bench_as_table(const BenchResult& trade) {
  constexpr std::size_t kColumns = 12;
  using Line = std::array<std::string, kColumns>;
  std::vector<Line> lines{{"setting", "cameras", "threads", "PSNR dB", "largest step dB", "SSIM",
                           "covered %", "decode ms", "render ms", "prepare ms", "MB", "front"}};
  for (const BenchRow& row : trade.rows) {
    const Evaluation& e = row.evaluation;
    Line line;
    std::string label = row.setting.label;
    std::ranges::replace(label, '|', '/');  // it would end the cell
    line[0] = label;
    line[2] = std::to_string(row.threads);
    if (!row.failure.empty()) {
      line[3] = "failed";
    } else {
      line[1] = std::to_string(e.cameras);
      line[3] = format_number_or_dash(e.mean.quality.psnr_db, 2);
      line[4] = format_number_or_dash(e.temporal_stability.max_step_db, 2);
      line[5] = format_number_or_dash(e.mean.quality.ssim, 4);
      line[6] = fmt::format("{:.1f}", e.mean.quality.covered * 100);
      line[7] = fmt::format("{:.1f}", e.mean.decode_ms);
      line[8] = fmt::format("{:.1f}", e.mean.render_ms);
      line[9] = fmt::format("{:.0f}", e.prepare_ms);
      line[10] = row.peak_memory == 0
                     ? ""
                     : fmt::format("{:.0f}", 1e-6 * static_cast<double>(row.peak_memory));
      line[11] = row.on_psnr_front ? "*" : "";
    }
    lines.push_back(std::move(line));
  }
  std::array<std::size_t, kColumns> width{};
  for (const Line& line : lines) {
    for (std::size_t i = 0; i < kColumns; ++i) width[i] = std::max(width[i], line[i].size());
  }
  std::string text;
  for (std::size_t l = 0; l < lines.size(); ++l) {
    for (std::size_t i = 0; i < kColumns; ++i) {
      text += i == 0 ? fmt::format("| {:<{}} ", lines[l][i], width[i])
                     : fmt::format("| {:>{}} ", lines[l][i], width[i]);
    }
    text += "|\n";
    if (l > 0) continue;
    for (std::size_t i = 0; i < kColumns; ++i) {
      text += i == 0 ? fmt::format("| {:-<{}} ", "", width[i])
                     : fmt::format("| {:->{}}: ", "", std::max<std::size_t>(2, width[i]) - 1);
    }
    text += "|\n";
  }
  return text + notes_of(trade);
}

}  // namespace raystage::evaluation
