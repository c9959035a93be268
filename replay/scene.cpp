// SPDX-License-Identifier: Apache-2.0
#include "replay/scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <numeric>
#include <span>
#include <vector>

#include "base/cancellation.h"
#include "base/error.h"
#include "compose/derived_data.h"
#include "render/methods.h"

namespace raystage::replay {
namespace {

/// Views in flight: one that moves and one that is refined.
constexpr int kViewsInFlight = 2;

compose::ShotPlanOptions plan_options(const SceneOptions& options) {
  compose::ShotPlanOptions result;
  result.cache_folder = options.cache_folder;
  result.memory_bytes = options.memory_bytes;
  return result;
}

constexpr int kMaxFrames = 250'000;  // of a shot: three hours at 24 frames/s

std::vector<compose::PlannedFrame> all_frames(const compose::ShotPlan& plan) {
  const schemas::ShotDocument& shot = plan.shot();
  if (std::int64_t{shot.last_frame} - shot.first_frame >= kMaxFrames) {
    throw Error::bad_input(
        fmt::format("found {} frames, the viewer shows at most {}",
                    std::int64_t{shot.last_frame} - shot.first_frame + 1, kMaxFrames),
        shot.name, "Show a part of the shot");
  }
  std::vector<int> frames(static_cast<std::size_t>(plan.shot().last_frame) -
                          plan.shot().first_frame + 1);
  std::iota(frames.begin(), frames.end(), plan.shot().first_frame);
  return plan.plan(frames, compose::MissingFrames::kHold, compose::MotionBlur::kNone);
}

}  // namespace

Scene::Scene(const schemas::ShotDocument& shot, const std::filesystem::path& shot_file,
             const SceneOptions& options)
    : plan_(shot, shot_file, plan_options(options)),
      memory_(compose::plan_sequence_memory(plan_, all_frames(plan_),
                                            {options.memory_bytes, kViewsInFlight, false})),
      compositor_(plan_, memory_),
      ranges_of_motion_(plan_) {
  if (plan_.shot_camera().is_equirectangular()) {
    throw Error::bad_input("the viewer shows perspective cameras only, this one is equirectangular",
                           shot_file.string() + "#/camera/projection",
                           "Compose the shot with a perspective camera, then change it back");
  }
}

compose::PlannedFrame Scene::planned(int frame) const {
  return plan_.plan(std::array{frame}, compose::MissingFrames::kHold, compose::MotionBlur::kNone)
      .front();
}

compose::CompositedView Scene::render(const SceneView& view, const std::stop_token& stop) const {
  const CancellationScope scope(stop);
  compose::PlannedFrame frame = planned(view.frame);
  frame.preview = view.preview;
  compose::CompositedView result = compositor_.composite(frame, view.camera, stop);
  throw_if_cancelled();
  return result;
}

void Scene::read_ahead_of(int frame) const {
  constexpr int kFrames = 8;
  for (int next = frame + 1; next <= frame + kFrames; ++next) {
    if (next <= plan_.shot().last_frame) compositor_.read_ahead(planned(next));
  }
}

std::function<std::optional<double>()> Scene::depth_progress() const {
  const render::StoredDataCounts& counts = compositor_.stored_data();
  return [&counts, begun = counts.parts_begun.load(),
          done = counts.parts_done.load()]() -> std::optional<double> {
    const auto parts = static_cast<double>(counts.parts_begun.load() - begun);
    if (parts == 0) return std::nullopt;
    return std::min(1.0, static_cast<double>(counts.parts_done.load() - done) / parts);
  };
}

std::string Scene::fast_method() const {
  constexpr std::string_view kFast = "focal_plane";
  const bool has_slow = std::ranges::any_of(plan_.light_fields(), [](const auto* layer) {
    // Methods without a focal plane search for surfaces, and so may those that choose by measuring.
    return !layer->method().uses_focal_plane() || layer->method().chooses_by_measuring();
  });
  return has_slow ? std::string(kFast) : std::string();
}

bool Scene::must_estimate_depths(int frame) const {
  const std::array frames{planned(frame)};
  return std::ranges::any_of(compose::list_derived_data(plan_, frames),
                             [](const auto& data) { return !data.is_stored; });
}

compose::ExrCamera make_view_camera(const compose::ShotCamera& shot_camera,
                                    const compose::CameraState& state, compose::Eye eye, int width,
                                    int height) {
  compose::ExrCamera camera;
  camera.view = shot_camera.camera(state, eye);
  if (camera.view.width != width || camera.view.height != height) {
    const double scale = static_cast<double>(width) / camera.view.width;
    schemas::Intrinsics& lens = camera.view.intrinsics;
    lens.fx *= scale;
    lens.fy *= scale;
    lens.cx *= scale;
    lens.cy = (lens.cy - camera.view.height / 2.0) * scale + height / 2.0;
    camera.view.width = width;
    camera.view.height = height;
  }
  camera.film_back_mm = state.film_back_mm;
  camera.focus_m = state.focus_m;
  camera.f_number = state.f_number;
  return camera;
}

}  // namespace raystage::replay
