// SPDX-License-Identifier: Apache-2.0
// Measures what encoding costs in rendered views, and searches the rate factor for a loss. Cost of
// a factor: encoding one group of each camera, and rendering up to four views.
#include "cli/view_loss.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <system_error>
#include <utility>

#include "base/atomic_file.h"
#include "base/error.h"
#include "render/common/image_quality.h"

namespace raystage::cli {
namespace {

constexpr int kMostViews = 4;

}  // namespace

ViewLoss::ViewLoss(const store::Take& take, std::filesystem::path folder, Settings settings,
                   std::stop_token stop)
    : take_(take),
      folder_(std::move(folder)),
      settings_(std::move(settings)),
      stop_(std::move(stop)) {
  options_.method = settings_.method;
  options_.use_take_folder = false;
  options_.count_needed_pixels = false;
  if (!settings_.views.empty()) views_ = schemas::read_views(settings_.views);
  choose_frames();
  create_folder(folder_);
  try {
    store::pack_excerpt(take_, folder_ / "source", first_, last_, std::nullopt, stop_);
    evaluate(folder_ / "source", [&](const evaluation::EvaluatedView& view) {
      Reference& reference = references_[view.id];
      reference.truth = view.truth;
      reference.covered.assign(view.covered.begin(), view.covered.end());
      reference.psnr_db = render::compare_images(view.image, view.truth, view.covered).psnr_db;
    });
  } catch (...) {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
    throw;
  }
}

ViewLoss::~ViewLoss() {
  std::error_code ignored;
  std::filesystem::remove_all(folder_, ignored);
}

/// Chooses the time of the excerpt, and the cameras to leave out.
void ViewLoss::choose_frames() {
  if (!settings_.views.empty()) {
    first_ = std::numeric_limits<Nanoseconds>::min();
    last_ = std::numeric_limits<Nanoseconds>::max();
    const auto count = static_cast<int>(views_.views.size());
    options_.view_step = std::max(1, (count + kMostViews - 1) / kMostViews);
    return;
  }
  const int cameras = take_.camera_count();
  if (cameras < 3) {
    throw Error::bad_input(
        "views cannot be rendered from fewer than three cameras to measure a loss",
        take_.folder().string(), "Choose the rate factor instead");
  }
  const auto frames = take_.archive(cameras / 2).frames();
  if (frames.empty()) {
    throw Error::bad_input("the camera in the middle of the list has no frames to measure a loss",
                           take_.folder().string(), "Choose the rate factor instead");
  }
  const auto count = static_cast<int>(frames.size());
  const int length = std::min(settings_.group_frames, count);
  const int begin = (count - length) / 2;
  const Nanoseconds interval =
      count > 1 ? (frames.back().time_ns - frames.front().time_ns) / (count - 1) : 0;
  // Cameras need not be synchronous: half an interval more on both sides.
  first_ = frames[begin].time_ns - interval / 2;
  last_ = frames[begin + length - 1].time_ns + interval / 2;
  const int left_out = cameras >= 9 ? 2 : 1;
  for (int i = 1; i <= left_out; ++i) {
    options_.excluded_camera_ids.push_back(
        take_.document().cameras[static_cast<std::size_t>(cameras * i / (left_out + 1))].id);
  }
  options_.view_step = std::max(1, (left_out * length + kMostViews - 1) / kMostViews);
}

void ViewLoss::evaluate(
    const std::filesystem::path& excerpt,
    const std::function<void(const evaluation::EvaluatedView&)>& on_view) const {
  evaluation::EvaluationOptions options = options_;
  options.on_view = on_view;
  evaluation::evaluate_views(
      store::Take(excerpt), views_, settings_.views.parent_path(), options, [](double) {}, stop_);
}

double ViewLoss::loss_db(const store::VideoSettings& video) const {
  const std::filesystem::path trial = folder_ / "trial";
  std::filesystem::remove_all(trial);
  store::pack_excerpt(take_, trial, first_, last_, video, stop_);
  double sum = 0, count = 0;
  evaluate(trial, [&](const evaluation::EvaluatedView& view) {
    const auto found = references_.find(view.id);
    if (found == references_.end()) return;
    const Reference& reference = found->second;
    const double psnr =
        render::compare_images(view.image, reference.truth, reference.covered).psnr_db;
    sum += reference.psnr_db - psnr;
    ++count;
  });
  if (count == 0 || sum != sum) {
    throw Error::bad_input("no view has pixels that can be compared", take_.folder().string(),
                           "Choose the rate factor instead");
  }
  return sum / count;
}

double ViewLoss::reference_db() const {
  double sum = 0;
  for (const auto& [id, reference] : references_) sum += reference.psnr_db;
  return sum / static_cast<double>(references_.size());
}

std::string ViewLoss::truth() const {
  if (!settings_.views.empty()) return settings_.views.filename().string();
  return fmt::format("frames of {}, left out", fmt::join(options_.excluded_camera_ids, ", "));
}

double largest_crf_within(double target_db, int least, int most,
                          const std::function<double(double)>& loss_of) {
  const double best = loss_of(least);
  if (!(best <= target_db)) {
    throw Error::bad_input(
        fmt::format("the rate factor {} already costs {:.3f} dB in rendered views", least, best),
        "", "Allow a larger loss, or pack without loss");
  }
  int within = least, beyond = most + 1;
  while (beyond - within > 1) {
    const int middle = (within + beyond) / 2;
    (loss_of(middle) <= target_db ? within : beyond) = middle;
  }
  return within;
}

}  // namespace raystage::cli
