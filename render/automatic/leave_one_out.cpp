// SPDX-License-Identifier: Apache-2.0
// Leave-one-out quality: renders up to nine cameras, each from the others, and compares with their
// undistorted frames. PSNR is the worst of five parts (corners and centre, two thirds wide and
// high); returns its mean and standard deviation in dB over cameras. Cost: up to nine renderings.

#include "render/automatic/leave_one_out.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <numeric>
#include <optional>
#include <span>
#include <vector>

#include "render/automatic/light_field_sequence.h"
#include "render/automatic/undistorted_image.h"
#include "render/common/image_quality.h"
#include "render/common/ray_cells.h"

namespace raystage::render {
namespace {

/// Sums over the compared images.
struct Comparison {
  std::array<std::vector<double>, 5> psnr_db;  ///< by part, then by camera that shows it
  std::int64_t asked = 0, covered = 0;         ///< pixels: all, reconstructed
};

/// Returns the light field frame without a camera.
LightFieldFrame without(const LightFieldFrame& instant, int camera) {
  LightFieldFrame rest = instant;
  rest.stored_data_counts = nullptr;  // measurements are never stored
  rest.shown_views.clear();           // the camera left out is none of them
  rest.frame_of_camera[camera] = -1;
  std::erase(rest.included_cameras, camera);
  const std::vector<int> present = rest.present_cameras();
  if (!present.empty()) {
    rest.present = std::make_shared<const rig::Topology>(rig::make_topology(*instant.rig, present));
  }
  rest.complete = rest.present;
  return rest;
}

VirtualCamera view_of(const rig::Rig::Camera& camera) {
  VirtualCamera view{camera.model.width(), camera.model.height(), camera.model.intrinsics(),
                     camera.pose};
  view.intrinsics.distortion = {};
  return view;
}

/// Returns whether the camera has others around it; other views are extrapolated.
bool is_between_others(int camera, const LightFieldFrame& instant) {
  std::vector<int> others = instant.included_cameras;
  std::erase(others, camera);
  const VirtualCamera view = view_of(instant.rig->cameras[camera]);
  const RayCells cells(view, *instant.rig, rig::make_topology(*instant.rig, others));
  return cells.locate(view.intrinsics.cx, view.intrinsics.cy).has_value();
}

/// Selects cameras by farthest-point sampling, starting with the camera nearest to the array's
/// centre.
std::vector<int> cameras_to_leave_out(const LightFieldFrame& instant) {
  constexpr std::size_t kFewest = 4;  // three remain to blend when one is left out
  constexpr std::size_t kMax = 9;
  std::vector<int> candidates = instant.included_cameras;
  std::vector<int> chosen;
  if (candidates.size() < kFewest) return chosen;
  const auto position = [&](int camera) { return instant.rig->cameras[camera].pose.position; };
  const Eigen::Vector3d centre = instant.rig->centre();
  const auto distance = [&](int camera) {
    if (chosen.empty()) return -(position(camera) - centre).norm();
    double nearest = std::numeric_limits<double>::infinity();
    for (const int other : chosen) {
      nearest = std::min(nearest, (position(camera) - position(other)).norm());
    }
    return nearest;
  };
  while (!candidates.empty() && chosen.size() < kMax) {
    const auto next = std::ranges::max_element(candidates, {}, distance);
    if (is_between_others(*next, instant)) chosen.push_back(*next);
    candidates.erase(next);
  }
  return chosen;
}

/// Returns the light field frame for one of `count` cameras, which are spread over the sequence. It
/// is the first frame from the camera's position on at which it and three others have frames.
std::optional<LightFieldFrame> instant_of(const LightFieldSequence& instants, int camera,
                                          std::size_t place, std::size_t count) {
  const auto all = static_cast<std::size_t>(instants.count());
  const std::size_t first = (2 * place + 1) * all / (2 * count);
  for (std::size_t step = 0; step < all; ++step) {
    LightFieldFrame instant = instants.at(static_cast<int>((first + step) % all));
    if (instant.is_present(camera) && instant.present_cameras().size() > 3) return instant;
  }
  return std::nullopt;
}

/// Returns the PSNR over the pixels of a part set in `counted`; not-a-number without any.
double psnr_of_part(const store::RgbImage& image, const store::RgbImage& truth,
                    std::span<const std::uint8_t> counted, int left, int top, int width,
                    int height) {
  double squares = 0, pixels = 0;
  for (int y = top; y < top + height; ++y) {
    for (int x = left; x < left + width; ++x) {
      const auto pixel = static_cast<std::size_t>(y) * image.width + x;
      if (counted[pixel] == 0) continue;
      ++pixels;
      for (std::size_t c = pixel * 3; c < pixel * 3 + 3; ++c) {
        const double error = static_cast<double>(image.values[c]) - truth.values[c];
        squares += error * error;
      }
    }
  }
  if (pixels == 0) return std::numeric_limits<double>::quiet_NaN();
  // Identical parts count as one code of error in one pixel, so that the mean is finite.
  return 10 * std::log10(255.0 * 255.0 * 3 * pixels / std::max(squares, 1.0));
}

void compare(const RenderedView& rendered, const UndistortedImage& truth, Comparison& comparison) {
  const store::RgbImage image = srgb_image(rendered);
  std::vector<std::uint8_t> counted = coverage_mask(rendered);
  for (std::size_t i = 0; i < counted.size(); ++i) {
    counted[i] &= truth.within[i];
    comparison.asked += truth.within[i];
    comparison.covered += counted[i];
  }
  const int width = std::max(1, image.width * 2 / 3), height = std::max(1, image.height * 2 / 3);
  const int right = image.width - width, bottom = image.height - height;
  const std::array<std::array<int, 2>, 5> corners{
      {{0, 0}, {right, 0}, {0, bottom}, {right, bottom}, {right / 2, bottom / 2}}};
  for (std::size_t part = 0; part < corners.size(); ++part) {
    const auto [left, top] = corners[part];
    const double psnr = psnr_of_part(image, truth.image, counted, left, top, width, height);
    if (!std::isnan(psnr)) comparison.psnr_db[part].push_back(psnr);
  }
}

}  // namespace

LeaveOneOutQuality measure_leave_one_out_quality(const Method& method,
                                                 const schemas::OptionValues& given,
                                                 const ViewRequest& request) {
  const MethodOptions options(method.options(), given, method.name());
  const LightFieldSequence instants(request.instant);
  const std::vector<int> cameras = cameras_to_leave_out(request.instant);
  LeaveOneOutQuality quality;
  Comparison comparison;
  for (std::size_t place = 0; place < cameras.size(); ++place) {
    const int camera = cameras[place];
    const auto instant = instant_of(instants, camera, place, cameras.size());
    if (!instant) continue;
    const LightFieldFrame rest = without(*instant, camera);
    const rig::Rig::Camera& left_out = instant->rig->cameras[camera];
    const VirtualCamera view = view_of(left_out);
    store::FrameCache& cache = *instant->cache;
    std::int64_t decoded = 0;
    try {
      const RenderedView rendered =
          method.render({view, rest, request.focal_plane, options, request.result_cache,
                         request.working_bytes, request.buffers, false, false, false});
      const auto frame = cache.fetch(camera, instant->frame_of_camera[camera], {}, decoded);
      compare(rendered,
              undistort_frame(*frame, left_out.model, cache.full_scale(), cache.blend_space()),
              comparison);
      ++quality.cameras;
    } catch (const store::RottenFrame&) {
      // Other cameras and instants measure as well.
    }
  }
  double least = std::numeric_limits<double>::infinity();
  for (const std::vector<double>& of_part : comparison.psnr_db) {
    if (of_part.empty()) continue;
    const auto count = static_cast<double>(of_part.size());
    const double mean = std::accumulate(of_part.begin(), of_part.end(), 0.0) / count;
    double squares = 0;
    for (const double psnr : of_part) squares += (psnr - mean) * (psnr - mean);
    const double deviation = std::sqrt(squares / count);
    if (mean - deviation >= least) continue;
    least = mean - deviation;
    quality.mean_db = mean;
    quality.stddev_db = deviation;
  }
  if (comparison.asked == 0) return quality;
  quality.covered = static_cast<double>(comparison.covered) / static_cast<double>(comparison.asked);
  return quality;
}

}  // namespace raystage::render
