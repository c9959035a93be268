// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <functional>
#include <span>
#include <vector>

#include "farm/ranks/messages.h"
#include "farm/ranks/mpi_world.h"
#include "render/common/contribution.h"
#include "render/distributed_rendering.h"

namespace raystage::farm {

/// The tree with rank 0 at its root along which contributions are added: in each step one rank of
/// kReductionRadix receives from the others. A rank's children come in increasing order; so do the
/// sums, whatever the order of arrival.
inline constexpr int kReductionRadix = 4;
int parent_rank(int rank);
std::vector<int> child_ranks(int rank, int ranks);

/// How contributions travel.
struct ViewExchange {
  MpiWorld& world;
  FragmentEncodingSettings encoding;
};

/// How a view's contributions travel: those of views in step have values that only floats hold;
/// what is asked for as JPEG goes as halves there.
FragmentEncodingSettings fragment_encoding_for(const DistributedViewRequest& view,
                                               const FragmentEncodingSettings& asked);

/// The ranks that have opened a take: its hosts, numbered in the order of their ranks.
struct RankSet {
  MpiWorld& world;
  std::span<const int> ranks;
};
/// Returns the number of a rank among them; -1: it is none of them.
int host_index(std::span<const int> ranks, int rank);
/// Returns the host number of each camera's owner, or -1.
std::vector<int> host_indices(std::span<const int> ranks, std::span<const int> camera_owners);

/// Calls `own` for a view: with all hosts as its group where the view is made in step. Where it
/// throws, the other ranks learn that this one has left.
Contribution contribute_as_rank(const RankSet& members, const DistributedViewRequest& view,
                                std::uint32_t view_number,
                                const DistributedRenderer::ContributeFunction& own);

/// Times of the reduction, in wall-clock milliseconds.
struct ReduceTimes {
  double local_ms = 0;  ///< this rank's contribution
  double wait_ms = 0;   ///< until those below had sent theirs
  double add_ms = 0;    ///< adding them
  RankTimes slowest;    ///< of the ranks below
  /// Of the wait, what no rank below worked: requests and fragments on their way, and requests that
  /// wait for their turn.
  double travel_ms() const { return std::max(0.0, local_ms + wait_ms - slowest.sum_ms()); }
  ReduceTimes& operator+=(const ReduceTimes& other);
};

/// Returns what this rank and those below it in the tree contribute to a view. `own`: what this
/// rank contributes. Adds what the messages of those below held to `counts`. Throws Error where one
/// of them, or this one, cannot contribute, when all have answered.
Contribution reduce_subtree(const ViewExchange& exchange, std::uint32_t view_number,
                            int light_field, const VirtualCamera& view,
                            const std::function<Contribution()>& own, FragmentCounts& counts,
                            ReduceTimes& times);

/// Sends what reduce_subtree() returns, or why it did not return, to the rank above. Throws
/// std::bad_alloc alone.
void send_to_parent(const ViewExchange& exchange, std::uint32_t view_number, int light_field,
                    const VirtualCamera& view, const std::function<Contribution()>& own);

}  // namespace raystage::farm
