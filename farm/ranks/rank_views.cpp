// SPDX-License-Identifier: Apache-2.0
// Adds the contributions of ranks to a view (thesis 4.1.4) along a tree with kReductionRadix = 4.
// Rank r receives from r + 4^k, r + 2 * 4^k and r + 3 * 4^k for all 4^k that divide r (rank 0: for
// all k). Inputs and outputs are planes of weighted samples of the view, 4 floats per pixel. For n
// ranks the cost is log4 n steps; each sample is sent at most that often. Sums are in single
// precision, in the same order for a given number of ranks.
#include "farm/ranks/rank_views.h"

#include <exception>
#include <new>
#include <optional>
#include <utility>

#include "base/error.h"
#include "base/stopwatch.h"

namespace raystage::farm {
namespace {

/// Returns the tag of replies for a view, above the tags of frames (see rank_takes.cpp).
int tag_of(std::uint32_t view_number) {
  return kFirstReplyTag + (1 << 29) + static_cast<int>(view_number % (1U << 28));
}

int tag_of_group(std::uint32_t view_number) { return tag_of(view_number) + (1 << 28); }

/// Exchanges messages between the hosts of a take in lockstep. The last byte of each message states
/// whether its sender has left the view. All others then leave it in the same exchange.
class MpiCommunicator : public render::RankCommunicator {
 public:
  MpiCommunicator(const RankSet& members, std::uint32_t view_number)
      : members_(members), tag_(tag_of_group(view_number)) {}

  int rank() const override { return host_index(members_.ranks, members_.world.rank()); }
  int size() const override { return static_cast<int>(members_.ranks.size()); }

  std::vector<Message> exchange(std::vector<Message> messages) const override {
    for (Message& message : messages) message.push_back(kHere);
    std::vector<Message> received =
        members_.world.exchange(tag_, members_.ranks, std::move(messages));
    has_ended_ = std::ranges::any_of(received, [](const Message& message) {
      return message.empty() || message.back() != kHere;
    });
    for (std::size_t host = 0; host < received.size(); ++host) {
      if (received[host].empty() || received[host].back() != kHere) {
        throw Error::failed("rank " + std::to_string(members_.ranks[host]) + " has left the view",
                            "", "See the error of that rank");
      }
      received[host].pop_back();
    }
    return received;
  }

  /// Runs a final exchange, in which hosts that have left the view meet the others.
  void end() const { exchange(std::vector<Message>(members_.ranks.size())); }

  /// Takes part in the next exchange of the others, so that none of them waits forever.
  void leave() const {
    if (has_ended_) return;
    members_.world.exchange(tag_, members_.ranks,
                            std::vector<Message>(members_.ranks.size(), Message{kLeft}));
  }

 private:
  static constexpr std::byte kHere{0}, kLeft{1};
  RankSet members_;
  int tag_;
  mutable bool has_ended_ = false;  ///< a host has left
};

render::FragmentTag fragment_tag(std::uint32_t view_number, int light_field, std::size_t plane) {
  return {view_number, static_cast<std::uint32_t>(light_field), static_cast<std::uint32_t>(plane)};
}

/// Adds the statistics of a host that worked at the same time.
void add(const render::RenderStatistics& from, render::RenderStatistics& to) {
  to.plan_ms = std::max(to.plan_ms, from.plan_ms);
  to.decode_ms = std::max(to.decode_ms, from.decode_ms);
  to.render_ms = std::max(to.render_ms, from.render_ms);
  to.pixels_decoded += from.pixels_decoded;
  to.pixels_needed += from.pixels_needed;
  to.cameras_used += from.cameras_used;
  to.working_bytes = std::max(to.working_bytes, from.working_bytes);
}

void keep_slower(const RankTimes& one, RankTimes& slowest) {
  if (one.sum_ms() > slowest.sum_ms()) slowest = one;
}

/// The failure of another rank, as the rank that assembles views reports it.
struct Failure {
  std::string what;
  bool is_bad_input = false;
  Error error() const {
    const std::string advice = "Correct the cause and render again";
    return is_bad_input ? Error::bad_input(what, "", advice) : Error::failed(what, "", advice);
  }
};

}  // namespace

ReduceTimes& ReduceTimes::operator+=(const ReduceTimes& other) {
  local_ms += other.local_ms;
  wait_ms += other.wait_ms;
  add_ms += other.add_ms;
  slowest.local_ms += other.slowest.local_ms;
  slowest.add_ms += other.slowest.add_ms;
  slowest.encode_ms += other.slowest.encode_ms;
  return *this;
}

int parent_rank(int rank) {
  int step = 1;
  while (rank / step % kReductionRadix == 0) step *= kReductionRadix;
  return rank - rank / step % kReductionRadix * step;
}

std::vector<int> child_ranks(int rank, int ranks) {
  std::vector<int> children;
  for (int step = 1; step < ranks && rank / step % kReductionRadix == 0; step *= kReductionRadix) {
    for (int i = 1; i < kReductionRadix && rank + i * step < ranks; ++i) {
      children.push_back(rank + i * step);
    }
  }
  return children;
}

render::FragmentEncodingOptions fragment_encoding_for(
    const render::DistributedViewRequest& view, const render::FragmentEncodingOptions& requested) {
  render::FragmentEncodingOptions options = requested;
  if (view.is_lockstep && requested.encoding == render::FragmentEncoding::kJpeg) {
    options.encoding = render::FragmentEncoding::kHalf;
  }
  return options;
}

int host_index(std::span<const int> ranks, int rank) {
  const auto found = std::ranges::find(ranks, rank);
  return found == ranks.end() ? -1 : static_cast<int>(found - ranks.begin());
}

std::vector<int> host_indices(std::span<const int> ranks, std::span<const int> camera_owners) {
  std::vector<int> hosts;
  for (const int owner : camera_owners) hosts.push_back(host_index(ranks, owner));
  return hosts;
}

render::Contribution contribute_as_rank(
    const RankSet& members, const render::DistributedViewRequest& view, std::uint32_t view_number,
    const render::DistributedRenderer::ContributeFunction& own) {
  if (!view.is_lockstep) return own(nullptr);
  const MpiCommunicator group(members, view_number);
  try {
    render::Contribution made = own(&group);
    group.end();
    return made;
  } catch (...) {
    group.leave();
    throw;
  }
}

render::Contribution reduce_subtree(const ViewExchange& exchange, std::uint32_t view_number,
                                    int light_field, const render::VirtualCamera& view,
                                    const std::function<render::Contribution()>& own,
                                    render::FragmentCounts& counts, ReduceTimes& times) {
  Stopwatch watch;
  render::Contribution sum;
  std::exception_ptr own_failure;  // thrown once the messages of all ranks below are received
  try {
    sum = own();
  } catch (...) {
    own_failure = std::current_exception();
  }
  times.local_ms += watch.lap_ms();
  std::optional<Failure> failure;
  for (const int child : child_ranks(exchange.world.rank(), exchange.world.size())) {
    try {
      const MessageBytes message = exchange.world.receive(child, tag_of(view_number));
      times.wait_ms += watch.lap_ms();
      const PartialView part = decode_partial_view(message);
      if (!part.error.empty() && !failure) failure = Failure{part.error, part.is_bad_input};
      if (own_failure || failure) continue;
      add(part.statistics, sum.statistics);
      render::add_notes(part.notes, sum.notes);
      counts += part.counts;
      keep_slower(part.slowest, times.slowest);
      sum.planes.resize(std::max(sum.planes.size(), part.planes.size()),
                        render::PixelValues(render::view_value_count(view), 0.0F));
      for (std::size_t i = 0; i < part.planes.size(); ++i) {
        render::add_fragments(part.planes[i], fragment_tag(view_number, light_field, i), view.width,
                              view.height, sum.planes[i]);
      }
      times.add_ms += watch.lap_ms();
    } catch (...) {
      if (!own_failure) own_failure = std::current_exception();
    }
  }
  if (own_failure) std::rethrow_exception(own_failure);
  if (failure) throw failure->error();
  return sum;
}

void send_to_parent(const ViewExchange& exchange, std::uint32_t view_number, int light_field,
                    const render::VirtualCamera& view,
                    const std::function<render::Contribution()>& own) {
  PartialView part;
  ReduceTimes times;
  try {
    render::Contribution sum =
        reduce_subtree(exchange, view_number, light_field, view, own, part.counts, times);
    part.statistics = sum.statistics;
    part.notes = std::move(sum.notes);
    Stopwatch watch;
    for (std::size_t i = 0; i < sum.planes.size(); ++i) {
      part.planes.push_back(render::encode_fragments(fragment_tag(view_number, light_field, i),
                                                     sum.planes[i], view.width, view.height,
                                                     exchange.encoding, part.counts));
      sum.planes[i] = {};
    }
    part.slowest = times.slowest;
    keep_slower({times.local_ms, times.add_ms, watch.lap_ms()}, part.slowest);
  } catch (const Error& error) {
    part = {};
    part.error = error.what();
    part.is_bad_input = error.exit_code() == ExitCode::kBadInput;
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& error) {
    part = {};
    part.error = "rank " + std::to_string(exchange.world.rank()) + ": " + error.what();
  }
  exchange.world.send(parent_rank(exchange.world.rank()), tag_of(view_number), encode(part));
}

}  // namespace raystage::farm
