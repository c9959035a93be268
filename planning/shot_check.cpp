// SPDX-License-Identifier: Apache-2.0
// Checks each frame of a shot against the array of each take: rays that no camera recorded, the
// distance from the border of the range of motion, effective resolution and ghosting
// (thesis 2.2, 5.2, 5.3). Frames are independent and run in parallel. Cost: well below a
// millisecond a frame for 64 cameras.
#include "planning/shot_check.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <utility>

#include "base/error.h"
#include "base/parallel.h"
#include "compose/sequence_memory_plan.h"
#include "planning/complete_topology.h"
#include "planning/outward_coverage.h"
#include "planning/recorded_directions.h"
#include "planning/recorded_rays.h"
#include "planning/view_sampling.h"
#include "render/common/plane_projection.h"
#include "rig/planning/range_of_motion.h"
#include "rig/planning/wall_eyed_array.h"
#include "rig/plenoptic_sampling.h"
#include "rig/rig.h"

namespace raystage::planning {
namespace {

/// The view of one eye, and the focal plane of the take.
struct EyeView {
  render::VirtualCamera view;
  Eigen::Vector4d plane;
};

/// A time of a layer: the eyes that look at it, and the cameras that have a frame at that time.
struct LayerTime {
  double weight = 1;  ///< in the mean over the exposure
  std::vector<EyeView> eyes;
  const rig::Topology* topology = nullptr;  ///< of these cameras; null: there are none
  int cameras = 0;
};

/// A frame of a layer.
struct LayerFrame {
  int frame = 0;
  std::vector<LayerTime> exposure;  ///< from the opening of the shutter to its closing; one: sharp

  const LayerTime& middle() const { return exposure[exposure.size() / 2]; }
};

/// Returns the view with its field of view multiplied by `factor` (on the tangent).
render::VirtualCamera narrowed(render::VirtualCamera view, double factor) {
  view.intrinsics.fx /= factor;
  view.intrinsics.fy /= factor;
  return view;
}

/// Returns perspective views that look from an equirectangular one to all sides, as small as four
/// of its pixels at the horizon.
std::vector<render::VirtualCamera> views_to_all_sides(const render::VirtualCamera& around) {
  std::vector<render::VirtualCamera> views;
  constexpr double kStep = std::numbers::pi / 4;
  for (int row = -1; row <= 1; ++row) {
    for (int column = 0; column < 8; ++column) {
      render::VirtualCamera view = render::virtual_camera_with_fov(
          2, 2, 2 * std::atan(2 * std::numbers::pi / around.width), around.pose);
      view.pose.world_from_camera_rotation =
          around.pose.world_from_camera_rotation *
          (Eigen::AngleAxisd(column * kStep, Eigen::Vector3d::UnitY()) *
           Eigen::AngleAxisd(row * kStep, Eigen::Vector3d::UnitX()))
              .toRotationMatrix();
      views.push_back(view);
    }
  }
  return views;
}

class LayerChecker {
 public:
  LayerChecker(const compose::ShotPlan& plan, const compose::LightFieldLayer& light_field)
      : plan_(plan), light_field_(light_field), rig_(light_field.take().rig()) {
    const std::size_t index = light_field.index();
    const schemas::ShotDocument::Layer& layer = plan.shot().layers[index];
    check_.layer = index;
    check_.name = layer.name.empty() ? fmt::format("layer {}", index) : layer.name;
    check_.volume = layer.volume;
    check_.method = light_field.reconstruction().method;
    check_.uses_focal_plane = light_field.method().uses_focal_plane();
    check_.cameras = static_cast<int>(rig_.cameras.size());
    check_.depth_range = light_field.depth_range();
    check_.eyes = static_cast<int>(plan.eyes().size());
    complete_ = complete_topology(rig_);
    check_.spacing = rig::max_neighbour_baseline(rig_, complete_);
    check_.sees_all_directions = plan.shot_camera().is_equirectangular();
    // Every method answers the rays of views of all directions by any camera that sees them.
    check_.blends_any_camera =
        check_.sees_all_directions || light_field.method().blends_any_camera();
    if (is_outward_array(rig_)) {
      check_.no_range_because =
          "its cameras look outwards (raystage plan coverage measures their range)";
    } else if (check_.sees_all_directions) {
      check_.no_range_because = "the shot's camera sees all directions";
    } else if (auto recorded = rig::recorded_array(rig_, &check_.no_range_because)) {
      array_ = std::move(recorded->array);
      check_.is_range_exact = recorded->is_ideal;
      check_.no_range_because.clear();
    }
  }

  LayerCheck run(std::span<const compose::PlannedFrame> frames, const ShotCheckOptions& options,
                 const std::stop_token& stop) {
    constexpr std::size_t kTogether = 256;  // so that few exposures are in memory
    if (options.finds_field_of_view && !check_.sees_all_directions) check_.field_of_view_factor = 1;
    for (; !frames.empty(); frames = frames.subspan(std::min(kTogether, frames.size()))) {
      check_frames(frames.first(std::min(kTogether, frames.size())), stop);
    }
    return std::move(check_);
  }

 private:
  /// Adds the checks of frames.
  void check_frames(std::span<const compose::PlannedFrame> frames, const std::stop_token& stop) {
    std::vector<LayerFrame> shown;
    for (const compose::PlannedFrame& frame : frames) {
      throw_if_stopped(stop);
      if (auto found = find_frame(frame)) shown.push_back(std::move(*found));
    }
    const std::size_t before = check_.frames.size();
    check_.frames.resize(before + shown.size());
    const auto checks = std::span(check_.frames).subspan(before);
    raystage::parallel_for(std::size_t{0}, shown.size(), [&](std::size_t i) {
      if (!stop.stop_requested()) checks[i] = check_frame(shown[i]);
    });
    throw_if_stopped(stop);
    if (check_.field_of_view_factor) {
      check_.field_of_view_factor =
          find_field_of_view(shown, checks, *check_.field_of_view_factor, stop);
    }
  }

  void throw_if_stopped(const std::stop_token& stop) const {
    if (stop.stop_requested()) {
      throw Error::failed("the check was stopped", check_.name, "Start it again");
    }
  }

  const rig::Topology& topology_of(const std::vector<int>& cameras) {
    const auto found = topologies_.find(cameras);
    if (found != topologies_.end()) return found->second;
    return topologies_.emplace(cameras, rig::make_topology(rig_, cameras)).first->second;
  }

  std::optional<LayerFrame> find_frame(const compose::PlannedFrame& planned) {
    if (!plan_.is_visible(light_field_.index(), planned.frame)) return std::nullopt;
    LayerFrame frame;
    frame.frame = planned.frame;
    if (planned.exposure.empty()) {
      frame.exposure.push_back(find_time(planned));
      return frame;
    }
    for (const compose::PlannedFrame& time : plan_.exposure_of(planned)) {
      frame.exposure.push_back(find_time(time));
    }
    frame.exposure.front().weight = frame.exposure.back().weight = 0.5;  // as ExposureAverage
    return frame;
  }

  LayerTime find_time(const compose::PlannedFrame& planned) {
    const std::size_t index = light_field_.index();
    LayerTime time;
    if (!planned.shown[index].tick) return time;
    const store::FrameSelection tick = light_field_.frames_of(*planned.shown[index].tick);
    std::vector<int> present;
    for (std::size_t camera = 0; camera < tick.frame.size(); ++camera) {
      if (tick.frame[camera] >= 0) present.push_back(static_cast<int>(camera));
    }
    if (present.empty()) return time;
    time.topology = &topology_of(present);
    time.cameras = static_cast<int>(present.size());
    for (const compose::Eye eye : plan_.eyes()) {
      const compose::ExrCamera camera = plan_.exr_camera(planned.time(), eye);
      time.eyes.push_back(
          {camera.view, light_field_.reconstruction_for(camera, planned.time()).focal_plane});
    }
    return time;
  }

  FrameCheck check_frame(const LayerFrame& frame) const {
    FrameCheck result;
    result.frame = frame.frame;
    result.unrecorded_share = mean_unrecorded_share(frame, false);
    const LayerTime& middle = frame.middle();
    result.cameras = std::ranges::min(frame.exposure, {}, &LayerTime::cameras).cameras;
    if (result.unrecorded_share > 0 && result.cameras > 0 && result.cameras < check_.cameras) {
      result.unrecorded_share_of_all = mean_unrecorded_share(frame, true);
    }
    if (middle.topology == nullptr) return result;
    const render::VirtualCamera& first = middle.eyes.front().view;
    result.horizontal_fov = first.is_equirectangular
                                ? 2 * std::numbers::pi
                                : 2 * std::atan(first.width / 2.0 / first.intrinsics.fx);
    for (const EyeView& eye : middle.eyes) {
      take_less(result.boundary_distance, boundary_distance(eye.view));
      if (const auto ratio = source_pixels(eye, *middle.topology)) {
        take_less(result.resolution, std::min(1.0, *ratio));
      }
      if (!check_.depth_range) continue;
      take_more(result.near_ghosting, ghosting(eye, check_.depth_range->near));
      take_more(result.far_ghosting, ghosting(eye, check_.depth_range->far));
    }
    return result;
  }

  /// Returns the radius of the sphere in focus of a view of all directions, metres.
  double focal_radius(const Eigen::Vector4d& plane) const {
    if (plane.head<3>().isZero(0)) return std::numeric_limits<double>::infinity();
    return std::abs(render::signed_plane_distance(plane, rig_.centre()));
  }

  /// Returns the least number of the cameras' pixels for a pixel of the view.
  std::optional<double> source_pixels(const EyeView& eye, const rig::Topology& topology) const {
    if (!eye.view.is_equirectangular) {
      return least_source_pixels_per_pixel(eye.view, rig_, topology, eye.plane);
    }
    std::optional<double> least;
    const double radius = focal_radius(eye.plane);
    for (const render::VirtualCamera& view : views_to_all_sides(eye.view)) {
      const Eigen::Vector4d plane =
          rig::fronto_parallel_plane(rig_, radius, view.pose.viewing_direction());
      take_less(least, least_source_pixels_per_pixel(view, rig_, topology, plane));
    }
    return least;
  }

  /// Returns the share of a view's rays that the layer's method lacks.
  double missing_share(const render::VirtualCamera& view, const Eigen::Vector4d& plane,
                       const rig::Topology& topology) const {
    if (view.is_equirectangular) {
      return unseen_directions({view.pose.position, focal_radius(plane)}, rig_, topology);
    }
    const auto share = check_.blends_any_camera ? unseen_share : unrecorded_share;
    return share(view, rig_, topology, plane);
  }

  /// Returns the mean over the exposure, of the eye for which it is larger.
  /// `of_all`: as if all cameras had frames.
  double mean_unrecorded_share(const LayerFrame& frame, bool of_all) const {
    double worst = 0;
    for (std::size_t eye = 0; eye < plan_.eyes().size(); ++eye) {
      double sum = 0, weights = 0;
      for (const LayerTime& time : frame.exposure) {
        weights += time.weight;
        sum += time.weight * (time.topology == nullptr
                                  ? 1
                                  : missing_share(time.eyes[eye].view, time.eyes[eye].plane,
                                                  of_all ? complete_ : *time.topology));
      }
      worst = std::max(worst, sum / weights);
    }
    return worst;
  }

  static void take_less(std::optional<double>& to, std::optional<double> value) {
    if (value && (!to || *value < *to)) to = value;
  }
  static void take_more(std::optional<double>& to, std::optional<double> value) {
    if (value && (!to || *value > *to)) to = value;
  }

  std::optional<double> boundary_distance(const render::VirtualCamera& view) const {
    if (!array_ || view.is_equirectangular) return std::nullopt;
    const rig::ViewFrustum frustum{rig::camera_slopes(view.intrinsics, view.width, view.height),
                                   view.pose.world_from_camera_rotation};
    const rig::RangeOfMotion range = rig::range_of_motion(*array_, frustum);
    if (range.positions.is_empty()) return std::nullopt;
    const rig::Pose& pose = array_->pose;
    return range.positions.signed_distance(pose.world_from_camera_rotation.transpose() *
                                           (view.pose.position - pose.position));
  }

  std::optional<double> ghosting(const EyeView& eye, double depth) const {
    if (!eye.view.is_equirectangular) {
      return ghosting_pixels(eye.view, rig_, eye.plane, depth, check_.spacing);
    }
    const render::VirtualCamera ahead = views_to_all_sides(eye.view)[8];
    return ghosting_pixels(
        ahead, rig_,
        rig::fronto_parallel_plane(rig_, focal_radius(eye.plane), ahead.pose.viewing_direction()),
        depth, check_.spacing);
  }

  /// Returns the largest factor, at most `factor`, at which no frame lacks rays, to 0.1 %.
  /// `checks`: of the frames.
  std::optional<double> find_field_of_view(const std::vector<LayerFrame>& frames,
                                           std::span<const FrameCheck> checks, double factor,
                                           const std::stop_token& stop) const {
    constexpr double kNarrowest = 0.01, kStep = 1e-3;
    const auto is_recorded = [&](const LayerFrame& frame, double narrower) {
      return std::ranges::all_of(frame.exposure, [&](const LayerTime& time) {
        return std::ranges::all_of(time.eyes, [&](const EyeView& eye) {
          return missing_share(narrowed(eye.view, narrower), eye.plane, *time.topology) == 0;
        });
      });
    };
    for (std::size_t i = 0; i < frames.size(); ++i) {
      throw_if_stopped(stop);
      const bool is_empty = std::ranges::any_of(
          frames[i].exposure, [](const LayerTime& time) { return time.topology == nullptr; });
      if (is_empty) return std::nullopt;
      if (checks[i].unrecorded_share == 0 || is_recorded(frames[i], factor)) continue;
      if (!is_recorded(frames[i], kNarrowest)) return std::nullopt;
      double enough = kNarrowest;
      while (factor - enough > kStep * factor) {
        const double middle = (enough + factor) / 2;
        (is_recorded(frames[i], middle) ? enough : factor) = middle;
      }
      factor = enough;
    }
    return factor;
  }

  const compose::ShotPlan& plan_;
  const compose::LightFieldLayer& light_field_;
  const rig::Rig& rig_;
  std::optional<rig::WallEyedArray> array_;
  rig::Topology complete_;                                // of all cameras
  std::map<std::vector<int>, rig::Topology> topologies_;  // by the cameras that are there
  LayerCheck check_;
};

}  // namespace

std::optional<double> LayerCheck::worst_ghosting() const {
  std::optional<double> worst;
  for (const FrameCheck& frame : frames) {
    for (const auto& ghosting : {frame.near_ghosting, frame.far_ghosting}) {
      if (ghosting && *ghosting > worst.value_or(-1)) worst = ghosting;
    }
  }
  return worst;
}

double LayerCheck::worst_unrecorded_share() const {
  double worst = 0;
  for (const FrameCheck& frame : frames) worst = std::max(worst, frame.unrecorded_share);
  return worst;
}

double LayerCheck::worst_resolution() const {
  double worst = 1;
  bool is_known = frames.empty();
  for (const FrameCheck& frame : frames) {
    worst = std::min(worst, frame.resolution.value_or(1));
    is_known = is_known || frame.resolution.has_value();
  }
  return is_known ? worst : 0;
}

namespace {

/// Combines a value of all layers: the better one in each frame of takes around a volume, and the
/// worst one of all frames and volumes. `better`: of two values.
template <class Value, class Better>
double worst_of(const std::vector<LayerCheck>& layers, double none, const Value& value,
                const Better& better) {
  std::map<std::pair<int, std::string>, double> best;  // by frame and volume
  for (const LayerCheck& layer : layers) {
    // A layer without a volume stands for itself.
    const std::string group =
        layer.volume.empty() ? fmt::format("{}", layer.layer) : "volume " + layer.volume;
    for (const FrameCheck& frame : layer.frames) {
      const std::optional<double> of_frame = value(frame);
      if (!of_frame) continue;
      const auto [known, is_new] = best.try_emplace({frame.frame, group}, *of_frame);
      if (!is_new) known->second = better(known->second, *of_frame);
    }
  }
  double worst = none;
  for (const auto& [key, of_frame] : best) {
    if (better(worst, of_frame) == worst) worst = of_frame;
  }
  return worst;
}

}  // namespace

double ShotCheck::worst_unrecorded_share() const {
  return worst_of(
      layers, 0, [](const FrameCheck& frame) { return std::optional(frame.unrecorded_share); },
      [](double a, double b) { return std::min(a, b); });
}

double ShotCheck::worst_resolution() const {
  const auto is_known = [](const LayerCheck& layer) { return layer.worst_resolution() > 0; };
  if (has_frames() && std::ranges::none_of(layers, is_known)) return 0;
  return worst_of(
      layers, 1, [](const FrameCheck& frame) { return frame.resolution; },
      [](double a, double b) { return std::max(a, b); });
}

bool ShotCheck::has_frames() const {
  return std::ranges::any_of(layers, [](const LayerCheck& layer) { return !layer.frames.empty(); });
}

ShotCheck check_shot(const compose::ShotPlan& plan, const std::string& name,
                     std::span<const compose::PlannedFrame> frames, const ShotCheckOptions& options,
                     const std::stop_token& stop) {
  const auto start = std::chrono::steady_clock::now();
  std::vector<const compose::LightFieldLayer*> light_fields = plan.light_fields();
  std::erase_if(light_fields, [&](const auto* layer) { return plan.is_light(layer->index()); });
  if (light_fields.empty()) {
    throw Error::bad_input("no light field is visible in the shot", name,
                           "Check a shot that has a layer with a take");
  }
  const bool looks_around = std::ranges::any_of(
      light_fields, [](const auto* layer) { return layer->take().rig().looks_around(); });
  if (plan.shot_camera().is_equirectangular() && !looks_around) {
    throw Error::bad_input(
        "the shot's camera sees all directions, and the cameras of every take look to one side",
        name, "Check a shot with a perspective camera");
  }
  ShotCheck check;
  check.shot = name;
  for (const compose::PlannedFrame& frame : frames) check.frames.push_back(frame.frame);
  if (!frames.empty()) {
    const render::VirtualCamera view = plan.camera(frames.front().frame, plan.eyes().front());
    check.width = view.width;
    check.height = view.height;
  }
  std::vector<FramePose> path;
  for (const compose::PlannedFrame& frame : frames) {
    path.push_back({frame.frame, plan.camera(frame.frame, plan.eyes().front()).pose});
  }
  if (!path.empty()) check.motion = measure_motion(path, plan.shot().fps);
  check.motion_limits = options.motion_limits;
  check.measured_settings = options.measured_settings;
  check.memory = static_cast<double>(compose::required_memory(plan, frames, 1, false));
  for (const compose::LightFieldLayer* light_field : light_fields) {
    check.layers.push_back(LayerChecker(plan, *light_field).run(frames, options, stop));
  }
  check.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return check;
}

}  // namespace raystage::planning
