// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "render/slabs/slab_kernels.h"

namespace raystage {

/// Which samples of a node's image are read or made: in each row none or those from one to another.
class NodeRows {
 public:
  struct Span {
    int begin = 0, end = 0;
    bool is_empty() const { return begin >= end; }
  };

  NodeRows() = default;
  /// None of them.
  NodeRows(int width, int height) : width_(width), spans_(static_cast<std::size_t>(height)) {}
  static NodeRows all(int width, int height);

  int height() const { return static_cast<int>(spans_.size()); }
  const Span& row(int y) const { return spans_[static_cast<std::size_t>(y)]; }
  bool covers(const NodeRows& other) const;
  bool is_whole() const;

  /// Adds what sample_slab_run() reads with a weight of the run's node at `corner` (as
  /// SlabRun::node: bit 0 the right ones, bit 1 the lower), and what lies between that and what is
  /// in already. A little more where runs are slanted in the image.
  void add(const SlabRun& run, int corner);

 private:
  void add_piece(const SlabRun& run, int corner, int begin, int end);

  int width_ = 0;
  std::vector<Span> spans_;
};

}  // namespace raystage
