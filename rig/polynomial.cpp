// SPDX-License-Identifier: Apache-2.0
// Finds sign changes of polynomials by bisection between those of the derivative, recursively.
#include "rig/polynomial.h"

namespace raystage::rig {
namespace {

double evaluate(const Polynomial& p, double r) {
  double value = 0;
  for (std::size_t i = p.size(); i-- > 0;) value = value * r + p[i];
  return value;
}

/// Returns the root of `p` between `low` and `high`, where its signs differ, to adjacent doubles.
double bisect(const Polynomial& p, double low, double high) {
  const bool low_positive = evaluate(p, low) > 0;
  for (;;) {
    const double middle = low + (high - low) / 2;
    if (middle <= low || middle >= high) return low;
    ((evaluate(p, middle) > 0) == low_positive ? low : high) = middle;
  }
}

}  // namespace

// The sign changes of the derivative bracket them: there is at most one between two.
std::vector<double> sign_changes(const Polynomial& p, double limit) {
  Polynomial derivative{};
  bool constant = true;
  for (std::size_t i = 1; i < p.size(); ++i) {
    derivative[i - 1] = static_cast<double>(i) * p[i];
    constant = constant && p[i] == 0;
  }
  if (constant) return {};
  std::vector<double> ends = sign_changes(derivative, limit);
  ends.push_back(limit);
  std::vector<double> roots;
  double low = 0;
  for (const double high : ends) {
    if ((evaluate(p, low) > 0) != (evaluate(p, high) > 0)) roots.push_back(bisect(p, low, high));
    low = high;
  }
  return roots;
}

}  // namespace raystage::rig
