// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "render/evaluation/bench.h"

namespace raystage {

/// A colour for each method, in the order in which a trade names them: classes c0 to c8 of the
/// page's style, then again from c0.
class MethodColours {
 public:
  explicit MethodColours(const BenchResult& trade);
  std::string of(const std::string& method) const;
  /// HTML: every method beside its colour.
  std::string key() const;

 private:
  std::vector<std::string> methods_;
};

enum class QualityMeasure { kPsnr, kSsim };

/// HTML: a chart of every setting by error and seconds per frame, the Pareto front marked, with the
/// cameras asked for first and on the most threads. Dots are of class "rowN", N the row whose
/// pictures show them.
std::string bench_chart(const BenchResult& trade, QualityMeasure measure,
                        const MethodColours& colours);

/// HTML: error against camera spacing, and what eq. 2.1 says of each; empty where only one spacing
/// was measured.
std::string spacing_section(const BenchResult& trade, const MethodColours& colours);

}  // namespace raystage
