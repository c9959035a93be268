// SPDX-License-Identifier: Apache-2.0
#include "planning/epipolar/measured_depths_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/base64.h"
#include "charts/html_page.h"
#include "charts/svg_chart.h"
#include "schemas/json_text.h"
#include "store/jpeg/encode.h"

namespace raystage::planning {
namespace {

using nlohmann::ordered_json;

std::string range_text(const schemas::DepthRange& range) {
  return fmt::format("{:.4g} m to {}", range.near,
                     std::isinf(range.far) ? "infinity" : fmt::format("{:.4g} m", range.far));
}

/// Returns by how many pixels points move between neighbouring cameras, over a range.
std::string disparity_text(const MeasuredDepths& depths) {
  if (!depths.range || depths.inverse_depth_per_pixel <= 0) return "";
  return fmt::format("Points move by {:.1f} to {:.1f} pixels from one camera to the next.\n",
                     std::max(0.0, 1 / depths.range->far) / depths.inverse_depth_per_pixel,
                     1 / depths.range->near / depths.inverse_depth_per_pixel);
}

std::string image_heading(const EpipolarImage& image) {
  return image.axis == EpipolarAxis::kRow
             ? fmt::format("Row of cameras, line {} of the picture", image.position)
             : fmt::format("Column of cameras, column {} of the picture", image.position);
}

std::string picture_of(const Image<std::uint8_t>& luma) {
  store::RgbImage image(luma.width, luma.height);
  for (int y = 0; y < luma.height; ++y) {
    for (int x = 0; x < luma.width; ++x) {
      std::ranges::fill(image.pixel(x, y), luma.at(x, y));
    }
  }
  return "data:image/jpeg;base64," + encode_base64(store::encode_jpeg(image, {}));
}

/// Returns the image with the slopes of the nearest and the farthest depth through its middle.
std::string drawing_of(const EpipolarImage& image, const MeasuredDepths& depths) {
  constexpr int kRowHeight = 18;
  const int width = image.luma.width, height = image.luma.height * kRowHeight;
  std::string svg = fmt::format(
      "<svg class=\"epi\" viewBox=\"0 0 {0} {1}\" role=\"img\" aria-label=\"{2}\">"
      "<image href=\"{3}\" width=\"{0}\" height=\"{1}\" preserveAspectRatio=\"none\"/>",
      width, height, image_heading(image), picture_of(image.luma));
  const auto line = [&](double inverse_depth, std::string_view css_class) {
    std::string points;
    for (std::size_t i = 0; i < image.shift_at_one_metre.size(); ++i) {
      points +=
          fmt::format("{:.1f},{:.1f} ", width / 2.0 + inverse_depth * image.shift_at_one_metre[i],
                      (static_cast<double>(i) + 0.5) * kRowHeight);
    }
    svg += fmt::format("<polyline class=\"{}\" points=\"{}\"/>", css_class, points);
  };
  if (depths.range) {
    line(1 / depths.range->near, "near");
    line(1 / depths.range->far, "far");
  }
  return svg + "</svg>\n";
}

std::string histogram_of(const MeasuredDepths& depths) {
  constexpr std::size_t kBins = 120;
  const double low = std::min(0.0, depths.inverse_depths.front());
  const double high =
      std::max(depths.inverse_depths.back(), depths.range ? 1 / depths.range->near : 0.0);
  const double bin = std::max(1e-12, (high - low) / kBins);
  std::array<double, kBins> counts{};
  for (const double value : depths.inverse_depths) {
    counts[std::min(kBins - 1, static_cast<std::size_t>((value - low) / bin))] += 1;
  }
  // Small surfaces are few pixels, so the share is drawn on a scale of its square root.
  const double total = static_cast<double>(depths.inverse_depths.size());
  double most = 0;
  for (const double count : counts) most = std::max(most, std::sqrt(count / total));
  charts::SvgChart chart("Measured pixels against inverse depth",
                         {low, low + bin * kBins, "1 / depth, 1/m (0: infinitely far)"},
                         {0, 1.1 * most, "share of pixels, square root", false});
  for (std::size_t i = 0; i < kBins; ++i) {
    const double left = low + bin * static_cast<double>(i);
    chart.bar(left, left + bin, 0, std::sqrt(counts[i] / total), "measured",
              fmt::format("{:.3f} % between {:.4g} and {:.4g} 1/m", 100 * counts[i] / total, left,
                          left + bin));
  }
  if (depths.range) {
    chart.vertical(1 / depths.range->near, fmt::format("{:.3g} m", depths.range->near));
    chart.vertical(1 / depths.range->far, std::isinf(depths.range->far)
                                              ? std::string("infinity")
                                              : fmt::format("{:.3g} m", depths.range->far));
  }
  return chart.str();
}

constexpr std::string_view kPageStyle = R"(
svg.epi { width:100%; image-rendering:pixelated; display:block; margin:0 0 1em }
svg.epi polyline { fill:none; stroke-width:2 }
polyline.near { stroke:var(--amber) }
polyline.far { stroke:var(--teal) }
.measured { fill:var(--teal) }
)";

}  // namespace

std::string format_measured_depths(const MeasuredDepths& depths) {
  std::string text = fmt::format("{} pixels measured, of up to {} cameras at {} instant{}.\n",
                                 depths.inverse_depths.size(), depths.cameras,
                                 depths.instants.size(), depths.instants.size() == 1 ? "" : "s");
  text += depths.range ? "Depth range  " + range_text(*depths.range) + "\n" + disparity_text(depths)
                       : "No depth range: " + depths.no_range_because + ".\n";
  if (!depths.stated) return text + "take.json states no depth range.\n";
  text += "take.json    " + range_text(*depths.stated) + "\n";
  // Reflections seem farther than the mirror, and repeated patterns nearer or farther than they
  // are.
  constexpr double kAlike = 1.2;
  const bool differs =
      depths.range && (1 / depths.range->near > kAlike / depths.stated->near ||
                       1 / depths.range->near < 1 / (kAlike * depths.stated->near) ||
                       std::isinf(depths.range->far) != std::isinf(depths.stated->far) ||
                       depths.range->far > kAlike * depths.stated->far ||
                       depths.range->far * kAlike < depths.stated->far);
  return differs ? text +
                       "They differ by more than a fifth: look at the histogram (--report) before "
                       "one replaces the other; mirrors and repeated patterns widen a range.\n"
                 : text;
}

std::string measured_depths_as_json(const MeasuredDepths& depths) {
  const auto range_json = [](const std::optional<schemas::DepthRange>& range) {
    return range ? ordered_json{range->near, schemas::number_or_null(range->far)}
                 : ordered_json(nullptr);
  };
  ordered_json images = ordered_json::array();
  for (const EpipolarImage& image : depths.images) {
    images.push_back({{"axis", image.axis == EpipolarAxis::kRow ? "row" : "column"},
                      {"position_px", image.position},
                      {"cameras", image.cameras},
                      {"shift_at_one_metre_px", image.shift_at_one_metre}});
  }
  ordered_json shares = ordered_json::array();
  for (const double share : {0.0, 0.001, 0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99, 0.999, 1.0}) {
    if (depths.inverse_depths.empty()) break;
    const auto last = static_cast<double>(depths.inverse_depths.size() - 1);
    shares.push_back(
        {{"share", share},
         {"inverse_depth_per_m", depths.inverse_depths[static_cast<std::size_t>(share * last)]}});
  }
  const ordered_json json{{"schema", "raystage/measured_depths/1"},
                          {"take", depths.take},
                          {"instants_ns", depths.instants},
                          {"cameras", depths.cameras},
                          {"pixels", depths.inverse_depths.size()},
                          {"depth_range_m", range_json(depths.range)},
                          {"no_range_because", depths.no_range_because},
                          {"stated_depth_range_m", range_json(depths.stated)},
                          {"inverse_depth_per_pixel", depths.inverse_depth_per_pixel},
                          {"quantiles", shares},
                          {"epipolar_images", images}};
  return schemas::dump_json(json) + "\n";
}

std::string measured_depths_as_page(const MeasuredDepths& depths) {
  std::string body;
  if (!depths.inverse_depths.empty()) {
    body += charts::html_section("Depths", charts::escape_html(format_measured_depths(depths)),
                                 histogram_of(depths));
  }
  for (const EpipolarImage& image : depths.images) {
    body += charts::html_section(
        image_heading(image),
        fmt::format("Each row is the same line of pixels of another camera, from {} (top) to {}. A "
                    "point is a line: vertical at infinity, the more inclined the nearer. Amber: "
                    "slope of the nearest depth, teal: of the farthest.",
                    charts::escape_html(image.cameras.front()),
                    charts::escape_html(image.cameras.back())),
        drawing_of(image, depths));
  }
  return charts::html_page("Epipolar-plane images: " + depths.take,
                           depths.range ? "depth range " + range_text(*depths.range)
                                        : "no depth range: " + depths.no_range_because,
                           body, kPageStyle);
}

}  // namespace raystage::planning
