// SPDX-License-Identifier: Apache-2.0
#include "reports/row_name.h"

#include <fmt/format.h>

#include <algorithm>

namespace raystage::reports {

std::string row_name(const evaluation::BenchRow& row, const evaluation::BenchResult& trade) {
  const bool many_steps = std::ranges::any_of(trade.rows, [&](const evaluation::BenchRow& other) {
    return other.camera_step != row.camera_step;
  });
  const bool many_threads = std::ranges::any_of(
      trade.rows, [&](const evaluation::BenchRow& other) { return other.threads != row.threads; });
  return row.setting.label +
         (many_steps ? fmt::format(", {} cameras", row.evaluation.cameras) : "") +
         (many_threads ? fmt::format(", {} thread{}", row.threads, row.threads == 1 ? "" : "s")
                       : "");
}

}  // namespace raystage::reports
