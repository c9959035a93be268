// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "render/slabs/slab_kernels.h"

namespace raystage::render {

/// The samples of a node's image that are read or computed: one interval per row, possibly empty.
class NodeRows {
 public:
  struct Span {
    int begin = 0, end = 0;
    bool is_empty() const { return begin >= end; }
  };

  NodeRows() = default;
  /// Creates empty intervals.
  NodeRows(int width, int height) : width_(width), spans_(static_cast<std::size_t>(height)) {}
  static NodeRows all(int width, int height);

  int height() const { return static_cast<int>(spans_.size()); }
  const Span& row(int y) const { return spans_[y]; }
  bool covers(const NodeRows& other) const;
  bool is_whole() const;

  /// Adds what sample_slab_run() reads with a weight of the run's node at `corner` (as
  /// SlabRun::node: bit 0 for right, bit 1 for lower). Everything between that and the present
  /// interval is added too, and slightly more where runs are slanted in the image.
  void add(const SlabRun& run, int corner);

 private:
  void add_piece(const SlabRun& run, int corner, int begin, int end);

  int width_ = 0;
  std::vector<Span> spans_;
};

}  // namespace raystage::render
