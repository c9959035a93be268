// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace raystage::charts {

/// A chart as inline SVG; the page's style sheet sets colours and fonts by class.
class SvgChart {
 public:
  struct Axis {
    double low = 0, high = 1;
    std::string label;
    bool ticks = true;
    bool logarithmic = false;  ///< x axis only; `low` must be above 0
  };
  /// Begins an empty chart. `description`: text for screen readers.
  SvgChart(std::string description, Axis x, Axis y);

  struct Point {
    double x, y;
  };
  /// Adds a polyline in the axes' units.
  void line(std::span<const Point> points, std::string_view css_class);
  /// A dot with tooltip `title`. Its name is next to it if there is space, always if `named`.
  struct Dot {
    double x = 0, y = 0;
    std::string css_class, name, title;
    bool named = false;
  };
  void dot(Dot dot);
  /// Adds a bar from (x0, y0) to (x1, y1) in the axes' units.
  void bar(double x0, double x1, double y0, double y1, std::string_view css_class,
           std::string_view title = "");
  /// Add a labelled line across the chart.
  void horizontal(double y, std::string_view label);
  void vertical(double x, std::string_view label);
  /// Adds a label below the x axis, rotated if `turned` (for many labels).
  void x_label(double x, std::string_view label, bool turned);

  /// Returns the chart as an SVG element.
  std::string str() const;

 private:
  double at_x(double x) const;
  double at_y(double y) const;
  std::string dots() const;
  std::string x_ticks() const;

  std::string description_, body_, labels_;
  std::vector<Dot> dots_;
  Axis x_, y_;
  int below_ = 46;  ///< pixels below the axis
};

}  // namespace raystage::charts
