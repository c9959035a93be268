// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "evaluation/bench.h"

namespace raystage::reports {

/// Assigns a CSS class to each method, in the order of the results: c0 to c8 of the page's style,
/// then again from c0.
class MethodColours {
 public:
  explicit MethodColours(const evaluation::BenchResult& trade);
  /// Returns the class of a method.
  std::string of(const std::string& method) const;
  /// Returns the legend as HTML.
  std::string key() const;

 private:
  std::vector<std::string> methods_;
};

enum class QualityMeasure { kPsnr, kSsim };

/// Returns a chart as HTML: quality against seconds per frame of every setting, with the Pareto
/// front, for the first camera step and the most threads. Dots have the class "rowN"; N is the row
/// whose pictures show the setting.
std::string bench_chart(const evaluation::BenchResult& trade, QualityMeasure measure,
                        const MethodColours& colours);

/// Returns a section as HTML: PSNR against camera spacing, and the prediction of eq. 2.1 for each.
/// Returns an empty text if only one spacing was measured.
std::string spacing_section(const evaluation::BenchResult& trade, const MethodColours& colours);

}  // namespace raystage::reports
