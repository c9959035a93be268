// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <ceres/iteration_callback.h>
#include <ceres/solver.h>
#include <ceres/types.h>

#include <stop_token>

namespace raystage::calibrate {

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

/// Returns options for a solution in one thread, which is the same everywhere.
inline ceres::Solver::Options ceres_options(ceres::LinearSolverType solver, int max_iterations,
                                            double tolerance = 1e-6) {
  ceres::Solver::Options options;
  options.num_threads = 1;
  options.logging_type = ceres::SILENT;
  options.linear_solver_type = solver;
  options.max_num_iterations = max_iterations;
  options.function_tolerance = tolerance;
  return options;
}

}  // namespace raystage::calibrate
