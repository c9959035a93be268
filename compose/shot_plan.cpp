// SPDX-License-Identifier: Apache-2.0
#include "compose/shot_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "compose/frame_range.h"
#include "render/methods.h"
#include "schemas/atomic_file.h"
#include "schemas/error.h"

namespace raystage {
namespace {

std::filesystem::path take_folder(const std::filesystem::path& shot_file,
                                  const ShotDocument& shot) {
  return (shot_file.parent_path() / shot.layers.front().take).lexically_normal();
}

/// What is the same in every frame's fingerprint.
Fingerprint common_fingerprint(const ShotDocument& shot, const Take& take,
                               const Reconstruction& reconstruction) {
  Fingerprint print;
  print.integer("reconstruction", kReconstructionVersion);
  print.integer("width", shot.width).integer("height", shot.height);
  print.integer("fps_n", shot.fps_numerator).integer("fps_d", shot.fps_denominator);
  print.text("compression", shot.output.compression);
  print.text("method", reconstruction.method);
  // With those not given, so that a new release's other ones render anew.
  const MethodOptions options(method_named(reconstruction.method).options, reconstruction.options,
                              reconstruction.method);
  for (const auto& [name, value] : options.values()) {
    print.text("option", name);
    if (const bool* flag = std::get_if<bool>(&value)) print.integer("value", *flag ? 1 : 0);
    if (const double* number = std::get_if<double>(&value)) print.number("value", *number);
    if (const std::string* text = std::get_if<std::string>(&value)) print.text("value", *text);
  }
  for (const double value : reconstruction.focal_plane) print.number("plane", value);
  print.text("fill", reconstruction.fill == HoleFill::kPushPull ? "push_pull" : "none");
  print.text("take", read_file(take.folder() / "take.json"));
  print.text("rig", read_file(take.folder() / "rig.json"));
  return print;
}

bool has_option(const Method& method, std::string_view name) {
  return std::ranges::any_of(method.options, [&](const auto& o) { return o.name == name; });
}

/// How deep the scene is: as the method's options say, else as the take does.
std::optional<DepthRange> scene_of(const Reconstruction& reconstruction, const Take& take) {
  const Method& method = method_named(reconstruction.method);
  const MethodOptions options(method.options, reconstruction.options, reconstruction.method);
  DepthRange scene = take.document().depth_range.value_or(DepthRange{0, 0});
  if (has_option(method, "near") && options.number("near") > 0) scene.near = options.number("near");
  if (has_option(method, "far") && options.number("far") > 0) scene.far = options.number("far");
  return scene.near > 0 && scene.far > 0 ? std::optional(scene) : std::nullopt;
}

Reconstruction reconstruction_of(const ShotDocument& shot, const Take& take,
                                 const std::filesystem::path& shot_file,
                                 std::optional<HoleFill> fill, const OptionValues& target) {
  const ShotDocument::Layer& layer = shot.layers.front();
  const Method& of_layer = method_named(layer.method);
  const MethodOptions options(of_layer.options, layer.options,
                              shot_file.string() + "#/layers/0/options");
  if (of_layer.check != nullptr) of_layer.check(options, take);
  check_exr_compression(shot.output.compression);
  Reconstruction reconstruction;
  reconstruction.method = target.empty() ? layer.method : "auto";
  reconstruction.options = target.empty() ? layer.options : target;
  const Method& method = method_named(reconstruction.method);
  // How deep the layer's scene is stays true whoever renders it.
  for (const char* name : {"near", "far"}) {
    if (has_option(method, name) && layer.options.contains(name)) {
      reconstruction.options[name] = layer.options.at(name);
    }
  }
  reconstruction.fill = fill.value_or(layer.fill);
  const std::optional<DepthRange> scene = scene_of(reconstruction, take);
  const bool best = layer.focal_plane.kind == ShotDocument::FocalPlane::Kind::kBest;
  // Nobody asks for the plane; but `auto` has nothing else where it does not know the scene.
  if (best && !scene && !method.on_focal_plane && method.name != "auto") return reconstruction;
  reconstruction.focal_plane = focal_plane_equation(layer.focal_plane, take.rig(), scene,
                                                    shot_file.string() + "#/layers/0/focal_plane");
  return reconstruction;
}

}  // namespace

Eigen::Vector4d focal_plane_equation(const ShotDocument::FocalPlane& plane, const Rig& rig,
                                     const std::optional<DepthRange>& depth_range,
                                     const std::string& where) {
  using Kind = ShotDocument::FocalPlane::Kind;
  switch (plane.kind) {
    case Kind::kInfinity:
      return {0, 0, 0, 1};
    case Kind::kDepth:
      return plane_in_front_of(rig, plane.depth);
    case Kind::kBest:
      if (!depth_range) {
        throw Error::bad_input("the best focal plane is unknown: the take has no depth range",
                               where,
                               "Give the plane's depth in metres, or add depth_range to take.json");
      }
      return plane_in_front_of(rig, best_focal_depth(*depth_range));
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

ShotPlan::ShotPlan(const std::filesystem::path& shot_file, std::optional<HoleFill> fill,
                   const OptionValues& target)
    : shot_file_(shot_file),
      shot_(read_shot(shot_file)),
      take_(take_folder(shot_file, shot_)),
      timeline_(read_timeline(take_)),
      path_(shot_.camera),
      reconstruction_(reconstruction_of(shot_, take_, shot_file, fill, target)),
      common_(common_fingerprint(shot_, take_, reconstruction_)) {
  if (timeline_.ticks.empty()) {
    throw Error::bad_input("the take's timeline is empty", take_.folder().string(),
                           "Run `raystage sync` and look at what it prints");
  }
  // An archive that is missing should stop the job now and not at the first frame that needs it.
  for (int camera = 0; camera < take_.camera_count(); ++camera) take_.archive(camera);
}

Nanoseconds ShotPlan::take_time(int frame) const {
  const ShotDocument::Layer& layer = shot_.layers.front();
  const double shot_seconds = (static_cast<double>(frame) - shot_.first_frame) *
                              shot_.fps_denominator / shot_.fps_numerator;
  const double seconds = layer.start_seconds + shot_seconds * layer.speed;
  constexpr double kLimit = 4e18;  // nanoseconds; keeps the sum below within int64
  return timeline_.ticks.front().time_ns +
         static_cast<Nanoseconds>(std::llround(
             std::clamp(seconds * static_cast<double>(kNanosecondsPerSecond), -kLimit, kLimit)));
}

std::optional<int> ShotPlan::tick_at(int frame) const {
  const auto tick = nearest_tick(timeline_.ticks, take_time(frame));
  if (!tick || timeline_.ticks[*tick].present() == 0) return std::nullopt;
  return static_cast<int>(*tick);
}

std::optional<int> ShotPlan::nearest_present(int tick) const {
  const auto present = [&](int i) {
    return timeline_.ticks[static_cast<std::size_t>(i)].present() > 0;
  };
  const int count = static_cast<int>(timeline_.ticks.size());
  for (int i = tick; i >= 0; --i) {
    if (present(i)) return i;
  }
  for (int i = tick + 1; i < count; ++i) {
    if (present(i)) return i;
  }
  return std::nullopt;
}

std::vector<PlannedFrame> ShotPlan::plan(std::span<const int> frames, MissingFrames policy) const {
  std::vector<PlannedFrame> planned;
  std::vector<int> missing;
  for (const int frame : frames) {
    PlannedFrame one{frame, tick_at(frame), false};
    if (!one.tick) {
      missing.push_back(frame);
      if (policy == MissingFrames::kHold) {
        const auto& ticks = timeline_.ticks;
        const auto after = std::upper_bound(
            ticks.begin(), ticks.end(), take_time(frame),
            [](Nanoseconds t, const FrameSelection& tick) { return t < tick.time_ns; });
        one.tick = nearest_present(std::max(0, static_cast<int>(after - ticks.begin()) - 1));
        one.held = one.tick.has_value();
      }
    }
    planned.push_back(one);
  }
  if (policy == MissingFrames::kError && !missing.empty()) {
    const double length =
        static_cast<double>(timeline_.ticks.back().time_ns - timeline_.ticks.front().time_ns) /
        static_cast<double>(kNanosecondsPerSecond);
    throw Error::bad_input(
        fmt::format("the take has nothing to show at {} of {} frames ({}); it lasts {:.3f} s from "
                    "its first tick",
                    missing.size(), frames.size(), format_frame_range(missing), length),
        shot_file_.string(),
        "Change start_seconds, speed or the frame range, or use --missing hold or --missing black");
  }
  return planned;
}

std::vector<std::filesystem::path> ShotPlan::files_read(const PlannedFrame& frame) const {
  const Method& method = method_named(reconstruction_.method);
  if (method.files_read == nullptr || !frame.tick) return {};
  const MethodOptions options(method.options, reconstruction_.options, method.name);
  return method.files_read(options, take_, timeline_.ticks[static_cast<std::size_t>(*frame.tick)]);
}

void ShotPlan::check_files(std::span<const PlannedFrame> frames) const {
  for (const PlannedFrame& frame : frames) {
    for (const auto& file : files_read(frame)) {
      if (std::filesystem::exists(file)) continue;
      throw Error::bad_input(fmt::format("frame {} needs a file that is not there", frame.frame),
                             file.string(),
                             "Put it there, or mend the options of method " +
                                 reconstruction_.method + " in " + shot_file_.string());
    }
  }
}

void ShotPlan::add_sources(const FrameSelection& tick, Fingerprint& print) const {
  for (std::size_t camera = 0; camera < tick.frame.size(); ++camera) {
    if (tick.frame[camera] < 0) {
      print.text("source", "absent");
      continue;
    }
    const FrameRecord& record = take_.archive(static_cast<int>(camera))
                                    .frames()[static_cast<std::size_t>(tick.frame[camera])];
    print.integer("source", record.time_ns);
    print.integer("xxh3", static_cast<std::int64_t>(record.xxh3));
  }
}

std::string ShotPlan::fingerprint(const PlannedFrame& frame, bool chromaticities,
                                  bool coverage_measures) const {
  Fingerprint print(common_);
  print.integer("chromaticities", chromaticities ? 1 : 0);
  print.integer("coverage_measures", coverage_measures ? 1 : 0);
  print.integer("frame", frame.frame);
  const VirtualCamera view = camera(frame.frame);
  for (const double value : view.pose.world_from_camera_rotation.reshaped()) {
    print.number("rotation", value);
  }
  for (const double value : view.pose.position) print.number("position", value);
  print.number("fx", view.intrinsics.fx).number("fy", view.intrinsics.fy);
  if (!frame.tick) return print.text("source", "none").hex();
  const FrameSelection& tick = timeline_.ticks[static_cast<std::size_t>(*frame.tick)];
  for (const auto& file : files_read(frame)) print.text("file", read_file(file));
  print.integer("time", tick.time_ns);
  add_sources(tick, print);
  const Method& method = method_named(reconstruction_.method);
  if (method.looks_beside != nullptr &&
      method.looks_beside(MethodOptions(method.options, reconstruction_.options, method.name))) {
    for (const int beside : {*frame.tick - 1, *frame.tick + 1}) {
      const auto i = static_cast<std::size_t>(beside);
      if (beside < 0 || i >= timeline_.ticks.size()) continue;
      print.integer("beside", beside - *frame.tick);
      add_sources(timeline_.ticks[i], print);
    }
  }
  return print.hex();
}

ExrMetadata ShotPlan::metadata(const PlannedFrame& frame) const {
  ExrMetadata metadata;
  metadata.camera = camera(frame.frame);
  metadata.frame = frame.frame;
  metadata.fps_numerator = shot_.fps_numerator;
  metadata.fps_denominator = shot_.fps_denominator;
  metadata.take_name = take_.document().name;
  metadata.method = reconstruction_.method;
  metadata.method_options = text_of(reconstruction_.options);
  metadata.compression = shot_.output.compression;
  if (!frame.tick) return metadata;

  const FrameSelection& tick = timeline_.ticks[static_cast<std::size_t>(*frame.tick)];
  Nanoseconds utc = 0;
  if (!__builtin_add_overflow(take_.document().epoch_utc, tick.time_ns, &utc)) {
    metadata.capture_utc = utc;
  }
  for (std::size_t camera = 0; camera < tick.frame.size(); ++camera) {
    if (tick.frame[camera] < 0) {
      metadata.absent_cameras.push_back(take_.document().cameras[camera].id);
    }
  }
  // Only where shot frames and captures go one to one does the distance between two frames'
  // exposures equal that of two captures.
  const double speed = std::abs(shot_.layers.front().speed);
  if (speed > 0 && std::abs(timeline_.fps * speed - shot_.fps) < 1e-3 * shot_.fps &&
      std::abs(speed - 1) < 1e-9) {
    metadata.capture_rate = timeline_.fps;
  }
  return metadata;
}

}  // namespace raystage
