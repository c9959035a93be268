// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <vector>

#include "compose/derived_data.h"
#include "compose/sequence.h"
#include "farm/submission.h"

namespace raystage::farm {

/// The result of check_submission().
struct SubmissionCheckResult {
  compose::CheckedSequence sequence;
  std::vector<compose::DerivedFrameData> instants;
  std::filesystem::path cache;  ///< for derived data; empty: the takes
};

/// Checks everything that a job needs before anything is written. Throws Error as check_sequence()
/// does, and for options, methods and memory limits that no task could use.
SubmissionCheckResult check_submission(const SubmissionOptions& options);

}  // namespace raystage::farm
