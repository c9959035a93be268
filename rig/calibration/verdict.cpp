// SPDX-License-Identifier: Apache-2.0
#include "rig/calibration/verdict.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "rig/calibration/flatness.h"

namespace raystage {
namespace {

constexpr int kJoined = 6;  // common points by which a camera can be placed
constexpr int kCells = 4;   // of the picture, each way
constexpr const char* kMendFit =
    "Look for cameras that moved or refocused while recording, and for times that do not fit "
    "(raystage sync); a lens per camera (--lens-per-camera) may fit better.";

std::vector<std::string> names_of(const std::vector<int>& cameras, const ArrayModel& model) {
  std::vector<std::string> names;
  for (const int i : cameras) names.push_back(model.cameras[static_cast<std::size_t>(i)].id);
  return names;
}

void say_once(std::vector<std::string>& list, std::string sentence) {
  if (std::ranges::find(list, sentence) == list.end()) list.push_back(std::move(sentence));
}

void judge_cameras(Verdict& verdict, const ArrayModel& model, const VerdictLimits& limits) {
  const std::vector<CameraFit> fits = fits_of(model);
  std::vector<std::string> blind, not_found, with_few, ill_fitting, narrow;
  for (std::size_t i = 0; i < fits.size(); ++i) {
    const std::string& id = model.cameras[i].id;
    if (fits[i].seen == 0) {
      blind.push_back(id);
    } else if (!model.cameras[i].pose) {
      not_found.push_back(fmt::format("{} (saw {})", id, fits[i].seen));
    } else if (fits[i].kept < limits.least_points) {
      with_few.push_back(fmt::format("{} ({})", id, fits[i].kept));
    } else if (!(fits[i].rms_px <= limits.most_rms_px)) {
      ill_fitting.push_back(fmt::format("{} ({:.2f} px)", id, fits[i].rms_px));
    } else if (fits[i].covered < 0.5) {
      narrow.push_back(fmt::format("{} ({:.0f} %)", id, 100 * fits[i].covered));
    }
  }
  if (!blind.empty()) {
    verdict.reasons.push_back(fmt::format("Nothing was seen by {}.", few_of(blind)));
    verdict.next_steps.push_back(
        "Look at the pictures of the cameras that saw nothing: covered, out of focus, turned away, "
        "or exposed too briefly for the light.");
  }
  if (!not_found.empty()) {
    verdict.reasons.push_back(fmt::format(
        "No place was found for {}: too few points in common with the others.", few_of(not_found)));
    verdict.next_steps.push_back(
        "Move the light through what these cameras share with their neighbours.");
  }
  if (!with_few.empty()) {
    verdict.reasons.push_back(
        fmt::format("Fewer than {} points count in {}.", limits.least_points, few_of(with_few)));
    verdict.next_steps.push_back("Record the light at more places in front of these cameras.");
  }
  if (!ill_fitting.empty()) {
    verdict.reasons.push_back(fmt::format("Points do not fit to {:.2f} px in {}.",
                                          limits.most_rms_px, few_of(ill_fitting)));
    verdict.next_steps.emplace_back(kMendFit);
  }
  if (!narrow.empty()) {
    verdict.warnings.push_back(fmt::format(
        "Points fill less than half of the picture in {}: the lens is extrapolated beyond them.",
        few_of(narrow)));
    verdict.next_steps.push_back("Move the light into the corners of every camera's picture.");
  }
}

void judge_groups(Verdict& verdict, const ArrayModel& model) {
  const Overlap overlap = overlap_of(model);
  std::vector<std::vector<int>> groups;
  for (const auto& group : overlap.groups) {
    if (group.size() > 1) groups.push_back(group);
  }
  if (groups.size() > 1) {
    verdict.reasons.push_back(
        fmt::format("The cameras fall into {} groups that share no points: {} / {}.", groups.size(),
                    few_of(names_of(groups[0], model)), few_of(names_of(groups[1], model))));
    verdict.next_steps.push_back("Move the light where cameras of both groups see it at once.");
  }
}

void judge_fit(Verdict& verdict, const ArrayModel& model, const VerdictLimits& limits) {
  const double rms = rms_of(model);
  if (!(rms <= limits.most_rms_px)) {
    verdict.reasons.push_back(
        fmt::format("Points are {:.2f} px (RMS) from where they should be; at most {:.2f} are "
                    "vouched for.",
                    rms, limits.most_rms_px));
    say_once(verdict.next_steps, kMendFit);
  }
  std::vector<int> seen_by(model.points.size(), 0);
  for (const ArrayModel::Observation& o : model.observations) {
    if (model.cameras[static_cast<std::size_t>(o.camera)].pose) {
      ++seen_by[static_cast<std::size_t>(o.point)];
    }
  }
  int could_count = 0, count = 0;
  for (const ArrayModel::Observation& o : model.observations) {
    if (seen_by[static_cast<std::size_t>(o.point)] < 2) continue;
    could_count += model.cameras[static_cast<std::size_t>(o.camera)].pose ? 1 : 0;
    count += model.counts(o) ? 1 : 0;
  }
  const double share = 1 - static_cast<double>(count) / std::max(could_count, 1);
  if (share > limits.most_outliers) {
    verdict.reasons.push_back(
        fmt::format("{:.0f} % of the detections do not fit; at most {:.0f} "
                    "are vouched for.",
                    100 * share, 100 * limits.most_outliers));
    verdict.next_steps.push_back(
        "Darken the room, cover what reflects the light, and see whether frames are matched "
        "rightly in time (raystage sync).");
  }
}

/// Two cameras explain points of one plane in two ways.
void judge_flatness(Verdict& verdict, const ArrayModel& model) {
  constexpr double kAllButAll = 0.9;
  if (!(share_on_a_plane(model) > kAllButAll)) return;
  verdict.reasons.emplace_back(
      "All points lie near one plane, or far away, and two cameras explain such points in two "
      "ways.");
  verdict.next_steps.emplace_back("Record the light at different depths, or with a third camera.");
}

void judge_direction(Verdict& verdict, const Uncertainty::Direction& direction,
                     const ArrayModel& model) {
  const std::string times =
      direction.deviation > 1000
          ? "not told by the recording at all"
          : fmt::format("uncertain by {:.1f} times what is tolerated", direction.deviation);
  say_once(verdict.reasons, fmt::format("{} {}.", describe(direction, model), times));
  if (direction.focal_length + direction.middle + direction.distortion > 0.4) {
    say_once(
        verdict.next_steps,
        "Measure the lens with a board (raystage calibrate lens), give it with --lens and hold "
        "it (--hold lens): cameras that look nearly the same way cannot tell a longer lens "
        "from a deeper scene, wherever the light goes. Where they do not, more of the light, "
        "near and far and in the corners of their pictures, helps too.");
  } else {
    say_once(verdict.next_steps,
             "Record more of the light, nearer to the array (one to ten times its width) and at "
             "different depths.");
  }
}

}  // namespace

std::vector<CameraFit> fits_of(const ArrayModel& model) {
  const std::vector<CameraModel> lenses = lenses_of(model);
  std::vector<CameraFit> fits(model.cameras.size());
  std::vector<std::array<bool, kCells * kCells>> covered(fits.size());
  for (const ArrayModel::Observation& o : model.observations) {
    const auto i = static_cast<std::size_t>(o.camera);
    ++fits[i].seen;
    if (!model.counts(o)) continue;
    const auto residual = residual_of(model, lenses, o);
    if (!residual) continue;
    ++fits[i].kept;
    fits[i].rms_px += residual->squaredNorm();
    const auto cell = [](double at, int size) {
      return static_cast<std::size_t>(
          std::clamp(static_cast<int>(kCells * at / size), 0, kCells - 1));
    };
    covered[i][cell(o.pixel.y(), model.cameras[i].height) * kCells +
               cell(o.pixel.x(), model.cameras[i].width)] = true;
  }
  for (std::size_t i = 0; i < fits.size(); ++i) {
    fits[i].rms_px = fits[i].kept > 0 ? std::sqrt(fits[i].rms_px / fits[i].kept)
                                      : std::numeric_limits<double>::quiet_NaN();
    fits[i].covered = static_cast<double>(std::ranges::count(covered[i], true)) / covered[i].size();
  }
  return fits;
}

Overlap overlap_of(const ArrayModel& model) {
  const std::size_t count = model.cameras.size();
  Overlap overlap;
  overlap.shared.assign(count, std::vector<int>(count, 0));
  for (std::size_t begin = 0, end = 0; begin < model.observations.size(); begin = end) {
    while (end < model.observations.size() &&
           model.observations[end].point == model.observations[begin].point) {
      ++end;
    }
    for (std::size_t a = begin; a < end; ++a) {
      for (std::size_t b = begin; b < end; ++b) {
        const auto one = static_cast<std::size_t>(model.observations[a].camera);
        const auto other = static_cast<std::size_t>(model.observations[b].camera);
        if (one != other) ++overlap.shared[one][other];
      }
    }
  }
  std::vector<bool> done(count, false);
  for (std::size_t start = 0; start < count; ++start) {
    if (done[start]) continue;
    std::vector<int> group{static_cast<int>(start)};
    done[start] = true;
    for (std::size_t k = 0; k < group.size(); ++k) {
      for (std::size_t other = 0; other < count; ++other) {
        if (done[other] || overlap.shared[static_cast<std::size_t>(group[k])][other] < kJoined) {
          continue;
        }
        done[other] = true;
        group.push_back(static_cast<int>(other));
      }
    }
    std::ranges::sort(group);
    overlap.groups.push_back(std::move(group));
  }
  std::ranges::stable_sort(overlap.groups, std::greater<>(),
                           [](const auto& g) { return g.size(); });
  return overlap;
}

std::vector<std::pair<int, int>> Overlap::pairs_without_points() const {
  std::vector<std::pair<int, int>> pairs;
  for (std::size_t a = 0; a < shared.size(); ++a) {
    for (std::size_t b = a + 1; b < shared.size(); ++b) {
      if (shared[a][b] == 0) pairs.emplace_back(static_cast<int>(a), static_cast<int>(b));
    }
  }
  return pairs;
}

std::string few_of(const std::vector<std::string>& names, std::size_t most) {
  std::string text;
  for (std::size_t i = 0; i < std::min(names.size(), most); ++i) {
    text += (i == 0 ? "" : ", ") + names[i];
  }
  if (names.size() > most) text += fmt::format(" and {} more", names.size() - most);
  return text;
}

std::string describe(const Uncertainty::Direction& d, const ArrayModel& model) {
  struct Part {
    double share;
    const char* name;
  };
  std::array<Part, 5> parts{
      Part{d.focal_length, "the focal length (and with it the depth of everything)"},
      Part{d.middle, "the principal point"}, Part{d.distortion, "the distortion"},
      Part{d.places, "where cameras stand"}, Part{d.turns, "where cameras look"}};
  std::ranges::sort(parts, std::greater<>(), &Part::share);
  constexpr double kTakesPart = 0.2;
  std::string text = parts[0].name;
  for (std::size_t i = 1; i < parts.size() && parts[i].share > kTakesPart; ++i) {
    text += std::string(" together with ") + parts[i].name;
  }
  if (!d.cameras.empty() && d.places + d.turns > kTakesPart) {
    text += " (" + few_of(names_of(d.cameras, model)) + ")";
  }
  text[0] = text[0] == 't' ? 'T' : 'W';
  return text + " is";
}

Verdict verdict_on(const ArrayModel& model, const std::optional<Uncertainty>& uncertainty,
                   bool scale_is_known, const VerdictLimits& limits) {
  Verdict verdict;
  judge_cameras(verdict, model, limits);
  judge_groups(verdict, model);
  judge_fit(verdict, model, limits);
  judge_flatness(verdict, model);
  constexpr double kAlike = 0.6, kSeen = 0.1;  // correlation; pixels
  if (uncertainty && uncertainty->correlation > kAlike && uncertainty->noise_px > kSeen) {
    verdict.warnings.push_back(fmt::format(
        "What is left of {:.2f} px is not noise: points that follow each other err alike "
        "(correlation {:.2f}).",
        uncertainty->noise_px, uncertainty->correlation));
    say_once(verdict.next_steps, kMendFit);
  }
  if (uncertainty) {
    constexpr std::size_t kMostSaid = 4;
    std::size_t said = 0;
    for (const Uncertainty::Direction& direction : uncertainty->weakest) {
      if (direction.deviation > 1 && said++ < kMostSaid) judge_direction(verdict, direction, model);
    }
  }
  if (!scale_is_known) {
    verdict.reasons.emplace_back("Nothing tells the scale: a light's path looks the same in any.");
    verdict.next_steps.emplace_back(
        "Give the distance from one camera to the next (--spacing-mm), or a measured one "
        "(--distance).");
  }
  return verdict;
}

}  // namespace raystage
