// SPDX-License-Identifier: Apache-2.0
#include "reports/bench_viewer.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string_view>

#include "base/base64.h"
#include "charts/html_page.h"
#include "evaluation/number_format.h"
#include "reports/row_name.h"

namespace raystage::reports {
namespace {

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
    ' - view ' + v.id + (kind === 'truth' ? '' :
      (p ? ': ' + p.numbers : '') + ' - over all views ' + r.numbers) +
    (source ? '' : ' - omitted: the page is full');
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

std::string numbers_of(const evaluation::ViewEvaluation& view) {
  return fmt::format("{} dB, SSIM {}, {:.3g} s",
                     evaluation::format_number_or_dash(view.quality.psnr_db, 2),
                     evaluation::format_number_or_dash(view.quality.ssim, 4),
                     (view.decode_ms + view.render_ms) / 1e3);
}

/// Returns the results of a view, or an empty text if it was not measured.
std::string numbers_of(const evaluation::BenchRow& row, const std::string& view_id) {
  const auto& views = row.evaluation.views;
  const auto view = std::ranges::find(views, view_id, &evaluation::ViewEvaluation::id);
  return view == views.end() ? "" : numbers_of(*view);
}

}  // namespace

std::string images_section(const evaluation::BenchResult& trade) {
  const auto views = trade.pictures.views();
  nlohmann::ordered_json data{{"gain", evaluation::BenchImages::kDifferenceGain}};
  for (const evaluation::BenchImages::View& view : views) {
    data["views"].push_back({{"id", view.id}, {"truth", encode_base64(view.truth)}});
  }
  std::string settings;
  for (std::size_t r = 0; r < trade.rows.size(); ++r) {
    const evaluation::BenchRow& row = trade.rows[r];
    nlohmann::ordered_json pictures = nlohmann::ordered_json::object();
    for (const evaluation::BenchImages::Picture& picture : trade.pictures.pictures()) {
      if (picture.row != r || !row.failure.empty()) continue;
      pictures[std::to_string(picture.view)] = {
          {"image", encode_base64(picture.image)},
          {"difference", encode_base64(picture.difference)},
          {"numbers", numbers_of(row, views[picture.view].id)}};
    }
    if (pictures.empty()) continue;
    settings += fmt::format("<option value=\"{}\">{}</option>",
                            data.contains("rows") ? data["rows"].size() : 0,
                            charts::escape_html(row_name(row, trade)));
    data["rows"].push_back({{"row", r},
                            {"label", row_name(row, trade)},
                            {"numbers", numbers_of(row.evaluation.mean)},
                            {"pictures", pictures}});
  }
  if (!data.contains("rows")) return "";
  std::string choices;
  for (std::size_t v = 0; v < views.size(); ++v) {
    choices +=
        fmt::format("<option value=\"{}\">view {}</option>", v, charts::escape_html(views[v].id));
  }
  // A "<" within a script could end it.
  std::string json;
  for (const char c : data.dump()) json += c == '<' ? std::string("\\u003c") : std::string(1, c);
  const std::string omitted_count = trade.pictures.omitted_count() > 0
                                        ? fmt::format(" {} pictures are omitted: the page is full.",
                                                      trade.pictures.omitted_count())
                                        : "";
  return "<div id=\"viewer\"></div>\n" +
         charts::html_section(
             "Pictures",
             "<kbd>t</kbd> truth, <kbd>p</kbd> picture, <kbd>d</kbd> difference, <kbd>space</kbd> "
             "switches between truth and picture, <kbd>&larr;</kbd> <kbd>&rarr;</kbd> setting, "
             "<kbd>v</kbd> next view. Click a dot of the first charts to show its setting here." +
                 omitted_count + "<noscript> Only this viewer requires JavaScript.</noscript>",
             "<div class=\"bar\"><button id=\"truth\">truth</button>"
             "<button id=\"image\">picture</button><button id=\"difference\">difference</button>"
             "<select id=\"setting\" aria-label=\"setting\">" +
                 settings + "</select><select id=\"view\" aria-label=\"view\">" + choices +
                 "</select></div>\n<figure><img id=\"shown\" alt=\"\"><figcaption id=\"caption\">"
                 "</figcaption></figure>\n<script type=\"application/json\" id=\"pictures\">" +
                 json + "</script>\n<script>" + std::string(kScript) + "</script>\n");
}

}  // namespace raystage::reports
