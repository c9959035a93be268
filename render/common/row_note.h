// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "render/common/view.h"
#include "rig/topology.h"

namespace raystage::render {

/// Adds a note for methods that blend a ray from the cameras of its cell, if these are a row
/// (rig::delaunay_topology).
inline void add_row_note(const rig::Topology& cells, RenderedView& image) {
  if (cells.kind != rig::Topology::Kind::kSegments) return;
  add_notes(
      {"the cameras are in a row: each ray is blended from the two cameras next to it, and a view "
       "from above or below the row has no vertical parallax"},
      image.notes);
}

}  // namespace raystage::render
