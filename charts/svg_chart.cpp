// SPDX-License-Identifier: Apache-2.0
// Draws a chart as SVG. Axis steps are 1, 2 or 5 times a power of ten. Names of dots are placed
// greedily at the first of eight positions that overlaps no dot or other name. Input: points in the
// axes' units. Cost: quadratic in dots.
#include "charts/svg_chart.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "charts/html_page.h"

namespace raystage::charts {
namespace {

constexpr int kWidth = 1040, kHeight = 300, kLeft = 70, kRight = 18, kTop = 16;

// Returns a step of 1, 2 or 5 times a power of ten; about `count` steps cover the range.
double tick_step(double range, int count) {
  const double raw = range / count;
  const double power = std::pow(10, std::floor(std::log10(raw)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (raw <= factor * power * (1 + 1e-9)) return factor * power;
  }
  return 10 * power;
}

int digits(double step) {
  return std::max(0, static_cast<int>(std::ceil(-std::log10(step) - 1e-9)));
}

/// A rectangle of the chart in pixels.
struct Box {
  double left, top, right, bottom;
  bool meets(const Box& other) const {
    return left < other.right && other.left < right && top < other.bottom && other.top < bottom;
  }
};

}  // namespace

SvgChart::SvgChart(std::string description, Axis x, Axis y)
    : description_(std::move(description)), x_(std::move(x)), y_(std::move(y)) {
  for (Axis* axis : {&x_, &y_}) {
    if (!(axis->high > axis->low)) axis->high = axis->low + 1;
  }
  x_.logarithmic = x_.logarithmic && x_.low > 0;
}

double SvgChart::at_x(double x) const {
  const double share = x_.logarithmic ? std::log(x / x_.low) / std::log(x_.high / x_.low)
                                      : (x - x_.low) / (x_.high - x_.low);
  return kLeft + share * (kWidth - kLeft - kRight);
}
double SvgChart::at_y(double y) const {
  const double share = std::clamp((y - y_.low) / (y_.high - y_.low), 0.0, 1.0);
  return kTop + (1 - share) * (kHeight - kTop);
}

void SvgChart::line(std::span<const Point> points, std::string_view css_class) {
  body_ += fmt::format("<polyline class=\"{}\" points=\"", css_class);
  for (const Point& p : points) body_ += fmt::format("{:.1f},{:.1f} ", at_x(p.x), at_y(p.y));
  body_ += "\"/>\n";
}

void SvgChart::bar(double x0, double x1, double y0, double y1, std::string_view css_class,
                   std::string_view title) {
  const double top = at_y(y1), bottom = at_y(y0);
  if (bottom - top <= 0) return;
  body_ += fmt::format(R"(<rect class="{}" x="{:.1f}" y="{:.1f}" width="{:.1f}" height="{:.1f}">)",
                       css_class, at_x(x0), top, std::max(0.5, at_x(x1) - at_x(x0)), bottom - top);
  if (!title.empty()) body_ += fmt::format("<title>{}</title>", escape_html(title));
  body_ += "</rect>\n";
}

void SvgChart::horizontal(double y, std::string_view label) {
  body_ += fmt::format(R"(<line class="limit" x1="{}" x2="{}" y1="{:.1f}" y2="{:.1f}"/>)", kLeft,
                       kWidth - kRight, at_y(y), at_y(y));
  labels_ += fmt::format(R"(<text class="note" x="{}" y="{:.1f}" text-anchor="end">{}</text>)",
                         kWidth - kRight - 4, at_y(y) - 5, escape_html(label));
}

void SvgChart::vertical(double x, std::string_view label) {
  if (x < x_.low || x > x_.high) return;
  body_ += fmt::format(R"(<line class="limit" x1="{0:.1f}" x2="{0:.1f}" y1="{1}" y2="{2}"/>)",
                       at_x(x), kTop, kHeight);
  const bool left = at_x(x) > kWidth - 260;
  labels_ +=
      fmt::format(R"(<text class="note" x="{:.1f}" y="{}" text-anchor="{}">{}</text>)",
                  at_x(x) + (left ? -5 : 5), kTop + 11, left ? "end" : "start", escape_html(label));
}

void SvgChart::x_label(double x, std::string_view label, bool turned) {
  const double at = at_x(x);
  if (turned) {
    below_ = 74;
    labels_ += fmt::format(
        R"svg(<text class="small" transform="translate({:.1f},{}) rotate(-90)" text-anchor="end">{}</text>)svg",
        at + 3, kHeight + 7, escape_html(label));
  } else {
    labels_ += fmt::format(R"(<text x="{:.1f}" y="{}" text-anchor="middle">{}</text>)", at,
                           kHeight + 18, escape_html(label));
  }
}

void SvgChart::dot(Dot dot) { dots_.push_back(std::move(dot)); }

std::string SvgChart::dots() const {
  // A name goes to the right of its dot, or to the first free position around it. Names that are
  // always shown are placed first.
  constexpr double kRadius = 6, kLetter = 6.7, kLine = 14;
  std::vector<Box> taken;
  for (const Dot& dot : dots_) {
    const double x = at_x(dot.x), y = at_y(dot.y);
    taken.push_back({x - kRadius, y - kRadius, x + kRadius, y + kRadius});
  }
  std::string svg;
  for (const bool named : {true, false}) {
    for (const Dot& dot : dots_) {
      if (dot.named != named) continue;
      const double x = at_x(dot.x), y = at_y(dot.y),
                   length = kLetter * static_cast<double>(dot.name.size());
      svg += fmt::format(
          R"(<circle class="{}" cx="{:.1f}" cy="{:.1f}" r="{}"><title>{}</title></circle>)",
          dot.css_class, x, y, named ? kRadius : kRadius - 1.5, escape_html(dot.title));
      struct Place {
        double left, bottom;
      };
      const std::array<Place, 8> places{{{x + 10, y + 4},
                                         {x + 8, y - 7},
                                         {x + 8, y + 15},
                                         {x - length - 8, y - 7},
                                         {x - length - 10, y + 4},
                                         {x - length - 8, y + 15},
                                         {x - length / 2, y - 12},
                                         {x - length / 2, y + 21}}};
      const auto box_at = [&](const Place& place) {
        return Box{place.left, place.bottom - kLine + 3, place.left + length, place.bottom + 3};
      };
      const auto free = std::ranges::find_if(places, [&](const Place& place) {
        const Box box = box_at(place);
        return box.left >= kLeft && box.right <= kWidth && box.top >= 0 && box.bottom <= kHeight &&
               std::ranges::none_of(taken, [&](const Box& other) { return box.meets(other); });
      });
      if (free == places.end() && !named) continue;
      const Place& place = free == places.end() ? places[0] : *free;
      taken.push_back(box_at(place));
      svg += fmt::format(R"(<text class="{}" x="{:.1f}" y="{:.1f}">{}</text>)",
                         named ? "label" : "name", place.left, place.bottom, escape_html(dot.name));
    }
  }
  return svg + "\n";
}

std::string SvgChart::x_ticks() const {
  std::string svg;
  const auto tick = [&](double x, const std::string& text, bool across) {
    svg += fmt::format(
        R"(<line class="grid" x1="{0:.1f}" x2="{0:.1f}" y1="{1}" y2="{2}"/><text x="{0:.1f}" y="{3}" text-anchor="middle">{4}</text>)",
        at_x(x), across ? kTop : kHeight, kHeight + 5, kHeight + 18, text);
  };
  if (x_.logarithmic) {
    for (double power = std::pow(10, std::floor(std::log10(x_.low))); power <= x_.high;
         power *= 10) {
      for (const double factor : {1.0, 2.0, 5.0}) {
        const double x = factor * power;
        if (x >= x_.low * (1 - 1e-9) && x <= x_.high * (1 + 1e-9)) {
          tick(x, fmt::format("{:g}", x), factor == 1);
        }
      }
    }
    return svg;
  }
  const double step = tick_step(x_.high - x_.low, 10);
  for (double x = std::ceil(x_.low / step - 1e-9) * step; x <= x_.high + step * 1e-9; x += step) {
    const double value = std::abs(x) < step * 1e-6 ? 0 : x;
    tick(x, fmt::format("{:.{}f}", value, digits(step)), false);
  }
  return svg;
}

std::string SvgChart::str() const {
  const int height = kHeight + below_;
  std::string svg = fmt::format("<svg viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"{}\">\n",
                                kWidth, height, escape_html(description_));
  const double y_step = tick_step(y_.high - y_.low, 5);
  for (double y = std::ceil(y_.low / y_step - 1e-9) * y_step; y <= y_.high * (1 + 1e-9);
       y += y_step) {
    const double value = std::abs(y) < y_step * 1e-6 ? 0 : y;
    svg += fmt::format(
        R"(<line class="grid" x1="{}" x2="{}" y1="{:.1f}" y2="{:.1f}"/><text x="{}" y="{:.1f}" text-anchor="end">{:.{}f}</text>)",
        kLeft, kWidth - kRight, at_y(y), at_y(y), kLeft - 8, at_y(y) + 4, value, digits(y_step));
  }
  if (x_.ticks) svg += x_ticks();
  svg += body_ + dots() + labels_;
  svg += fmt::format(R"(<line class="axis" x1="{0}" x2="{1}" y1="{2}" y2="{2}"/>)", kLeft,
                     kWidth - kRight, kHeight);
  svg += fmt::format(R"(<text class="label" x="{}" y="{}" text-anchor="end">{}</text>)",
                     kWidth - kRight, height - 6, escape_html(x_.label));
  svg += fmt::format(
      R"svg(<text class="label" transform="translate(14,{}) rotate(-90)" text-anchor="end">{}</text>)svg",
      kTop, escape_html(y_.label));
  return svg + "\n</svg>\n";
}

}  // namespace raystage::charts
