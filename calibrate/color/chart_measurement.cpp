// SPDX-License-Identifier: Apache-2.0
// Detects a ColorChecker Classic with OpenCV's MCC detector and maps its outline to the grid of
// patches by a homography. Averages the linear light over the central half of each patch. A
// detection is accepted if it correlates with the published colours. Output: 24 RGB means per
// camera. Cost: pixels of at most `most_frames` frames per camera.
#include "calibrate/color/chart_measurement.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <opencv2/mcc.hpp>
#include <optional>

#include "base/error.h"
#include "base/parallel.h"
#include "store/processing/frames/corrected_frame.h"

namespace raystage::calibrate {
namespace {

/// Homography from the picture to chart units: a patch is 1 wide, the corner of the first one is
/// (0, 0).
using ChartFromPixel = cv::Matx33d;

constexpr double kPatch = 2.5, kBetween = 0.25;  // of a ColorChecker
constexpr double kPitch = (kPatch + kBetween) / kPatch;

std::optional<ChartFromPixel> found_in(const store::CorrectedFrame& picture) {
  cv::Mat codes, bgr;
  const cv::Mat levels(picture.height, picture.width, CV_16UC4,
                       const_cast<std::uint16_t*>(picture.values.data()));
  levels.convertTo(codes, CV_8UC4, 1 / 257.0);
  cv::cvtColor(codes, bgr, cv::COLOR_RGBA2BGR);
  const auto detector = cv::mcc::CCheckerDetector::create();
  try {
    if (!detector->process(bgr, cv::mcc::MCC24, 1)) return std::nullopt;
  } catch (const cv::Exception&) {
    return std::nullopt;  // the detector misses candidates
  }
  const std::vector<cv::Point2f> box = detector->getBestColorChecker()->getBox();
  if (box.size() != 4) return std::nullopt;
  // The box encloses the outermost patches and a margin as wide as the gap between two patches.
  const float left = static_cast<float>(-kBetween / kPatch);
  const auto right = static_cast<float>(rig::kChartColumns * kPitch);
  const auto bottom = static_cast<float>(rig::kChartRows * kPitch);
  const std::vector<cv::Point2f> chart{
      {left, left}, {right, left}, {right, bottom}, {left, bottom}};
  return ChartFromPixel(cv::getPerspectiveTransform(box, chart));
}

struct Sums {
  std::array<schemas::Rgb, rig::kChartPatches> light{};
  std::array<double, rig::kChartPatches> x{}, y{}, count{}, unexposed{};
};

/// Returns sums over the central part of every patch, half as wide and high.
Sums sums_over(const store::CorrectedFrame& picture, const ChartFromPixel& chart_from_pixel,
               const std::array<std::uint16_t, 3>& black,
               const std::array<std::uint16_t, 3>& full) {
  Sums sums;
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x) {
      const cv::Vec3d at = chart_from_pixel * cv::Vec3d(x, y, 1);  // OpenCV's pixel coordinates
      const double u = at[0] / at[2] / kPitch, v = at[1] / at[2] / kPitch;
      const double column = std::floor(u), row = std::floor(v);
      if (!(column >= 0 && row >= 0 && column < rig::kChartColumns && row < rig::kChartRows))
        continue;
      const auto is_inside = [](double part) {
        return part * kPitch > 0.25 && part * kPitch < 0.75;
      };
      if (!is_inside(u - column) || !is_inside(v - row)) continue;
      const auto patch = static_cast<std::size_t>(row * rig::kChartColumns + column);
      const auto rgb = picture.pixel(x, y);
      bool is_exposed = true;
      for (std::size_t c = 0; c < 3; ++c) {
        sums.light[patch][c] += rgb[c] / 65535.0;
        is_exposed = is_exposed && rgb[c] >= black[c] && rgb[c] < full[c];
      }
      sums.unexposed[patch] += is_exposed ? 0 : 1;
      sums.x[patch] += x + 0.5;
      sums.y[patch] += y + 0.5;
      sums.count[patch] += 1;
    }
  }
  return sums;
}

/// Returns whether a detection has the colours of a chart, by correlation with them.
bool looks_like_a_chart(const std::array<schemas::Rgb, rig::kChartPatches>& light) {
  constexpr double kMin = 0.8;
  const rig::PatchColors known = rig::color_checker_reference();
  double x = 0, y = 0, xx = 0, yy = 0, xy = 0;
  constexpr double kCount = 3.0 * rig::kChartPatches;
  for (std::size_t p = 0; p < rig::kChartPatches; ++p) {
    for (std::size_t c = 0; c < 3; ++c) {
      const double a = std::sqrt(std::max(0.0, known[p][c])),
                   b = std::sqrt(std::max(0.0, light[p][c]));
      x += a / kCount;
      y += b / kCount;
      xx += a * a / kCount;
      yy += b * b / kCount;
      xy += a * b / kCount;
    }
  }
  const double spread = (xx - x * x) * (yy - y * y);
  return spread > 0 && (xy - x * y) / std::sqrt(spread) > kMin;
}

}  // namespace

ChartMeasurement measure_chart(const store::Take& take, int camera,
                               const schemas::PhotometricResponse& of, int most_frames,
                               const std::stop_token& stop) {
  const schemas::PhotometricResponse response = store::curve_and_hot_pixels_only(of);
  const rig::CameraModel& model = take.rig().cameras[camera].model;
  const rig::PictureSize size{model.width(), model.height()};
  const auto frames = static_cast<int>(take.archive(camera).frames().size());
  const store::CodeScale linear{store::BlendSpace::kLinear, 1};
  const auto black = store::levels_from_code(take, response, linear, 1);  // above clipped codes
  const auto full = store::levels_from_code(take, response, linear, store::kMaxUnclippedCode);
  constexpr double kMinPixels = 4, kMaxUnexposed = 0.02;
  ChartMeasurement measurement;
  const int looked_at = std::min(frames, most_frames);
  for (int k = 0; k < looked_at; ++k) {
    if (stop.stop_requested()) {
      throw Error::failed("the detection of the chart was stopped", take.folder().string(),
                          "Start it again");
    }
    const int frame = (2 * k + 1) * frames / (2 * looked_at);
    if (!take.archive(camera).intact_jpeg(frame)) continue;  // rotten
    const auto found =
        found_in(store::decode_corrected_frame(take, camera, frame, size, response, {}));
    if (!found) continue;
    const store::CorrectedFrame picture =
        store::decode_corrected_frame(take, camera, frame, size, response, linear);
    const Sums sums = sums_over(picture, *found, black, full);
    if (std::ranges::min(sums.count) < kMinPixels) continue;
    std::array<schemas::Rgb, rig::kChartPatches> light = sums.light;
    for (std::size_t p = 0; p < light.size(); ++p) {
      for (double& channel : light[p]) channel /= sums.count[p];
    }
    if (!looks_like_a_chart(light)) continue;
    measurement.size = {picture.width, picture.height};
    ++measurement.frames;
    for (std::size_t p = 0; p < light.size(); ++p) {
      ChartMeasurement::Patch& patch = measurement.patches[p];
      for (std::size_t c = 0; c < 3; ++c) patch.measured[c] += light[p][c];
      patch.x += sums.x[p] / sums.count[p];
      patch.y += sums.y[p] / sums.count[p];
      patch.is_exposed = patch.is_exposed && sums.unexposed[p] <= kMaxUnexposed * sums.count[p];
    }
  }
  for (ChartMeasurement::Patch& patch : measurement.patches) {
    const double count = std::max(1, measurement.frames);
    for (double& channel : patch.measured) channel /= count;
    patch.x /= count;
    patch.y /= count;
  }
  return measurement;
}

std::vector<ChartMeasurement> measure_charts(
    const store::Take& take, const std::vector<schemas::PhotometricResponse>& responses,
    const std::stop_token& stop) {
  std::vector<ChartMeasurement> measurements(responses.size());
  parallel_for(std::size_t{0}, measurements.size(), [&](std::size_t camera) {
    measurements[camera] =
        measure_chart(take, static_cast<int>(camera), responses[camera], kMostChartFrames, stop);
  });
  return measurements;
}

}  // namespace raystage::calibrate
