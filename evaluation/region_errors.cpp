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
constexpr std::array<double RegionErrors::*, 5> kDepthErrors{
    &RegionErrors::bad_depths_half_px, &RegionErrors::bad_depths_1_px, &RegionErrors::plane_rms_px,
    &RegionErrors::edge_alpha, &RegionErrors::edge_alpha_gradient};
constexpr std::array<PictureErrors RegionErrors::*, 2> kPictures{&RegionErrors::edge_band,
                                                                 &RegionErrors::thin};
constexpr std::array<double PictureErrors::*, 3> kPictureErrors{
    &PictureErrors::psnr_db, &PictureErrors::ms_ssim, &PictureErrors::share};

/// The surfaces of a pixel, in pixels of disparity.
struct Surfaces {
  double front_share = 1, front = 0, behind = 0;

  bool are_two() const { return front_share > 0 && front_share < 1 && front - behind > 1; }
  /// Returns the share of the pixel that is nearer than a disparity.
  double share_before(double disparity) const {
    return (front > disparity ? front_share : 0) + (behind > disparity ? 1 - front_share : 0);
  }
};

/// Alpha of rendered and true surfaces at edges.
class AlphaErrors {
 public:
  AlphaErrors(const ComparedView& view, const TrueDepths& truth,
              std::span<const TrueSurfaces> surfaces)
      : view_(view), width_(truth.width), height_(truth.height) {
    const auto disparity = [&](float z) {
      return z > 0 && std::isfinite(z) ? truth.disparity_scale / z : 0.0;
    };
    for (std::size_t i = 0; i < surfaces.size(); ++i) {
      truth_.push_back({surfaces[i].front_share, disparity(surfaces[i].front_z),
                        disparity(surfaces[i].behind_z)});
      rendered_.push_back({1, disparity(view.z[i]), 0});
    }
    for (const render::EdgePixel& edge : view.edges) {
      rendered_[edge.pixel] = {edge.front[3], disparity(edge.front_z), disparity(edge.behind_z)};
    }
  }

  void measure(RegionErrors& errors) const {
    double count = 0, error = 0, gradient = 0;
    for (int y = 1; !truth_.empty() && y + 1 < height_; ++y) {
      for (int x = 1; x + 1 < width_; ++x) {
        const std::size_t i = at(x, y);
        if (view_.covered[i] == 0 || !truth_[i].are_two()) continue;
        const double border = (truth_[i].front + truth_[i].behind) / 2;
        const auto of = [&](int column, int row) {
          const std::size_t there = at(column, row);
          if (truth_[there].front_share == 0) return 0.0;  // unknown
          return rendered_[there].share_before(border) - truth_[there].share_before(border);
        };
        ++count;
        error += std::abs(of(x, y));
        gradient += std::hypot(of(x + 1, y) - of(x - 1, y), of(x, y + 1) - of(x, y - 1)) / 2;
      }
    }
    errors.edge_alpha = count > 0 ? error / count : kNaN;
    errors.edge_alpha_gradient = count > 0 ? gradient / count : kNaN;
  }

 private:
  std::size_t at(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) +
           static_cast<std::size_t>(x);
  }

  const ComparedView& view_;
  int width_, height_;
  std::vector<Surfaces> truth_, rendered_;
};

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
                           const TruthRegions& regions, std::span<const TrueSurfaces> surfaces) {
  RegionErrors errors;
  AlphaErrors(view, truth, surfaces).measure(errors);
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
