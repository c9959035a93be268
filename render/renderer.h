// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "render/common/light_field_frame.h"
#include "render/common/method.h"
#include "render/common/result_cache.h"
#include "render/common/view.h"
#include "render/common/world_ray.h"
#include "render/distributed_rendering.h"
#include "render/lumigraph/ray_query.h"
#include "schemas/hole_fill.h"
#include "schemas/option_values.h"
#include "store/processing/frames/blend_space.h"
#include "store/take.h"
#include "store/timeline.h"

namespace raystage::render {

/// The most frames of a shot that may show a light field frame, in the mean, for their views to be
/// stated as ReconstructionOptions::shown_views. If more do, time stands still: any view may be
/// shown next.
inline constexpr std::size_t kMostFramesOfShownViews = 4;

/// Selects how rays are reconstructed.
struct ReconstructionOptions {
  std::string method = "focal_plane";  ///< see methods()
  /// a x + b y + c z + d = 0 in the world; (0, 0, 0, 1) lies at infinity. See
  /// fronto_parallel_plane().
  Eigen::Vector4d focal_plane{0, 0, 0, 1};
  schemas::OptionValues options = {};  ///< of the method, by name; see Method::options()
  schemas::HoleFill fill = schemas::HoleFill::kNone;
  int max_supersampling = 64;  ///< as RendererOptions, the lower one counts; 1: for previews
  std::vector<VirtualCamera> shown_views = {};  ///< as LightFieldFrame
};

struct RendererOptions {
  std::size_t cache_bytes = std::size_t{1} << 30;  ///< decoded source frames kept in memory
  /// The matte of the frames; null: everything is visible. `depth` searches for surfaces in the
  /// frames without matte, for which a quarter of the cache is reserved; its results are valid for
  /// every matte.
  std::shared_ptr<const store::FrameMatte> matte = nullptr;
  std::size_t result_cache_bytes = std::size_t{1} << 30;  ///< budget of the result cache
  /// The result cache, shared with other renderers of the same take and cameras. Null: the renderer
  /// creates its own, of `result_cache_bytes`.
  std::shared_ptr<ResultCache> result_cache = nullptr;
  std::size_t working_bytes = std::size_t{1} << 30;  ///< working memory of a method for one view
  std::vector<int> excluded_cameras;  ///< indices of cameras that must not contribute
  /// The take's timeline, by increasing time, for methods that use temporal neighbours. These are
  /// the ticks before and after the tick that is nearest to the requested frames, within half a
  /// tick. Empty: none. Must outlive the renderer.
  std::span<const store::FrameSelection> ticks;
  store::BlendSpace blend_space = store::BlendSpace::kPerceptual;
  /// Maximum supersampling along each axis, 1 to 64; 1: never. Views with less resolution than the
  /// light field are rendered with an integer multiple of their pixels and averaged in linear light
  /// (thesis 5.3). The multiple is large enough for steps as short as the cameras' pixels. The
  /// samples held at once take at most supersampling_bytes. This is a separate limit, so that
  /// pixels do not depend on the memory budget. Row-independent methods
  /// (Method::is_row_independent) render bands of rows that fit it. Other methods hold the whole
  /// view, and use fewer samples where it would exceed the limit.
  int max_supersampling = 8;
  std::size_t supersampling_bytes = std::size_t{512} << 20;
  bool count_needed_pixels = false;  ///< fills RenderStatistics::pixels_needed (costs time)
  bool measure_coverage = false;     ///< fills RenderedView::cameras and nearest_ray (costs time)
  bool measure_confidence = false;   ///< fills RenderedView::confidence (costs time)
  bool reference = false;            ///< use the slow per-ray reference
  /// Whether derived data may be stored in the take's folder and read from it.
  bool use_take_folder = true;
  /// Folder for derived data (CACHE/depth/...) in place of the take's folder, which may be
  /// read-only; empty: the take's folder. Does not change the pixels.
  std::filesystem::path cache_folder = {};
  /// Counts derived and read data, for views and for rays; null: not counted.
  std::shared_ptr<StoredDataCounts> stored_data_counts = nullptr;
  /// With kAbsent a view that reads a rotten frame is rendered without all rotten frames of its
  /// instant, so that it does not depend on what was read before. Distributed views fail instead.
  store::RottenFrames rotten_frames = store::RottenFrames::kAbsent;
  /// Renders views of distributed methods together with other ranks; null: this rank renders alone.
  std::shared_ptr<const DistributedRenderer> hosts = nullptr;
  /// As LightFieldFrame, for distributed views.
  std::vector<int> rank_of_camera = {};
  int this_rank = 0;
  bool is_valid(std::string* reason) const;
};

/// What is requested from a light field.
enum class QueryKind { kViews, kRays };

/// Throws Error (bad input) where LightFieldRenderer::query() cannot answer rays with this method,
/// because they meet no single surface.
void check_ray_query_support(const ReconstructionOptions& reconstruction);

/// Renders views of a take. render() is thread-safe (frames in flight); the pixels do not depend on
/// the number of threads. Uses the TBB arena in which it is called.
class LightFieldRenderer {
 public:
  /// Throws Error (bad input) where all cameras are excluded. Keeps a reference to `take`.
  LightFieldRenderer(const store::Take& take, const RendererOptions& settings);
  ~LightFieldRenderer();

  /// Renders a view. Adds a note to views with at least one and a half times the light field's
  /// resolution, and to views with too little supersampling. Throws Error (bad input) for an
  /// unknown method, unknown options and frames that cannot be read.
  RenderedView render(const VirtualCamera& view, const store::FrameSelection& frames,
                      const ReconstructionOptions& reconstruction) const;

  /// Returns the contribution of this rank's cameras to a view that another rank assembles.
  /// `group`: as ViewRequest. Throws as render().
  Contribution contribute(const DistributedViewRequest& view, const RankCommunicator* group) const;

  /// Returns the bytes of the view's own values while it is rendered, including requested measures
  /// and, with supersampling, both the samples and their mean.
  std::size_t view_bytes(const VirtualCamera& view, const store::FrameSelection& frames,
                         const ReconstructionOptions& reconstruction) const;

  /// Starts reading from disk the frames that a later render() will need. This is a hint: frames of
  /// cameras that earlier views did not use are not read.
  void read_ahead(const store::FrameSelection& frames) const;
  /// Returns how many of those frames were requested before they were decoded.
  int frames_read_ahead() const;
  /// Returns the cost of decoding frames since the renderer was created.
  store::DecodeCosts decode_costs() const;
  /// Returns the bytes of decoded frames cached for later views: at most
  /// RendererOptions::cache_bytes, unless a single frame is larger.
  std::size_t decoded_bytes_cached() const;

  /// Samples any rays, not only those of a view, into the same number of `samples`: see
  /// query_rays(). Holes are not filled. `lumigraph` (weights per ray) and `visual_hull` use their
  /// options. Every other method gives only the surface, on which rays are blended by the default
  /// options of lumigraph. Of its options, only the following change the surface; others are
  /// validated and ignored.
  ///   depth        its own surface: `near`, `far`, `plane_px`, `neighbours`, `support_views`,
  ///                `temporal` and `store_depths`
  ///   plane_sweep  the surface of depth with default options: `near` and `far`; depths are
  ///                stored in the take unless RendererOptions::use_take_folder is off
  ///   all others   no options; the surface is the focal plane of `reconstruction`, also for
  ///                aperture, whose own plane is ignored
  /// Throws Error (bad input) as render(). Also throws for `auto`, which chooses only for views,
  /// and for `slabs` in a box, which has a focal plane per face. Returns the cameras as
  /// RenderedView::rotten_cameras.
  std::vector<int> query(std::span<const WorldRay> rays, const store::FrameSelection& frames,
                         const ReconstructionOptions& reconstruction,
                         std::span<RaySample> samples) const;

  /// Returns the file in which render() or query() stores what the method derives once per light
  /// field frame (Method::stored_file); empty: none. Empty also for `auto`, which chooses a method
  /// when it renders. Throws Error (bad input) as render() does.
  std::filesystem::path stored_file(const store::FrameSelection& frames,
                                    const ReconstructionOptions& reconstruction,
                                    QueryKind as) const;
  /// Writes that file, unless it exists and is complete: the same bytes as render() and query()
  /// write. Throws Error as render() does.
  StoreResult store(const store::FrameSelection& frames,
                    const ReconstructionOptions& reconstruction, QueryKind as) const;

 private:
  RenderedView render_instant(const VirtualCamera& view, const LightFieldFrame& instant,
                              const ReconstructionOptions& reconstruction) const;

  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace raystage::render
