// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <filesystem>
#include <memory>
#include <vector>

#include "base/time.h"
#include "rig/rig.h"
#include "store/processing/frames/frame_cache.h"
#include "store/take.h"

namespace raystage {

/// Counts the light field frames whose stored data (Method::stored_file) a method needed; one
/// counts again after its data was dropped from memory.
struct StoredDataCounts {
  std::atomic<int> derived = 0;  ///< not stored before, or damaged
  std::atomic<int> read = 0;     ///< from their files
};

/// The light field of one instant: which cameras have a frame, and who neighbours whom then.
struct LightFieldFrame {
  const Take* take = nullptr;  ///< that the frames are of
  const Rig* rig = nullptr;    ///< the take's
  FrameCache* cache = nullptr;
  FrameCache* opaque = nullptr;  ///< the frames without their matte; null: `cache` has none
  FrameCache::Look look = FrameCache::kByItself;  ///< of the view, whatever parts it is made in
  Nanoseconds time_ns = 0;                        ///< since the take's epoch
  /// Per camera of the rig: its frame, or -1 where it has none at this instant or is left out.
  std::vector<int> frame_of_camera;
  /// The same of the timeline's ticks before and after, where there are any: see
  /// RendererSettings::ticks.
  std::vector<std::vector<int>> adjacent_frames;
  std::vector<int> included_cameras;  ///< cameras that are not left out, in increasing order
  /// Per camera of the rig: which host contributes its frames to views that several hosts render
  /// together; -1: none. Empty: this host contributes all.
  std::vector<int> rank_of_camera;
  int this_rank = 0;
  /// Cells of the cameras present, and of all that could be (those not left out): rays are blended
  /// by the first, RenderedView::coverage is counted by the second. Equal when nobody is absent.
  std::shared_ptr<const Topology> present, complete;

  /// Holds the files of derived data; empty: the take's folder does. See derived_folder().
  std::filesystem::path cache_folder;
  StoredDataCounts* stored_data_counts = nullptr;  ///< null: nothing is counted

  const std::filesystem::path& derived_folder() const {
    return cache_folder.empty() ? take->folder() : cache_folder;
  }

  /// To find surfaces in: those are where they are, whatever shows of them.
  FrameCache& opaque_frames() const { return opaque != nullptr ? *opaque : *cache; }

  bool is_local(int camera) const {
    return rank_of_camera.empty() || rank_of_camera[static_cast<std::size_t>(camera)] == this_rank;
  }

  bool is_present(int camera) const {
    return frame_of_camera[static_cast<std::size_t>(camera)] >= 0;
  }
};

}  // namespace raystage
