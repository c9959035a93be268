// SPDX-License-Identifier: Apache-2.0
// Finds the views that a shot shows of each light field frame: those of all its frames, so that
// what is derived for them does not depend on which frames are rendered together.
#include "compose/shown_views.h"

#include <cstdint>

#include "compose/exposure_plan.h"
#include "compose/shot_plan.h"
#include "render/renderer.h"

namespace raystage::compose {
namespace {

// Of an exposure. How many times are rendered depends on layers, too, of which only those that the
// rendered frames need are opened.
constexpr int kIntervals = 8;
constexpr std::int64_t kMostFramesOfShot = 1'000'000;  // of longer shots any view may be shown
/// Ticks of a take that plays slowly are shown by n or n + 1 frames; all of them are to be alike.
constexpr std::size_t kLimit = 2 * render::kMostFramesOfShownViews;

}  // namespace

bool ShownViews::depends_on_views(std::size_t layer) const {
  const LightFieldLayer* light_field = plan_.light_field(layer);
  // Single rays may pass anywhere.
  return light_field != nullptr && !plan_.is_light(layer) &&
         !plan_.shot_camera().is_equirectangular() && light_field->depends_on_shown_views();
}

void ShownViews::find_times() const {
  times_.clear();
  const std::int64_t frames_of_shot =
      std::int64_t{plan_.shot().last_frame} - plan_.shot().first_frame + 1;
  if (frames_of_shot > kMostFramesOfShot) return;
  const auto add = [this](std::size_t layer, const ShownTick& shown, int frame, double offset) {
    if (!shown.tick || plan_.light_field(layer)->time_in_exposure(*shown.tick)) return;
    Times& of_tick = times_[{layer, *shown.tick}];
    if (of_tick.frames == 0 || of_tick.last_frame != frame) ++of_tick.frames;
    of_tick.last_frame = frame;
    if (of_tick.frames > kLimit) {
      of_tick.times.clear();
    } else {
      of_tick.times.push_back(frame + offset);
    }
  };
  std::vector<const LightFieldLayer*> layers;
  for (const LightFieldLayer* layer : plan_.light_fields()) {
    if (depends_on_views(layer->index())) layers.push_back(layer);
  }
  if (layers.empty()) return;
  for (int frame = plan_.shot().first_frame; frame <= plan_.shot().last_frame; ++frame) {
    const double end = exposure_end(plan_, frame);
    for (const LightFieldLayer* layer : layers) {
      if (!plan_.is_needed(layer->index(), frame)) continue;
      const ShownTick middle = layer->shown_tick_at(frame, policy_);
      add(layer->index(), middle, frame, 0);
      for (int i = 0; end > 0 && i <= kIntervals; ++i) {
        if (2 * i == kIntervals) continue;
        const double offset = end * (2.0 * i / kIntervals - 1);
        add(layer->index(), layer->shown_tick_in_exposure(frame, offset, middle), frame, offset);
      }
    }
  }
  for (const LightFieldLayer* layer : layers) forget_if_time_stands(layer->index());
}

void ShownViews::forget_if_time_stands(std::size_t layer) const {
  const auto first = times_.lower_bound({layer, 0}), end = times_.lower_bound({layer + 1, 0});
  std::size_t ticks = 0, frames = 0;
  for (auto tick = first; tick != end; ++tick) {
    if (tick->second.frames > kLimit) continue;
    ++ticks;
    frames += tick->second.frames;
  }
  if (frames > render::kMostFramesOfShownViews * ticks) times_.erase(first, end);
}

std::vector<render::VirtualCamera> ShownViews::of(std::size_t layer, int tick) const {
  std::call_once(found_, [this] { find_times(); });
  std::vector<render::VirtualCamera> views;
  const auto add = [&](double time) {
    for (const Eye eye : plan_.eyes()) views.push_back(plan_.camera(time, eye));
  };
  if (!depends_on_views(layer)) return views;
  if (const auto time = plan_.light_field(layer)->time_in_exposure(tick)) {
    add(*time);
  } else if (const auto found = times_.find({layer, tick}); found != times_.end()) {
    for (const double of_tick : found->second.times) add(of_tick);
  }
  return views;
}

}  // namespace raystage::compose
