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

/// The tree along which contributions are added has rank 0 at its root. In each step one of
/// kReductionRadix ranks receives from the others. Children are sorted, and their contributions are
/// added in this order, whatever the order of arrival.
inline constexpr int kReductionRadix = 4;
int parent_rank(int rank);
std::vector<int> child_ranks(int rank, int ranks);

/// The ranks and the encoding with which contributions are sent.
struct ViewExchange {
  MpiWorld& world;
  render::FragmentEncodingOptions encoding;
};

/// Returns the encoding for a view's contributions. For a view in lockstep it replaces JPEG by
/// half, because JPEG cannot hold the values of such contributions.
render::FragmentEncodingOptions fragment_encoding_for(
    const render::DistributedViewRequest& view, const render::FragmentEncodingOptions& requested);

/// The ranks that have opened a take, called its hosts. Host i is the rank ranks[i].
struct RankSet {
  MpiWorld& world;
  std::span<const int> ranks;
};
/// Returns the host number of a rank, or -1 if it is not among `ranks`.
int host_index(std::span<const int> ranks, int rank);
/// Returns the host number of each camera's owner, or -1.
std::vector<int> host_indices(std::span<const int> ranks, std::span<const int> camera_owners);

/// Returns this rank's contribution to a view by calling `own`. For a view in lockstep `own` gets a
/// communicator of all hosts; if it throws, the other ranks are notified that this rank has left.
render::Contribution contribute_as_rank(const RankSet& members,
                                        const render::DistributedViewRequest& view,
                                        std::uint32_t view_number,
                                        const render::DistributedRenderer::ContributeFunction& own);

/// Times of the reduction, in wall-clock milliseconds.
struct ReduceTimes {
  double local_ms = 0;  ///< this rank's contribution
  double wait_ms = 0;   ///< waiting for the contributions of the ranks below
  double add_ms = 0;    ///< adding them
  RankTimes slowest;    ///< of the ranks below
  /// Returns the part of the wait in which no rank below worked: requests and fragments were being
  /// sent, or requests were queued.
  double travel_ms() const { return std::max(0.0, local_ms + wait_ms - slowest.sum_ms()); }
  ReduceTimes& operator+=(const ReduceTimes& other);
};

/// Returns the sum of the contributions of this rank (`own`) and the ranks below it in the tree.
/// Adds the fragments of the received messages to `counts`. If a rank cannot contribute, throws
/// Error after all ranks below have answered.
render::Contribution reduce_subtree(const ViewExchange& exchange, std::uint32_t view_number,
                                    int light_field, const render::VirtualCamera& view,
                                    const std::function<render::Contribution()>& own,
                                    render::FragmentCounts& counts, ReduceTimes& times);

/// Sends the result of reduce_subtree(), or its error, to the rank above. Throws only
/// std::bad_alloc.
void send_to_parent(const ViewExchange& exchange, std::uint32_t view_number, int light_field,
                    const render::VirtualCamera& view,
                    const std::function<render::Contribution()>& own);

}  // namespace raystage::farm
