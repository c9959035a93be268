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
}

namespace raystage::render {

class RankCommunicator;

/// A request to a method: a view of one light field frame.
struct ViewRequest {
  const VirtualCamera& view;
  const LightFieldFrame& instant;
  /// The plane on which methods without a surface of their own sample rays: a x + b y + c z + d = 0
  /// in the world.
  Eigen::Vector4d focal_plane;
  const MethodOptions& options;  ///< of this method
  ResultCache& result_cache;
  std::size_t working_bytes;  ///< memory that the method may use in addition to the result cache
  BufferPool& buffers;        ///< allocates the largest buffers of the method
  bool count_needed_pixels = false;  ///< fill RenderStatistics::pixels_needed (costs time)
  bool measure_coverage = false;     ///< fill RenderedView::cameras and nearest_ray (costs time)
  bool use_take_folder = true;       ///< derived data may be stored in the take and read from it
  int supersampling = 1;  ///< rays per output pixel along each axis; `view` includes the factor
  /// For a band of rows of a larger view: the band's first row and the height of the larger view,
  /// in pixels of `view`. full_height 0: the view is complete.
  int first_row = 0, full_height = 0;
  const RankCommunicator* group = nullptr;  ///< for contribute() with DistributionMode::kLockstep
};

/// A request to a method for the surface that single rays meet: see Method::surface().
struct SurfaceRequest {
  const MethodOptions& options;    ///< of this method
  const LightFieldFrame& instant;  ///< its rig must outlive the surface
  Eigen::Vector4d focal_plane;     ///< as ViewRequest
  ResultCache& result_cache;
  std::size_t working_bytes;
  bool use_take_folder = true;  ///< as ViewRequest
  bool reference = false;       ///< use the reference implementation
};

/// Options worth comparing with the defaults: cheaper, finer, or with a target.
struct MethodPreset {
  std::string_view name;     ///< e.g. "fast"
  std::string_view options;  ///< "NAME=VALUE,..."
};

/// What users read about a method: `raystage render --methods`, and the table in docs/artist.md,
/// which is generated. Without a full stop.
struct MethodDescription {
  std::string_view summary;         ///< what the method does: "blends ..."
  std::string_view artefacts = {};  ///< the visible errors
  std::string_view use = {};        ///< what the method is good for
};

/// The result of Method::store().
struct StoreResult {
  bool was_already_stored = false;  ///< the file existed and was complete
  std::string failure_reason;       ///< why the data could not be stored; empty if it was stored
};

/// The method that answers single rays in place of another method.
struct RayDelegate {
  std::string_view method;        ///< its name; empty: the method answers rays itself
  schemas::OptionValues options;  ///< of that method
};

/// How ranks that each have some of the cameras render a view together.
enum class DistributionMode {
  kNone,           ///< not supported: the archives must be gathered
  kContributions,  ///< each rank contributes samples of its own cameras: contribute(), combine()
  kLockstep,    ///< as kContributions, and ranks exchange intermediate results: ViewRequest::group
  kFetchFrames  ///< one rank renders the view and fetches the parts of frames that it reads
};

/// A reconstruction method: reconstructs views of a light field. There is one immutable object per
/// method; all members are thread-safe. Every per-pixel operation happens inside.
class Method {
 public:
  Method() = default;
  virtual ~Method() = default;
  Method(const Method&) = delete;
  Method& operator=(const Method&) = delete;

  virtual std::string_view name() const = 0;
  virtual MethodDescription description() const = 0;
  virtual std::span<const OptionSpec> options() const = 0;
  /// Returns option values worth comparing with the defaults.
  virtual std::span<const MethodPreset> presets() const { return {}; }

  /// Renders a view without lens distortion. Throws Error (bad input) where the options cannot
  /// render a view of the take and for frames that cannot be read.
  virtual RenderedView render(const ViewRequest& request) const = 0;
  /// Renders any view with the slow per-ray reference, which render() must match. Throws as
  /// render().
  virtual RenderedView render_reference(const ViewRequest& request) const = 0;

  /// Throws Error (bad input) where the options cannot render a view of the take, as far as this
  /// can be known before rendering.
  virtual void check(const MethodOptions& /*options*/, const store::Take& /*take*/) const {}
  /// Returns the files, in addition to the archives, that determine the pixels, for fingerprints.
  virtual std::vector<std::filesystem::path> input_files(
      const MethodOptions& /*options*/, const store::Take& /*take*/,
      const store::FrameSelection& /*frames*/) const {
    return {};
  }

  // Views that several ranks render together, each from the cameras that it has (thesis 4.1).

  virtual DistributionMode distribution(const MethodOptions& /*options*/) const {
    return DistributionMode::kNone;
  }
  /// Returns the contribution of this rank's cameras (LightFieldFrame::is_local) to a view. Throws
  /// as render(). Only where distribution() is kContributions or kLockstep.
  virtual Contribution contribute(const ViewRequest& request) const;
  /// Returns the view from the sums, plane by plane, of all ranks' contributions. Reads no frame.
  /// Only where distribution() is kContributions or kLockstep.
  virtual RenderedView combine(const ViewRequest& request, std::vector<PixelValues> planes) const;

  // Data that a method derives once per light field frame and stores for all its views: camera
  // depths.

  virtual bool stores_data() const { return false; }
  /// Returns the file of the stored data, relative to LightFieldFrame::derived_folder(); empty
  /// where these options store none. Reads the encoded frames of all cameras. Throws as check().
  virtual std::filesystem::path stored_file(const MethodOptions& /*options*/,
                                            const LightFieldFrame& /*instant*/) const {
    return {};
  }
  /// Derives the data and writes the file, unless it exists and is complete. Rendering a view
  /// writes the same bytes. Uses `working_bytes` of memory. Throws Error as render().
  virtual StoreResult store(const MethodOptions& /*options*/, const LightFieldFrame& /*instant*/,
                            std::size_t /*working_bytes*/) const {
    return {};
  }

  // Single rays, see query_rays().

  /// Throws Error (bad input) where the method cannot answer single rays because they meet no
  /// single surface.
  virtual void check_ray_support(const MethodOptions& /*options*/) const {}
  /// Returns the method whose surface() answers rays instead.
  virtual RayDelegate ray_delegate(const MethodOptions& /*options*/) const { return {}; }
  /// Returns the surface that rays meet; by default the focal plane. Throws as render().
  virtual RaySurface surface(const SurfaceRequest& request) const;
  /// Returns whether the method has the options of ray_weight_options(). Rays of other methods are
  /// weighted with default options.
  virtual bool has_ray_weights() const { return false; }

  // Properties of the method for the renderer and its users.

  /// Returns whether the method supports ViewRequest::measure_coverage.
  virtual bool measures_coverage() const { return true; }
  /// Returns whether the method needs memory only for decoded frames: it caches no results and its
  /// working memory is small.
  virtual bool caches_frames_only(const MethodOptions& /*options*/) const { return false; }
  /// Returns whether rays are sampled on ViewRequest::focal_plane.
  virtual bool uses_focal_plane() const { return true; }
  /// Returns whether any camera that sees a point may show it, and not only those of the array's
  /// cell that its ray passes.
  virtual bool blends_any_camera() const { return !uses_focal_plane(); }
  /// Returns whether rays are sampled on the focal plane where the depth range of the scene is
  /// unknown.
  virtual bool may_use_focal_plane() const { return uses_focal_plane(); }
  /// Returns whether the method may fill RenderedView::edges.
  virtual bool tells_surfaces_apart() const { return false; }
  /// Returns whether the method may fill RenderedView::empty_space.
  virtual bool marks_empty_space() const { return false; }
  /// Returns whether only the foreground is shown: transparent pixels are not missing rays.
  virtual bool shows_foreground_only() const { return false; }
  /// Returns whether pixels depend on LightFieldFrame::adjacent_frames.
  virtual bool reads_adjacent_frames(const MethodOptions& /*options*/) const { return false; }
  /// Returns whether pixels depend on LightFieldFrame::shown_views.
  virtual bool depends_on_shown_views(const MethodOptions& /*options*/) const { return false; }
  /// Returns whether pixels do not depend on pixels in other rows, so that any rows can be rendered
  /// separately. Results for all rows should be cached, because each band requests them again.
  virtual bool is_row_independent(const MethodOptions& /*options*/) const { return false; }
  /// Returns whether the method has a lens: the options f_number, film_width and radius.
  virtual bool has_lens() const { return false; }
  /// Returns whether the method measures, on the take, which other method to use.
  virtual bool chooses_by_measuring() const { return false; }
};

}  // namespace raystage::render
