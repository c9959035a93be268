// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace raystage {

/// How far a run came, in its report. A report that no run has filled in is not a success.
enum class RunStatus {
  kNotRun,   ///< the run did not start, or ended by an exception
  kStopped,  ///< stopped on request before the end
  kFinished  ///< came to its end; the report says what failed on the way
};

}  // namespace raystage
