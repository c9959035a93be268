// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "render/common/contribution.h"
#include "render/common/light_field_frame.h"
#include "render/common/method_options.h"
#include "render/common/result_cache.h"
#include "render/common/view.h"
#include "render/common/world_ray.h"
#include "store/take.h"
#include "store/timeline.h"

namespace raystage {

class BufferPool;
class RankCommunicator;

/// What a method is asked for: a view of one instant.
struct ViewRequest {
  const VirtualCamera& view;
  const LightFieldFrame& instant;
  /// Where rays are looked up by methods that need a surface and find none themselves:
  /// a x + b y + c z + d = 0 in the world.
  Eigen::Vector4d focal_plane;
  const MethodOptions& options;  ///< of this method
  ResultCache& kept;
  std::size_t working_bytes;         ///< memory that the method may use meanwhile, beside `kept`
  BufferPool& buffers;               ///< where the largest pieces of it come from
  bool count_needed_pixels = false;  ///< fill RenderStatistics::pixels_needed (costs time)
  bool measure_coverage = false;     ///< fill RenderedView::cameras and nearest_ray (costs time)
  bool use_take_folder = true;       ///< derived things may be kept in the take and taken from it
  int supersampling = 1;  ///< the view has so many pixels along each axis for one that is wanted
  /// Where the view is some rows of the picture that is wanted: the first of them, and how high
  /// that is, in its own pixels; height 0: the view is all of it.
  int first_row = 0, full_height = 0;
  const RankCommunicator* group = nullptr;  ///< of contribute(), with DistributionMode::kLockstep
};

/// What is asked of a method that answers single rays: see Method::surface().
struct SurfaceRequest {
  const MethodOptions& options;    ///< of this method
  const LightFieldFrame& instant;  ///< its rig must outlive the surface
  Eigen::Vector4d focal_plane;     ///< as ViewRequest
  ResultCache& kept;
  std::size_t working_bytes;
  bool use_take_folder = true;  ///< as ViewRequest
  bool reference = false;       ///< the slow, obvious surface
};

/// Options worth comparing with the method as it is unless told: cheaper, finer, or with a target.
struct MethodPreset {
  std::string_view name;     ///< e.g. "fast"
  std::string_view options;  ///< "NAME=VALUE,..."
};

/// The result of Method::store().
struct StoreResult {
  bool was_already_stored = false;  ///< the file was there, whole
  std::string failure_reason;       ///< why the data could not be stored; empty: it is stored
};

/// The method that answers single rays in place of another one.
struct RayDelegate {
  std::string_view method;  ///< by name; empty: the method answers rays itself
  OptionValues options;     ///< of that method
};

/// How hosts that hold some of the cameras each render a view together.
enum class DistributionMode {
  kNone,           ///< they do not: the archives must be gathered
  kContributions,  ///< each contributes samples of its own cameras: contribute(), combine()
  kLockstep,       ///< the same, and they exchange what they found meanwhile: ViewRequest::group
  kFetchFrames     ///< one renders the view, and fetches the parts of frames that it reads
};

/// Reconstructs views of a light field. There is one immutable object per method; all members may
/// be called from many threads at once. Every per-pixel operation happens inside.
class Method {
 public:
  Method() = default;
  virtual ~Method() = default;
  Method(const Method&) = delete;
  Method& operator=(const Method&) = delete;

  virtual std::string_view name() const = 0;
  virtual std::string_view summary() const = 0;  ///< for people, a line
  virtual std::span<const OptionSpec> options() const = 0;
  /// Returns option values that are worth comparing with the defaults.
  virtual std::span<const MethodPreset> presets() const { return {}; }

  /// Renders a view without lens distortion. Throws Error (bad input) for options that render no
  /// view of the take and for frames that cannot be read.
  virtual RenderedView render(const ViewRequest& request) const = 0;
  /// Renders any view, slowly and obviously: what render() must match. Throws as render().
  virtual RenderedView render_reference(const ViewRequest& request) const = 0;

  /// Throws Error (bad input) where these options render no view of the take, as far as that can be
  /// known before one is rendered.
  virtual void check(const MethodOptions& /*options*/, const Take& /*take*/) const {}
  /// Returns the files that determine the pixels, next to the archives, for fingerprints.
  virtual std::vector<std::filesystem::path> input_files(const MethodOptions& /*options*/,
                                                         const Take& /*take*/,
                                                         const FrameSelection& /*frames*/) const {
    return {};
  }

  // Views that several hosts render together, each from the cameras that it holds (thesis 4.1).

  virtual DistributionMode distribution(const MethodOptions& /*options*/) const {
    return DistributionMode::kNone;
  }
  /// Returns what the cameras that this host holds (LightFieldFrame::is_local) contribute to a
  /// view. Throws as render(). Only where distribution() is kContributions or kLockstep.
  virtual Contribution contribute(const ViewRequest& request) const;
  /// Returns the view of the contributions of all hosts, added up plane by plane. Reads no frame.
  /// Only where distribution() is kContributions or
  /// kLockstep.
  virtual RenderedView combine(const ViewRequest& request, std::vector<PixelValues> planes) const;

  // Data that a method derives once from a light field frame and stores for all views of it: camera
  // depths.

  virtual bool stores_data() const { return false; }
  /// Returns the file of the stored data, below LightFieldFrame::derived_folder(); empty: with
  /// these options there is none. Reads the encoded frames of all cameras. Throws as check().
  virtual std::filesystem::path stored_file(const MethodOptions& /*options*/,
                                            const LightFieldFrame& /*instant*/) const {
    return {};
  }
  /// Derives the data and writes the file, unless it is there and whole: the same bytes as
  /// rendering a view writes. Works in `working_bytes`. Throws Error as render().
  virtual StoreResult store(const MethodOptions& /*options*/, const LightFieldFrame& /*instant*/,
                            std::size_t /*working_bytes*/) const {
    return {};
  }

  // Single rays, see query_rays().

  /// Throws Error (bad input) where the method cannot answer single rays: there is no one surface
  /// that they meet.
  virtual void check_ray_support(const MethodOptions& /*options*/) const {}
  /// Returns the method whose surface() is asked instead.
  virtual RayDelegate ray_delegate(const MethodOptions& /*options*/) const { return {}; }
  /// Returns where rays meet the scene; by default the focal plane. Throws as render().
  virtual RaySurface surface(const SurfaceRequest& request) const;
  /// Whether its options are ray_weight_settings()'s; rays of other methods are weighed by default
  /// options.
  virtual bool has_ray_weights() const { return false; }

  // What the renderer and its users must know of the method.

  /// Knows what ViewRequest::measure_coverage asks for.
  virtual bool measures_coverage() const { return true; }
  /// Needs memory for decoded frames alone: has no results to cache and works in little memory.
  virtual bool caches_frames_only(const MethodOptions& /*options*/) const { return false; }
  /// Looks rays up on ViewRequest::focal_plane.
  virtual bool uses_focal_plane() const { return true; }
  /// Looks rays up on it where the depth range of the scene is not known.
  virtual bool may_use_focal_plane() const { return uses_focal_plane(); }
  /// May fill RenderedView::empty_space.
  virtual bool marks_empty_space() const { return false; }
  /// Shows the foreground alone: transparent pixels are no missing rays.
  virtual bool shows_foreground_only() const { return false; }
  /// Pixels depend on LightFieldFrame::adjacent_frames.
  virtual bool reads_adjacent_frames(const MethodOptions& /*options*/) const { return false; }
  /// Pixels do not depend on those in other rows, so that any rows of a view can be rendered by
  /// themselves. Results for all rows are best cached: they are asked for again.
  virtual bool is_row_independent(const MethodOptions& /*options*/) const { return false; }
  /// Has a lens: the options f_number, film_width and radius.
  virtual bool has_lens() const { return false; }
  /// Measures which method to use, on the take at hand.
  virtual bool chooses_by_measuring() const { return false; }
};

}  // namespace raystage
