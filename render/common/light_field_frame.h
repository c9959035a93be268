// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <vector>

#include "base/time.h"
#include "render/common/view.h"
#include "rig/rig.h"
#include "store/processing/frames/frame_cache.h"
#include "store/take.h"

namespace raystage::render {

/// Counts the light field frames whose stored data (Method::stored_file) a method needed. A frame
/// counts again after its data was evicted from memory.
struct StoredDataCounts {
  std::atomic<int> derived = 0;  ///< not stored before, or damaged
  std::atomic<int> read = 0;     ///< from their files
  /// Progress of deriving: equal parts of the work, begun and done since the counts were made.
  std::atomic<std::int64_t> parts_begun = 0, parts_done = 0;
};

/// The frames of all cameras at one tick: which cameras have a frame, and which are neighbours.
struct LightFieldFrame {
  const store::Take* take = nullptr;  ///< the take of the frames
  const rig::Rig* rig = nullptr;      ///< the rig of the take, or its facets (FacetedFrame)
  /// Per camera of the rig: that of the take, whose frames it shows; empty: the same.
  std::vector<int> camera_of_take;
  store::FrameCache* cache = nullptr;
  /// Decodes frames without their matte; null: `cache` has none.
  store::FrameCache* opaque = nullptr;
  /// The fetch group of the view, whatever parts it is made in.
  store::FrameCache::FetchGroup fetch_group = store::FrameCache::kUngrouped;
  Nanoseconds time_ns = 0;  ///< since the take's epoch
  /// Per camera of the rig: its frame, or -1 where it has none at this instant or is excluded.
  /// Interpolated frames have the numbers of store::InterpolatedFrames.
  std::vector<int> frame_of_camera;
  /// As frame_of_camera, for the ticks before and after where the timeline has them: see
  /// RendererOptions::ticks.
  std::vector<std::vector<int>> adjacent_frames;
  /// Cameras with rotten frames among these, which were replaced by -1; in increasing order.
  std::vector<int> rotten_cameras;
  std::vector<int> included_cameras;  ///< cameras that are not excluded, in increasing order
  /// All views that are shown of the light field frame; empty: any may be. A method may derive only
  /// what they read: Method::depends_on_shown_views().
  std::vector<VirtualCamera> shown_views;
  /// Per camera of the rig: the rank that contributes its frames to distributed views; -1: none.
  /// Empty: this rank contributes all.
  std::vector<int> rank_of_camera;
  int this_rank = 0;
  /// Cells of the present cameras, and of all cameras that are not excluded. Rays are blended by
  /// the first; RenderedView::coverage is relative to the second. Equal if no camera is absent.
  std::shared_ptr<const rig::Topology> present, complete;

  /// Folder for the files of derived data; empty: the take's folder. See derived_folder().
  std::filesystem::path cache_folder;
  StoredDataCounts* stored_data_counts = nullptr;  ///< null: nothing is counted

  const std::filesystem::path& derived_folder() const {
    return cache_folder.empty() ? take->folder() : cache_folder;
  }

  /// Returns the frames in which methods search for surfaces: without mattes, because a matte does
  /// not change where surfaces are.
  store::FrameCache& opaque_frames() const { return opaque != nullptr ? *opaque : *cache; }

  bool is_local(int camera) const {
    return rank_of_camera.empty() || rank_of_camera[camera] == this_rank;
  }

  bool is_present(int camera) const { return frame_of_camera[camera] >= 0; }
  /// Returns the cameras that have a frame, in increasing order.
  std::vector<int> present_cameras() const {
    std::vector<int> cameras;
    for (int camera = 0; camera < static_cast<int>(frame_of_camera.size()); ++camera) {
      if (is_present(camera)) cameras.push_back(camera);
    }
    return cameras;
  }
};

}  // namespace raystage::render
