// SPDX-License-Identifier: Apache-2.0
// Composites one view of a frame. Visible layers are rendered from the front; takes around a volume
// are blended by ray direction (volume_blending.h). Shadows, clips and opacity are applied to each
// layer before merge(). Light fields that are lights answer rays of the geometry, the first one in
// front of the others. Input: the frame's instants and a camera with overscan. Output: an image in
// the output colour space with all requested AOVs. Cost: the sum of the layers; in layer order none
// behind an opaque one.
#include "compose/frame_compositor.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <utility>

#include "base/stopwatch.h"
#include "compose/geometry/frustum_culling.h"
#include "compose/geometry/shadow_catcher.h"
#include "compose/layers/cryptomatte.h"
#include "compose/layers/merge.h"
#include "compose/layers/motion_vectors.h"
#include "compose/layers/volume_blending.h"

namespace raystage::compose {
namespace {

bool is_opaque(const LayerImage& image) {
  for (std::size_t i = 3; i < image.rgba.size(); i += 4) {
    if (image.rgba[i] < 1) return false;
  }
  return true;
}

}  // namespace

FrameCompositor::FrameCompositor(const ShotPlan& plan, const SequenceMemoryPlan& memory)
    : plan_(plan), stored_data_(std::make_shared<render::StoredDataCounts>()) {
  for (std::size_t i = 0; i < plan.layers(); ++i) {
    renderers_.emplace_back();
    if (plan.layer(i) == nullptr) continue;
    renderers_.back() = plan.layer(i)->make_renderer(
        {memory.per_layer[i], plan.measures_coverage(), plan.writes_aov("lf.confidence"),
         plan.cache_folder(), stored_data_, plan.hosts(), plan.rotten_frames()});
  }
}

LayerView FrameCompositor::layer_view(std::size_t layer, const PlannedFrame& frame,
                                      const ExrCamera& camera, const Geometry& geometry,
                                      std::span<const float> object_ids) const {
  const bool has_meshes = !geometry.mesh_indices.empty();
  return {frame.frame,
          frame.shown[layer],
          camera,
          has_meshes ? &geometry.scene : nullptr,
          has_meshes ? geometry.mesh_indices[layer] : -1,
          object_ids,
          frame.preview,
          geometry.record ? &geometry.record->rotten_cameras : nullptr,
          frame.offset,
          frame.views_shown(layer)};
}

FrameCompositor::Geometry FrameCompositor::geometry_in_frame(const PlannedFrame& frame,
                                                             const ExrCamera& camera) const {
  Geometry geometry{{}, {}, std::make_shared<SharedRecord>()};
  geometry.scene = plan_.geometry_at(frame, geometry.mesh_indices);
  bool is_needed = false;
  for (std::size_t i = 0; i < plan_.layers() && !is_needed; ++i) {
    const bool is_mesh = geometry.mesh_indices[i] >= 0;
    is_needed = (is_mesh && renderers_[i]->may_show(layer_view(i, frame, camera, geometry))) ||
                (plan_.shot().layers[i].shadows && plan_.is_visible(i, frame.frame));
  }
  if (!is_needed || geometry.scene.meshes.empty()) return {{}, {}, geometry.record};
  for (const MeshInstance& mesh : geometry.scene.meshes) {
    if (may_intersect_frustum(mesh, camera.view)) mesh.scene->build_bvh();
  }
  if (plan_.shot().lights.empty()) {
    geometry.scene.headlight = camera.view.pose.world_from_camera_rotation.col(2);
  }
  geometry.scene.busy_ns = &geometry.record->geometry_ns;
  geometry.scene.lights.environment_radiance =
      environment_of(frame, camera, geometry.scene.lights, geometry.record);
  return geometry;
}

EnvironmentRadiance FrameCompositor::environment_of(
    const PlannedFrame& frame, const ExrCamera& camera, const Lights& behind,
    const std::shared_ptr<SharedRecord>& record) const {
  EnvironmentRadiance seen_behind = behind.environment_radiance;
  // The first light is in front: it is queried first.
  for (std::size_t l = plan_.light_field_lights().size(); l-- > 0;) {
    const ShotPlan::LightFieldLight& light = plan_.light_field_lights()[l];
    seen_behind =
        layer_light_radiance(light, frame, camera, std::move(seen_behind), behind.ambient, record);
  }
  return seen_behind;
}

EnvironmentRadiance FrameCompositor::layer_light_radiance(
    const ShotPlan::LightFieldLight& light, const PlannedFrame& frame, const ExrCamera& camera,
    EnvironmentRadiance behind, const Eigen::Vector3f& ambient,
    const std::shared_ptr<SharedRecord>& record) const {
  std::vector<LayerRays> takes;
  std::vector<Eigen::Vector3d> view_directions;
  for (const std::size_t layer : light.layers) {
    if (!renderers_[layer]) continue;
    auto rays = renderers_[layer]->rays(layer_view(layer, frame, camera, {{}, {}, record}));
    if (!rays) continue;
    view_directions.push_back(rays->viewing_direction);
    takes.push_back(
        {[this, layer, record, query = std::move(rays->query)](
             std::span<const render::WorldRay> of_light, std::span<render::RaySample> samples) {
           const Stopwatch query_time;
           try {
             // Isolated: other rows of the geometry would count as time of the light field.
             tbb::this_task_arena::isolate([&] { query(of_light, samples); });
           } catch (const Error& error) {
             throw plan_.error_of_layer(layer, error);
           }
           record->light_queries_ns += std::llround(1e6 * query_time.ms());
         },
         rays->viewing_direction});
  }
  if (takes.empty()) return behind;
  return [takes = std::move(takes), view_directions = std::move(view_directions),
          behind = std::move(behind), strength = static_cast<float>(light.strength),
          to_working = plan_.colors().working_from_scene_matrix,
          ambient](std::span<const render::WorldRay> rays, std::span<const float> spread,
                   std::span<Eigen::Vector3f> seen) {
    std::ranges::fill(seen, ambient);
    if (behind) behind(rays, spread, seen);
    std::vector<std::vector<render::RaySample>> samples;
    for (const LayerRays& take : takes) {
      samples.emplace_back(rays.size());
      take.query(rays, samples.back());
    }
    VolumeBlender blender(view_directions);
    std::vector<std::array<float, 4>> of_takes(takes.size());
    for (std::size_t i = 0; i < rays.size(); ++i) {
      blender.find(rays[i].direction);
      for (std::size_t t = 0; t < takes.size(); ++t) of_takes[t] = samples[t][i].rgba;
      const auto rgba = blender.blend(of_takes);
      seen[i] = strength * (to_working * Eigen::Vector3f(rgba[0], rgba[1], rgba[2])) +
                (1 - rgba[3]) * seen[i];
    }
  };
}

LayerSurfaces FrameCompositor::render_layer(std::size_t layer, const PlannedFrame& frame,
                                            const ExrCamera& camera, const Geometry& geometry,
                                            bool separates, double& uncovered_share) const {
  const schemas::ShotDocument::Layer& document = plan_.shot().layers[layer];
  const std::vector<float> ids = cryptomatte_ids(layer);
  const LayerView view = layer_view(layer, frame, camera, geometry, ids);
  LayerSurfaces surfaces;
  // Isolated: while this thread waits for tiles of its frame, it must not start another frame.
  try {
    tbb::this_task_arena::isolate([&] { surfaces.image = renderers_[layer]->render(view); });
  } catch (const Error& error) {
    throw plan_.error_of_layer(layer, error);
  }
  uncovered_share = uncovered_share_of_layer(layer, surfaces.image);
  if (separates) surfaces = separate_surfaces(std::move(surfaces.image));
  surfaces.image.edges = {};
  const auto finish_image = [&](LayerImage& image) {
    if (plan_.layer(layer)->is_in_scene_space()) convert_to_working_space(image);
    if (camera.adjacent && plan_.light_field(layer) != nullptr && document.volume.empty()) {
      tbb::this_task_arena::isolate(
          [&] { add_camera_motion(camera.view, *camera.adjacent, image); });
    }
    remove_unrequested_aovs(image);
    if (!document.shadows || !frame.shown[layer].tick) return;
    const ShadowCatcher catcher{document.shadows->strength, document.shadows->occlusion_distance_m,
                                document.shadows->rays};
    const Stopwatch shadow_time;
    tbb::this_task_arena::isolate(
        [&] { apply_shadow_catcher(geometry.scene, camera.view, catcher, image); });
    geometry.record->shadows_ms += shadow_time.ms();
  };
  finish_image(surfaces.image);
  if (surfaces.behind) finish_image(*surfaces.behind);
  return surfaces;
}

void FrameCompositor::apply_layer_settings(std::size_t layer, const ExrCamera& camera,
                                           bool has_clips, LayerSurfaces& surfaces) const {
  const auto opacity = static_cast<float>(plan_.shot().layers[layer].opacity);
  const auto apply_to = [&](LayerImage& image) {
    if (plan_.shot().output.cryptomatte && image.ids.empty()) {
      assign_object_id(image, cryptomatte_ids(layer).front());
    }
    if (has_clips) {
      tbb::this_task_arena::isolate([&] { apply(plan_.clips(layer), camera.view, image); });
    }
    if (opacity < 1) {
      for (float& value : image.rgba) value *= opacity;
    }
  };
  apply_to(surfaces.image);
  if (surfaces.behind) apply_to(*surfaces.behind);
  cover_behind(surfaces);
}

LayerImage FrameCompositor::render_volume(std::size_t foremost, std::size_t count,
                                          const PlannedFrame& frame, const ExrCamera& camera,
                                          const Geometry& geometry) const {
  std::vector<std::size_t> layers;
  std::vector<Eigen::Vector3d> view_directions;
  for (std::size_t i = foremost + 1 - count; i <= foremost; ++i) {
    if (!plan_.is_visible(i, frame.frame)) continue;
    layers.push_back(i);
    view_directions.push_back(plan_.light_field(i)->take().rig().mean_viewing_direction());
  }
  if (layers.empty()) return transparent_layer_image(camera.view.width, camera.view.height);
  std::vector<LayerImage> images(layers.size());
  std::vector<const LayerImage*> takes(layers.size(), nullptr);
  const auto render = [&](std::size_t i) {
    double of_take = 0;  // what counts is what none of the takes saw
    images[i] = render_layer(layers[i], frame, camera, geometry, false, of_take).image;
    tbb::this_task_arena::isolate([&] { apply(plan_.clips(layers[i]), camera.view, images[i]); });
    takes[i] = &images[i];
  };
  LayerImage result;
  const auto blend = [&] {
    tbb::this_task_arena::isolate(
        [&] { result = blend_volume(takes, view_directions, camera.view); });
  };
  std::vector<bool> holds;
  tbb::this_task_arena::isolate([&] { holds = takes_in_view(view_directions, camera.view); });
  for (std::size_t i = 0; i < layers.size(); ++i) {
    if (holds[i]) render(i);
  }
  blend();
  // The other takes are rendered only if the first ones left gaps.
  const bool others = std::ranges::find(holds, false) != holds.end();
  if (others && !is_opaque(result)) {
    for (std::size_t i = 0; i < layers.size(); ++i) {
      if (!holds[i]) render(i);
    }
    blend();
  }
  for (const LayerImage& image : images) result.statistics.add_part(image.statistics);
  return result;
}

CompositedView FrameCompositor::composite(const PlannedFrame& frame, const ExrCamera& camera,
                                          const std::stop_token& stop, DeepImage* deep) const {
  CompositedView view = merged_view(frame, camera, stop, deep);
  const Stopwatch finishing;
  finish(view.picture, deep);
  view.times.merge_ms += finishing.ms();
  return view;
}

void FrameCompositor::finish(LayerImage& image, DeepImage* deep) const {
  convert_to_output_space(image, deep);
  add_missing_aovs(image);
}

CompositedView FrameCompositor::merged_view(const PlannedFrame& frame, const ExrCamera& camera,
                                            const std::stop_token& stop, DeepImage* deep) const {
  const Stopwatch total;
  CompositingTimes times;
  std::vector<double> uncovered_share(plan_.layers(), 0.0);
  std::vector<LayerImage> front_first;
  std::vector<bool> is_holdout;
  render::RenderStatistics statistics;
  const Geometry geometry = geometry_in_frame(frame, camera);
  times.geometry_ms = total.ms();  // includes BVHs, which the first frame builds
  double geometry_layers_ms = 0;
  const bool in_layer_order = plan_.shot().merge == schemas::ShotDocument::Merge::kLayerOrder;
  // Not by `deep`: the pixels of flat files must not depend on it.
  const bool separates = !in_layer_order || plan_.layers() == 1;
  for (std::size_t i = plan_.layers(); i-- > 0 && !stop.stop_requested();) {
    const std::size_t of_picture = plan_.volume_layer_count(i);
    const bool is_volume = !plan_.shot().layers[i].volume.empty();
    const std::size_t foremost = i;
    i -= of_picture - 1;
    if (!is_volume && !plan_.is_visible(i, frame.frame)) continue;
    const schemas::ShotDocument::Layer& document = plan_.shot().layers[i];
    if (is_volume && document.opacity <= 0) continue;
    const Layer* opened = plan_.layer(i);  // null is possible in a volume
    if (!is_volume &&
        (opened == nullptr || !renderers_[i]->may_show(layer_view(i, frame, camera, geometry)))) {
      continue;
    }
    const Stopwatch layer_time;
    LayerSurfaces surfaces;
    if (is_volume) {
      surfaces.image = render_volume(foremost, of_picture, frame, camera, geometry);
      uncovered_share[i] = uncovered_share_of_layer(i, surfaces.image);
    } else {
      surfaces = render_layer(i, frame, camera, geometry, separates, uncovered_share[i]);
    }
    if (is_volume && camera.adjacent) {
      tbb::this_task_arena::isolate(
          [&] { add_camera_motion(camera.view, *camera.adjacent, surfaces.image); });
    }
    const LayerStage stage = is_volume ? LayerStage::kLightFields : opened->stage();
    times.add(stage, layer_time.ms());
    if (stage == LayerStage::kGeometry) geometry_layers_ms += layer_time.ms();
    statistics.add_part(surfaces.image.statistics);
    apply_layer_settings(i, camera, !is_volume, surfaces);
    const bool is_whole = !surfaces.behind && is_opaque(surfaces.image);
    front_first.push_back(std::move(surfaces.image));
    is_holdout.push_back(document.holdout);
    if (surfaces.behind) {
      front_first.push_back(std::move(*surfaces.behind));
      is_holdout.push_back(document.holdout);
    }
    if (in_layer_order && is_whole) break;
  }
  const auto busy = static_cast<double>(geometry.record->geometry_ns);
  const double share_of_lights =
      busy > 0 ? std::min(1.0, static_cast<double>(geometry.record->light_queries_ns) / busy) : 0;
  const double moved = share_of_lights * geometry_layers_ms - geometry.record->shadows_ms;
  times.light_fields_ms += moved;
  times.geometry_ms -= moved;
  if (front_first.empty()) {
    front_first.push_back(transparent_layer_image(camera.view.width, camera.view.height));
    is_holdout.push_back(false);
  }
  std::vector<MergedLayer> rear_first;
  for (std::size_t i = front_first.size(); i-- > 0;) {
    rear_first.push_back({&front_first[i], is_holdout[i]});
  }
  if (deep != nullptr) *deep = make_deep_image(rear_first);
  LayerImage result;
  if (front_first.size() == 1 && !is_holdout[0]) {
    result = std::move(front_first[0]);
  } else {
    tbb::this_task_arena::isolate([&] {
      result = merge(rear_first, in_layer_order ? MergeOrder::kLayerOrder : MergeOrder::kDepth);
    });
  }
  result.statistics = statistics;
  times.merge_ms = total.ms() - times.light_fields_ms - times.geometry_ms;
  return {std::move(result), times, std::move(uncovered_share),
          geometry.record->rotten_cameras.ids()};
}

double FrameCompositor::uncovered_share_of_layer(std::size_t layer, const LayerImage& image) const {
  const Layer* opened = plan_.layer(layer);
  if (opened == nullptr || !opened->is_transparent_where_unseen() || image.pixels() == 0) return 0;
  // Holes that were filled are opaque, but not covered.
  const auto coverage = std::ranges::find_if(image.aovs, [](const Aov& aov) {
    return aov.layer == "lf" && aov.channels.front() == "coverage";
  });
  std::size_t empty = 0;
  for (std::size_t i = 0; i < image.pixels(); ++i) {
    const float seen = coverage == image.aovs.end() ? image.rgba[4 * i + 3] : coverage->values[i];
    empty += seen > 0 ? 0 : 1;
  }
  return static_cast<double>(empty) / image.pixels();
}

void FrameCompositor::convert_to_working_space(LayerImage& image) const {
  if (plan_.colors().working_from_scene) plan_.colors().working_from_scene->apply(image.rgba);
}

void FrameCompositor::remove_unrequested_aovs(LayerImage& image) const {
  std::erase_if(image.aovs, [&](const Aov& aov) {
    return !plan_.writes_aov(aov.layer == "lf" ? "lf." + aov.channels.front() : aov.layer);
  });
}

void FrameCompositor::convert_to_output_space(LayerImage& image, DeepImage* deep) const {
  const auto& transform = plan_.colors().file_from_working;
  if (!transform) return;
  transform->apply(image.rgba);
  for (Aov& aov : image.aovs) {
    if (aov.is_colour && aov.channels.size() == 3) transform->apply_rgb(aov.values);
  }
  for (std::size_t i = 0; deep != nullptr && i < deep->samples.size(); ++i) {
    transform->apply(deep->samples[i].rgba);
  }
}

void FrameCompositor::add_missing_aovs(LayerImage& image) const {
  const auto& layers = plan_.shot().layers;
  std::vector<Aov> wanted;
  const auto want = [&](const char* layer, const std::vector<std::string>& channels,
                        bool is_colour = false, float empty_value = 0) {
    Aov aov{layer, channels, is_colour, empty_value, {}};
    const bool is_one_of_many = aov.layer == "lf";
    if (plan_.writes_aov(is_one_of_many ? "lf." + channels.front() : aov.layer)) {
      wanted.push_back(std::move(aov));
    }
  };
  if (std::ranges::any_of(layers, [](const auto& layer) { return layer.geometry.has_value(); })) {
    want("P", {"X", "Y", "Z"});
    want("N", {"X", "Y", "Z"});
    want("albedo", {"R", "G", "B"}, true);
  }
  const auto moves = [](const schemas::ShotDocument::Layer& layer) {
    return layer.geometry.has_value() || layer.is_light_field();
  };
  if (std::ranges::any_of(layers, moves)) want("motion", {"X", "Y", "Z", "W"});
  if (std::ranges::any_of(layers, &schemas::ShotDocument::Layer::is_light_field)) {
    want("lf", {"coverage"});
    want("lf", {"confidence"});
    want("lf", {"cameras"});
    want("lf", {"nearest"}, false, std::numeric_limits<float>::infinity());
  }
  // The same order in all frames.
  std::vector<Aov> all;
  for (Aov& aov : wanted) {
    const auto own = std::ranges::find_if(image.aovs, [&](const Aov& of_image) {
      return of_image.layer == aov.layer && of_image.channels == aov.channels;
    });
    if (own != image.aovs.end()) {
      all.push_back(std::move(*own));
      continue;
    }
    aov.values.assign(image.pixels() * aov.channels.size(), aov.empty_value);
    all.push_back(std::move(aov));
  }
  image.aovs = std::move(all);
  if (!plan_.shot().output.cryptomatte) return;
  if (image.ids.empty()) image.ids.assign(image.pixels() * 2 * kIdRanks, 0.0F);
  // Readers that do not know the measures of the light field may stop at them: they come last.
  const auto first_measure =
      std::ranges::find(image.aovs, std::string("lf"), [](const Aov& aov) { return aov.layer; });
  std::vector<Aov> ids = cryptomatte_aovs(image);
  image.aovs.insert(first_measure, std::make_move_iterator(ids.begin()),
                    std::make_move_iterator(ids.end()));
  image.ids = {};
}

std::vector<float> FrameCompositor::cryptomatte_ids(std::size_t layer) const {
  std::vector<float> ids;
  for (const std::string& name : plan_.object_names(layer)) ids.push_back(object_id(name));
  return ids;
}

void FrameCompositor::read_ahead(const PlannedFrame& frame) const {
  for (std::size_t i = 0; i < plan_.layers(); ++i) {
    if (renderers_[i]) renderers_[i]->read_ahead(frame.shown[i]);
  }
}

int FrameCompositor::frames_read_ahead() const {
  int frames = 0;
  for (const auto& renderer : renderers_) frames += renderer ? renderer->frames_read_ahead() : 0;
  return frames;
}

store::DecodeCosts FrameCompositor::decode_costs() const {
  store::DecodeCosts costs;
  for (const auto& renderer : renderers_) {
    if (renderer) costs += renderer->decode_costs();
  }
  return costs;
}

std::size_t FrameCompositor::decoded_bytes_cached() const {
  std::size_t bytes = 0;
  for (const auto& renderer : renderers_) bytes += renderer ? renderer->decoded_bytes_cached() : 0;
  return bytes;
}

}  // namespace raystage::compose
