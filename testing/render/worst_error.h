// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <iostream>
#include <string>
#include <utility>

namespace raystage::testing {

/// Holds a property's errors to what each of them may be, and at its end prints the largest
/// (docs/numerics.md) and how much of its allowance an error used at most: far below 1 it would
/// hide a fault. A test that compared nothing fails.
class WorstError {
 public:
  /// `what`: with its unit. Errors that may be larger than `of_interest` do not count as the
  /// largest: there the answer is not known, to anybody's doubles.
  explicit WorstError(std::string what, double of_interest = 1e300)
      : what_(std::move(what)), of_interest_(of_interest) {}
  ~WorstError() {
    EXPECT_GT(compared_, 0) << what_ << ": nothing was compared";
    std::cout << "[  worst   ] " << what_ << ": " << std::scientific << std::setprecision(1)
              << error_ << std::defaultfloat << std::setprecision(2) << ", " << of_bound_
              << " of what it may be (" << compared_ << " compared)" << std::endl;
  }
  WorstError(const WorstError&) = delete;
  WorstError& operator=(const WorstError&) = delete;

  /// Within a property.
  void expect(double error, double bound) {
    error = std::abs(error);
    if (!(error <= bound)) RC_LOG() << what_ << ": " << error << ", bound " << bound << '\n';
    RC_ASSERT(error <= bound);
    ++compared_;
    if (error > 0) of_bound_ = std::max(of_bound_, error / bound);
    if (bound <= of_interest_) error_ = std::max(error_, error);
  }

 private:
  std::string what_;
  double of_interest_;
  double error_ = 0, of_bound_ = 0;
  int compared_ = 0;
};

}  // namespace raystage::testing
