// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <vector>

#include "compose/preparation.h"
#include "compose/sequence.h"
#include "farm/submission.h"

namespace raystage::farm {

/// What the checks of a submission found.
struct Checked {
  CheckedSequence sequence;
  std::vector<DerivedInstant> instants;
  std::filesystem::path cache;  ///< for derived data; empty: the takes
};

/// Checks everything that a job needs before anything is written. Throws Error as check_sequence(),
/// and for options, methods and memory that no task could use.
Checked check_submission(const SubmissionOptions& options);

}  // namespace raystage::farm
