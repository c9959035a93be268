// SPDX-License-Identifier: Apache-2.0
// Renders views of the method "depth" on several hosts. Each host estimates the depths of its own
// cameras once per light field frame, with the frames and maps of their neighbours
// (local_depths.h). For a view, each host warps its cameras' depths and host 0 selects the depth
// with the largest support. Then each host adds the samples of its cameras at these depths. The two
// rounds of reweighting (blend_reweighted()) exchange the mean. Output: sums per pixel, see
// contribute(). Cost per host: O(pixels x its cameras).
#include "render/depth/distributed.h"

#include <algorithm>
#include <array>
#include <memory>
#include <utility>

#include "base/error.h"
#include "base/parallel.h"
#include "render/common/rank_communicator.h"
#include "render/depth/angular_fit.h"
#include "render/depth/blend_kernels.h"
#include "render/depth/distributed_angular_fit.h"
#include "render/depth/fusion.h"
#include "render/depth/host_messages.h"
#include "render/depth/host_reduction.h"
#include "render/depth/local_depths.h"
#include "render/depth/surface_pairs.h"
#include "render/depth/view_sources.h"
#include "render/depth/warp.h"
#include "render/sampling/field_coverage.h"

namespace raystage::render::depth {
namespace {

using Message = RankCommunicator::Message;
using Tile = BlendingField::Tile;

class NoOthers : public RankCommunicator {
 public:
  int rank() const override { return 0; }
  int size() const override { return 1; }
  std::vector<Message> exchange(std::vector<Message> messages) const override { return messages; }
};

std::vector<Message> empty_messages(const RankCommunicator& group) {
  return std::vector<Message>(static_cast<std::size_t>(group.size()));
}

/// Returns the depth of each pixel of the view: host 0 votes on the hypotheses of all hosts.
InverseDepthMap vote_together(const ViewRequest& request, DepthViewPlan& plan,
                              const RankCommunicator& group) {
  const LightFieldFrame& instant = request.instant;
  const FusionInputs vote = fusion_inputs(plan, request);
  std::vector<Message> messages = empty_messages(group);
  std::vector<DepthTiles> warped(vote.hypotheses.size());
  for (std::size_t i = 0; i < vote.hypotheses.size(); ++i) {
    if (!instant.is_local(vote.cameras[i])) continue;
    warped[i] = warp_hypotheses(plan.pinhole, vote.hypotheses[i]);
    if (group.rank() == 0) continue;
    append_values(std::span<const std::int32_t>(warped[i].first), messages[0]);
    const auto count = static_cast<std::uint64_t>(warped[i].values.size());
    append_values(std::span(&count, 1), messages[0]);
    append_values(std::span<const float>(warped[i].values), messages[0]);
    warped[i] = {};
  }
  const std::vector<Message> hypotheses = group.exchange(std::move(messages));
  messages = empty_messages(group);
  InverseDepthMap map;
  if (group.rank() == 0) {
    for (std::size_t host = 1; host < hypotheses.size(); ++host) {
      std::span<const std::byte> rest(hypotheses[host]);
      for (std::size_t i = 0; i < vote.hypotheses.size(); ++i) {
        if (instant.rank_of_camera[vote.cameras[i]] != static_cast<int>(host)) continue;
        warped[i].first = take_values<std::int32_t>(rest, depth_tile_count(plan.pinhole));
        const std::uint64_t count = take_values<std::uint64_t>(rest, 1)[0];
        warped[i].values = take_values<float>(rest, static_cast<std::size_t>(count));
      }
    }
    map = fuse_warped_hypotheses(plan.pinhole, vote.hypotheses, warped, vote.settings);
    fill_unknown_depths(plan, map);
    for (std::size_t host = 1; host < messages.size(); ++host) {
      messages[host].reserve(map.values.size() * sizeof(float) + RankCommunicator::kTrailerBytes);
      append_values(std::span<const float>(map.values), messages[host]);
    }
  }
  const std::vector<Message> found = group.exchange(std::move(messages));
  if (group.rank() != 0) {
    std::span<const std::byte> rest(found[0]);
    map.width = plan.pinhole.width;
    map.height = plan.pinhole.height;
    map.values = take_values<float>(rest, view_value_count(plan.pinhole) / 4);
  }
  return map;
}

/// Blends bands of the view in rounds. A band is the rows of tiles whose samples are in memory.
class BandBlend {
 public:
  BandBlend(const ViewRequest& request, const DepthViewPlan& plan, const ViewSources& sources,
            const RankCommunicator& group)
      : request_(request), plan_(plan), sources_(sources), group_(group) {}

  void blend(int first, int end, Contribution& contribution) {
    const BlendingField& field = plan_.field;
    top_ = field.tile(0, first).top;
    const int bottom = field.tile(0, end - 1).bottom;
    const auto width = static_cast<std::size_t>(request_.view.width);
    const std::size_t pixels = width * static_cast<std::size_t>(bottom - top_);
    find_surfaces(first, end);
    in_sight_.assign(pixels, 0.0F);
    sample(first, end, Surface::kFront);
    const std::size_t start = static_cast<std::size_t>(top_) * width;
    const std::vector<float> alpha = blend_samples(first, end, contribution.planes[0]);
    if (has_pairs_) {
      HostReduction(group_, request_.view.width, columns_with_samples(first, end))
          .reduce_to_first(in_sight_);
    }
    std::vector<float> alpha_behind(pixels, 0.0F);
    if (has_pairs_) {
      sample(first, end, Surface::kBehind);
      alpha_behind = blend_samples(first, end, contribution.planes[2]);
    }
    if (group_.rank() != 0) return;
    for_each_tile(first, end, [&](const Tile& tile, const TileSamples& samples) {
      for (int y = tile.top; y < tile.bottom; ++y) {
        const SurfaceRun& surfaces = samples.surfaces[static_cast<std::size_t>(y - tile.top)];
        for (int x = tile.left; x < tile.right; ++x) {
          const std::size_t in_tile = static_cast<std::size_t>(x - tile.left), i = in_band(x, y);
          float* pixel = &contribution.planes[1][4 * (start + i)];
          pixel[0] = surfaces.front[in_tile];
          pixel[1] = alpha[i];
          pixel[2] = surfaces.is_pair[in_tile] ? surfaces.behind[in_tile] : kUnknownDepth;
          pixel[3] = in_sight_[i];
          contribution.planes[3][4 * (start + i)] = alpha_behind[i];
        }
      }
    });
  }

  /// Frees the last band.
  void release() { tiles_ = {}; }

 private:
  enum class Surface { kFront, kBehind };

  /// A tile's samples of this host's cameras, row by row.
  struct TileSamples {
    std::vector<SurfaceRun> surfaces;  ///< of each row
    bool has_pairs = false;
    std::size_t cameras = 0;
    std::vector<float> values;  ///< per row and camera: 4 samples, weight, visibility of each pixel
  };
  static constexpr std::size_t kPerRun = 6 * static_cast<std::size_t>(kMaxRunPixels);

  std::size_t in_band(int x, int y) const {
    return static_cast<std::size_t>(y - top_) * request_.view.width + x;
  }

  template <class Body>
  void for_each_tile(int first, int end, const Body& body) {
    const int columns = plan_.field.columns();
    raystage::parallel_for(0, (end - first) * columns, [&](int i) {
      body(plan_.field.tile(i % columns, first + i / columns), tiles_[i]);
    });
  }

  void find_surfaces(int first, int end) {
    tiles_.assign(static_cast<std::size_t>((end - first) * plan_.field.columns()), {});
    const auto separation = surface_separation(plan_, request_);
    for_each_tile(first, end, [&](const Tile& tile, TileSamples& samples) {
      for (int y = tile.top; y < tile.bottom; ++y) {
        samples.surfaces.push_back(
            surfaces_of_run(plan_.view_depths, tile.left, y, tile.right - tile.left, separation));
        samples.has_pairs = samples.has_pairs || samples.surfaces.back().has_pairs();
      }
    });
    has_pairs_ = std::ranges::any_of(tiles_, &TileSamples::has_pairs);
  }

  /// Samples this host's cameras at the points in front, or in tiles with pairs at those behind.
  void sample(int first, int end, Surface surface) {
    for_each_tile(first, end, [&](const Tile& tile, TileSamples& samples) {
      std::vector<const BlendingField::TileCamera*> cameras;
      for (const BlendingField::TileCamera& camera : tile.cameras) {
        if (surface == Surface::kBehind && !samples.has_pairs) break;
        if (sources_[camera.camera].frame) cameras.push_back(&camera);
      }
      samples.cameras = cameras.size();
      samples.values.resize(cameras.size() * static_cast<std::size_t>(tile.bottom - tile.top) *
                            kPerRun);
      float* at = samples.values.data();
      const auto n = static_cast<std::size_t>(tile.right - tile.left);
      std::array<FrontShare, kMaxRunPixels> shares;
      for (int y = tile.top; y < tile.bottom; ++y) {
        const SurfaceRun& surfaces = samples.surfaces[static_cast<std::size_t>(y - tile.top)];
        const auto& depths = surface == Surface::kFront ? surfaces.front : surfaces.behind;
        const PixelRun pixels{tile.left, y, {depths.data(), n}};
        const bool weighs = surface == Surface::kFront && surfaces.has_pairs();
        shares.fill({});
        for (const BlendingField::TileCamera* camera : cameras) {
          const CameraRun run{at, at + std::ptrdiff_t{4} * kMaxRunPixels,
                              at + std::ptrdiff_t{5} * kMaxRunPixels};
          sample_camera(sources_, plan_, tile, *camera, pixels, run);
          if (weighs) {
            weigh_front_surfaces(sources_, plan_, camera->camera, pixels, surfaces, run,
                                 {run.samples + 3, 4}, shares);
          }
          at += kPerRun;
        }
        for (std::size_t x = 0; weighs && x < n; ++x) {
          in_sight_[in_band(tile.left, y) + x] = shares[x].visible;
        }
      }
    });
  }

  /// Blends the samples over all hosts. Writes this host's part of the sums to a plane, and returns
  /// the sums of weights, of all hosts on host 0.
  std::vector<float> blend_samples(int first, int end, PixelValues& plane) {
    const std::size_t pixels = in_sight_.size();
    std::vector<float> sums(4 * pixels, 0.0F), alpha(pixels, 0.0F);
    for_each_run(first, end, [&](const Tile& tile, int y, const BlendRun& run) {
      const std::size_t at = in_band(tile.left, y);
      const auto n = static_cast<std::size_t>(run.count);
      sum_weighted(run, {&sums[4 * at], 4 * n}, {&alpha[at], n});
    });
    const HostReduction over_hosts(group_, request_.view.width, columns_with_samples(first, end));
    over_hosts.reduce_to_first(alpha);
    over_hosts.sum(sums, 4);
    for (int round = 0; round < kReweightingRounds; ++round) {
      const std::vector<float> mean = std::exchange(sums, std::vector<float>(4 * pixels, 0.0F));
      for_each_run(first, end, [&](const Tile& tile, int y, const BlendRun& run) {
        const std::size_t at = 4 * in_band(tile.left, y);
        const auto n = 4 * static_cast<std::size_t>(run.count);
        sum_reweighted(run, {&mean[at], n}, {&sums[at], n});
      });
      if (round + 1 < kReweightingRounds) over_hosts.sum(sums, 4);
    }
    const std::size_t start =
        static_cast<std::size_t>(top_) * static_cast<std::size_t>(request_.view.width);
    std::ranges::copy(sums, plane.begin() + static_cast<std::ptrdiff_t>(4 * start));
    return alpha;
  }

  /// Returns, for each row of the band, the columns in which this host has samples.
  std::vector<HostReduction::Columns> columns_with_samples(int first, int end) const {
    std::vector<HostReduction::Columns> columns;
    for (int row = first; row < end; ++row) {
      HostReduction::Columns in_row;
      for (int column = 0; column < plan_.field.columns(); ++column) {
        const auto index = static_cast<std::size_t>((row - first) * plan_.field.columns() + column);
        if (tiles_[index].cameras == 0) continue;
        const Tile& tile = plan_.field.tile(column, row);
        if (in_row.begin == in_row.end) in_row.begin = tile.left;
        in_row.end = tile.right;
      }
      const Tile& tile = plan_.field.tile(0, row);
      columns.insert(columns.end(), static_cast<std::size_t>(tile.bottom - tile.top), in_row);
    }
    return columns;
  }

  /// Calls body(tile, y, run) for each row of each tile in which this host has samples.
  template <class Body>
  void for_each_run(int first, int end, const Body& body) {
    for_each_tile(first, end, [&](const Tile& tile, const TileSamples& samples) {
      if (samples.cameras == 0) return;
      std::vector<const float*> sample_of(samples.cameras), share_of(samples.cameras),
          visible_of(samples.cameras);
      const float* at = samples.values.data();
      for (int y = tile.top; y < tile.bottom; ++y) {
        for (std::size_t c = 0; c < samples.cameras; ++c, at += kPerRun) {
          sample_of[c] = at;
          share_of[c] = at + std::ptrdiff_t{4} * kMaxRunPixels;
          visible_of[c] = at + std::ptrdiff_t{5} * kMaxRunPixels;
        }
        body(tile, y,
             BlendRun{sample_of, share_of, visible_of, tile.right - tile.left,
                      static_cast<float>(plan_.settings.agreement * 257)});
      }
    });
  }

  const ViewRequest& request_;
  const DepthViewPlan& plan_;
  const ViewSources& sources_;
  const RankCommunicator& group_;
  int top_ = 0;  // first row of the band in the view
  std::vector<TileSamples> tiles_;
  bool has_pairs_ = false;       // whether a pixel of the band shows two surfaces
  std::vector<float> in_sight_;  // FrontShare::visible of each pixel of the band
};

/// Of a contribution: sums at the points in front; their inverse depth, weight, the inverse depth
/// behind them (unknown: there is one surface) and FrontShare::visible; sums at the points behind;
/// their weight; the fit over the positions of the cameras (weigh_angular_fit()).
constexpr std::size_t kPlanes = 5;

/// Returns the end of the band from row of tiles `first` on, at least one row of tiles further. The
/// samples of all hosts' cameras in it fit `working_bytes`, so all hosts use the same bands.
int end_of_band(const DepthViewPlan& plan, int first, std::size_t working_bytes) {
  constexpr std::size_t kPerCamera =
      6 * sizeof(float) * static_cast<std::size_t>(kMaxRunPixels) * BlendingField::kTile;
  std::size_t bytes = 0;
  for (int row = first; row < plan.field.rows(); ++row) {
    for (int column = 0; column < plan.field.columns(); ++column) {
      bytes += kPerCamera * plan.field.tile(column, row).cameras.size();
    }
    if (bytes > working_bytes && row > first) return row;
  }
  return plan.field.rows();
}

}  // namespace

Contribution contribute(const ViewRequest& request) {
  const NoOthers alone;
  const RankCommunicator& group = request.group != nullptr ? *request.group : alone;
  const auto start = RenderClock::now();
  Contribution contribution;
  contribution.planes.assign(kPlanes, PixelValues(view_value_count(request.view), 0.0F));
  std::optional<DepthViewPlan> plan = plan_without_depths(request);
  if (!plan) return contribution;
  const auto held = local_depths(request, plan->settings, group);
  plan->depths = std::shared_ptr<const CameraDepths>(held, &held->depths);
  contribution.notes = held->notes;
  plan->view_depths = vote_together(request, *plan, group);
  ViewSources sources(request, *plan);
  const auto planned = RenderClock::now();
  sources.decode(contribution.statistics);
  const auto decoded = RenderClock::now();
  BandBlend band(request, *plan, sources, group);
  std::vector<TileRows> bands;
  for (int first = 0; first < plan->field.rows(); first = bands.back().end) {
    bands.push_back({first, end_of_band(*plan, first, request.working_bytes)});
    band.blend(first, bands.back().end, contribution);
  }
  band.release();
  fit_angular_together(request, *plan, sources, group, bands, contribution.planes[4]);
  contribution.statistics.pixels_decoded += held->depths.pixels_decoded;
  contribution.statistics.plan_ms = milliseconds(planned - start);
  contribution.statistics.decode_ms = milliseconds(decoded - planned);
  contribution.statistics.render_ms = milliseconds(RenderClock::now() - decoded);
  return contribution;
}

RenderedView combine(const ViewRequest& request, const std::vector<PixelValues>& planes) {
  std::optional<DepthViewPlan> plan = plan_without_depths(request);
  if (!plan) return transparent_view(request);
  RenderedView image = uninitialised_view(request.view);
  const store::FrameCache& cache = *request.instant.cache;
  const auto width = static_cast<std::size_t>(request.view.width);
  const auto full_scale = static_cast<float>(cache.full_scale());
  // Writes the colours of a row from the sums of all hosts and their weights.
  const auto finish = [&](const PixelValues& sums_of_view, const PixelValues& weights,
                          std::size_t weight_at, std::size_t row, std::span<float> rgba) {
    for (std::size_t x = 0; x < width; ++x) {
      const float* sum = &sums_of_view[4 * (row + x)];
      const float alpha = weights[4 * (row + x) + weight_at];
      const float scale = sum[3] > 0 ? alpha / std::max(sum[3], 1e-30F) : 0.0F;
      for (std::size_t c = 0; c < 4; ++c) rgba[4 * x + c] = sum[c] * scale;
    }
    finish_samples(rgba, cache.blend_space(), full_scale, rgba);
  };
  std::vector<std::vector<EdgePixel>> edges(static_cast<std::size_t>(request.view.height));
  raystage::parallel_for(0, request.view.height, [&](int y) {
    const std::size_t row = static_cast<std::size_t>(y) * width;
    const std::span<float> rgba(&image.rgba[4 * row], 4 * width);
    std::vector<float> behind(4 * width);
    finish(planes.at(0), planes.at(1), 1, row, rgba);
    finish(planes.at(2), planes.at(3), 0, row, behind);
    mix_angular_fit(cache, {&planes.at(4)[4 * row], 4 * width}, rgba);
    for (std::size_t x = 0; x < width; ++x) {
      const float* facts = &planes.at(1)[4 * (row + x)];
      float depth = facts[0];
      const std::span<float, 4> pixel(&rgba[4 * x], 4);
      if (facts[2] >= 0) {
        constexpr float kFull = 65535;
        CombinedSurfaces both =
            combine_surfaces({facts[0], facts[2]}, {facts[3], facts[1] / kFull}, pixel,
                             std::span<const float, 4>(&behind[4 * x], 4));
        std::ranges::copy(both.rgba, pixel.begin());
        depth = both.inverse_depth;
        if (both.edge) {
          both.edge->pixel = static_cast<std::uint32_t>(row + x);
          edges[static_cast<std::size_t>(y)].push_back(*both.edge);
        }
      }
      const float absent =
          absent_camera_weight(plan->complete, request.instant, static_cast<int>(x), y);
      image.coverage[row + x] = pixel[3] * (1 - absent);
      image.z[row + x] =
          pixel[3] > 0 && depth > 0 ? 1 / depth : std::numeric_limits<float>::infinity();
    }
  });
  for (const std::vector<EdgePixel>& of_row : edges) {
    image.edges.insert(image.edges.end(), of_row.begin(), of_row.end());
  }
  image.notes = plan->notes;
  return image;
}

}  // namespace raystage::render::depth
