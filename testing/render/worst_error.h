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

/// Compares a property's errors with their bounds. At its end it prints the largest error
/// (docs/numerics.md) and the largest ratio of error to bound; a small ratio could hide a fault.
/// Fails if nothing was compared.
class WorstError {
 public:
  /// `what`: the quantity, with its unit. Errors whose bound exceeds `of_interest` are not printed
  /// as the largest: they are ill-conditioned even in double.
  explicit WorstError(std::string what, double of_interest = 1e300)
      : what_(std::move(what)), of_interest_(of_interest) {}
  ~WorstError() {
    EXPECT_GT(compared_, 0) << what_ << ": nothing was compared";
    std::cout << "[  worst   ] " << what_ << ": " << std::scientific << std::setprecision(1)
              << error_ << std::defaultfloat << std::setprecision(2) << ", " << of_bound_
              << " of its bound (" << compared_ << " compared)" << std::endl;
  }
  WorstError(const WorstError&) = delete;
  WorstError& operator=(const WorstError&) = delete;

  /// Compares an error with its bound. Call it only within a property.
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
