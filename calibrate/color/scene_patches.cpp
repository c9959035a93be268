// SPDX-License-Identifier: Apache-2.0
// Finds patches of the scene that several cameras observe: a grid of patches per picture and
// instant, each searched in the nearest cameras (patch_search.h). Input: take, rig, depth range in
// metres. Output: at most `max_points` patches. Cost: instants times cameras times patches times
// depth steps.
#include "calibrate/color/scene_patches.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <cmath>

#include "base/error.h"
#include "base/options.h"
#include "base/parallel.h"
#include "base/resources.h"
#include "calibrate/color/patch_search.h"
#include "store/timeline.h"

namespace raystage::calibrate {
namespace {

std::vector<int> nearest_cameras(const rig::Rig& rig, const store::FrameSelection& frames, int to,
                                 int count) {
  std::vector<int> cameras;
  for (int c = 0; c < static_cast<int>(rig.cameras.size()); ++c) {
    if (c != to && frames.frame[c] >= 0) cameras.push_back(c);
  }
  const auto distance = [&](int c) {
    return (rig.cameras[c].pose.position - rig.cameras[to].pose.position).norm();
  };
  std::ranges::stable_sort(cameras, {}, distance);
  if (cameras.size() > static_cast<std::size_t>(count)) {
    cameras.resize(count);
  }
  return cameras;
}

/// Returns the number of threads for which memory suffices: each holds the pictures of a camera and
/// its neighbours.
std::size_t searches_at_once(const rig::Rig& rig, const PatchSearchOptions& options) {
  constexpr std::size_t kBytesPerPixel = 24;  // prepared for comparison, and during decoding
  std::size_t most_pixels = 1;
  for (const rig::Rig::Camera& camera : rig.cameras) {
    most_pixels = std::max(most_pixels, static_cast<std::size_t>(camera.model.width()) *
                                            static_cast<std::size_t>(camera.model.height()));
  }
  const std::size_t bytes =
      kBytesPerPixel * most_pixels * static_cast<std::size_t>(options.neighbours + 1);
  const auto threads = static_cast<std::size_t>(tbb::this_task_arena::max_concurrency());
  return std::clamp<std::size_t>(free_memory() / 2 / bytes, 1, std::max<std::size_t>(1, threads));
}

std::vector<store::FrameSelection> instants_of(const store::Take& take, int count) {
  const auto known = store::read_timeline_if_present(take);
  const store::Timeline timeline = known ? *known : store::build_timeline(take, 0, 0);
  std::vector<store::FrameSelection> instants;
  const auto ticks = static_cast<int>(timeline.ticks.size());
  const int used = std::min(count, ticks);
  for (int i = 0; i < used; ++i) {
    const auto tick = static_cast<std::size_t>((2 * i + 1) * ticks / (2 * used));
    instants.push_back(timeline.ticks[tick]);
  }
  return instants;
}

void leave_out_rotten(const store::Take& take, store::FrameSelection& instant) {
  for (std::size_t c = 0; c < instant.frame.size(); ++c) {
    int& frame = instant.frame[c];
    if (frame >= 0 && take.archive(static_cast<int>(c)).is_rotten(frame)) frame = -1;
  }
}

}  // namespace

bool PatchSearchOptions::is_valid(std::string* reason) const {
  return is_within("instants", instants, 1, 1e6, reason) &&
         is_within("columns", columns, 1, 10000, reason) &&
         is_within("rows", rows, 1, 10000, reason) &&
         is_within("neighbours", neighbours, 1, 10000, reason) &&
         is_within("points", max_points, 1, 1e9, reason) &&
         is_within("correlation", min_ncc, 0, 1, reason) &&
         is_within("contrast", min_contrast, 0, 1, reason) &&
         is_within("correlation margin", min_ncc_margin, 0, 1, reason);
}

std::vector<ScenePatch> find_scene_patches(const store::Take& take, const rig::Rig& rig,
                                           const PatchSearchOptions& options,
                                           const std::function<void(double)>& progress,
                                           const std::stop_token& stop) {
  require_valid(options, "search for scene patches");
  std::vector<store::FrameSelection> instants = instants_of(take, options.instants);
  for (store::FrameSelection& instant : instants) leave_out_rotten(take, instant);
  const store::LevelTable levels = store::make_level_table(store::BlendSpace::kLinear);
  const std::size_t cameras = rig.cameras.size();
  std::vector<std::vector<ScenePatch>> found(instants.size() * cameras);
  std::atomic<std::size_t> done = 0;
  const auto never = [] { return false; };
  parallel_for_in_order(found.size(), searches_at_once(rig, options), never, [&](std::size_t task) {
    if (stop.stop_requested()) {
      throw Error::failed("the search for scene patches was stopped", take.folder().string(),
                          "Start it again");
    }
    const store::FrameSelection& instant = instants[task / cameras];
    const auto base = static_cast<int>(task % cameras);
    const auto shown = [&](int camera) {
      return load_patch_search_image(take, rig, camera, instant.frame[camera], levels);
    };
    if (instant.frame[base] >= 0) {
      std::vector<PatchSearchImage> others;
      for (const int camera : nearest_cameras(rig, instant, base, options.neighbours)) {
        others.push_back(shown(camera));
      }
      const PatchSearchImage mine = shown(base);
      const PatchSearch search(rig, options, mine, others);
      const rig::CameraModel& model = rig.cameras[base].model;
      for (int j = 0; j < options.rows; ++j) {
        for (int i = 0; i < options.columns; ++i) {
          auto point = search.find({std::floor((i + 0.5) * model.width() / options.columns) + 0.5,
                                    std::floor((j + 0.5) * model.height() / options.rows) + 0.5});
          if (point) found[task].push_back(std::move(*point));
        }
      }
    }
    progress(static_cast<double>(++done) / found.size());
  });
  std::vector<ScenePatch> all, points;
  for (auto& some : found) std::ranges::move(some, std::back_inserter(all));
  const auto most = static_cast<std::size_t>(options.max_points);
  if (all.size() <= most) return all;
  for (std::size_t i = 0; i < most; ++i) points.push_back(std::move(all[i * all.size() / most]));
  return points;
}

}  // namespace raystage::calibrate
