// SPDX-License-Identifier: Apache-2.0
// Measures what encoding costs in rendered views, and searches the rate factor for a loss. Cost of
// a factor: encoding one group of each camera (of given views: what is between the first and the
// last that is rendered, too), and rendering up to four views.
#include "cli/view_loss.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/atomic_file.h"
#include "base/child_process.h"
#include "base/error.h"
#include "schemas/views_document.h"

namespace raystage::cli {
namespace {

constexpr int kMostViews = 4;
constexpr const char* kAdvice = "Give the rate factor instead: --crf";

/// Returns the mean time from a frame to the next; 0 of fewer than two.
Nanoseconds mean_interval(std::span<const store::FrameRecord> frames) {
  if (frames.size() < 2) return 0;
  return (frames.back().time_ns - frames.front().time_ns) /
         static_cast<Nanoseconds>(frames.size() - 1);
}

/// Of what a command printed: its error is the last line.
std::string last_line(std::string text) {
  while (text.ends_with('\n')) text.pop_back();
  return text.substr(text.rfind('\n') + 1);
}

int step_for(int views) { return std::max(1, (views + kMostViews - 1) / kMostViews); }

}  // namespace

ViewLoss::ViewLoss(const store::Take& take, const std::filesystem::path& target, Settings settings,
                   std::stop_token stop)
    : take_(take), folder_(target), settings_(std::move(settings)), stop_(std::move(stop)) {
  choose_frames();
  store::write_excerpt(take_, folder_.path() / "source", excerpt_, stop_);
  reference_db_ = psnr_of("source");
}

/// Chooses the time of the given views, and that of a group before and after.
void ViewLoss::choose_frames_of_views() {
  const auto views = schemas::read_views(settings_.views).views;
  view_step_ = step_for(static_cast<int>(views.size()));
  Nanoseconds margin = 0;
  for (int camera = 0; camera < take_.camera_count(); ++camera) {
    margin = std::max(margin, settings_.frames * mean_interval(take_.archive(camera).frames()));
  }
  excerpt_.first = std::numeric_limits<Nanoseconds>::max();
  excerpt_.last = std::numeric_limits<Nanoseconds>::min();
  for (std::size_t i = 0; i < views.size(); i += static_cast<std::size_t>(view_step_)) {
    excerpt_.first = std::min(excerpt_.first, views[i].time_ns - margin);
    excerpt_.last = std::max(excerpt_.last, views[i].time_ns + margin);
  }
}

/// Chooses the time of the excerpt, and the cameras to leave out.
void ViewLoss::choose_frames() {
  if (!settings_.views.empty()) return choose_frames_of_views();
  const int cameras = take_.camera_count();
  if (cameras < 3) {
    throw Error::bad_input("a loss in views cannot be measured with fewer than three cameras",
                           take_.folder().string(), kAdvice);
  }
  const auto frames = take_.archive(cameras / 2).frames();
  if (frames.empty()) {
    throw Error::bad_input("the camera in the middle of the list has no frames",
                           take_.folder().string(), kAdvice);
  }
  const auto count = static_cast<int>(frames.size());
  const int length = std::min(settings_.frames, count);
  const int begin = (count - length) / 2;
  const Nanoseconds interval = mean_interval(frames);
  // Cameras need not be synchronous: half an interval more on both sides.
  excerpt_.first = frames[begin].time_ns - interval / 2;
  excerpt_.last = frames[begin + length - 1].time_ns + interval / 2;
  if (count == 1) {  // a still: all that there is
    excerpt_.first = std::numeric_limits<Nanoseconds>::min();
    excerpt_.last = std::numeric_limits<Nanoseconds>::max();
  }
  // The camera in the middle: views from there are covered.
  const Eigen::Vector3d centre = take_.rig().centre();
  int middle = 0;
  double nearest = std::numeric_limits<double>::infinity();
  for (int camera = 0; camera < cameras; ++camera) {
    const Eigen::Vector3d position = take_.rig().cameras[camera].pose.position;
    if ((position - centre).norm() >= nearest) continue;
    nearest = (position - centre).norm();
    middle = camera;
  }
  excerpt_.unencoded_cameras = {middle};
  view_step_ = step_for(length);
}

/// Returns the mean PSNR of the views of an excerpt, dB.
double ViewLoss::psnr_of(const std::string& name) const {
  const std::filesystem::path result = folder_.path() / (name + ".json");
  std::vector<std::string> command{sibling_program("raystage-evaluate").string(),
                                   (folder_.path() / name).string()};
  if (!settings_.views.empty()) command.push_back(settings_.views.string());
  for (const int camera : excerpt_.unencoded_cameras) {
    command.insert(command.end(), {"--exclude-cameras",
                                   take_.document().cameras[static_cast<std::size_t>(camera)].id});
  }
  command.insert(command.end(), {"--method", settings_.method, "--view-step",
                                 std::to_string(view_step_), "--no-pixel-counts", "-q", "--json",
                                 result.string(), "-j", std::to_string(settings_.threads)});
  ChildOptions options;
  options.stop = stop_;
  const ChildResult evaluated = run_child(command, options);
  if (evaluated.exit_code != 0) {
    throw Error::failed("the views cannot be rendered: " + last_line(evaluated.out),
                        take_.folder().string(), kAdvice);
  }
  const auto mean = nlohmann::json::parse(read_file(result)).at("mean");
  const double psnr = mean.at("psnr_db").is_number() ? mean.at("psnr_db").get<double>() : NAN;
  if (!std::isfinite(psnr)) {
    throw Error::bad_input("no view can be compared with a truth", take_.folder().string(),
                           kAdvice);
  }
  return psnr;
}

double ViewLoss::loss_db(const store::VideoSettings& video) const {
  std::filesystem::remove_all(folder_.path() / "trial");
  store::Excerpt trial = excerpt_;
  trial.video = video;
  trial.references = settings_.references;
  store::write_excerpt(take_, folder_.path() / "trial", trial, stop_);
  return reference_db_ - psnr_of("trial");
}

std::string ViewLoss::truth() const {
  if (!settings_.views.empty()) return settings_.views.filename().string();
  std::string ids;
  for (const int camera : excerpt_.unencoded_cameras) {
    ids += " " + take_.document().cameras[static_cast<std::size_t>(camera)].id;
  }
  return "frames of the camera left out," + ids;
}

double largest_crf_within(const std::string& take, double target_db, int least, int most,
                          const std::function<double(double)>& loss_of) {
  const double best = loss_of(least);
  if (best > target_db) {
    throw Error::bad_input(
        fmt::format("the rate factor {} already costs {:.3f} dB in rendered views", least, best),
        take, "Allow a larger loss, or pack without loss");
  }
  int within = least, beyond = most + 1;
  while (beyond - within > 1) {
    const int middle = (within + beyond) / 2;
    (loss_of(middle) <= target_db ? within : beyond) = middle;
  }
  return within;
}

}  // namespace raystage::cli
