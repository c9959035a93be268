// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <vector>

#include "compose/derived_data.h"
#include "compose/sequence.h"
#include "farm/submission.h"

namespace raystage::farm {

/// What the checks of a submission found.
struct SubmissionCheckResult {
  CheckedSequence sequence;
  std::vector<DerivedFrameData> instants;
  std::filesystem::path cache;  ///< for derived data; empty: the takes
};

/// Checks everything that a job needs before anything is written. Throws Error as check_sequence(),
/// and for options, methods and memory that no task could use.
SubmissionCheckResult check_submission(const SubmissionOptions& options);

}  // namespace raystage::farm
