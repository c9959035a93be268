// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "farm/path_map.h"
#include "farm/ranks/mpi_world.h"
#include "render/common/fragment_encoding.h"

namespace raystage::farm {

struct WorkerRankOptions {
  std::vector<PathMappingRule> takes;  ///< as RankOptions
  render::FragmentEncodingOptions encoding;
  int threads = 1;             ///< of the TBB arena in which views are rendered
  int out_of_memory_code = 1;  ///< exit code of the job if this rank runs out of memory
};

/// Runs any rank except the root: serves the requests of rank 0 and returns at the stop request.
/// Reports failures to rank 0 instead of throwing them.
void run_worker_rank(MpiWorld& world, const WorkerRankOptions& options);

}  // namespace raystage::farm
