// SPDX-License-Identifier: Apache-2.0
#include "evaluation/region_errors.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include "render/common/image_quality.h"

namespace raystage::evaluation {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

PictureErrors picture_errors(const ComparedView& view, std::span<const std::uint8_t> region) {
  PictureErrors errors;
  std::vector<std::uint8_t> counted(region.begin(), region.end());
  errors.share = static_cast<double>(std::ranges::count(counted, 1)) /
                 static_cast<double>(std::max<std::size_t>(1, counted.size()));
  for (std::size_t i = 0; i < counted.size(); ++i) counted[i] &= view.covered[i];
  errors.psnr_db = render::compare_images(view.image, view.truth, counted).psnr_db;
  errors.ms_ssim = render::multi_scale_ssim(view.image, view.truth, view.covered, counted);
  return errors;
}

/// All values, to compute means of them alike.
constexpr std::array<double RegionErrors::*, 3> kDepthErrors{
    &RegionErrors::bad_depths_half_px, &RegionErrors::bad_depths_1_px, &RegionErrors::plane_rms_px};
constexpr std::array<PictureErrors RegionErrors::*, 2> kPictures{&RegionErrors::edge_band,
                                                                 &RegionErrors::thin};
constexpr std::array<double PictureErrors::*, 3> kPictureErrors{
    &PictureErrors::psnr_db, &PictureErrors::ms_ssim, &PictureErrors::share};

/// Returns the mean of the finite values.
template <class Get>
double mean_of(std::span<const RegionErrors> errors, const Get& get) {
  double sum = 0, count = 0;
  for (const RegionErrors& one : errors) {
    const double value = get(one);
    if (!std::isfinite(value)) continue;
    sum += value;
    ++count;
  }
  return count > 0 ? sum / count : kNaN;
}

}  // namespace

RegionErrors region_errors(const ComparedView& view, const TrueDepths& truth,
                           const TruthRegions& regions) {
  RegionErrors errors;
  errors.edge_band = picture_errors(view, regions.edge_band);
  errors.thin = picture_errors(view, regions.thin);
  double counted = 0, half = 0, one = 0, on_planes = 0, squares = 0;
  const auto disparity = [&](float z) {
    return z > 0 && std::isfinite(z) ? truth.disparity_scale / z : 0.0;
  };
  for (std::size_t i = 0; i < truth.z.size(); ++i) {
    if (view.covered[i] == 0 || !(truth.z[i] > 0)) continue;
    const double error = std::abs(disparity(view.z[i]) - disparity(truth.z[i]));
    ++counted;
    half += error > 0.5 ? 1 : 0;
    one += error > 1 ? 1 : 0;
    if (regions.plane[i] == 0) continue;
    ++on_planes;
    squares += error * error;
  }
  errors.bad_depths_half_px = counted > 0 ? half / counted : kNaN;
  errors.bad_depths_1_px = counted > 0 ? one / counted : kNaN;
  errors.plane_rms_px = on_planes > 0 ? std::sqrt(squares / on_planes) : kNaN;
  return errors;
}

RegionErrors mean_region_errors(std::span<const RegionErrors> errors) {
  RegionErrors mean;
  for (const auto member : kDepthErrors) {
    mean.*member = mean_of(errors, [&](const RegionErrors& one) { return one.*member; });
  }
  for (const auto region : kPictures) {
    for (const auto member : kPictureErrors) {
      (mean.*region).*member =
          mean_of(errors, [&](const RegionErrors& one) { return (one.*region).*member; });
    }
  }
  return mean;
}

}  // namespace raystage::evaluation
