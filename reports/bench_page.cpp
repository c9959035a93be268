// SPDX-License-Identifier: Apache-2.0
#include "reports/bench_page.h"

#include <fmt/format.h>

#include <map>
#include <set>
#include <string_view>

#include "charts/html_page.h"
#include "evaluation/bench.h"
#include "evaluation/number_format.h"
#include "render/common/method_options.h"
#include "reports/bench_charts.h"
#include "reports/bench_viewer.h"
#include "reports/crop_section.h"
#include "reports/quality_table.h"

namespace raystage::reports {
namespace {

constexpr std::string_view kStyle = R"(
:root { --c0:#58b6b0; --c1:#f0b64a; --c2:#ee7563; --c3:#7aa7f0; --c4:#c08ae8; --c5:#8fc76b;
  --c6:#f08fb8; --c7:#c5c0b0; --c8:#d6a27a }
@media (prefers-color-scheme: light) { :root { --c0:#0f7f78; --c1:#a86a00; --c2:#c23a26;
  --c3:#2b5fb8; --c4:#7a3fb0; --c5:#4b7f1e; --c6:#b23a72; --c7:#6b6658; --c8:#8a5a30 } }
.c0 { color:var(--c0) } .c1 { color:var(--c1) } .c2 { color:var(--c2) } .c3 { color:var(--c3) }
.c4 { color:var(--c4) } .c5 { color:var(--c5) } .c6 { color:var(--c6) } .c7 { color:var(--c7) }
.c8 { color:var(--c8) }
svg circle { fill:var(--panel); stroke:currentColor; stroke-width:2; cursor:pointer }
svg circle.front { fill:currentColor }
svg .label { font-weight:600 }
svg text { paint-order:stroke; stroke:var(--panel); stroke-width:3px }
svg .stairs { stroke:var(--soft); stroke-width:1.2; stroke-dasharray:2 4 }
svg .prepare { stroke:currentColor; stroke-width:1.2; stroke-opacity:.6 }
svg .course { stroke:currentColor; stroke-width:1.6 }
.key i { background:currentColor; border-radius:50% }
.key span { white-space:nowrap; margin-right:16px } .key i { margin:0 6px 0 0 }
.wide { overflow-x:auto } .wide th:nth-child(2), .wide td:nth-child(2) { text-align:right }
.every th, .every td { padding-left:7px; font-size:12px; vertical-align:top }
.every .options { text-align:left !important; min-width:130px; color:var(--soft) }
.every td:first-child { white-space:nowrap }
tr.front td:first-child { font-weight:600 }
.every td.failure { text-align:left; color:var(--red); white-space:normal; overflow-wrap:anywhere }
.bar { display:flex; flex-wrap:wrap; gap:8px; margin:0 0 12px; align-items:center }
button, select { font:inherit; font-size:14px; color:var(--text); background:var(--ink);
  border:1px solid var(--rule); border-radius:4px; padding:4px 12px; max-width:100% }
.bar:not(.names) button[aria-pressed=true] { border-color:var(--amber); color:var(--amber) }
button:focus-visible, select:focus-visible { outline:2px solid var(--amber); outline-offset:1px }
figure { margin:0 0 12px } figure img { display:block; width:100%; max-width:960px }
figcaption { color:var(--soft); font-size:14px; padding-top:6px }
.best { font-weight:700; color:var(--amber) }
.quality td:first-child { white-space:nowrap } .quality tr :nth-child(2) { text-align:right }
.names { position:sticky; top:0; z-index:1; background:var(--panel); padding:8px 0 }
.names[hidden] { display:none }
.names button[aria-pressed=true] { border-color:currentColor; box-shadow:inset 0 0 0 1px }
.names button.shown { background:var(--rule) }
.place h3 { font-size:14px; font-weight:600; margin:0 0 6px }
.place h3 span { color:var(--soft); font-weight:400; display:block }
.strip { display:flex; flex-wrap:wrap; gap:8px; margin:0 0 18px }
.strip figure { margin:0; width:192px } .strip figcaption { font-size:13px; padding-top:4px }
.strip img { width:100%; height:auto; image-rendering:pixelated }
.flips .places { display:grid; grid-template-columns:repeat(auto-fill, minmax(288px, 1fr)); gap:8px 24px }
.flips .strip { display:block; width:288px; max-width:100%; cursor:pointer }
.flips .strip figure { width:auto }
.strip:focus-visible { outline:2px solid var(--amber); outline-offset:3px }
kbd { border:1px solid var(--rule); border-radius:3px; padding:0 5px; font:inherit }
)";

std::string threads_section(const evaluation::BenchResult& trade) {
  std::set<int> counts;
  for (const evaluation::BenchRow& row : trade.rows) counts.insert(row.threads);
  if (counts.size() < 2) return "";
  std::string table = "<div class=\"wide\"><table><thead><tr><th>setting</th>";
  for (const int threads : counts) {
    table += fmt::format("<th>{} thread{}, ms</th>", threads, threads == 1 ? "" : "s");
  }
  table += "<th>speed-up</th></tr></thead><tbody>\n";
  for (const evaluation::BenchRow& first : trade.rows) {
    if (first.threads != *counts.begin() || !first.failure.empty()) continue;
    std::map<int, double> times;
    for (const evaluation::BenchRow& row : trade.rows) {
      if (row.setting.label == first.setting.label && row.camera_step == first.camera_step &&
          row.failure.empty()) {
        times[row.threads] = 1e3 * row.seconds_per_frame();
      }
    }
    table += fmt::format("<tr><td>{}, {} cameras</td>", charts::escape_html(first.setting.label),
                         first.evaluation.cameras);
    for (const int threads : counts) {
      table += times.contains(threads) ? fmt::format("<td>{:.1f}</td>", times[threads])
                                       : std::string("<td>-</td>");
    }
    const auto most = times.find(*counts.rbegin());
    table += most != times.end() && most->second > 0
                 ? fmt::format("<td>{:.2f}</td></tr>\n", times[first.threads] / most->second)
                 : std::string("<td>-</td></tr>\n");
  }
  return charts::html_section("Time against threads",
                              "Wall-clock time for decoding and rendering of one frame.",
                              table + "</tbody></table></div>\n");
}

/// Returns the options of a setting and the notes of its method as HTML.
std::string options_and_notes(const evaluation::BenchRow& row) {
  std::string options = render::options_to_text(row.setting.options);
  if (row.setting.focal_depth) options += fmt::format(" plane at {:g} m", *row.setting.focal_depth);
  std::string html;
  for (const char c : charts::escape_html(options)) {
    html += c;
    if (c == ',') html += "<wbr>";
  }
  for (const std::string& note : row.evaluation.notes) {
    html += (html.empty() ? "" : "<br>") + charts::escape_html(note);
  }
  return html;
}

std::string table_of(const evaluation::BenchResult& trade, const MethodColours& colours) {
  std::string table =
      "<div class=\"wide every\"><table><thead><tr><th>setting</th><th class=\"options\">options, "
      "notes</th>"
      "<th>cam&shy;eras</th><th>threads</th><th>PSNR dB</th><th>devi&shy;ation</th><th>largest "
      "step</th>"
      "<th>SSIM</th><th>covered %</th><th>s per frame</th><th>decode ms</th><th>render ms</th>"
      "<th>prepare ms</th><th>MB</th></tr></thead><tbody>\n";
  for (const evaluation::BenchRow& row : trade.rows) {
    const evaluation::Evaluation& e = row.evaluation;
    table += fmt::format("<tr{}><td class=\"{}\">{}{}</td><td class=\"options\">{}</td>",
                         row.on_psnr_front ? " class=\"front\"" : "",
                         colours.of(row.setting.method), charts::escape_html(row.setting.label),
                         row.on_psnr_front ? " &#9679;" : "", options_and_notes(row));
    if (!row.failure.empty()) {
      table += fmt::format("<td colspan=\"12\" class=\"failure\">{}</td></tr>\n",
                           charts::escape_html(row.failure));
      continue;
    }
    table += fmt::format(
        "<td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td>"
        "<td>{:.1f}</td><td>{:.3g}</td><td>{:.1f}</td><td>{:.1f}</td><td>{:.0f}</td>"
        "<td>{}</td></tr>\n",
        e.cameras, row.threads, evaluation::format_number_or_dash(e.mean.quality.psnr_db, 2),
        evaluation::format_number_or_dash(e.temporal_stability.stddev_db, 2),
        evaluation::format_number_or_dash(e.temporal_stability.max_step_db, 2),
        evaluation::format_number_or_dash(e.mean.quality.ssim, 4), e.mean.quality.covered * 100,
        row.seconds_per_frame(), e.mean.decode_ms, e.mean.render_ms, e.prepare_ms,
        row.peak_memory == 0 ? "-"
                             : fmt::format("{:.0f}", 1e-6 * static_cast<double>(row.peak_memory)));
  }
  return charts::html_section(
      "All settings",
      "&#9679;: on the Pareto front of PSNR. Deviation, largest step: of PSNR between views, dB. "
      "Prepare: once per instant, not part of the time per frame. Memory: maximum resident memory, "
      "including the cache of decoded frames.",
      table + "</tbody></table></div>\n");
}

}  // namespace

std::string bench_as_page(const evaluation::BenchResult& trade) {
  const MethodColours colours(trade);
  const std::string how =
      "A dot is a setting: its error against the median time to decode and render one frame. "
      "Filled "
      "dots joined by steps are the Pareto front: no other setting is better in both. A line to "
      "the "
      "right of a dot adds the time to prepare an instant, which is spent once per instant. " +
      colours.key();
  std::string body = charts::html_section("Error against time", how,
                                          bench_chart(trade, QualityMeasure::kPsnr, colours));
  body += charts::html_section("Structural similarity against time",
                               "The same settings measured by SSIM (structural similarity).",
                               bench_chart(trade, QualityMeasure::kSsim, colours));
  body += spacing_section(trade, colours) + threads_section(trade) +
          quality_section(trade, colours) + crop_section(trade, colours) + images_section(trade) +
          table_of(trade, colours);
  return charts::html_page(
      trade.take + ": speed against accuracy",
      fmt::format("{} views with known truth{}, {} rows measured{}; {}", trade.views.size(),
                  trade.exact_times ? ", at their exact times" : "",
                  std::ranges::count(trade.rows, std::string(), &evaluation::BenchRow::failure),
                  trade.complete ? "" : " before it was stopped", trade.cpu),
      body, kStyle);
}

}  // namespace raystage::reports
