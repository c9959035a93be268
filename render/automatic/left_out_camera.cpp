// SPDX-License-Identifier: Apache-2.0
#include "render/automatic/left_out_camera.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "render/quality/image_quality.h"
#include "schemas/transfer_function.h"
#include "store/timeline.h"

namespace raystage {
namespace {

constexpr std::size_t kMostCameras = 3;

/// The frames of the members at the middle of the take.
Instant middle_instant(const Instant& now) {
  Instant middle = now;
  const auto frames = now.take->archive(now.members.front()).frames();
  middle.time_ns = frames.empty() ? now.time_ns : frames[frames.size() / 2].time_ns;
  const auto tolerance =
      static_cast<Nanoseconds>(kNanosecondsPerSecond / now.take->document().nominal_fps / 2);
  const FrameSelection selection = select_frames(*now.take, middle.time_ns, tolerance);
  std::ranges::fill(middle.frame_of_camera, -1);
  for (const int camera : now.members) {
    const auto i = static_cast<std::size_t>(camera);
    middle.frame_of_camera[i] = selection.frame[i];
  }
  return middle;
}

/// From the middle of the array outwards: the nearest to the centre, and those at a quarter and at
/// half of the order, so that they are not all neighbours.
std::vector<int> cameras_to_leave_out(const Instant& instant, std::vector<int> present) {
  const Eigen::Vector3d centre = instant.rig->centre();
  std::ranges::stable_sort(present, {}, [&](int camera) {
    return (instant.rig->cameras[static_cast<std::size_t>(camera)].pose.position - centre).norm();
  });
  std::vector<int> chosen;
  for (const std::size_t at : {std::size_t{0}, present.size() / 4, present.size() / 2}) {
    if (chosen.size() < kMostCameras && std::ranges::count(chosen, present[at]) == 0) {
      chosen.push_back(present[at]);
    }
  }
  return chosen;
}

/// The camera's frame as 8-bit sRGB codes, photometrically corrected, seen without its distortion.
RgbImage ideal_picture(const DecodedFrame& frame, const CameraModel& model, double full_scale,
                       BlendSpace space) {
  RgbImage image{frame.width, frame.height, {}};
  image.pixels.resize(static_cast<std::size_t>(frame.width) *
                      static_cast<std::size_t>(frame.height) * 3);
  const Intrinsics& k = model.intrinsics();
  std::size_t at = 0;
  for (int y = 0; y < frame.height; ++y) {
    for (int x = 0; x < frame.width; ++x) {
      const Eigen::Vector2d ideal((x + 0.5 - k.cx) / k.fx, (y + 0.5 - k.cy) / k.fy);
      const Eigen::Vector2d pixel = model.pixel_from_ideal(ideal).value_or(Eigen::Vector2d(0, 0));
      const double left = std::clamp(pixel.x() - 0.5, 0.0, frame.width - 1.0);
      const double top = std::clamp(pixel.y() - 0.5, 0.0, frame.height - 1.0);
      const int x0 = static_cast<int>(left), y0 = static_cast<int>(top);
      const double fx = left - x0, fy = top - y0;
      for (std::size_t c = 0; c < 3; ++c, ++at) {
        const auto code = [&](int i, int j) {
          const auto row = static_cast<std::size_t>(std::min(y0 + j, frame.height - 1));
          const auto column = static_cast<std::size_t>(std::min(x0 + i, frame.width - 1));
          return frame.rgbx[(row * static_cast<std::size_t>(frame.width) + column) * 4 + c] /
                 65535.0;
        };
        const double value = (1 - fy) * ((1 - fx) * code(0, 0) + fx * code(1, 0)) +
                             fy * ((1 - fx) * code(0, 1) + fx * code(1, 1));
        const double linear =
            full_scale * (space == BlendSpace::kPerceptual ? linear_from_srgb(value) : value);
        image.pixels[at] = static_cast<std::uint8_t>(
            std::lround(255 * srgb_from_linear(std::clamp(linear, 0.0, 1.0))));
      }
    }
  }
  return image;
}

double error_without(int camera, const Instant& middle, std::vector<int> present,
                     const Method& method, const MethodOptions& options,
                     const ViewRequest& request) {
  const auto index = static_cast<std::size_t>(camera);
  Instant instant = middle;
  instant.frame_of_camera[index] = -1;
  std::erase(present, camera);
  std::erase(instant.members, camera);
  instant.present = std::make_shared<const Topology>(topology_of(*middle.rig, present));
  instant.complete = instant.present;
  const Rig::Camera& left_out = middle.rig->cameras[index];
  VirtualCamera view{left_out.model.width(), left_out.model.height(), left_out.model.intrinsics(),
                     left_out.pose};
  view.intrinsics.distortion = {};
  const RenderedView rendered =
      method.render({view, instant, request.focal_plane, options, request.kept,
                     request.working_bytes, request.buffers, false, false, false});
  std::int64_t decoded = 0;
  const auto frame = middle.cache->fetch(camera, middle.frame_of_camera[index], {}, decoded);
  const RgbImage truth = ideal_picture(*frame, left_out.model, middle.cache->full_scale(),
                                       middle.cache->blend_space());
  return compare_images(srgb_image(rendered), truth, covered_pixels(rendered)).psnr_db;
}

}  // namespace

double error_at_left_out_cameras(const Method& method, const OptionValues& given,
                                 const ViewRequest& request) {
  constexpr std::size_t kFewest = 4;  // three to blend when one is left out
  const Instant middle = middle_instant(request.instant);
  std::vector<int> present;
  for (const int camera : middle.members) {
    if (middle.is_present(camera)) present.push_back(camera);
  }
  constexpr double kNone = -std::numeric_limits<double>::infinity();
  if (present.size() < kFewest) return kNone;
  const MethodOptions options(method.options, given, method.name);
  double sum = 0;
  int counted = 0;
  for (const int camera : cameras_to_leave_out(middle, present)) {
    const double psnr = error_without(camera, middle, present, method, options, request);
    if (std::isnan(psnr)) continue;  // nothing of it was seen
    sum += psnr;
    ++counted;
  }
  return counted > 0 ? sum / counted : kNone;
}

}  // namespace raystage
