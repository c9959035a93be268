// SPDX-License-Identifier: Apache-2.0
#include "compose/shot_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <utility>

#include "base/cancellation.h"
#include "base/error.h"
#include "base/resources.h"
#include "compose/exposure_plan.h"
#include "compose/frame_range.h"
#include "compose/layers/cryptomatte.h"
#include "compose/layers/solid_layer.h"
#include "compose/plate_layer.h"
#include "store/absent_archives.h"

namespace raystage::compose {
namespace {

/// Budget of textures, which are loaded as tiles of the needed MIP levels.
constexpr std::size_t kTextureBytes = std::size_t{256} << 20;

schemas::ShotDocument shot_with(schemas::ShotDocument shot, const ShotPlanOptions& options,
                                const std::string& shot_file) {
  shot = draft_of_shot(std::move(shot), options.draft, shot_file);
  if (!options.layout.empty()) shot.output.layout = options.layout;
  // Programs that read Cryptomatte disagree about files of several parts (Psyop/Cryptomatte issues
  // 137 and 145).
  if (shot.output.layout.empty())
    shot.output.layout = shot.output.cryptomatte ? "single" : "standard";
  auto& aovs = shot.output.aovs;
  aovs.insert(aovs.end(), options.aovs.begin(), options.aovs.end());
  std::ranges::sort(aovs);  // the order in the shot does not matter
  aovs.erase(std::unique(aovs.begin(), aovs.end()), aovs.end());
  return shot;
}

/// Converts shares of the picture to shares of the picture with overscan.
ScreenClip screen_clip_from(const schemas::ShotDocument::Clip& document,
                            const schemas::ShotDocument& shot) {
  const auto share_of = [](double share, int size, int overscan) {
    // An edge at the picture's border also keeps the overscan.
    if (share <= 0 || share >= 1) return share;
    return (share * size + overscan) / (size + 2.0 * overscan);
  };
  const auto [x, y] = shot.output.overscan;
  const schemas::ShotDocument::ScreenRegion& s = document.screen;
  return {share_of(s.left, shot.width, x), share_of(s.right, shot.width, x),
          share_of(s.top, shot.height, y), share_of(s.bottom, shot.height, y),
          document.feather * shot.width / (shot.width + 2.0 * x)};
}

Clip clip_from(const schemas::ShotDocument::Clip& document, const schemas::ShotDocument& shot) {
  Clip clip;
  clip.inverted = document.inverted;
  if (document.plane) {
    const auto& p = *document.plane;
    clip.shape = PlaneClip{{p[0], p[1], p[2], p[3]}, document.feather};
  } else if (document.box) {
    const auto& [least, most] = *document.box;
    clip.shape =
        BoxClip{{least[0], least[1], least[2]}, {most[0], most[1], most[2]}, document.feather};
  } else {
    clip.shape = screen_clip_from(document, shot);
  }
  return clip;
}

}  // namespace

ShotPlan::ShotPlan(const std::filesystem::path& shot_file, const ShotPlanOptions& options)
    : ShotPlan(schemas::read_shot(shot_file), shot_file, options) {}

ShotPlan::ShotPlan(const schemas::ShotDocument& shot, const std::filesystem::path& shot_file,
                   const ShotPlanOptions& options)
    : rotten_frames_(options.rotten_frames),
      shot_file_(shot_file),
      cache_folder_(options.cache_folder),
      folder_(options.folder.empty() ? shot_file.parent_path() : options.folder),
      hosts_(options.hosts),
      memory_bytes_(options.memory_bytes > 0 ? options.memory_bytes : available_memory() / 2),
      shot_(shot_with(shot, options, shot_file.string())),
      camera_(shot_, shot_file, folder_),
      colors_(make_shot_color_spaces(shot_, shot_file, folder_, options.color_config)) {
  check_exr_compression(shot_.output.compression);
  if (!shot_.output.data_compression.empty()) check_exr_compression(shot_.output.data_compression);
  parse_exr_layout(shot_.output.layout);
  for (const schemas::ShotDocument::Layer& layer : shot_.layers) {
    clips_.emplace_back();
    for (const schemas::ShotDocument::Clip& clip : layer.clips)
      clips_.back().push_back(clip_from(clip, shot_));
  }
  find_light_field_lights();
  layers_.resize(layers());
  for (std::size_t i = 0; i < layers(); ++i) {
    if (!is_visible_in_any(i, options.frames)) continue;
    try {
      layers_[i] = open_layer(i, options);
    } catch (const Error& error) {
      throw error_of_layer(i, error);
    }
  }
  assign_object_names();
}

Error ShotPlan::error_of_layer(std::size_t layer, const Error& error) const {
  if (error.where().starts_with(shot_file_.string())) return error;
  const std::string& name = shot_.layers[layer].name;
  const std::string where = fmt::format("{}#/layers/{}{}{}{}", shot_file_.string(), layer,
                                        name.empty() ? "" : " (" + name + ")",
                                        error.where().empty() ? "" : ": ", error.where());
  const auto make = error.exit_code() == ExitCode::kBadInput ? Error::bad_input : Error::failed;
  return make(error.what_happened(), where, error.what_to_do()).concerning(error.settings());
}

std::unique_ptr<const Layer> ShotPlan::open_layer(std::size_t layer,
                                                  const ShotPlanOptions& options) {
  const schemas::ShotDocument::Layer& document = shot_.layers[layer];
  if (document.geometry) return open_geometry(layer);
  if (document.plate) {
    return std::make_unique<const PlateLayer>(shot_, layer, folder_, colors_.studio,
                                              options.draft.scale, memory_bytes_);
  }
  if (document.solid) return std::make_unique<const SolidLayer>(*document.solid);
  return open_light_field(layer, options);
}

namespace {

store::Take open_take(const std::filesystem::path& folder, const ShotPlanOptions& options) {
  if (options.hosts != nullptr) return options.hosts->open(folder);
  if (!options.accepts_missing_archives) return store::Take(folder);
  return store::Take(folder, store::make_absent_archives(folder));
}

}  // namespace

std::unique_ptr<const Layer> ShotPlan::open_light_field(std::size_t layer,
                                                        const ShotPlanOptions& options) {
  // A target is for views only; lights and equirectangular views need rays.
  const bool needs_rays = is_light(layer) || camera_.is_equirectangular();
  if (camera_.is_equirectangular() && !options.target.empty()) {
    throw Error::bad_input("methods for equirectangular views are not chosen by a target",
                           shot_file_.string() + "#/camera/projection", "State a method")
        .concerning({"target_error", "target_time"});
  }
  auto opened = std::make_unique<const LightFieldLayer>(
      shot_, layer, shot_file_, folder_,
      open_take((folder_ / shot_.layers[layer].take).lexically_normal(), options), options.fill,
      needs_rays ? schemas::OptionValues{} : options.target, options.draft.camera_step);
  if (needs_rays) render::check_ray_query_support(opened->reconstruction());
  return opened;
}

void ShotPlan::assign_object_names() {
  object_names_.resize(layers());
  if (!shot_.output.cryptomatte) return;
  for (std::size_t i = 0; i < layers(); ++i) {
    const schemas::ShotDocument::Layer& of_shot = shot_.layers[i];
    const std::string& name = of_shot.volume.empty() ? of_shot.name : of_shot.volume;
    const std::string layer = name.empty() ? fmt::format("layer{}", i) : name;
    if (layers_[i]) {
      object_names_[i] = layers_[i]->object_names(layer);
    } else if (!of_shot.geometry) {
      object_names_[i] = {layer};
    }
  }
}

void ShotPlan::find_light_field_lights() {
  for (std::size_t i = 0; i < shot_.lights.size(); ++i) {
    const schemas::ShotDocument::Light& light = shot_.lights[i];
    if (light.light_field.empty()) continue;
    LightFieldLight selected{{}, light.strength};
    for (std::size_t layer = 0; layer < layers(); ++layer) {
      if (shot_.layers[layer].volume == light.light_field) selected.layers.push_back(layer);
    }
    const auto layer =
        std::ranges::find(shot_.layers, light.light_field, &schemas::ShotDocument::Layer::name);
    const bool is_there = layer != shot_.layers.end();
    if (selected.layers.empty() && std::ranges::count(shot_.layers, light.light_field,
                                                      &schemas::ShotDocument::Layer::name) > 1) {
      throw Error::bad_input(
          fmt::format("the light uses the layer \"{}\", but several have this name",
                      light.light_field),
          fmt::format("{}#/lights/{}", shot_file_.string(), i), "Give them different names");
    }
    if (selected.layers.empty() && is_there && layer->is_light_field()) {
      selected.layers = {static_cast<std::size_t>(layer - shot_.layers.begin())};
    }
    if (selected.layers.empty()) {
      throw Error::bad_input(
          fmt::format("the light uses the layer \"{}\", which {}", light.light_field,
                      is_there ? "has no take" : "does not exist"),
          fmt::format("{}#/lights/{}", shot_file_.string(), i), "Name a layer with a take");
    }
    light_field_lights_.push_back(std::move(selected));
  }
}

std::vector<const LightFieldLayer*> ShotPlan::light_fields() const {
  std::vector<const LightFieldLayer*> found;
  for (std::size_t i = 0; i < layers(); ++i) found.push_back(light_field(i));
  std::erase(found, nullptr);
  return found;
}

std::size_t ShotPlan::volume_layer_count(std::size_t layer) const {
  const std::string& volume = shot_.layers[layer].volume;
  std::size_t count = 1;
  while (!volume.empty() && count <= layer && shot_.layers[layer - count].volume == volume) ++count;
  return count;
}

std::unique_ptr<const Layer> ShotPlan::open_geometry(std::size_t layer) {
  if (!textures_) {
    textures_ =
        std::make_unique<Textures>(kTextureBytes, memory_bytes_, colors_.working_from_scene_matrix);
    lights_ = make_lights(shot_.lights, folder_, *textures_);
    Fingerprint print;
    compose::add_to_fingerprint(print, shot_.lights, folder_);
    if (shot_.lights.empty()) print.text("light", "headlight");
    lights_fingerprint_ = print.hex();
  }
  return std::make_unique<const GeometryLayer>(
      *shot_.layers[layer].geometry, FrameRate{shot_.fps_numerator, shot_.fps_denominator}, folder_,
      fmt::format("{}#/layers/{}/geometry", shot_file_.string(), layer), *textures_);
}

GeometryScene ShotPlan::geometry_at(const PlannedFrame& frame,
                                    std::vector<int>& mesh_indices) const {
  GeometryScene scene;
  scene.textures = textures_.get();
  scene.lights = lights_;
  mesh_indices.assign(layers(), -1);
  for (std::size_t i = 0; i < layers(); ++i) {
    const GeometryLayer* mesh = geometry(i);
    if (mesh == nullptr || !is_visible(i, frame.frame)) continue;
    mesh_indices[i] = static_cast<int>(scene.meshes.size());
    scene.meshes.push_back(mesh->instance_at(frame.time()));
    if (writes_aov("motion")) scene.meshes.back().motion = mesh->motion_at(frame.time());
  }
  return scene;
}

std::size_t ShotPlan::shared_bytes() const {
  std::size_t bytes = textures_ && textures_->is_used() ? kTextureBytes : 0;
  for (const auto& layer : layers_) bytes += layer ? layer->shared_bytes() : 0;
  return bytes;
}

bool ShotPlan::writes_aov(std::string_view aov) const {
  return std::ranges::find(shot_.output.aovs, aov) != shot_.output.aovs.end();
}

bool ShotPlan::measures_coverage() const {
  return writes_aov("lf.cameras") || writes_aov("lf.nearest");
}

bool ShotPlan::is_shown(std::size_t layer, int frame) const {
  const schemas::ShotDocument::Layer& document = shot_.layers[layer];
  return frame >= document.first_frame.value_or(frame) &&
         frame <= document.last_frame.value_or(frame) && document.opacity > 0 &&
         keeps_any_pixel(clips_[layer]);
}

bool ShotPlan::is_occluded_by_solid(std::size_t layer, int frame) const {
  if (shot_.merge != schemas::ShotDocument::Merge::kLayerOrder) return false;
  for (std::size_t i = layers(); --i > layer;) {
    const schemas::ShotDocument::Layer& front = shot_.layers[i];
    if (!is_shown(i, frame)) continue;
    // Hidden geometry still casts shadows and appears in mirrors.
    const bool shows_geometry = front.geometry || front.shadows;
    if (shows_geometry && shot_.layers[layer].geometry) return false;
    if (front.solid && front.solid->alpha >= 1 && front.opacity >= 1 && front.clips.empty()) {
      return true;
    }
  }
  return false;
}

bool ShotPlan::is_visible(std::size_t layer, int frame) const {
  return is_shown(layer, frame) && !is_occluded_by_solid(layer, frame);
}

bool ShotPlan::is_light(std::size_t layer) const {
  return std::ranges::any_of(light_field_lights_, [&](const LightFieldLight& light) {
    return std::ranges::find(light.layers, layer) != light.layers.end();
  });
}

bool ShotPlan::is_needed(std::size_t layer, int frame) const {
  if (is_visible(layer, frame)) return true;
  if (!is_light(layer)) return false;
  for (std::size_t i = 0; i < layers(); ++i) {
    if (shot_.layers[i].geometry && is_visible(i, frame)) return true;
  }
  return false;
}

bool ShotPlan::is_visible_in_any(std::size_t layer,
                                 const std::optional<std::vector<int>>& frames) const {
  if (frames) {
    return std::ranges::any_of(*frames, [&](int frame) { return is_needed(layer, frame); });
  }
  for (int frame = shot_.first_frame; frame <= shot_.last_frame; ++frame) {
    if (is_needed(layer, frame)) return true;
  }
  return false;
}

std::vector<PlannedFrame> ShotPlan::plan(std::span<const int> frames, MissingFrames policy,
                                         MotionBlur blur) const {
  std::vector<PlannedFrame> planned;
  for (const int frame : frames) planned.push_back({frame, std::vector<ShownTick>(layers())});
  for (const LightFieldLayer* take : light_fields()) {
    const std::size_t i = take->index();
    std::vector<int> missing;
    for (PlannedFrame& one : planned) {
      throw_if_cancelled();  // a short text has ten million frames
      if (!is_needed(i, one.frame)) continue;
      one.shown[i] = take->shown_tick_at(one.frame, policy);
      if (!one.shown[i].tick || one.shown[i].held) missing.push_back(one.frame);
    }
    if (policy != MissingFrames::kError || missing.empty()) continue;
    throw Error::bad_input(
        fmt::format("the take has no instant for {} of {} frames ({}); {}", missing.size(),
                    frames.size(), format_frame_range(missing), take->take_duration_text()),
        layers() == 1 ? shot_file_.string() : fmt::format("{}#/layers/{}", shot_file_.string(), i),
        "Change start_seconds, speed, time_keys or the frame range, or show missing frames as held "
        "or black")
        .concerning({"missing"});
  }
  if (blur == MotionBlur::kNone) return planned;
  const auto shown_views = std::make_shared<const ShownViews>(*this, policy);
  for (PlannedFrame& one : planned) {
    throw_if_cancelled();
    one.exposure = exposure_offsets(*this, one.frame);
    one.shown_views = shown_views;
  }
  return planned;
}

std::vector<PlannedFrame> ShotPlan::exposure_of(const PlannedFrame& frame) const {
  std::vector<PlannedFrame> samples;
  for (const double offset : frame.exposure) {
    PlannedFrame sample{frame.frame, frame.shown, frame.preview, offset, {}, frame.shown_views};
    for (const LightFieldLayer* take : light_fields()) {
      ShownTick& shown = sample.shown[take->index()];
      if (offset != 0) shown = take->shown_tick_in_exposure(frame.frame, offset, shown);
    }
    samples.push_back(std::move(sample));
  }
  return samples;
}

void ShotPlan::check_files(std::span<const PlannedFrame> frames) const {
  std::set<std::filesystem::path> files_checked;
  for (const PlannedFrame& frame : frames) {
    throw_if_cancelled();
    const bool camera_has_focus = camera_.state(frame.frame).focus_m.has_value();
    for (std::size_t i = 0; i < layers(); ++i) {
      if (!layers_[i]) continue;
      layers_[i]->check_frame({frame.frame, frame.shown[i], is_visible(i, frame.frame),
                               camera_has_focus, files_checked});
      if (light_field(i) == nullptr) continue;
      for (const PlannedFrame& sample : exposure_of(frame)) {
        layers_[i]->check_frame({frame.frame, sample.shown[i], is_visible(i, frame.frame),
                                 camera_has_focus, files_checked});
      }
    }
  }
}

ExrCamera ShotPlan::exr_camera(double frame, Eye eye) const {
  ExrCamera camera = exr_camera_at(frame, eye);
  if (writes_aov("motion")) {
    camera.adjacent = {exr_camera_at(frame - 1, eye).view, exr_camera_at(frame + 1, eye).view};
  }
  return camera;
}

ExrCamera ShotPlan::exr_camera_at(double frame, Eye eye) const {
  const CameraState state = camera_.state(frame);
  ExrCamera camera;
  camera.view = camera_.camera(frame, eye);
  camera.film_back_mm = state.film_back_mm;
  camera.focus_m = state.focus_m;
  camera.f_number = state.f_number;
  add_overscan(camera, shot_.output.overscan);
  if (state.shutter_deg) {
    camera.exposure_seconds =
        *state.shutter_deg / 360 * shot_.fps_denominator / shot_.fps_numerator;
  }
  return camera;
}

ExrMetadata ShotPlan::metadata(const PlannedFrame& frame) const {
  ExrMetadata metadata;
  metadata.frame = frame.frame;
  metadata.fps_numerator = shot_.fps_numerator;
  metadata.fps_denominator = shot_.fps_denominator;
  metadata.layout = parse_exr_layout(shot_.output.layout);
  metadata.compression = shot_.output.compression;
  metadata.data_compression = shot_.output.data_compression;
  metadata.color_interop_id = colors_.interop_id;
  metadata.color_space = colors_.space;
  metadata.color_config = colors_.config;
  if (colors_.working_from_scene) metadata.working_space = shot_.output.color.working_space;
  if (shot_.output.cryptomatte) {
    std::vector<std::string> names;
    for (std::size_t i = 0; i < layers(); ++i) {
      if (!is_visible(i, frame.frame)) continue;
      names.insert(names.end(), object_names_[i].begin(), object_names_[i].end());
    }
    metadata.cryptomatte_key = cryptomatte_key();
    metadata.cryptomatte_name = kCryptomatteName;
    metadata.cryptomatte_manifest = cryptomatte_manifest(names);
  }
  for (std::size_t i = 0; i < layers(); ++i) {
    if (!layers_[i] || !is_visible(i, frame.frame)) continue;
    if (layers_[i]->fill_metadata(frame.shown[i], metadata)) break;
  }
  return metadata;
}

}  // namespace raystage::compose
