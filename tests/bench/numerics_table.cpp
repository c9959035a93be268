// SPDX-License-Identifier: Apache-2.0
// Prints the table of docs/numerics.md: the errors of geometry at the extremes against 50 digits.
#include <fmt/format.h>
#include <hwy/targets.h>

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "render/sampling/source_view.h"
#include "testing/render/kernel_accuracy.h"

namespace raystage {
namespace {

using testing::GeometryErrors;

void widen(GeometryErrors& worst, const GeometryErrors& errors) {
  worst.weight = std::max(worst.weight, errors.weight);
  worst.position = std::max(worst.position, errors.position);
  worst.depth = std::max(worst.depth, errors.depth);
  worst.weight_sum = std::max(worst.weight_sum, errors.weight_sum);
  worst.weights_compared = errors.weights_compared;
  worst.positions_compared = errors.positions_compared;
}

std::string number(double error, bool known) {
  if (!known) return "-";
  return error == 0 ? "0" : fmt::format("{:.0e}", error);
}

void print(const std::string& name, const testing::ViewAccuracy& accuracy) {
  const GeometryErrors &d = accuracy.in_double, &k = accuracy.in_kernels;
  const bool weights = d.weights_compared > 0, positions = d.positions_compared > 0;
  fmt::print("| {} | {} | {} | {} | {} | {} | {} | {} |\n", name, number(d.weight, weights),
             number(d.position, positions), number(d.depth, positions), number(k.weight, weights),
             number(k.position, positions), number(k.depth, positions),
             number(k.weight_sum, weights));
}

void run() {
  std::string sets;
  const auto targets = hwy::SupportedAndGeneratedTargets();
  std::vector<std::int64_t> distinct;
  const auto choose = [](auto target) {
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  };
  for (const auto target : targets) {
    choose(target);
    if (sets.find(render::kernel_target()) != std::string::npos) continue;
    sets += (sets.empty() ? "" : ", ") + std::string(render::kernel_target());
    distinct.push_back(target);
  }
  fmt::print("Kernels on {}: the worst of them.\n\n", sets);
  fmt::print(
      "| | weight | position, px | depth | weight | position, px | depth | sum of weights |\n");
  fmt::print("| --- | --: | --: | --: | --: | --: | --: | --: |\n");
  for (const testing::ExtremeView& extreme : testing::extremes()) {
    testing::ViewAccuracy worst;
    for (const auto target : distinct) {
      choose(target);
      const testing::ViewAccuracy accuracy = testing::measure_accuracy(extreme);
      widen(worst.in_double, accuracy.in_double);
      widen(worst.in_kernels, accuracy.in_kernels);
    }
    print(extreme.name, worst);
  }
}

}  // namespace
}  // namespace raystage

int main() {
  raystage::run();
  return 0;
}
