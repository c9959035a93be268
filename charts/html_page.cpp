// SPDX-License-Identifier: Apache-2.0
#include "charts/html_page.h"

#include <fmt/format.h>

namespace raystage::charts {
namespace {

// The policy allows only inline scripts and embedded pictures.
constexpr std::string_view kPolicy =
    "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'";

constexpr std::string_view kStyle = R"(
:root { color-scheme:dark light; --ink:#10141b; --panel:#171d27; --rule:#2a3340; --text:#e9e6dd;
  --soft:#98a2b1; --amber:#f0b64a; --teal:#58b6b0; --red:#ee7563; --grey:#4a5668 }
@media (prefers-color-scheme: light) {
  :root { --ink:#f4f2ec; --panel:#fff; --rule:#d9d6cd; --text:#1a1f28; --soft:#5b6675;
    --amber:#a86a00; --teal:#0f7f78; --red:#c23a26; --grey:#aab3bf } }
@media print { :root { --ink:#fff; --panel:#fff; --text:#111; --soft:#555; --rule:#ccc } }
* { box-sizing:border-box }
body { margin:0; background:var(--ink); color:var(--text); line-height:1.5;
  font:16px/1.5 "Inter","Source Sans 3","Noto Sans","DejaVu Sans",system-ui,sans-serif; }
main { max-width:1120px; margin:0 auto; padding:48px 40px 72px }
h1 { font-size:30px; line-height:1.2; margin:0 0 4px; font-weight:600; letter-spacing:-.01em }
h2 { font-size:17px; margin:0 0 2px; font-weight:600 }
.sub { color:var(--soft); margin:0 0 28px }
.facts { display:flex; flex-wrap:wrap; gap:12px 44px; margin:0 0 28px; padding:18px 0;
  border-top:1px solid var(--rule); border-bottom:1px solid var(--rule) }
.facts div { font-size:13px; color:var(--soft) }
.facts b { display:block; font-size:22px; line-height:1.3; font-weight:600; color:var(--text);
  font-variant-numeric:tabular-nums }
section { background:var(--panel); border-radius:6px; padding:20px 24px 10px; margin:0 0 22px }
section p { color:var(--soft); margin:0 0 12px; font-size:14px; max-width:90ch }
svg { display:block; width:100%; height:auto; font-family:inherit }
svg text { fill:var(--soft); font-size:12px; font-variant-numeric:tabular-nums }
svg .small { font-size:10px }
svg .label { fill:var(--text) }
svg .note { fill:var(--amber) }
svg .grid { stroke:var(--rule); stroke-width:1 }
svg .axis { stroke:var(--soft); stroke-width:1 }
svg .limit { stroke:var(--amber); stroke-width:1; stroke-dasharray:5 4 }
svg polyline { fill:none; stroke-linejoin:round }
.key i { display:inline-block; width:11px; height:11px; border-radius:2px; margin:0 6px 0 16px }
.key i:first-child { margin-left:0 }
table { border-collapse:collapse; width:100%; font-size:13px; font-variant-numeric:tabular-nums }
th { text-align:right; font-weight:600; color:var(--soft); padding:6px 0 6px 14px;
  border-bottom:1px solid var(--rule); vertical-align:bottom }
td { text-align:right; padding:2.5px 0 2.5px 14px; border-bottom:1px solid var(--rule) }
th:first-child,td:first-child { text-align:left; padding-left:0 }
th:nth-child(2),td:nth-child(2) { text-align:left }
td.some { color:var(--amber) }
)";

}  // namespace

std::string escape_html(std::string_view text) {
  std::string escaped;
  for (const char c : text) {
    switch (c) {
      case '&':
        escaped += "&amp;";
        break;
      case '<':
        escaped += "&lt;";
        break;
      case '>':
        escaped += "&gt;";
        break;
      case '"':
        escaped += "&quot;";
        break;
      default:
        escaped += c;
    }
  }
  return escaped;
}

std::string html_page(std::string_view title, std::string_view subtitle, std::string_view body,
                      std::string_view style) {
  return fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta http-equiv=\"Content-Security-Policy\" content=\"{5}\">\n"
      "<meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\n"
      "<title>{0}</title>\n<style>{3}{4}</style>\n</head>\n<body>\n<main>\n"
      "<h1>{0}</h1>\n<p class=\"sub\">{1}</p>\n{2}</main>\n</body>\n</html>\n",
      escape_html(title), escape_html(subtitle), body, kStyle, style, kPolicy);
}

std::string html_section(std::string_view heading, std::string_view explanation,
                         std::string_view content) {
  return fmt::format("<section>\n<h2>{}</h2>\n<p>{}</p>\n{}</section>\n", escape_html(heading),
                     explanation, content);
}

}  // namespace raystage::charts
