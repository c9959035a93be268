// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/opencv_focal_plane.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "base/transfer_function.h"
#include "render/common/ray_cells.h"
#include "render/common/world_ray.h"
#include "store/jpeg/decode.h"

namespace raystage {
namespace {

/// Returns where each pixel's ray crosses the array, in the plane z = 0: x and y, metres.
std::pair<cv::Mat, cv::Mat> crossings(const render::VirtualCamera& view) {
  const Eigen::Matrix3d ray_from_pixel = render::world_ray_from_pixel(view);
  const Eigen::Vector3d& eye = view.pose.position;
  std::pair<cv::Mat, cv::Mat> at{cv::Mat(view.height, view.width, CV_32F),
                                 cv::Mat(view.height, view.width, CV_32F)};
  for (int y = 0; y < view.height; ++y) {
    for (int x = 0; x < view.width; ++x) {
      const Eigen::Vector3d ray = ray_from_pixel * Eigen::Vector3d(x + 0.5, y + 0.5, 1);
      const double t = -eye.z() / ray.z();
      at.first.at<float>(y, x) = static_cast<float>(eye.x() + t * ray.x());
      at.second.at<float>(y, x) = static_cast<float>(eye.y() + t * ray.y());
    }
  }
  return at;
}

}  // namespace

OpenCvFocalPlane::OpenCvFocalPlane(const store::Take& take) : take_(take) {
  store::JpegDecoder decoder;
  for (int i = 0; i < take.camera_count(); ++i) {
    const store::RgbImage image = decoder.decode(take.archive(i).jpeg(0), "frame");
    cv::Mat linear(image.height, image.width, CV_32FC3);
    for (int p = 0; p < image.width * image.height; ++p) {
      auto& pixel = linear.at<cv::Vec3f>(p / image.width, p % image.width);
      for (int c = 0; c < 3; ++c) {
        const auto code = image.values[3 * p + c];
        pixel[c] = static_cast<float>(linear_from_srgb(code / 255.0));
      }
    }
    images_.push_back(linear);
  }
  std::vector<int> all;
  for (int i = 0; i < take.camera_count(); ++i) all.push_back(i);
  topology_ = rig::make_topology(take.rig(), all);
}

cv::Mat OpenCvFocalPlane::render(const render::VirtualCamera& view, const Eigen::Vector4d& plane,
                                 bool crop) const {
  std::vector<cv::Mat> weights = draw_weights(view);
  const render::PlaneProjection projection(view, plane);
  cv::Mat sum = cv::Mat::zeros(view.height, view.width, CV_32FC3);
  cv::Mat warped, weight3;
  for (std::size_t i = 0; i < images_.size(); ++i) {
    if (weights[i].empty()) continue;
    cv::Rect region(0, 0, view.width, view.height);
    if (crop) region = cv::boundingRect(cv::Mat(weights[i] > 0));
    if (region.empty()) continue;
    const cv::Mat homography = source_from_view(projection, i, region);
    cv::warpPerspective(images_[i], warped, homography, region.size(),
                        cv::INTER_LINEAR | cv::WARP_INVERSE_MAP, cv::BORDER_CONSTANT);
    cv::merge(std::vector<cv::Mat>(3, weights[i](region)), weight3);
    cv::Mat target = sum(region);
    cv::accumulateProduct(warped, weight3, target);
  }
  return sum;
}

cv::Mat OpenCvFocalPlane::render_aperture(const render::VirtualCamera& view,
                                          const Eigen::Vector4d& plane, double radius) const {
  const render::PlaneProjection projection(view, plane);
  const cv::Rect whole(0, 0, view.width, view.height);
  const auto [right, up] = crossings(view);
  double left_most = 0, right_most = 0, lowest = 0, highest = 0;
  cv::minMaxLoc(right, &left_most, &right_most);
  cv::minMaxLoc(up, &lowest, &highest);
  cv::Mat sum = cv::Mat::zeros(view.height, view.width, CV_32FC3);
  cv::Mat weights = cv::Mat::zeros(view.height, view.width, CV_32F);
  cv::Mat weight(view.height, view.width, CV_32F), warped, weight3;
  const auto per_square = static_cast<float>(1 / (radius * radius));
  for (std::size_t i = 0; i < images_.size(); ++i) {
    const Eigen::Vector3d& at = take_.rig().cameras[i].pose.position;
    const double beside = at.x() - std::clamp(at.x(), left_most, right_most);
    const double above = at.y() - std::clamp(at.y(), lowest, highest);
    if (beside * beside + above * above >= radius * radius) continue;
    const auto x0 = static_cast<float>(at.x()), y0 = static_cast<float>(at.y());
    for (int y = 0; y < view.height; ++y) {
      const auto* x_row = right.ptr<float>(y);
      const auto* y_row = up.ptr<float>(y);
      auto* row = weight.ptr<float>(y);
      for (int x = 0; x < view.width; ++x) {
        const float dx = x_row[x] - x0, dy = y_row[x] - y0;
        const float inside = std::max(0.0F, 1 - (dx * dx + dy * dy) * per_square);
        row[x] = inside * inside * (3 - 2 * inside);
      }
    }
    cv::warpPerspective(images_[i], warped, source_from_view(projection, i, whole), whole.size(),
                        cv::INTER_LINEAR | cv::WARP_INVERSE_MAP, cv::BORDER_CONSTANT);
    cv::merge(std::vector<cv::Mat>(3, weight), weight3);
    cv::accumulateProduct(warped, weight3, sum);
    cv::accumulate(weight, weights);
  }
  cv::merge(std::vector<cv::Mat>(3, weights), weight3);
  cv::divide(sum, weight3, sum);
  return sum;
}

cv::Mat OpenCvFocalPlane::source_from_view(const render::PlaneProjection& projection,
                                           std::size_t camera, const cv::Rect& region) const {
  const rig::Rig::Camera& source = take_.rig().cameras[camera];
  const schemas::Intrinsics& k = source.model.intrinsics();
  Eigen::Matrix3d calibration;  // pixel centres at integers, as in OpenCV
  calibration << k.fx, 0, k.cx - 0.5, 0, k.fy, k.cy - 0.5, 0, 0, 1;
  Eigen::Matrix3d offset = Eigen::Matrix3d::Identity();
  offset(0, 2) = region.x + 0.5;
  offset(1, 2) = region.y + 0.5;
  const Eigen::Matrix3d h = calibration * projection.ideal_from_pixel(source.pose) * offset;
  cv::Mat out(3, 3, CV_64F);
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) out.at<double>(r, c) = h(r, c);
  }
  return out;
}

std::vector<cv::Mat> OpenCvFocalPlane::draw_weights(const render::VirtualCamera& view) const {
  std::vector<cv::Mat> weights(images_.size());
  const render::RayCells cells(view, take_.rig(), topology_);
  std::vector<int> scratch;
  std::vector<render::RayCells::Span> spans;
  for (int y = 0; y < view.height; ++y) {
    cells.row_spans(y, view.width, scratch, spans);
    for (const render::RayCells::Span& span : spans) {
      const auto& cell = cells.cells()[span.cell];
      for (std::size_t c = 0; c < 3; ++c) {
        cv::Mat& weight = weights[cell.camera[c]];
        if (weight.empty()) weight = cv::Mat::zeros(view.height, view.width, CV_32F);
        auto* row = weight.ptr<float>(y);
        const double total_y = cell.total.y() * (y + 0.5) + cell.total.z();
        const double share_y = cell.share[c].y() * (y + 0.5) + cell.share[c].z();
        for (int x = span.begin; x < span.end; ++x) {
          row[x] = static_cast<float>((cell.share[c].x() * (x + 0.5) + share_y) /
                                      (cell.total.x() * (x + 0.5) + total_y));
        }
      }
    }
  }
  return weights;
}

}  // namespace raystage
