// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <ceres/iteration_callback.h>
#include <ceres/types.h>

#include <stop_token>

namespace raystage {

/// Stops a Ceres solve between two iterations. The token must outlive it.
class CeresStopCallback : public ceres::IterationCallback {
 public:
  explicit CeresStopCallback(const std::stop_token& stop) : stop_(stop) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary& /*step*/) override {
    return stop_.stop_requested() ? ceres::SOLVER_ABORT : ceres::SOLVER_CONTINUE;
  }

 private:
  const std::stop_token& stop_;
};

}  // namespace raystage
