// SPDX-License-Identifier: Apache-2.0
#include "compose/frame_painter.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <limits>
#include <utility>

#include "compose/layers/merge.h"

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

}  // namespace

FramePainter::FramePainter(const ShotPlan& plan, const MemoryPlan& memory, bool coverage_measures)
    : plan_(plan), coverage_measures_(coverage_measures) {
  for (std::size_t i = 0; i < plan.layers(); ++i) {
    renderers_.emplace_back();
    const LightFieldLayer* light_field = plan.light_field(i);
    if (light_field == nullptr) continue;
    RendererSettings settings;
    settings.cache_bytes = memory.of_layer[i].cache;
    settings.kept_bytes = memory.of_layer[i].kept;
    settings.working_bytes = memory.of_layer[i].working;
    settings.measure_coverage = coverage_measures;
    settings.ticks = light_field->timeline().ticks;
    renderers_.back() = std::make_unique<const LightFieldRenderer>(light_field->take(), settings);
  }
}

LayerImage FramePainter::layer_image_of(std::size_t layer, const PlannedFrame& frame,
                                        const VirtualCamera& camera) const {
  const ShotDocument::Layer& document = plan_.shot().layers[layer];
  if (document.solid) return solid_image(*document.solid, camera.width, camera.height);
  if (!frame.shown[layer].tick) return empty_image(camera.width, camera.height);
  const LightFieldLayer& light_field = *plan_.light_field(layer);
  RenderedView view;
  // Isolated: while this thread waits for its frame's tiles it must not begin another frame,
  // which would keep this one waiting.
  tbb::this_task_arena::isolate([&] {
    view = renderers_[layer]->render(camera, light_field.tick(frame.shown[layer]),
                                     light_field.reconstruction());
  });
  return layer_image(std::move(view));
}

LayerImage FramePainter::paint(const PlannedFrame& frame, const VirtualCamera& camera,
                               const std::stop_token& stop) const {
  std::vector<LayerImage> front_first;
  std::vector<bool> is_holdout;
  RenderStatistics statistics;
  const bool stated = plan_.shot().merge == ShotDocument::Merge::kStated;
  for (std::size_t i = plan_.layers(); i-- > 0 && !stop.stop_requested();) {
    if (!plan_.is_visible(i, frame.frame)) continue;
    const ShotDocument::Layer& document = plan_.shot().layers[i];
    LayerImage image = layer_image_of(i, frame, camera);
    add_up(image.statistics, statistics);
    tbb::this_task_arena::isolate([&] { apply(plan_.clips(i), camera, image); });
    if (document.opacity < 1) {
      for (float& value : image.rgba) value *= static_cast<float>(document.opacity);
    }
    front_first.push_back(std::move(image));
    is_holdout.push_back(document.holdout);
    if (stated && hides_all(front_first.back())) break;
  }
  LayerImage result;
  if (front_first.empty()) {
    result = empty_image(camera.width, camera.height);
  } else if (front_first.size() == 1 && !is_holdout[0]) {
    result = std::move(front_first[0]);
  } else {
    std::vector<MergedLayer> rear_first;
    for (std::size_t i = front_first.size(); i-- > 0;) {
      rear_first.push_back({&front_first[i], is_holdout[i]});
    }
    tbb::this_task_arena::isolate(
        [&] { result = merge(rear_first, stated ? MergeOrder::kStated : MergeOrder::kDepth); });
  }
  result.statistics = statistics;
  complete(result);
  return result;
}

void FramePainter::complete(LayerImage& image) const {
  const bool has_light_field =
      std::ranges::any_of(plan_.shot().layers, &ShotDocument::Layer::is_light_field);
  if (!has_light_field) return;
  const auto ensure = [&](const char* channel, float nothing) {
    for (const Aov& aov : image.aovs) {
      if (aov.layer == "lf" && aov.channels.front() == channel) return;
    }
    image.aovs.push_back({"lf", {channel}, false, nothing, PixelValues(image.pixels(), nothing)});
  };
  ensure("coverage", 0);
  if (!coverage_measures_) return;
  ensure("cameras", 0);
  ensure("nearest", std::numeric_limits<float>::infinity());
}

void FramePainter::read_ahead(const PlannedFrame& frame) const {
  for (std::size_t i = 0; i < plan_.layers(); ++i) {
    if (renderers_[i] == nullptr || !frame.shown[i].tick || !plan_.is_visible(i, frame.frame)) {
      continue;
    }
    renderers_[i]->read_ahead(plan_.light_field(i)->tick(frame.shown[i]));
  }
}

int FramePainter::frames_read_ahead() const {
  int frames = 0;
  for (const auto& renderer : renderers_) frames += renderer ? renderer->frames_read_ahead() : 0;
  return frames;
}

std::size_t FramePainter::decoded_bytes_held() const {
  std::size_t bytes = 0;
  for (const auto& renderer : renderers_) bytes += renderer ? renderer->decoded_bytes_held() : 0;
  return bytes;
}

}  // namespace raystage
