// SPDX-License-Identifier: Apache-2.0
#include "reports/crop_section.h"

#include <fmt/format.h>

#include <cmath>
#include <string_view>

#include "base/base64.h"
#include "charts/html_page.h"
#include "images/png_file.h"
#include "reports/row_name.h"

namespace raystage::reports {
namespace {

// The pictures of all crops flip together: "shown" is the index of the button, 0 the truth.
constexpr std::string_view kFlipScript = R"(
(() => {
const crops = document.getElementById('crops'), names = crops.querySelector('.names');
const buttons = [...names.querySelectorAll('button')], strips = [...crops.querySelectorAll('.strip')];
let chosen = 1, setting = 1;
function show(shown) {
  for (const strip of strips) {
    [...strip.children].forEach((figure, i) => { figure.hidden = i !== shown; });
    strip.setAttribute('aria-label', strip.dataset.place + ': ' + buttons[shown].textContent);
  }
  buttons.forEach((button, i) => button.classList.toggle('shown', i === shown));
}
function choose(at) {
  chosen = (at + buttons.length) % buttons.length;
  if (chosen > 0) setting = chosen;
  buttons.forEach((button, i) => button.setAttribute('aria-pressed', i === chosen));
  show(chosen);
}
const flip = () => choose(chosen > 0 ? 0 : setting);
buttons.forEach((button, i) => {
  button.onclick = () => choose(i);
  button.onmouseenter = () => show(i);
  button.onmouseleave = () => show(chosen);
});
for (const strip of strips) {
  strip.tabIndex = 0;
  strip.setAttribute('role', 'button');
  strip.onclick = flip;
}
// Before the pictures below, which use the same keys, where the pointer or the focus is here.
document.addEventListener('keydown', e => {
  const isInside = crops.contains(e.target);
  if (e.ctrlKey || e.altKey || e.metaKey || !(isInside || crops.matches(':hover'))) return;
  if (!isInside && /^(BUTTON|SELECT|INPUT)$/.test(e.target.tagName)) return;
  const presses = e.key === ' ' || e.key === 'Enter';
  if (e.key === 'ArrowRight') choose(chosen + 1);
  else if (e.key === 'ArrowLeft') choose(chosen - 1);
  else if (e.key === 't') flip();
  else if (presses && e.target.tagName !== 'BUTTON') flip();
  else return;
  e.preventDefault();
  e.stopPropagation();
}, true);
names.hidden = false;
crops.classList.add('flips');
choose(1);
})();
)";

constexpr std::string_view kExplanation =
    "Each crop shows the same pixels of a view, enlarged, in the truth and in every setting. Crops "
    "are placed where the settings differ most, where even the best of them is wrong, and, if the "
    "true depths are known, at the largest errors at edges of depth and at thin structures. The "
    "position is that of the top left pixel, dB is the PSNR of the crop. Point at a name to show "
    "its crops, click it to keep them. Click a crop or press <kbd>t</kbd> to flip to the truth and "
    "back; <kbd>&larr;</kbd> <kbd>&rarr;</kbd> change the setting.";

std::string_view reason_text(evaluation::CropReason reason) {
  switch (reason) {
    case evaluation::CropReason::kDifference:
      return "Settings differ most";
    case evaluation::CropReason::kError:
      return "Even the best is wrong";
    case evaluation::CropReason::kEdge:
      return "Edges of depth";
    case evaluation::CropReason::kThin:
      return "Thin structures";
  }
  return "";
}

std::string figure_of(const store::RgbImage& image, const std::string& name,
                      const std::string& caption, const std::string& colour) {
  return fmt::format(
      "<figure><img alt=\"{}\" width=\"{}\" height=\"{}\" decoding=\"sync\" "
      "src=\"data:image/png;base64,{}\"><figcaption class=\"{}\">{}</figcaption></figure>\n",
      charts::escape_html(name), image.width, image.height,
      encode_base64(images::encode_png(image, "crop of " + name)), colour,
      charts::escape_html(caption));
}

/// Returns the PSNR of a crop as text.
std::string caption_of(const std::string& name, const evaluation::WindowErrors& errors) {
  if (std::isnan(errors.rms)) return name + ", mostly not covered";
  if (errors.rms == 0) return name + ", equal to the truth";
  return fmt::format("{}, {:.2f} dB", name, 20 * std::log10(255 / errors.rms));
}

std::string place_of(const evaluation::BenchCrops::ChosenCrop& chosen,
                     const evaluation::BenchResult& trade, const MethodColours& colours) {
  const evaluation::BenchCrops::Crop& crop = chosen.crop;
  const std::string place =
      charts::escape_html(fmt::format("{}, pixel {}, {}", crop.view, crop.window.x, crop.window.y));
  std::string figures = figure_of(crop.truth, "truth", "truth", "");
  for (const evaluation::BenchCrops::Picture& picture : crop.pictures) {
    const evaluation::BenchRow& row = trade.rows[picture.row];
    const std::string name = row_name(row, trade);
    figures += figure_of(picture.image, name, caption_of(name, picture.errors),
                         colours.of(row.setting.method));
  }
  return fmt::format(
      "<div class=\"place\"><h3>{}<span>{}</span></h3>\n"
      "<div class=\"strip\" data-place=\"{}\">\n{}</div></div>\n",
      reason_text(chosen.reason), place, place, figures);
}

}  // namespace

std::string crop_section(const evaluation::BenchResult& trade, const MethodColours& colours) {
  const std::vector<evaluation::BenchCrops::ChosenCrop> crops = trade.crops.chosen();
  if (crops.empty()) return "";
  std::string names = "<button>truth</button>", places;
  for (const evaluation::BenchCrops::Picture& picture : crops.front().crop.pictures) {
    const evaluation::BenchRow& row = trade.rows[picture.row];
    names += fmt::format("<button class=\"{}\">{}</button>", colours.of(row.setting.method),
                         charts::escape_html(row_name(row, trade)));
  }
  for (const evaluation::BenchCrops::ChosenCrop& crop : crops) {
    places += place_of(crop, trade, colours);
  }
  return "<div id=\"crops\">\n" +
         charts::html_section("Crops", kExplanation,
                              "<div class=\"bar names\" hidden>" + names +
                                  "</div>\n<div class=\"places\">\n" + places + "</div>\n") +
         "<script>" + std::string(kFlipScript) + "</script></div>\n";
}

}  // namespace raystage::reports
