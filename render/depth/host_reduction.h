// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "render/common/rank_communicator.h"

namespace raystage::render::depth {

/// Adds values per pixel over the hosts of a group, in the order of the hosts, for the rows of a
/// band of a view. A host sends the columns in which it has values and receives the sums there.
class HostReduction {
 public:
  /// Columns [begin, end) of a row in which a host may have values; begin == end if none.
  struct Columns {
    std::int32_t begin = 0, end = 0;
  };

  /// Stores `columns`: of this host, by row. All hosts must give the same number of rows.
  HostReduction(const RankCommunicator& group, int width, std::vector<Columns> columns)
      : group_(group), width_(static_cast<std::size_t>(width)), columns_(std::move(columns)) {}

  /// Replaces the values in this host's columns by the sums. `values`: `channels` per pixel, rows
  /// of `width` pixels, 0 outside the columns. Each host adds a part of the rows.
  void sum(std::span<float> values, int channels) const;

  /// Adds the other hosts' values, one per pixel, to those of host 0; those of other hosts stay.
  void reduce_to_first(std::span<float> values) const;

 private:
  struct Rows {
    std::size_t begin = 0, end = 0;
  };
  Rows rows_of(std::size_t host) const;
  RankCommunicator::Message message_of(std::span<const float> values, std::size_t channels,
                                       Rows rows) const;
  /// Adds the values of `message` for `rows` to `sums`, whose first row is rows.begin. Returns the
  /// columns of its sender. Throws Error (failed) for columns outside the view.
  std::vector<Columns> add(const RankCommunicator::Message& message, std::size_t channels,
                           Rows rows, std::span<float> sums) const;

  const RankCommunicator& group_;
  std::size_t width_;
  std::vector<Columns> columns_;
};

}  // namespace raystage::render::depth
