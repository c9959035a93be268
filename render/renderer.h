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

namespace raystage {

/// How rays are reconstructed.
struct ReconstructionSettings {
  std::string method = "focal_plane";  ///< see methods()
  /// a x + b y + c z + d = 0 in the world; (0, 0, 0, 1) lies at infinity. See
  /// fronto_parallel_plane().
  Eigen::Vector4d focal_plane{0, 0, 0, 1};
  OptionValues options = {};  ///< of the method, by name; see Method::options()
  HoleFill fill = HoleFill::kNone;
};

struct RendererSettings {
  std::size_t cache_bytes = std::size_t{1} << 30;  ///< decoded source frames kept in memory
  /// What shows of the frames; null: all. `depth` looks for surfaces in the frames as they were
  /// taken, for which a quarter of the cache is set aside; what it finds serves every matte.
  std::shared_ptr<const FrameMatte> matte = nullptr;
  std::size_t result_cache_bytes = std::size_t{1}
                                   << 30;  ///< what methods work out once for many views
  /// Where that is kept, shared with other renderers of the same take and cameras; null: in a place
  /// of its own, of `result_cache_bytes`.
  std::shared_ptr<ResultCache> kept = nullptr;
  std::size_t working_bytes = std::size_t{1} << 30;  ///< what a method may use for one view
  std::vector<int> excluded_cameras;  ///< cameras of the take that must not contribute
  /// The take's timeline, by increasing time, for methods that look at the instants before and
  /// after: those of the tick nearest to the frames asked for, within half a tick. Empty: there are
  /// none. Referred to.
  std::span<const FrameSelection> ticks;
  BlendSpace blend_space = BlendSpace::kPerceptual;
  /// Views with less resolution than the light field are rendered with whole multiples of their
  /// pixels, as many as make their steps as short as the cameras', and averaged in linear light
  /// (thesis 5.3); at most this many along each axis, 1 to 64; 1: never. The samples held at once
  /// take supersampling_bytes at most: a bound of its own, so that pixels do not depend on the
  /// memory granted. Methods whose pixels know nothing of each other (Method::is_row_independent)
  /// render bands of rows that fit it; of others the view is held whole, and there are fewer
  /// samples where they would be more.
  int max_supersampling = 8;
  std::size_t supersampling_bytes = std::size_t{512} << 20;
  bool count_needed_pixels = false;  ///< fills RenderStatistics::pixels_needed (costs time)
  bool measure_coverage = false;     ///< fills RenderedView::cameras and nearest_ray (costs time)
  bool measure_confidence = false;   ///< fills RenderedView::confidence (costs time)
  bool reference = false;            ///< the slow, obvious implementation, ray by ray
  /// What methods derive from a take may be kept in its folder, and taken from there.
  bool use_take_folder = true;
  /// Holds what methods derive (CACHE/depth/...) in place of the take's folder, which may be
  /// read-only; empty: the take's folder. Does not change the pixels.
  std::filesystem::path cache_folder = {};
  /// Counts what methods derived and read, for views and for rays; null: no counts.
  std::shared_ptr<StoredDataCounts> stored_data_counts = nullptr;
  /// Who renders views of distributed methods together with this host; null: it renders alone.
  std::shared_ptr<const DistributedRenderer> hosts = nullptr;
  /// As LightFieldFrame, for views that are rendered together.
  std::vector<int> rank_of_camera = {};
  int this_rank = 0;
};

/// What a light field is asked for.
enum class QueryKind { kViews, kRays };

/// Throws Error (bad input) where LightFieldRenderer::query() cannot answer rays so: there is no
/// one surface that they meet.
void check_ray_query_support(const ReconstructionSettings& reconstruction);

/// Renders views of a take. Many threads may call render() at once (frames in flight); the pixels
/// do not depend on how many threads there are. Uses the TBB arena it is called in.
class LightFieldRenderer {
 public:
  /// Throws Error (bad input) where no camera is left. Keeps a reference to `take`.
  LightFieldRenderer(const Take& take, const RendererSettings& settings);
  ~LightFieldRenderer();

  /// A view with one and a half times the light field's resolution or more has a note that says so,
  /// and so has one that is supersampled less than it takes. Throws Error (bad input) for an
  /// unknown method, options that it does not have, or frames that cannot be read.
  RenderedView render(const VirtualCamera& view, const FrameSelection& frames,
                      const ReconstructionSettings& reconstruction) const;

  /// Returns what the cameras that this host holds contribute to a view that another one puts
  /// together. `group`: as ViewRequest. Throws as render().
  Contribution contribute(const DistributedViewRequest& view, const RankCommunicator* group) const;

  /// Memory that the view's own values take while it is rendered, bytes: with what is measured,
  /// and, where it is supersampled, of the samples and of their mean.
  std::size_t view_bytes(const VirtualCamera& view, const FrameSelection& frames,
                         const ReconstructionSettings& reconstruction) const;

  /// Asks for the frames that a later render() will need to be read from the disk meanwhile. A
  /// hint: of cameras that earlier views did not look at nothing is read.
  void read_ahead(const FrameSelection& frames) const;
  /// How many of those were asked for before they were decoded.
  int frames_read_ahead() const;
  /// What decoding the cameras' frames has taken since the renderer was made.
  DecodeCosts decode_costs() const;
  /// Memory of decoded frames that are kept for later views, bytes: RendererSettings::cache_bytes
  /// at most, but for a single frame that is larger.
  std::size_t decoded_bytes_cached() const;

  /// Any rays, not only those of a view, into as many `samples`: see query_rays(). No fill.
  /// `lumigraph` (weights per ray) and `visual_hull` answer by their options. Of every other method
  /// only the surface counts; rays are blended on it as lumigraph does unless told, and options
  /// other than these are checked but have no say:
  ///   depth        where it finds the scene: by `near`, `far`, `plane_px`, `neighbours`,
  ///                `witnesses`, `temporal` and `keep`
  ///   plane_sweep  where depth finds it, unless told, between its `near` and `far`: depths that
  ///                are kept in the take unless RendererSettings::use_take_folder is off
  ///   all others   on `reconstruction`'s focal plane, also aperture: a plane of its own is not
  ///                followed
  /// Throws Error (bad input), beside what render() does, for `auto`, which chooses for views, and
  /// for `slabs` in a box, whose rays have a focal plane for each of its sides.
  void query(std::span<const WorldRay> rays, const FrameSelection& frames,
             const ReconstructionSettings& reconstruction, std::span<RaySample> samples) const;

  /// Returns the file in which render() or query() stores what the method derives once from a light
  /// field frame (Method::stored_file); empty: none. Not known for `auto`, which chooses a method
  /// when it renders: none. Throws Error (bad input) as render() does.
  std::filesystem::path stored_file(const FrameSelection& frames,
                                    const ReconstructionSettings& reconstruction,
                                    QueryKind as) const;
  /// Writes that file, unless it is there and whole: the same bytes as render() and query() write.
  /// Throws Error as render() does.
  StoreResult store(const FrameSelection& frames, const ReconstructionSettings& reconstruction,
                    QueryKind as) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace raystage
