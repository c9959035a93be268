// SPDX-License-Identifier: Apache-2.0
#include "compose/frame_painter.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <iterator>
#include <limits>
#include <utility>

#include "compose/geometry/cast_shadows.h"
#include "compose/geometry/in_view.h"
#include "compose/layers/cryptomatte.h"
#include "compose/layers/merge.h"
#include "compose/layers/volume.h"
#include "render/methods.h"

namespace raystage {
namespace {

LayerImage solid_image(const ShotDocument::Solid& solid, int width, int height) {
  LayerImage image = empty_image(width, height);
  for (std::size_t pixel = 0; pixel < image.pixels(); ++pixel) {
    for (std::size_t c = 0; c < 3; ++c) {
      image.rgba[4 * pixel + c] = static_cast<float>(solid.color[c] * solid.alpha);
    }
    image.rgba[4 * pixel + 3] = static_cast<float>(solid.alpha);
  }
  if (solid.depth_m) std::ranges::fill(image.z, static_cast<float>(*solid.depth_m));
  return image;
}

bool hides_all(const LayerImage& image) {
  for (std::size_t i = 3; i < image.rgba.size(); i += 4) {
    if (image.rgba[i] < 1) return false;
  }
  return true;
}

void add_up(const RenderStatistics& from, RenderStatistics& to) {
  to.plan_ms += from.plan_ms;
  to.decode_ms += from.decode_ms;
  to.render_ms += from.render_ms;
  to.pixels_decoded += from.pixels_decoded;
}

/// Since it was made.
class Stopwatch {
 public:
  double ms() const {
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start_)
        .count();
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace

FramePainter::FramePainter(const ShotPlan& plan, const MemoryPlan& memory)
    : plan_(plan), stored_data_(std::make_shared<StoredDataCounts>()) {
  for (std::size_t i = 0; i < plan.layers(); ++i) {
    renderers_.emplace_back();
    const LightFieldLayer* light_field = plan.light_field(i);
    if (light_field == nullptr) continue;
    RendererSettings settings;
    settings.cache_bytes = memory.of_layer[i].cache;
    settings.kept_bytes = memory.of_layer[i].kept;
    settings.working_bytes = memory.of_layer[i].working;
    settings.measure_coverage = plan.measures_coverage();
    settings.measure_confidence = plan.wants("lf.confidence");
    settings.ticks = light_field->timeline().ticks;
    settings.matte = light_field->matte();
    settings.cache_folder = plan.cache_folder();
    settings.stored_data_counts = stored_data_;
    if (plan.hosts() != nullptr) plan.hosts()->share(light_field->take(), settings);
    renderers_.back() = std::make_unique<const LightFieldRenderer>(light_field->take(), settings);
  }
}

FramePainter::Geometry FramePainter::geometry_of(const PlannedFrame& frame,
                                                 const ExrCamera& camera) const {
  Geometry geometry;
  geometry.scene = plan_.geometry_at(frame.frame, geometry.mesh_of_layer);
  bool is_needed = false;
  for (std::size_t i = 0; i < plan_.layers() && !is_needed; ++i) {
    is_needed = is_in_view(geometry, i, camera) ||
                (plan_.shot().layers[i].shadows && plan_.is_visible(i, frame.frame));
  }
  if (!is_needed || geometry.scene.meshes.empty()) return {};
  for (const PlacedMesh& mesh : geometry.scene.meshes) {
    if (may_be_in_view(mesh, camera.view)) mesh.scene->prepare();
  }
  geometry.scene.lights.surroundings = surroundings_of(frame, camera, geometry.scene.lights);
  return geometry;
}

bool FramePainter::is_in_view(const Geometry& geometry, std::size_t layer,
                              const ExrCamera& camera) const {
  if (geometry.mesh_of_layer.empty() || geometry.mesh_of_layer[layer] < 0) return false;
  const auto mesh = static_cast<std::size_t>(geometry.mesh_of_layer[layer]);
  return may_be_in_view(geometry.scene.meshes[mesh], camera.view);
}

Surroundings FramePainter::surroundings_of(const PlannedFrame& frame, const ExrCamera& camera,
                                           const Lights& behind) const {
  Surroundings seen_behind = behind.surroundings;
  // The first light is asked first: it lies in front.
  for (std::size_t l = plan_.light_field_lights().size(); l-- > 0;) {
    const ShotPlan::LayerLight& light = plan_.light_field_lights()[l];
    seen_behind = light_of(light, frame, camera, std::move(seen_behind), behind.ambient);
  }
  return seen_behind;
}

Surroundings FramePainter::light_of(const ShotPlan::LayerLight& light, const PlannedFrame& frame,
                                    const ExrCamera& camera, Surroundings behind,
                                    const Eigen::Vector3f& ambient) const {
  struct Asked {
    const LightFieldRenderer* renderer;
    const FrameSelection* tick;
    Reconstruction how;
  };
  std::vector<Asked> takes;
  std::vector<Eigen::Vector3d> facing;
  for (const std::size_t layer : light.layers) {
    const ShownInstant& shown = frame.shown[layer];
    if (!shown.tick) continue;
    const LightFieldLayer& light_field = *plan_.light_field(layer);
    takes.push_back({renderers_[layer].get(), &light_field.tick(shown),
                     light_field.reconstruction_for(camera, frame.frame)});
    facing.push_back(light_field.take().rig().mean_viewing_direction());
  }
  if (takes.empty()) return behind;
  return [takes = std::move(takes), facing = std::move(facing), behind = std::move(behind),
          strength = static_cast<float>(light.strength),
          to_working = plan_.colors().working_from_scene_matrix,
          ambient](std::span<const WorldRay> rays, std::span<const float> spread,
                   std::span<Eigen::Vector3f> seen) {
    std::ranges::fill(seen, ambient);
    if (behind) behind(rays, spread, seen);
    std::vector<std::vector<RaySample>> samples;
    for (const Asked& take : takes) {
      samples.emplace_back(rays.size());
      take.renderer->query(rays, *take.tick, take.how, samples.back());
    }
    RayHolders holders(facing);
    std::vector<std::array<float, 4>> of_takes(takes.size());
    for (std::size_t i = 0; i < rays.size(); ++i) {
      holders.find(rays[i].direction);
      for (std::size_t t = 0; t < takes.size(); ++t) of_takes[t] = samples[t][i].rgba;
      const auto rgba = holders.blend(of_takes);
      seen[i] = strength * (to_working * Eigen::Vector3f(rgba[0], rgba[1], rgba[2])) +
                (1 - rgba[3]) * seen[i];
    }
  };
}

LayerImage FramePainter::layer_image_of(std::size_t layer, const PlannedFrame& frame,
                                        const ExrCamera& camera, const Geometry& geometry) const {
  const ShotDocument::Layer& document = plan_.shot().layers[layer];
  if (document.geometry) {
    LayerImage image;
    tbb::this_task_arena::isolate([&] {
      image =
          render_geometry(geometry.scene, static_cast<std::size_t>(geometry.mesh_of_layer[layer]),
                          camera.view, document.geometry->samples, ids_of(layer));
    });
    drop_unwanted(image);
    return image;
  }
  if (document.plate) {
    LayerImage image = plan_.plate(layer)->image(frame.frame, camera.overscan_x, camera.overscan_y);
    turn_into_working_colors(image);
    return image;
  }
  if (document.solid) return solid_image(*document.solid, camera.view.width, camera.view.height);
  if (!frame.shown[layer].tick) return empty_image(camera.view.width, camera.view.height);
  const LightFieldLayer& light_field = *plan_.light_field(layer);
  RenderedView view;
  // Isolated: while this thread waits for its frame's tiles it must not begin another frame,
  // which would keep this one waiting.
  tbb::this_task_arena::isolate([&] {
    view = renderers_[layer]->render(camera.view, light_field.tick(frame.shown[layer]),
                                     light_field.reconstruction_for(camera, frame.frame));
  });
  LayerImage image = layer_image(std::move(view));
  turn_into_working_colors(image);
  drop_unwanted(image);
  if (document.shadows) {
    const ShadowCatcher catcher{document.shadows->strength, document.shadows->reach_m,
                                document.shadows->rays};
    tbb::this_task_arena::isolate(
        [&] { cast_shadows(geometry.scene, camera.view, catcher, image); });
  }
  return image;
}

LayerImage FramePainter::volume_image_of(std::size_t foremost, std::size_t count,
                                         const PlannedFrame& frame, const ExrCamera& camera,
                                         const Geometry& geometry) const {
  std::vector<std::size_t> layers;
  std::vector<Eigen::Vector3d> facing;
  for (std::size_t i = foremost + 1 - count; i <= foremost; ++i) {
    if (!plan_.is_visible(i, frame.frame)) continue;
    layers.push_back(i);
    facing.push_back(plan_.light_field(i)->take().rig().mean_viewing_direction());
  }
  if (layers.empty()) return empty_image(camera.view.width, camera.view.height);
  std::vector<LayerImage> images(layers.size());
  std::vector<const LayerImage*> takes(layers.size(), nullptr);
  const auto render = [&](std::size_t i) {
    images[i] = layer_image_of(layers[i], frame, camera, geometry);
    tbb::this_task_arena::isolate([&] { apply(plan_.clips(layers[i]), camera.view, images[i]); });
    takes[i] = &images[i];
  };
  LayerImage result;
  const auto blend = [&] {
    tbb::this_task_arena::isolate([&] { result = blend_volume(takes, facing, camera.view); });
  };
  std::vector<bool> holds;
  tbb::this_task_arena::isolate([&] { holds = holders_of(facing, camera.view); });
  for (std::size_t i = 0; i < layers.size(); ++i) {
    if (holds[i]) render(i);
  }
  blend();
  // The others are asked only where those that face the rays left something open.
  const bool others = std::ranges::find(holds, false) != holds.end();
  if (others && !hides_all(result)) {
    for (std::size_t i = 0; i < layers.size(); ++i) {
      if (!holds[i]) render(i);
    }
    blend();
  }
  for (const LayerImage& image : images) add_up(image.statistics, result.statistics);
  return result;
}

PaintedView FramePainter::paint(const PlannedFrame& frame, const ExrCamera& camera,
                                const std::stop_token& stop, DeepImage* deep) const {
  const Stopwatch total;
  PaintTimes times;
  std::vector<double> unseen(plan_.layers(), 0.0);
  std::vector<LayerImage> front_first;
  std::vector<bool> is_holdout;
  RenderStatistics statistics;
  const Geometry geometry = geometry_of(frame, camera);
  times.geometry_ms = total.ms();  // the first frame builds trees
  const bool stated = plan_.shot().merge == ShotDocument::Merge::kStated;
  for (std::size_t i = plan_.layers(); i-- > 0 && !stop.stop_requested();) {
    const std::size_t of_picture = plan_.layers_of_picture(i);
    const bool is_volume = !plan_.shot().layers[i].volume.empty();
    const std::size_t foremost = i;
    i -= of_picture - 1;
    if (!is_volume && !plan_.is_visible(i, frame.frame)) continue;
    const ShotDocument::Layer& document = plan_.shot().layers[i];
    if (is_volume && document.opacity <= 0) continue;
    if (document.geometry && !is_in_view(geometry, i, camera)) continue;
    const Stopwatch of_layer;
    LayerImage image = is_volume ? volume_image_of(foremost, of_picture, frame, camera, geometry)
                                 : layer_image_of(i, frame, camera, geometry);
    if (document.is_light_field()) times.light_fields_ms += of_layer.ms();
    if (document.geometry) times.geometry_ms += of_layer.ms();
    if (plan_.shot().output.cryptomatte && image.ids.empty()) {
      make_one_object(image, ids_of(i).front());
    }
    add_up(image.statistics, statistics);
    unseen[i] = unseen_of(i, image);
    if (!is_volume) {
      tbb::this_task_arena::isolate([&] { apply(plan_.clips(i), camera.view, image); });
    }
    if (document.opacity < 1) {
      for (float& value : image.rgba) value *= static_cast<float>(document.opacity);
    }
    front_first.push_back(std::move(image));
    is_holdout.push_back(document.holdout);
    if (stated && hides_all(front_first.back())) break;
  }
  if (front_first.empty()) {
    front_first.push_back(empty_image(camera.view.width, camera.view.height));
    is_holdout.push_back(false);
  }
  std::vector<MergedLayer> rear_first;
  for (std::size_t i = front_first.size(); i-- > 0;) {
    rear_first.push_back({&front_first[i], is_holdout[i]});
  }
  if (deep != nullptr) *deep = deep_samples(rear_first);
  LayerImage result;
  if (front_first.size() == 1 && !is_holdout[0]) {
    result = std::move(front_first[0]);
  } else {
    tbb::this_task_arena::isolate(
        [&] { result = merge(rear_first, stated ? MergeOrder::kStated : MergeOrder::kDepth); });
  }
  result.statistics = statistics;
  turn_into_file_colors(result, deep);
  complete(result);
  times.merge_ms = total.ms() - times.light_fields_ms - times.geometry_ms;
  return {std::move(result), times, std::move(unseen)};
}

double FramePainter::unseen_of(std::size_t layer, const LayerImage& image) const {
  const LightFieldLayer* light_field = plan_.light_field(layer);
  if (light_field == nullptr || light_field->matte() || image.pixels() == 0 ||
      method_named(light_field->reconstruction().method).shows_foreground_only()) {
    return 0;
  }
  std::size_t empty = 0;
  for (std::size_t i = 3; i < image.rgba.size(); i += 4) empty += image.rgba[i] > 0 ? 0 : 1;
  return static_cast<double>(empty) / static_cast<double>(image.pixels());
}

void FramePainter::turn_into_working_colors(LayerImage& image) const {
  if (plan_.colors().working_from_scene) plan_.colors().working_from_scene->apply(image.rgba);
}

void FramePainter::drop_unwanted(LayerImage& image) const {
  std::erase_if(image.aovs, [&](const Aov& aov) {
    return !plan_.wants(aov.layer == "lf" ? "lf." + aov.channels.front() : aov.layer);
  });
}

void FramePainter::turn_into_file_colors(LayerImage& image, DeepImage* deep) const {
  const auto& transform = plan_.colors().file_from_working;
  if (!transform) return;
  transform->apply(image.rgba);
  for (Aov& aov : image.aovs) {
    if (aov.is_colour && aov.channels.size() == 3) transform->apply_to_opaque(aov.values);
  }
  for (std::size_t i = 0; deep != nullptr && i < deep->samples.size(); ++i) {
    transform->apply(deep->samples[i].rgba);
  }
}

void FramePainter::complete(LayerImage& image) const {
  const auto& layers = plan_.shot().layers;
  std::vector<Aov> wanted;
  const auto want = [&](const char* layer, const std::vector<std::string>& channels,
                        bool is_colour = false, float nothing = 0) {
    Aov aov{layer, channels, is_colour, nothing, {}};
    const bool is_one_of_many = aov.layer == "lf";
    if (plan_.wants(is_one_of_many ? "lf." + channels.front() : aov.layer)) {
      wanted.push_back(std::move(aov));
    }
  };
  if (std::ranges::any_of(layers, &ShotDocument::Layer::is_light_field)) {
    want("lf", {"coverage"});
    want("lf", {"confidence"});
    want("lf", {"cameras"});
    want("lf", {"nearest"}, false, std::numeric_limits<float>::infinity());
  }
  if (std::ranges::any_of(layers, [](const auto& layer) { return layer.geometry.has_value(); })) {
    want("P", {"X", "Y", "Z"});
    want("N", {"X", "Y", "Z"});
    want("albedo", {"R", "G", "B"}, true);
  }
  // In one order, whichever layer was in front.
  std::vector<Aov> all;
  for (Aov& aov : wanted) {
    const auto own = std::ranges::find_if(image.aovs, [&](const Aov& of_image) {
      return of_image.layer == aov.layer && of_image.channels == aov.channels;
    });
    if (own != image.aovs.end()) {
      all.push_back(std::move(*own));
      continue;
    }
    aov.values.assign(image.pixels() * aov.channels.size(), aov.nothing);
    all.push_back(std::move(aov));
  }
  image.aovs = std::move(all);
  if (!plan_.shot().output.cryptomatte) return;
  if (image.ids.empty()) image.ids.assign(image.pixels() * 2 * kIdRanks, 0.0F);
  std::ranges::move(cryptomatte_aovs(image), std::back_inserter(image.aovs));
  image.ids = {};
}

std::vector<float> FramePainter::ids_of(std::size_t layer) const {
  std::vector<float> ids;
  for (const std::string& name : plan_.object_names(layer)) ids.push_back(object_id(name));
  return ids;
}

void FramePainter::read_ahead(const PlannedFrame& frame) const {
  for (std::size_t i = 0; i < plan_.layers(); ++i) {
    if (renderers_[i] == nullptr || !frame.shown[i].tick) continue;
    renderers_[i]->read_ahead(plan_.light_field(i)->tick(frame.shown[i]));
  }
}

int FramePainter::frames_read_ahead() const {
  int frames = 0;
  for (const auto& renderer : renderers_) frames += renderer ? renderer->frames_read_ahead() : 0;
  return frames;
}

DecodeCosts FramePainter::decode_costs() const {
  DecodeCosts costs;
  for (const auto& renderer : renderers_) {
    if (renderer) costs += renderer->decode_costs();
  }
  return costs;
}

std::size_t FramePainter::decoded_bytes_held() const {
  std::size_t bytes = 0;
  for (const auto& renderer : renderers_) bytes += renderer ? renderer->decoded_bytes_held() : 0;
  return bytes;
}

}  // namespace raystage
