// SPDX-License-Identifier: Apache-2.0
// Renders a frame at the times of its exposure: the middle, both ends, then always the times
// halfway between those, until the average does not change or all planned times are used. Every
// picture is a composite of its own, so that the camera, meshes and light fields move together.
// Cost: that of a sharp frame, times the pictures.
#include <tbb/task_arena.h>

#include <algorithm>
#include <optional>
#include <utility>

#include "base/stopwatch.h"
#include "compose/frame_compositor.h"
#include "compose/layers/exposure.h"

namespace raystage::compose {
namespace {

/// The largest change of a colour in [0, 1] that is not visible: a quarter of an 8-bit code.
constexpr float kLeastChange = 0.001F;

/// The mean over the exposure of the shares of rays that no camera recorded, of each layer.
class MeanShares {
 public:
  void add(const std::vector<double>& shares, double weight) {
    sums_.resize(shares.size());
    for (std::size_t i = 0; i < shares.size(); ++i) sums_[i] += weight * shares[i];
    weight_ += weight;
  }
  std::vector<double> mean() && {
    for (double& sum : sums_) sum /= weight_;
    return std::move(sums_);
  }

 private:
  std::vector<double> sums_;
  double weight_ = 0;
};

void add_names(const std::vector<std::string>& names, std::vector<std::string>& all) {
  all.insert(all.end(), names.begin(), names.end());
  std::ranges::sort(all);
  all.erase(std::unique(all.begin(), all.end()), all.end());
}

}  // namespace

CompositedView FrameCompositor::composite_exposure(const PlannedFrame& frame, Eye eye,
                                                   const std::stop_token& stop,
                                                   DeepImage* deep) const {
  const auto view_at = [&](const PlannedFrame& at, DeepImage* into) {
    return merged_view(at, plan_.exr_camera(at.time(), eye), stop, into);
  };
  if (frame.exposure.empty()) {
    return composite(frame, plan_.exr_camera(frame.frame, eye), stop, deep);
  }
  CompositedView result = view_at(frame, deep);
  render::RenderStatistics statistics = result.picture.statistics;
  std::vector<std::string> notes = result.picture.notes;
  const std::vector<PlannedFrame> exposure = plan_.exposure_of(frame);
  ExposureAverage average(std::move(result.picture));
  MeanShares uncovered;
  uncovered.add(result.uncovered_share, 1);
  const auto picture_at = [&](std::size_t sample, double weight) {
    CompositedView view = view_at(exposure[sample], nullptr);
    uncovered.add(view.uncovered_share, weight);
    result.times.add(view.times);
    add_names(view.rotten_cameras, result.rotten_cameras);
    statistics.add_part(view.picture.statistics);
    render::add_notes(view.picture.notes, notes);
    return std::move(view.picture);
  };
  const std::size_t intervals = exposure.size() - 1;
  // Isolated: while this thread waits for parts of its frame, it must not start another frame.
  const auto isolated = [](const auto& step) { return tbb::this_task_arena::isolate(step); };
  for (const std::size_t end : {std::size_t{0}, intervals}) {
    const LayerImage picture = picture_at(end, ExposureAverage::kEndWeight);
    isolated([&] { average.add_end(picture); });
  }
  isolated([&] { return average.end_level(); });
  for (std::size_t step = intervals / 2; step > 1 && !stop.stop_requested(); step /= 2) {
    for (std::size_t sample = step / 2; sample < intervals; sample += step) {
      const LayerImage picture = picture_at(sample, 1);
      isolated([&] { average.add(picture); });
    }
    if (isolated([&] { return average.end_level(); }).value_or(1) < kLeastChange) break;
  }
  const Stopwatch finishing;
  isolated([&] { result.picture = std::move(average).finish(); });
  result.picture.statistics = statistics;
  result.picture.notes = std::move(notes);
  result.uncovered_share = std::move(uncovered).mean();
  finish(result.picture, deep);
  result.times.merge_ms += finishing.ms();
  return result;
}

}  // namespace raystage::compose
