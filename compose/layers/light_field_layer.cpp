// SPDX-License-Identifier: Apache-2.0
// Renders a take as a layer. A shot frame shows the tick nearest to its time in the take
// (take_time()), or exactly that time. Focal plane and lens follow the camera if the shot requests
// it. Input: a view with overscan, metres; output: a premultiplied image in kSceneSpace with
// coverage measures as AOVs. Cost: that of the reconstruction method.
#include "compose/layers/light_field_layer.h"

#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/atomic_file.h"
#include "base/cancellation.h"
#include "base/error.h"
#include "render/automatic/automatic.h"
#include "render/common/exact_times.h"
#include "render/methods.h"
#include "schemas/imported_depths_document.h"
#include "store/exact_frames.h"

namespace raystage::compose {
namespace {

bool has_option(const render::Method& method, std::string_view name) {
  return std::ranges::any_of(method.options(), [&](const auto& o) { return o.name == name; });
}

/// Returns the depth range of the method's options, or else that of the take.
std::optional<schemas::DepthRange> depth_range_of(
    const render::ReconstructionOptions& reconstruction, const store::Take& take) {
  const render::Method& method = render::method_named(reconstruction.method);
  const render::MethodOptions options(method.options(), reconstruction.options,
                                      reconstruction.method);
  schemas::DepthRange scene = take.document().depth_range.value_or(schemas::DepthRange{0, 0});
  if (has_option(method, "near") && options.number("near") > 0) scene.near = options.number("near");
  if (has_option(method, "far") && options.number("far") > 0) scene.far = options.number("far");
  return scene.near > 0 && scene.far > 0 ? std::optional(scene) : std::nullopt;
}

render::ReconstructionOptions reconstruction_of(const schemas::ShotDocument::Layer& layer,
                                                const store::Take& take, const std::string& where,
                                                std::optional<schemas::HoleFill> fill,
                                                const schemas::OptionValues& target) {
  const render::Method* of_layer = render::find_method(layer.method);
  if (of_layer == nullptr) {
    throw Error::bad_input("there is no reconstruction method \"" + layer.method + "\"",
                           where + "/method", "Use one of " + render::method_names());
  }
  using Time = schemas::ShotDocument::Layer::Time;
  if (layer.time == Time::kExact && of_layer->shows_foreground_only()) {
    throw Error::bad_input(
        fmt::format("method {} reads a matte for each recorded frame, and exact times have none",
                    of_layer->name()),
        where + "/time", "Remove \"time\", or choose another method");
  }
  of_layer->check({of_layer->options(), layer.options, where + "/options"}, take);
  render::ReconstructionOptions reconstruction;
  reconstruction.method =
      target.empty() ? layer.method : std::string(render::automatic_method().name());
  reconstruction.options = target.empty() ? layer.options : target;
  const render::Method& method = render::method_named(reconstruction.method);
  // The layer's depth range holds for any method.
  for (const char* name : {"near", "far"}) {
    if (has_option(method, name) && layer.options.contains(name)) {
      reconstruction.options[name] = layer.options.at(name);
    }
  }
  reconstruction.fill = fill.value_or(layer.fill);
  const std::optional<schemas::DepthRange> scene = depth_range_of(reconstruction, take);
  const bool best = layer.focal_plane.kind == schemas::ShotDocument::FocalPlane::Kind::kBest;
  // The method ignores the plane, except `auto`, which falls back to it without a depth range.
  if (best && !scene && !method.may_use_focal_plane()) return reconstruction;
  reconstruction.focal_plane =
      focal_plane_equation(layer.focal_plane, take.rig(), scene, where + "/focal_plane");
  return reconstruction;
}

/// Returns the depth of the focal plane from the array, metres; of keys, the first. Returns nullopt
/// if the plane has no such depth, or for kBest without a depth range.
std::optional<double> focal_depth(const schemas::ShotDocument::FocalPlane& plane,
                                  const std::optional<schemas::DepthRange>& depth_range) {
  using Kind = schemas::ShotDocument::FocalPlane::Kind;
  if (plane.kind == Kind::kDepth) return plane.depth;
  if (plane.kind == Kind::kKeys) return plane.keys.front().depth;
  if (plane.kind == Kind::kBest && depth_range) return rig::optimal_focal_depth(*depth_range);
  return std::nullopt;
}

/// Returns the plane perpendicular to the optical axis, `focus` metres in front of the camera.
Eigen::Vector4d plane_at_focus(const rig::Pose& pose, double focus) {
  const Eigen::Vector3d ahead = -pose.world_from_camera_rotation.col(2);
  return {ahead.x(), ahead.y(), ahead.z(), -ahead.dot(pose.position) - focus};
}

std::string pointer_of(const std::filesystem::path& shot_file, std::size_t index) {
  return fmt::format("{}#/layers/{}", shot_file.string(), index);
}

}  // namespace

Eigen::Vector4d focal_plane_equation(const schemas::ShotDocument::FocalPlane& plane,
                                     const rig::Rig& rig,
                                     const std::optional<schemas::DepthRange>& depth_range,
                                     const std::string& where) {
  using Kind = schemas::ShotDocument::FocalPlane::Kind;
  switch (plane.kind) {
    case Kind::kInfinity:
    case Kind::kCamera:  // until reconstruction_for() gets the camera
      return {0, 0, 0, 1};
    case Kind::kDepth:
    case Kind::kKeys:
    case Kind::kBest:
      if (const auto depth = focal_depth(plane, depth_range)) {
        return rig::fronto_parallel_plane(rig, *depth);
      }
      throw Error::bad_input("the best focal plane is unknown: the take has no depth range", where,
                             "Give the plane's depth in metres, or add depth_range to take.json");
    case Kind::kEquation:
      break;
  }
  const auto& e = plane.equation;
  const Eigen::Vector4d equation(e[0], e[1], e[2], e[3]);
  const double normal = equation.head<3>().norm();
  if (!equation.allFinite() || (normal == 0 && equation[3] == 0)) {
    throw Error::bad_input("the focal plane's equation is 0 or not finite", where,
                           "Give a, b, c, d of a x + b y + c z + d = 0");
  }
  if (normal == 0) return {0, 0, 0, 1};
  return equation / normal;
}

namespace {

/// Copies samples to the pixels from `first` on.
void copy_samples(std::span<const render::RaySample> samples, std::size_t first,
                  render::RenderedView& view) {
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const render::RaySample& sample = samples[i];
    const std::size_t pixel = first + i;
    std::ranges::copy(sample.rgba, view.rgba.begin() + static_cast<std::ptrdiff_t>(4 * pixel));
    view.coverage[pixel] = sample.coverage;
    view.z[pixel] = sample.depth;
    if (view.cameras.empty()) continue;
    view.cameras[pixel] = sample.cameras;
    view.nearest_ray[pixel] = sample.nearest_ray;
  }
}

/// Adds a note if rows of rolling shutters are shown at their own times. `frames`: of cameras of
/// the rig.
void note_row_times(const rig::Rig& rig, const store::FrameSelection& frames,
                    render::RenderedView& view) {
  double farthest_us = 0;  // of a row from the middle one
  for (std::size_t camera = 0; camera < frames.frame.size(); ++camera) {
    if (frames.frame[camera] < 0 || frames.is_interpolated(camera)) continue;
    const rig::Rig::Camera& shown = rig.cameras[camera];
    farthest_us = std::max(farthest_us, std::abs(shown.line_time_us) * shown.model.height() / 2.0);
  }
  if (farthest_us == 0) return;
  view.notes.push_back(fmt::format(
      "rolling shutters: each row shows the time at which it was exposed, up to {:.3g} ms from the "
      "tick; \"time\": \"exact\" of the layer shows all rows at one time",
      farthest_us / 1000));
}

/// Renders the views of a take.
class TakeRenderer final : public LayerRenderer {
 public:
  TakeRenderer(const LightFieldLayer& layer, const LayerRendererOptions& settings)
      : layer_(layer),
        renderer_(layer.take(), renderer_options(layer, settings)),
        measures_coverage_(settings.measure_coverage) {}

  LayerImage render(const LayerView& view) const override {
    const render::VirtualCamera& camera = view.camera.view;
    if (!view.shown.tick) return transparent_layer_image(camera.width, camera.height);
    if (camera.is_equirectangular) return render_rays(view);
    const bool is_preview =
        !view.preview.method.empty() && !layer_.method().shows_foreground_only();
    render::ReconstructionOptions how =
        is_preview ? layer_.preview_reconstruction(view.preview.method, view.camera, view.time())
                   : layer_.reconstruction_for(view.camera, view.time());
    how.max_supersampling = view.preview.max_supersampling;
    if (!is_preview) how.shown_views = view.shown_views;
    const store::FrameSelection frames = layer_.frames_of(*view.shown.tick);
    render::RenderedView rendered = renderer_.render(camera, frames, how);
    collect(rendered.rotten_cameras, view.rotten_cameras);
    note_row_times(layer_.take().rig(), frames, rendered);
    return make_layer_image(std::move(rendered));
  }

  /// Renders a view of an equirectangular camera, one ray per pixel, some rows at a time.
  LayerImage render_rays(const LayerView& view) const {
    const render::VirtualCamera& camera = view.camera.view;
    constexpr int kRows = 64;
    const std::optional<LayerRays> queried = rays(view);
    std::vector<render::WorldRay> of_rows;
    std::vector<render::RaySample> samples;
    render::RenderedView result = render::empty_view(camera);
    if (measures_coverage_) {
      result.cameras.resize(result.coverage.size(), 0.0F);
      result.nearest_ray.resize(result.coverage.size(), std::numeric_limits<float>::infinity());
    }
    for (int begin = 0; begin < camera.height; begin += kRows) {
      throw_if_cancelled();
      const int end = std::min(begin + kRows, camera.height);
      of_rows.clear();
      for (int y = begin; y < end; ++y) {
        for (int x = 0; x < camera.width; ++x) {
          of_rows.push_back(render::pixel_ray(camera, x + 0.5, y + 0.5));
        }
      }
      samples.assign(of_rows.size(), {});
      queried->query(of_rows, samples);
      copy_samples(samples, static_cast<std::size_t>(begin) * camera.width, result);
    }
    const rig::CameraModel& first = layer_.take().rig().cameras.front().model;
    const double source_pixels = render::pixel_angle(camera) * first.intrinsics().fx;
    constexpr double kAliases = 1.5;  // as views of perspective cameras, which take several rays
    if (source_pixels >= kAliases) {
      result.notes.push_back(fmt::format(
          "one ray a pixel, which covers {:.1f} pixels of the cameras along each axis: details may "
          "alias; render a larger picture and reduce it",
          source_pixels));
    }
    note_row_times(layer_.take().rig(), layer_.frames_of(*view.shown.tick), result);
    return make_layer_image(std::move(result));
  }

  std::optional<LayerRays> rays(const LayerView& view) const override {
    if (!view.shown.tick) return std::nullopt;
    return LayerRays{
        [this, frames = layer_.frames_of(*view.shown.tick), rotten = view.rotten_cameras,
         how = layer_.reconstruction_for(view.camera, view.time())](
            std::span<const render::WorldRay> rays, std::span<render::RaySample> samples) {
          collect(renderer_.query(rays, frames, how, samples), rotten);
        },
        layer_.take().rig().mean_viewing_direction()};
  }

  void read_ahead(const ShownTick& shown) const override {
    if (shown.tick) renderer_.read_ahead(layer_.frames_of(*shown.tick));
  }
  int frames_read_ahead() const override { return renderer_.frames_read_ahead(); }
  store::DecodeCosts decode_costs() const override { return renderer_.decode_costs(); }
  std::size_t decoded_bytes_cached() const override { return renderer_.decoded_bytes_cached(); }

 private:
  void collect(const std::vector<int>& rotten, RottenCameras* into) const {
    if (into == nullptr) return;
    for (const int camera : rotten) into->add(layer_.take().document().cameras[camera].id);
  }

  static render::RendererOptions renderer_options(const LightFieldLayer& layer,
                                                  const LayerRendererOptions& settings) {
    render::RendererOptions result;
    result.cache_bytes = settings.memory.cache;
    result.result_cache_bytes = settings.memory.result_cache;
    result.working_bytes = settings.memory.working;
    result.measure_coverage = settings.measure_coverage;
    result.measure_confidence = settings.measure_confidence;
    result.ticks = layer.timeline().ticks;
    result.matte = layer.matte();
    result.cache_folder = settings.cache_folder;
    result.stored_data_counts = settings.stored_data_counts;
    result.rotten_frames = settings.rotten_frames;
    if (settings.hosts != nullptr) settings.hosts->share(layer.take(), result);
    return result;
  }

  const LightFieldLayer& layer_;
  render::LightFieldRenderer renderer_;
  bool measures_coverage_;
};

}  // namespace

LightFieldLayer::LightFieldLayer(const schemas::ShotDocument& shot, std::size_t index,
                                 const std::filesystem::path& shot_file,
                                 const std::filesystem::path& folder, store::Take take,
                                 std::optional<schemas::HoleFill> fill,
                                 const schemas::OptionValues& target, int camera_step)
    : index_(index),
      shot_file_(shot_file),
      layer_(shot.layers[index]),
      first_frame_(shot.first_frame),
      fps_numerator_(shot.fps_numerator),
      fps_denominator_(shot.fps_denominator),
      take_(std::move(take)),
      timeline_(store::read_timeline(take_)),
      reconstruction_(
          reconstruction_of(layer_, take_, pointer_of(shot_file, index), fill, target)) {
  for (const int camera : rig::cameras_off_grid_step(take_.rig(), camera_step)) {
    for (store::FrameSelection& tick : timeline_.ticks) tick.frame[camera] = -1;
  }
  if (timeline_.ticks.empty()) {
    throw Error::bad_input("the take's timeline is empty", take_.folder().string(),
                           "Run `raystage sync` and check its report");
  }
  using Time = schemas::ShotDocument::Layer::Time;
  if (layer_.time == Time::kExact) render::require_plausible_line_times(take_, timeline_);
  // Fail now if an archive is missing, and not at the first frame that needs it.
  for (int camera = 0; camera < take_.camera_count(); ++camera) take_.archive(camera);
  if (layer_.matte) {
    matte_ = std::make_shared<const store::TakeMatte>(take_, *layer_.matte, folder);
    if (reconstruction_.fill != schemas::HoleFill::kNone) {
      throw Error::bad_input("hole filling would fill what the matte makes transparent",
                             pointer_of(shot_file_, index_), "Remove fill or the matte")
          .concerning({"fill"});
    }
  }
  if (layer_.focal_plane.kind == schemas::ShotDocument::FocalPlane::Kind::kKeys) {
    std::vector<CurveKey<double>> keys;
    for (const auto& key : layer_.focal_plane.keys) keys.push_back({key.frame, key.depth});
    focus_ = Curve<double>(keys);
  }
  focal_depth_ = focal_depth(layer_.focal_plane, depth_range());
  if (!layer_.time_keys.empty()) {
    std::vector<CurveKey<double>> keys;
    for (const auto& key : layer_.time_keys) keys.push_back({key.frame, key.seconds});
    time_ = Curve<double>(keys);
  }
  common_ = common_fingerprint();
}

const render::Method& LightFieldLayer::method() const {
  return render::method_named(reconstruction_.method);
}

render::MethodOptions LightFieldLayer::method_options() const {
  return {method().options(), reconstruction_.options, reconstruction_.method};
}

std::optional<schemas::DepthRange> LightFieldLayer::depth_range() const {
  return depth_range_of(reconstruction_, take_);
}

bool LightFieldLayer::reads_adjacent_frames() const {
  return method().reads_adjacent_frames(method_options());
}

bool LightFieldLayer::depends_on_shown_views() const {
  return method().depends_on_shown_views(method_options());
}

render::ReconstructionOptions LightFieldLayer::reconstruction_for(const ExrCamera& camera,
                                                                  double frame) const {
  render::ReconstructionOptions result = reconstruction_;
  const std::optional<double> depth = focus_ ? focus_(frame) : focal_depth_;
  if (depth) {
    result.focal_plane =
        rig::fronto_parallel_plane(take_.rig(), *depth, camera.view.pose.viewing_direction());
  }
  schemas::OptionValues& options = result.options;
  const bool has_lens_options = method().has_lens();
  if (focal_plane_follows_camera() && camera.focus_m) {
    result.focal_plane = plane_at_focus(camera.view.pose, *camera.focus_m);
    const bool has_lens = options.contains("f_number") || options.contains("radius");
    if (has_lens_options && camera.f_number && !has_lens) {
      options["f_number"] = *camera.f_number;
      options["film_width"] = camera.film_back_mm;
    }
  }
  if (has_lens_options && options.contains("f_number") && camera.overscan_x > 0) {
    // film_width is that of the picture; the method expects that of the view with overscan.
    const render::MethodOptions given(method().options(), options, result.method);
    options["film_width"] = given.number("film_width") * camera.view.width /
                            (camera.view.width - 2.0 * camera.overscan_x);
  }
  return result;
}

render::ReconstructionOptions LightFieldLayer::preview_reconstruction(std::string_view method,
                                                                      const ExrCamera& camera,
                                                                      double frame) const {
  render::ReconstructionOptions result = reconstruction_for(camera, frame);
  if (method == result.method) return result;
  result.method = method;
  const render::Method& preview = render::method_named(result.method);
  std::erase_if(result.options, [&](const auto& option) {
    return (option.first != "near" && option.first != "far") || !has_option(preview, option.first);
  });
  if (camera.focus_m) result.focal_plane = plane_at_focus(camera.view.pose, *camera.focus_m);
  return result;
}

std::vector<std::filesystem::path> LightFieldLayer::input_files(const ShownTick& shown) const {
  if (!shown.tick) return {};
  const store::FrameSelection frames = frames_of(*shown.tick);
  std::vector<std::filesystem::path> files = method().input_files(method_options(), take_, frames);
  for (std::size_t i = 0; matte_ && i < frames.frame.size(); ++i) {
    const int first = frames.frame[i],
              second = frames.is_interpolated(i) ? frames.second[i].frame : -1;
    for (const int frame : {first, second}) {
      if (frame < 0) continue;
      std::ranges::move(matte_->input_files(static_cast<int>(i), frame), std::back_inserter(files));
    }
  }
  return files;
}

void LightFieldLayer::check_frame(const LayerFrameCheck& check) const {
  for (const auto& file : input_files(check.shown)) {
    if (file_exists(file)) continue;
    throw Error::bad_input(fmt::format("a file that frame {} needs is missing", check.frame),
                           file.string(), "Add it, or correct the layer in " + shot_file_.string());
  }
  if (!focal_plane_follows_camera() || check.camera_has_focus) return;
  throw Error::bad_input("the focal plane follows the camera, which has no focus_m",
                         pointer_of(shot_file_, index_),
                         "Add focus_m to a key of the camera, or choose another focal plane");
}

std::size_t LightFieldLayer::decoded_frame_bytes() const {
  constexpr std::size_t kBytesPerPixel = 8;  // four channels of 16 bits
  std::size_t bytes = 0;
  for (const rig::Rig::Camera& camera : take_.rig().cameras) {
    bytes += static_cast<std::size_t>(camera.model.width()) *
             static_cast<std::size_t>(camera.model.height()) * kBytesPerPixel;
  }
  if (layer_.time != schemas::ShotDocument::Layer::Time::kExact) return bytes;
  // Of each interpolated frame the two recorded ones are held, too. While it is computed, flow in
  // both directions and sampled pictures.
  constexpr std::size_t kHeld = 3, kFlowBytesPerPixel = 120;
  std::size_t largest = 0;
  for (const rig::Rig::Camera& camera : take_.rig().cameras) {
    largest = std::max(largest, static_cast<std::size_t>(camera.model.width()) *
                                    static_cast<std::size_t>(camera.model.height()));
  }
  const auto at_once = static_cast<std::size_t>(tbb::this_task_arena::max_concurrency());
  return kHeld * bytes +
         std::min(at_once, take_.rig().cameras.size()) * largest * kFlowBytesPerPixel;
}

bool LightFieldLayer::is_transparent_where_unseen() const {
  return !matte_ && !method().shows_foreground_only();
}

void LightFieldLayer::add_sources(const store::FrameSelection& tick, Fingerprint& print) const {
  for (std::size_t camera = 0; camera < tick.frame.size(); ++camera) {
    if (tick.frame[camera] < 0) {
      print.text("source", "absent");
      continue;
    }
    const auto add = [&](int frame) {
      const store::ArchiveReader& archive = take_.archive(static_cast<int>(camera));
      print.integer("source", archive.frames()[frame].time_ns);
      print.integer("xxh3", static_cast<std::int64_t>(archive.jpeg_xxh3(frame)));
    };
    add(tick.frame[camera]);
    if (!tick.is_interpolated(camera)) continue;
    print.number("interpolated", tick.second[camera].part);
    // Only of rolling shutters, so that fingerprints of other frames remain.
    if (tick.second[camera].line_part != 0) {
      print.number("line time", tick.second[camera].line_part);
    }
    add(tick.second[camera].frame);
  }
}

std::string LightFieldLayer::common_fingerprint() const {
  Fingerprint print;
  print.text("method", reconstruction_.method);
  // Includes defaults, so that changed defaults of a release cause new rendering.
  const render::MethodOptions options = method_options();
  schemas::OptionValues labelled;
  for (const render::OptionSpec& spec : method().options()) {
    labelled[std::string(spec.fingerprint_name())] = options.values().at(std::string(spec.name));
  }
  for (const auto& [name, value] : labelled) {
    print.text("option", name);
    if (const bool* flag = std::get_if<bool>(&value)) print.integer("value", *flag ? 1 : 0);
    if (const double* number = std::get_if<double>(&value)) print.number("value", *number);
    if (const std::string* text = std::get_if<std::string>(&value)) print.text("value", *text);
  }
  // With a focus pull, each frame adds its own plane.
  for (const double value : reconstruction_.focal_plane) {
    if (!focus_) print.number("plane", value);
  }
  print.integer("focuses as camera", focal_plane_follows_camera() ? 1 : 0);
  print.text("fill", reconstruction_.fill == schemas::HoleFill::kPushPull ? "push_pull" : "none");
  print.text("take", read_file(take_.file("take.json")));
  print.text("rig", read_file(take_.file("rig.json")));
  const ContainedPath imported = take_.file(schemas::ImportedDepthsDocument::kFile);
  if (file_exists(imported.path())) print.text("imported depths", read_file(imported));
  if (matte_) {
    print.text("matte", schemas::format_matte(*layer_.matte));
    print.text("matte from", matte_->sources());
  }
  return print.hex();
}

void LightFieldLayer::add_to_fingerprint(Fingerprint& print, double frame,
                                         const ShownTick& shown) const {
  print.text("light field", common_);
  if (focus_) print.number("focus", focus_(frame));
  if (!shown.tick) {
    print.text("source", "none");
    return;
  }
  for (const auto& file : input_files(shown)) print.text("file", read_file(file));
  const store::FrameSelection frames = frames_of(*shown.tick);
  print.integer("time", frames.time_ns);
  add_sources(frames, print);
  if (!reads_adjacent_frames()) return;
  for (const int adjacent : adjacent_ticks(*shown.tick)) {
    print.integer("beside", timeline_.ticks[adjacent].time_ns < frames.time_ns ? -1 : 1);
    add_sources(timeline_.ticks[adjacent], print);
  }
}

bool LightFieldLayer::fill_metadata(const ShownTick& shown, ExrMetadata& metadata) const {
  metadata.take_name = take_.document().name;
  metadata.method = reconstruction_.method;
  metadata.method_options = render::options_to_text(reconstruction_.options);
  if (!shown.tick) return true;
  const store::FrameSelection frames = frames_of(*shown.tick);
  Nanoseconds utc = 0;
  if (!__builtin_add_overflow(take_.document().epoch_utc, frames.time_ns, &utc)) {
    metadata.capture_utc = utc;
  }
  for (std::size_t camera = 0; camera < frames.frame.size(); ++camera) {
    if (frames.frame[camera] < 0) {
      metadata.absent_cameras.push_back(take_.document().cameras[camera].id);
    }
  }
  // captureRate is defined only if each shot frame is one capture. Without a speed, the rate of the
  // timeline may differ from the shot's as a measured rate does from a nominal one.
  const double fps = static_cast<double>(fps_numerator_) / fps_denominator_;
  const double speed = std::abs(layer_.speed);
  const double tolerance = std::abs(speed - 1) < 1e-9 ? 1e-3 : 1e-9;
  if (!time_ && std::abs(timeline_.fps * speed - fps) < tolerance * fps) {
    metadata.capture_rate = timeline_.fps;
  }
  return true;
}

std::unique_ptr<const LayerRenderer> LightFieldLayer::make_renderer(
    const LayerRendererOptions& settings) const {
  return std::make_unique<const TakeRenderer>(*this, settings);
}

}  // namespace raystage::compose
