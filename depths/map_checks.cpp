// SPDX-License-Identifier: Apache-2.0
// Checks imported depth maps: their unit by the take's depth range, and their precision. A file
// stores all depths of a map in multiples of one step, at least 1/65534 of the largest inverse
// depth: one pixel at 1 mm, as an error of matching leaves it, would round 10 m to 10.7 m. Such
// outliers become unknown; maps without them keep their step. Inputs: inverse depths, 1/m. Cost:
// O(pixels), and a copy of the known depths if any may be an outlier.
#include "depths/map_checks.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "render/depth/depth_file.h"
#include "rig/camera_stations.h"
#include "schemas/rig_document.h"

namespace raystage::depths {
namespace {

using render::InverseDepthMap;

constexpr double kImplausibleFactor = 3;  // beyond the depth range

/// Returns whether most known depths are far outside of the take's depth range.
bool is_implausible(const InverseDepthMap& map, const std::optional<schemas::DepthRange>& range) {
  if (!range) return false;
  const double least = 1 / (range->far * kImplausibleFactor),
               most = kImplausibleFactor / range->near;
  std::size_t known = 0, outside = 0;
  for (const float value : map.values) {
    if (value < 0) continue;
    ++known;
    if (value < least || value > most) ++outside;
  }
  return 2 * outside > known;
}

/// Returns the largest inverse depth of all but the nearest 1 % of the known pixels, 1/m.
double largest_of_most(const InverseDepthMap& map) {
  std::vector<float> known;
  std::ranges::copy_if(map.values, std::back_inserter(known), [](float q) { return q >= 0; });
  const auto at = known.begin() + static_cast<std::ptrdiff_t>((known.size() - 1) * 99 / 100);
  std::ranges::nth_element(known, at);
  return static_cast<double>(*at);
}

/// Marks depths as unknown that are so near that others would be stored too coarsely; returns their
/// number. See check_map().
std::size_t forget_near_outliers(InverseDepthMap& map, double parallax,
                                 const std::optional<schemas::DepthRange>& scene) {
  constexpr double kHeadroom = 64;
  constexpr double kNegligiblePx = 0.01;
  const double negligible = kNegligiblePx * double{render::kMaxDepthSteps} / parallax;
  double limit = std::max(negligible, scene ? kImplausibleFactor / scene->near : 0);
  const auto is_too_near = [&](float q) { return static_cast<double>(q) > limit; };
  if (std::ranges::none_of(map.values, is_too_near)) return 0;
  limit = std::max(limit, kHeadroom * largest_of_most(map));
  const auto count = std::ranges::count_if(map.values, is_too_near);
  std::ranges::replace_if(map.values, is_too_near, render::kUnknownDepth);
  return static_cast<std::size_t>(count);
}

}  // namespace

MapFindings check_map(InverseDepthMap& map, double parallax,
                      const std::optional<schemas::DepthRange>& scene) {
  MapFindings found;
  found.is_implausible = is_implausible(map, scene);
  found.too_near = forget_near_outliers(map, parallax, scene);
  found.rounding_px = static_cast<double>(render::depth_step(map)) / 2 * parallax;
  return found;
}

std::vector<double> neighbour_parallaxes(const rig::Rig& rig) {
  std::vector<double> parallaxes = rig::nearest_baselines(rig);
  for (std::size_t i = 0; i < parallaxes.size(); ++i) {
    if (!std::isfinite(parallaxes[i])) parallaxes[i] = schemas::kDefaultCameraSpacing;
    const schemas::Intrinsics& k = rig.cameras[i].model.intrinsics();
    parallaxes[i] *= std::max(k.fx, k.fy);
  }
  return parallaxes;
}

std::string list_of(const std::vector<std::string>& names) {
  constexpr std::size_t kMax = 12;
  std::string text;
  for (std::size_t i = 0; i < std::min(kMax, names.size()); ++i) {
    text += (i > 0 ? ", " : "") + names[i];
  }
  if (names.size() > kMax) text += fmt::format(" and {} more", names.size() - kMax);
  return text;
}

std::vector<std::string> notes_about(std::span<const MapFindings> findings,
                                     const std::vector<std::string>& files) {
  constexpr double kVisiblePx = 0.1;
  std::vector<std::string> notes, with_outliers, coarse;
  std::size_t implausible = 0, too_near = 0;
  double largest = 0;
  for (std::size_t i = 0; i < findings.size(); ++i) {
    if (findings[i].is_implausible) ++implausible;
    too_near += findings[i].too_near;
    if (findings[i].too_near > 0) with_outliers.push_back(files[i]);
    if (findings[i].rounding_px > kVisiblePx) coarse.push_back(files[i]);
    largest = std::max(largest, findings[i].rounding_px);
  }
  if (implausible > 0) {
    notes.push_back(
        fmt::format("most depths of {} of {} maps are far outside of the take's depth range: "
                    "check their unit, and whether they are planar depths or distances",
                    implausible, files.size()));
  }
  if (!with_outliers.empty()) {
    notes.push_back(fmt::format(
        "{} pixels of {} of {} maps are so near that all other depths would be stored too "
        "coarsely, and became unknown: check these maps for outliers: {}",
        too_near, with_outliers.size(), files.size(), list_of(with_outliers)));
  }
  if (!coarse.empty()) {
    notes.push_back(fmt::format(
        "the depths of {} of {} maps are rounded by up to {:.2g} pixels of disparity between "
        "neighbouring cameras, because others are so near: if these are wrong, remove them and "
        "import the maps again: {}",
        coarse.size(), files.size(), largest, list_of(coarse)));
  }
  return notes;
}

}  // namespace raystage::depths
