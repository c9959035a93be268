// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "charts/html_page.h"
#include "charts/svg_chart.h"
#include "render/evaluation/trade.h"
#include "render/view/method_options.h"

namespace raystage {
namespace {

constexpr int kColours = 9;

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
svg .stairs { stroke:var(--soft); stroke-width:1.2; stroke-dasharray:2 4 }
svg .prepare { stroke:currentColor; stroke-width:1.2; stroke-opacity:.6 }
svg .course { stroke:currentColor; stroke-width:1.6 }
.key i { background:currentColor; border-radius:50% }
.key span { white-space:nowrap; margin-right:16px } .key i { margin:0 6px 0 0 }
.wide { overflow-x:auto } .wide th:nth-child(2), .wide td:nth-child(2) { text-align:right }
.every th, .every td { padding-left:9px; font-size:12px } td.options { text-align:left !important }
tr.front td:first-child { font-weight:600 }
td.failure { text-align:left; color:var(--red); white-space:normal }
.bar { display:flex; flex-wrap:wrap; gap:8px; margin:0 0 12px; align-items:center }
button, select { font:inherit; font-size:14px; color:var(--text); background:var(--ink);
  border:1px solid var(--rule); border-radius:4px; padding:4px 12px; max-width:100% }
button[aria-pressed=true] { border-color:var(--amber); color:var(--amber) }
button:focus-visible, select:focus-visible { outline:2px solid var(--amber); outline-offset:1px }
figure { margin:0 0 12px } figure img { display:block; width:100%; max-width:960px }
figcaption { color:var(--soft); font-size:14px; padding-top:6px }
kbd { border:1px solid var(--rule); border-radius:3px; padding:0 5px; font:inherit }
)";

constexpr std::string_view kScript = R"(
const data = JSON.parse(document.getElementById('pictures').textContent);
const by = id => document.getElementById(id);
let row = 0, view = 0, kind = 'image';
function show() {
  const r = data.rows[row], v = data.views[view], p = r.pictures[view];
  const source = kind === 'truth' ? v.truth : p && p[kind];
  by('shown').src = source ? 'data:image/jpeg;base64,' + source : 'data:,';
  by('shown').alt = kind + ' of view ' + v.id;
  by('caption').textContent = (kind === 'truth' ? 'Truth' : kind === 'image' ? r.label :
    r.label + ', difference from the truth, ' + data.gain + ' times') +
    ' - view ' + v.id + (kind === 'truth' ? '' : ' - over all views ' + r.numbers) +
    (source ? '' : ' - no room for this picture');
  by('setting').value = row;
  by('view').value = view;
  for (const k of ['truth', 'image', 'difference'])
    by(k).setAttribute('aria-pressed', k === kind);
}
const turn = (at, by, count) => (at + by + count) % count;
for (const k of ['truth', 'image', 'difference'])
  by(k).onclick = () => { kind = k; show(); };
by('setting').onchange = e => { row = +e.target.value; show(); };
by('view').onchange = e => { view = +e.target.value; show(); };
for (const dot of document.querySelectorAll('circle')) dot.onclick = () => {
  const at = data.rows.findIndex(r => dot.classList.contains('row' + r.row));
  if (at >= 0) { row = at; show(); by('viewer').scrollIntoView(); }
};
document.onkeydown = e => {
  if (e.ctrlKey || e.altKey || e.metaKey || e.target.tagName === 'SELECT') return;
  const key = e.key.toLowerCase();
  if (key === 't') kind = 'truth';
  else if (key === 'p') kind = 'image';
  else if (key === 'd') kind = 'difference';
  else if (key === ' ' && e.target.tagName !== 'BUTTON') kind = kind === 'truth' ? 'image' : 'truth';
  else if (key === 'arrowright') row = turn(row, 1, data.rows.length);
  else if (key === 'arrowleft') row = turn(row, -1, data.rows.length);
  else if (key === 'v') view = turn(view, 1, data.views.length);
  else return;
  e.preventDefault();
  show();
};
show();
)";

/// A colour for each method.
class Colours {
 public:
  explicit Colours(const Trade& trade) {
    for (const TradeRow& row : trade.rows) {
      if (std::ranges::find(methods_, row.setting.method) == methods_.end()) {
        methods_.push_back(row.setting.method);
      }
    }
  }
  std::string of(const std::string& method) const {
    return fmt::format("c{}", (std::ranges::find(methods_, method) - methods_.begin()) % kColours);
  }
  std::string key() const {
    std::string text = "<span class=\"key\">";
    for (const std::string& method : methods_) {
      text += fmt::format("<span class=\"{}\"><i></i>{}</span>", of(method), escape_html(method));
    }
    return text + "</span>";
  }

 private:
  std::vector<std::string> methods_;
};

std::string name_of(const TradeRow& row, const Trade& trade) {
  const bool many_steps = std::ranges::any_of(
      trade.rows, [&](const TradeRow& other) { return other.camera_step != row.camera_step; });
  const bool many_threads = std::ranges::any_of(
      trade.rows, [&](const TradeRow& other) { return other.threads != row.threads; });
  return row.setting.label +
         (many_steps ? fmt::format(", {} cameras", row.evaluation.cameras) : "") +
         (many_threads ? fmt::format(", {} threads", row.threads) : "");
}

/// What a chart of error against time shows: everything with the cameras asked for first, on the
/// most threads.
std::vector<const TradeRow*> charted(const Trade& trade) {
  int threads = 0;
  for (const TradeRow& row : trade.rows) threads = std::max(threads, row.threads);
  std::vector<const TradeRow*> rows;
  for (const TradeRow& row : trade.rows) {
    if (row.threads == threads && row.camera_step == trade.rows.front().camera_step &&
        row.failure.empty()) {
      rows.push_back(&row);
    }
  }
  return rows;
}

struct Measure {
  const char *name, *unit;
  double (*of)(const TradeRow&);
  bool TradeRow::*front;
  double margin;  ///< above and below, in its unit
  int digits;
};

constexpr Measure kPsnr{"PSNR",
                        "PSNR, dB",
                        [](const TradeRow& row) { return row.evaluation.mean.quality.psnr_db; },
                        &TradeRow::on_psnr_front,
                        0.6,
                        2};
constexpr Measure kSsim{"SSIM",
                        "SSIM",
                        [](const TradeRow& row) { return row.evaluation.mean.quality.ssim; },
                        &TradeRow::on_ssim_front,
                        0.01,
                        4};

double seconds_with_preparation(const TradeRow& row) {
  return row.seconds_per_frame() + row.evaluation.prepare_ms / 1e3;
}

/// The row whose pictures stand for this one: threads change no byte of them.
std::size_t pictured_row(const Trade& trade, const TradeRow& row) {
  const auto same = std::ranges::find_if(trade.rows, [&](const TradeRow& other) {
    return other.setting.label == row.setting.label && other.camera_step == row.camera_step;
  });
  return static_cast<std::size_t>(same - trade.rows.begin());
}

std::string trade_chart(const Trade& trade, const Measure& measure, const Colours& colours) {
  std::vector<const TradeRow*> rows = charted(trade);
  std::erase_if(rows, [&](const TradeRow* row) {
    return !std::isfinite(measure.of(*row)) || !(row->seconds_per_frame() > 0);
  });
  if (rows.empty()) return "<p>Nothing could be measured.</p>\n";
  double fast = std::numeric_limits<double>::infinity(), slow = 0, low = fast, high = -fast;
  for (const TradeRow* row : rows) {
    fast = std::min(fast, row->seconds_per_frame());
    slow = std::max(slow, seconds_with_preparation(*row));
    low = std::min(low, measure.of(*row));
    high = std::max(high, measure.of(*row));
  }
  SvgChart chart(fmt::format("{} against seconds per frame", measure.name),
                 {fast / 1.6, slow * 2.2, "seconds per frame, logarithmic", true, true},
                 {low - measure.margin, high + measure.margin, measure.unit, true});
  std::ranges::sort(rows, {}, &TradeRow::seconds_per_frame);
  std::vector<SvgChart::Point> stairs;
  for (const TradeRow* row : rows) {
    if (!(row->*measure.front)) continue;
    const double x = row->seconds_per_frame();
    if (!stairs.empty()) stairs.push_back({x, stairs.back().y});
    stairs.push_back({x, measure.of(*row)});
  }
  chart.line(stairs, "stairs");
  for (const TradeRow* row : rows) {
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

std::string range_text(const DepthRange& range) {
  return std::isinf(range.far) ? fmt::format("{:.3g} to infinity", range.near)
                               : fmt::format("{:.3g} to {:.3g}", range.near, range.far);
}

/// Error against camera spacing, and what eq. 2.1 says of each.
std::string spacing_section(const Trade& trade, const Colours& colours) {
  std::map<int, const TradeRow*> steps;
  std::map<std::string, std::vector<SvgChart::Point>> courses;
  std::map<std::string, std::string> colour;
  int threads = 0;
  for (const TradeRow& row : trade.rows) threads = std::max(threads, row.threads);
  double low = std::numeric_limits<double>::infinity(), high = -low, narrow = low, wide = 0;
  for (const TradeRow& row : trade.rows) {
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

std::string threads_section(const Trade& trade) {
  std::set<int> counts;
  for (const TradeRow& row : trade.rows) counts.insert(row.threads);
  if (counts.size() < 2) return "";
  std::string table = "<div class=\"wide\"><table><thead><tr><th>setting</th>";
  for (const int threads : counts) table += fmt::format("<th>{} threads, ms</th>", threads);
  table += "<th>times as fast</th></tr></thead><tbody>\n";
  for (const TradeRow& first : trade.rows) {
    if (first.threads != *counts.begin() || !first.failure.empty()) continue;
    std::map<int, double> times;
    for (const TradeRow& row : trade.rows) {
      if (row.setting.label == first.setting.label && row.camera_step == first.camera_step &&
          row.failure.empty()) {
        times[row.threads] = 1e3 * row.seconds_per_frame();
      }
    }
    table += fmt::format("<tr><td>{}, {} cameras</td>", escape_html(first.setting.label),
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
  return html_section("Time against threads", "Decoding and rendering of a frame.",
                      table + "</tbody></table></div>\n");
}

std::string numbers_of(const TradeRow& row) {
  return fmt::format("{:.2f} dB, SSIM {:.4f}, {:.3g} s", row.evaluation.mean.quality.psnr_db,
                     row.evaluation.mean.quality.ssim, row.seconds_per_frame());
}

std::string pictures_section(const Trade& trade) {
  const auto views = trade.pictures.views();
  nlohmann::ordered_json data{{"gain", TradePictures::kDifferenceGain}};
  for (const TradePictures::View& view : views) {
    data["views"].push_back({{"id", view.id}, {"truth", base64(view.truth)}});
  }
  std::string settings;
  for (std::size_t r = 0; r < trade.rows.size(); ++r) {
    const TradeRow& row = trade.rows[r];
    nlohmann::ordered_json pictures = nlohmann::ordered_json::object();
    for (const TradePictures::Picture& picture : trade.pictures.pictures()) {
      if (picture.row != r || !row.failure.empty()) continue;
      pictures[std::to_string(picture.view)] = {{"image", base64(picture.image)},
                                                {"difference", base64(picture.difference)}};
    }
    if (pictures.empty()) continue;
    settings += fmt::format("<option value=\"{}\">{}</option>",
                            data.contains("rows") ? data["rows"].size() : 0,
                            escape_html(name_of(row, trade)));
    data["rows"].push_back({{"row", r},
                            {"label", name_of(row, trade)},
                            {"numbers", numbers_of(row)},
                            {"pictures", pictures}});
  }
  if (!data.contains("rows")) return "";
  std::string choices;
  for (std::size_t v = 0; v < views.size(); ++v) {
    choices += fmt::format("<option value=\"{}\">view {}</option>", v, escape_html(views[v].id));
  }
  // A "<" within a script could end it.
  std::string json;
  for (const char c : data.dump()) json += c == '<' ? std::string("\\u003c") : std::string(1, c);
  const std::string left_out =
      trade.pictures.left_out() > 0
          ? fmt::format(" {} pictures had no room on this page.", trade.pictures.left_out())
          : "";
  return "<div id=\"viewer\"></div>\n" +
         html_section(
             "Pictures",
             "<kbd>t</kbd> truth, <kbd>p</kbd> picture, <kbd>d</kbd> difference, <kbd>space</kbd> "
             "flips truth and picture, <kbd>&larr;</kbd> <kbd>&rarr;</kbd> setting, <kbd>v</kbd> "
             "next "
             "view; a dot of the first charts shows its setting here." +
                 left_out +
                 "<noscript> Flipping needs JavaScript; all else on this page does not."
                 "</noscript>",
             "<div class=\"bar\"><button id=\"truth\">truth</button>"
             "<button id=\"image\">picture</button><button id=\"difference\">difference</button>"
             "<select id=\"setting\" aria-label=\"setting\">" +
                 settings + "</select><select id=\"view\" aria-label=\"view\">" + choices +
                 "</select></div>\n<figure><img id=\"shown\" alt=\"\"><figcaption id=\"caption\">"
                 "</figcaption></figure>\n<script type=\"application/json\" id=\"pictures\">" +
                 json + "</script>\n<script>" + std::string(kScript) + "</script>\n");
}

std::string table_of(const Trade& trade, const Colours& colours) {
  std::string table =
      "<div class=\"wide every\"><table><thead><tr><th>setting</th><th>options</th><th>cameras</th>"
      "<th>threads</th><th>PSNR dB</th><th>devi&shy;ation</th><th>largest step</th>"
      "<th>SSIM</th><th>covered %</th><th>s per frame</th><th>decode ms</th><th>render ms</th>"
      "<th>least ms</th><th>prepare ms</th><th>MB</th></tr></thead><tbody>\n";
  for (const TradeRow& row : trade.rows) {
    const Evaluation& e = row.evaluation;
    std::string options = text_of(row.setting.options);
    if (row.setting.focal_depth)
      options += fmt::format(" plane at {:g} m", *row.setting.focal_depth);
    table += fmt::format("<tr{}><td class=\"{}\">{}{}</td><td class=\"options\">{}</td>",
                         row.on_psnr_front ? " class=\"front\"" : "",
                         colours.of(row.setting.method), escape_html(row.setting.label),
                         row.on_psnr_front ? " &#9679;" : "", escape_html(options));
    if (!row.failure.empty()) {
      table += fmt::format("<td colspan=\"13\" class=\"failure\">{}</td></tr>\n",
                           escape_html(row.failure));
      continue;
    }
    table += fmt::format(
        "<td>{}</td><td>{}</td><td>{:.2f}</td><td>{:.2f}</td><td>{:.2f}</td><td>{:.4f}</td>"
        "<td>{:.1f}</td><td>{:.3g}</td><td>{:.1f}</td><td>{:.1f}</td><td>{:.1f}</td><td>{:.0f}</td>"
        "<td>{}</td></tr>\n",
        e.cameras, row.threads, e.mean.quality.psnr_db, e.steadiness.deviation_db,
        e.steadiness.largest_step_db, e.mean.quality.ssim, e.mean.quality.covered * 100,
        row.seconds_per_frame(), e.mean.decode_ms, e.mean.render_ms, e.mean.render_least_ms,
        e.prepare_ms,
        row.peak_memory == 0 ? "-"
                             : fmt::format("{:.0f}", 1e-6 * static_cast<double>(row.peak_memory)));
  }
  return html_section(
      "Every setting",
      "&#9679; on the PSNR front. Deviation and largest step: of PSNR from view to view, dB. "
      "Prepare: "
      "once an instant, not in the time per frame. Memory: resident at most, the cache of decoded "
      "frames included.",
      table + "</tbody></table></div>\n");
}

}  // namespace

std::string trade_as_page(const Trade& trade) {
  const Colours colours(trade);
  const std::string how =
      "A dot is a setting: decoding and rendering of one frame, median, against the truth. Filled "
      "and joined by steps: the Pareto front, settings that no other beats in both. A line to the "
      "right of a dot ends at the time with what the method prepares once an instant. " +
      colours.key();
  std::string body = html_section("Error against time", how, trade_chart(trade, kPsnr, colours));
  body += html_section("Structural similarity against time",
                       "The same settings by SSIM, which weighs structure rather than codes.",
                       trade_chart(trade, kSsim, colours));
  body += spacing_section(trade, colours) + threads_section(trade) + pictures_section(trade) +
          table_of(trade, colours);
  return html_page(
      trade.take + ": speed against accuracy",
      fmt::format("{} views whose truth is known, {} rows measured{}; {}", trade.views.size(),
                  trade.rows.size(), trade.complete ? "" : " before it was stopped", trade.cpu),
      body, kStyle);
}

}  // namespace raystage
