// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "render/view/instant.h"
#include "render/view/kept_results.h"
#include "render/view/method_options.h"
#include "render/view/view.h"
#include "store/take.h"
#include "store/timeline.h"

namespace raystage {

class BufferPool;

/// What a method is asked for: a view of one instant.
struct ViewRequest {
  const VirtualCamera& view;
  const Instant& instant;
  /// Where rays are looked up by methods that need a surface and find none themselves:
  /// a x + b y + c z + d = 0 in the world.
  Eigen::Vector4d focal_plane;
  const MethodOptions& options;  ///< of this method
  KeptResults& kept;
  std::size_t working_bytes;         ///< memory that the method may use meanwhile, beside `kept`
  BufferPool& buffers;               ///< where the largest pieces of it come from
  bool count_needed_pixels = false;  ///< fill RenderStatistics::pixels_needed (costs time)
  bool measure_coverage = false;     ///< fill RenderedView::cameras and nearest_ray (costs time)
  bool use_take_folder = true;       ///< derived things may be kept in the take and taken from it
  int supersampling = 1;  ///< the view has so many pixels along each axis for one that is wanted
  /// Where the view is some rows of the picture that is wanted: the first of them, and how high
  /// that is, in its own pixels; height 0: the view is all of it.
  int first_row = 0, whole_height = 0;
};

/// Options worth comparing with the method as it is unless told: cheaper, finer, or with a target.
struct MethodPreset {
  std::string_view name;     ///< e.g. "fast"
  std::string_view options;  ///< "NAME=VALUE,..."
};

/// What became of data that a method was to store.
struct StoreResult {
  bool was_stored = false;  ///< the file was there, whole
  std::string not_stored;   ///< why the data could not be stored; empty: it is stored
};

/// Data that a method derives once from a light field frame and stores for all views of it: camera
/// depths. Null functions: the method stores nothing.
struct StoredData {
  /// Returns the file, below Instant::derived_folder(); empty: with these options there is none.
  /// Reads the encoded frames of all cameras. Throws Error (bad input) as Method::check.
  std::filesystem::path (*file)(const MethodOptions& options, const Instant& instant) = nullptr;
  /// Derives the data and writes the file, unless it is there and whole: the same bytes as
  /// rendering a view writes. Works in `working_bytes`. Throws Error as Method::render.
  StoreResult (*store)(const MethodOptions& options, const Instant& instant,
                       std::size_t working_bytes) = nullptr;
};

/// A way to reconstruct views, chosen by name. Whatever is done per pixel is done inside.
struct Method {
  std::string_view name;
  std::string_view summary;  ///< for people, a line
  std::span<const OptionSpec> options;
  /// For views without lens distortion.
  RenderedView (*render)(const ViewRequest& request);
  /// The slow, obvious one, for any view.
  RenderedView (*render_reference)(const ViewRequest& request);
  /// Files beside the archives that determine the pixels, for fingerprints; null: none.
  std::vector<std::filesystem::path> (*files_read)(const MethodOptions& options, const Take& take,
                                                   const FrameSelection& frames) = nullptr;
  bool measures_coverage = false;  ///< knows what ViewRequest::measure_coverage asks for
  std::span<const MethodPreset> presets = {};
  /// Whether it wants memory for decoded frames alone: keeps nothing, and works in little; null:
  /// never.
  bool (*frames_only)(const MethodOptions& options) = nullptr;
  bool on_focal_plane = true;        ///< looks rays up on ViewRequest::focal_plane
  bool tells_nothing_there = false;  ///< may fill RenderedView::nothing_there
  /// Throws Error (bad input) where these options render no view of the take, as far as that can be
  /// known before one is; null: nothing to know.
  void (*check)(const MethodOptions& options, const Take& take) = nullptr;
  /// Whether pixels depend on Instant::frames_beside; null: never.
  bool (*looks_beside)(const MethodOptions& options) = nullptr;
  /// Whether pixels know nothing of those in other rows, so that any rows of a view can be rendered
  /// by themselves; null: never. What is found for all of them is best kept: it is asked for anew.
  bool (*rows_alone)(const MethodOptions& options) = nullptr;
  StoredData stored = {};  ///< what it derives once from a light field frame
};

}  // namespace raystage
