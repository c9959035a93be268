// SPDX-License-Identifier: Apache-2.0
// Hashes the inputs that determine the file of a frame.
#include "compose/shot_plan.h"

namespace raystage::compose {
namespace {

void add_clip(const schemas::ShotDocument::Clip& clip, Fingerprint& print) {
  print.integer("inverted", clip.inverted ? 1 : 0).number("feather", clip.feather);
  if (clip.plane) {
    for (const double value : *clip.plane) print.number("plane", value);
  }
  if (clip.box) {
    for (const auto& corner : *clip.box) {
      for (const double value : corner) print.number("box", value);
    }
  }
  for (const double value :
       {clip.screen.left, clip.screen.right, clip.screen.top, clip.screen.bottom}) {
    print.number("screen", value);
  }
}

/// Adds the shot's settings that all frames share, except those of layers and colours.
Fingerprint of_shot(const schemas::ShotDocument& shot) {
  Fingerprint print;
  print.integer("reconstruction", kReconstructionVersion);
  print.integer("width", shot.width).integer("height", shot.height);
  print.integer("overscan_x", shot.output.overscan[0])
      .integer("overscan_y", shot.output.overscan[1]);
  print.integer("fps_n", shot.fps_numerator).integer("fps_d", shot.fps_denominator);
  print.text("compression", shot.output.compression);
  print.text("data_compression", shot.output.data_compression).text("layout", shot.output.layout);
  print.integer("channel_names", kExrChannelNames);
  print.integer("cryptomatte", shot.output.cryptomatte ? 1 : 0);
  for (const std::string& aov : shot.output.aovs) print.text("aov", aov);
  print.integer("merge", shot.merge == schemas::ShotDocument::Merge::kDepth ? 1 : 0);
  return print;
}

void add_layer(const schemas::ShotDocument::Layer& layer, Fingerprint& print) {
  print.integer("holdout", layer.holdout ? 1 : 0).number("opacity", layer.opacity);
  print.text("volume", layer.volume);
  if (layer.shadows) {
    print.number("strength", layer.shadows->strength)
        .number("reach", layer.shadows->occlusion_distance_m);
    print.integer("shadow rays", layer.shadows->rays);
  }
  for (const schemas::ShotDocument::Clip& clip : layer.clips) add_clip(clip, print);
  if (!layer.solid) return;
  for (const double value : layer.solid->color) print.number("color", value);
  print.number("alpha", layer.solid->alpha).number("depth", layer.solid->depth_m.value_or(0));
}

/// Adds all camera properties that pixels or headers depend on.
void add_camera(const ExrCamera& camera, Fingerprint& print) {
  const render::VirtualCamera& view = camera.view;
  for (const double value : view.pose.world_from_camera_rotation.reshaped()) {
    print.number("rotation", value);
  }
  for (const double value : view.pose.position) print.number("position", value);
  print.number("fx", view.intrinsics.fx).number("fy", view.intrinsics.fy);
  print.number("cx", view.intrinsics.cx).number("cy", view.intrinsics.cy);
  if (view.is_equirectangular) print.number("equirectangular", view.eye_offset);
  print.number("film_back", camera.film_back_mm);
  for (const auto& value : {camera.focus_m, camera.f_number, camera.exposure_seconds}) {
    print.number("lens", value.value_or(-1));
  }
  if (!camera.adjacent) return;
  for (const render::VirtualCamera* other : {&camera.adjacent->before, &camera.adjacent->after}) {
    for (const double value : other->pose.world_from_camera_rotation.reshaped()) {
      print.number("adjacent", value);
    }
    for (const double value : other->pose.position) print.number("adjacent", value);
    for (const double value :
         {other->intrinsics.fx, other->intrinsics.fy, other->intrinsics.cx, other->intrinsics.cy}) {
      print.number("adjacent", value);
    }
  }
}

/// Adds the views for which a layer's data is derived, of which frames nearby may show others.
void add_shown_views(const PlannedFrame& frame, std::size_t layer, Fingerprint& print) {
  for (const render::VirtualCamera& view : frame.views_shown(layer)) {
    for (const double value : view.pose.world_from_camera_rotation.reshaped()) {
      print.number("shown", value);
    }
    for (const double value : view.pose.position) print.number("shown", value);
    const schemas::Intrinsics& k = view.intrinsics;
    for (const double value : {k.fx, k.fy, k.cx, k.cy}) print.number("shown", value);
  }
}

}  // namespace

void ShotPlan::add_exposure_sample(const PlannedFrame& sample, Fingerprint& print) const {
  print.number("exposure", sample.offset);
  for (const Eye eye : eyes()) add_camera(exr_camera(sample.time(), eye), print);
  for (std::size_t i = 0; i < layers(); ++i) {
    if (!is_needed(i, sample.frame) || !layers_[i]) continue;
    if (light_field(i) == nullptr && geometry(i) == nullptr) continue;  // others stand still
    layers_[i]->add_to_fingerprint(print, sample.time(), sample.shown[i]);
  }
}

std::string ShotPlan::fingerprint(const PlannedFrame& frame, bool chromaticities) const {
  Fingerprint print = of_shot(shot_);
  print.integer("chromaticities", chromaticities ? 1 : 0);
  if (!colors_.config.empty()) {
    print.text("color space", colors_.space).text("color config", colors_.config);
    print.text("working space", shot_.output.color.working_space);
    print.text("called rec709", shot_.output.color.rec709_space);
  }
  print.integer("frame", frame.frame);
  for (const LightFieldLight& light : light_field_lights_) {
    for (const std::size_t layer : light.layers) {
      print.integer("light", static_cast<std::int64_t>(layer));
    }
  }
  for (const Eye eye : eyes()) add_camera(exr_camera(frame.frame, eye), print);
  bool shows_geometry = false;
  for (std::size_t i = 0; i < layers(); ++i) {
    if (!is_needed(i, frame.frame)) continue;
    print.integer("layer", static_cast<std::int64_t>(i));
    print.integer("visible", is_visible(i, frame.frame) ? 1 : 0);
    add_layer(shot_.layers[i], print);
    for (const std::string& name : object_names_[i]) print.text("object", name);
    if (layers_[i]) layers_[i]->add_to_fingerprint(print, frame.frame, frame.shown[i]);
    add_shown_views(frame, i, print);
    if (writes_aov("motion") && geometry(i) != nullptr) {
      for (const ObjectMotion& moved : geometry(i)->motion_at(frame.frame)) {
        for (const Eigen::Affine3d* side : {&moved.before_from_now, &moved.after_from_now}) {
          for (const double value : side->matrix().reshaped()) print.number("moved", value);
        }
      }
    }
    shows_geometry = shows_geometry || geometry(i) != nullptr;
  }
  if (shows_geometry) print.text("lights", lights_fingerprint_);
  for (const PlannedFrame& sample : exposure_of(frame)) {
    add_exposure_sample(sample, print);
    for (std::size_t i = 0; i < layers(); ++i) {
      if (sample.shown[i].tick != frame.shown[i].tick) add_shown_views(sample, i, print);
    }
  }
  return print.hex();
}

}  // namespace raystage::compose
