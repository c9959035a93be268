// SPDX-License-Identifier: Apache-2.0
// Matches SIFT features (Lowe 2004) between all pairs of pictures: ratio test in both directions,
// then the fundamental matrix of the pair by RANSAC; of fisheyes, that of views by pinholes. A
// union-find joins matches to points; points with two positions in one picture are removed. Output:
// detections, pixels. Cost: cameras squared times features squared.
#include "calibrate/detect/feature_matching.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <map>
#include <numeric>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>
#include <set>

#include "base/error.h"
#include "base/options.h"
#include "base/parallel.h"
#include "calibrate/detect/point_tracks.h"
#include "calibrate/geometry/ray_view.h"
#include "store/jpeg/decode.h"
#include "store/timeline.h"

namespace raystage::calibrate {
namespace {

struct Picture {
  rig::CameraModel lens;
  std::vector<cv::KeyPoint> places = {};
  cv::Mat descriptors = {};

  /// Returns the ray of a feature, if there is one.
  std::optional<Eigen::Vector3d> ray(int feature) const {
    const cv::Point2f& place = places[static_cast<std::size_t>(feature)].pt;
    return lens.unproject({place.x + 0.5, place.y + 0.5});  // OpenCV's centres are at integers
  }
};

void find_features(const store::Take& take, int camera, int frame, int most, Picture& picture) {
  const auto jpeg = take.archive(camera).intact_jpeg(frame);
  if (!jpeg) return;  // its camera counts as absent
  store::JpegDecoder decoder;
  const std::string& id = take.document().cameras[camera].id;
  store::RgbImage image = decoder.decode(*jpeg, id);
  const cv::Mat rgb(image.height, image.width, CV_8UC3, image.values.data());
  cv::Mat grey;
  cv::cvtColor(rgb, grey, cv::COLOR_RGB2GRAY);
  cv::SIFT::create(most)->detectAndCompute(grey, {}, picture.places, picture.descriptors);
}

/// Returns for each feature of the first picture its match in the second, or -1 if none passes the
/// ratio test.
std::vector<int> nearest_matches(const Picture& from, const Picture& to, double max_ratio) {
  std::vector<int> matches(from.places.size(), -1);
  if (from.places.empty() || to.places.size() < 2) return matches;
  std::vector<std::vector<cv::DMatch>> nearest;
  cv::BFMatcher(cv::NORM_L2).knnMatch(from.descriptors, to.descriptors, nearest, 2);
  for (const auto& two : nearest) {
    if (two.size() == 2 && two[0].distance < max_ratio * two[1].distance) {
      matches[two[0].queryIdx] = two[0].trainIdx;
    }
  }
  return matches;
}

using Matches = std::vector<std::pair<int, int>>;

/// Returns which matches of rays fit one epipolar geometry. RANSAC uses those near the mean
/// direction, in views by pinholes; all are then tested by their angles to the epipolar planes.
std::vector<unsigned char> fitting_rays(const Matches& matches, const Picture& a, const Picture& b,
                                        double max_error_px) {
  using Eigen::Vector3d;
  std::vector<unsigned char> agrees(matches.size(), 0);
  std::vector<Vector3d> from_rays, to_rays;
  std::vector<std::size_t> of_rays;
  for (std::size_t i = 0; i < matches.size(); ++i) {
    const auto from = a.ray(matches[i].first), to = b.ray(matches[i].second);
    if (!from || !to) continue;
    from_rays.push_back(from->normalized());
    to_rays.push_back(to->normalized());
    of_rays.push_back(i);
  }
  const RayView from_view(a.lens, from_rays), to_view(b.lens, to_rays);
  const double from_focal = a.lens.intrinsics().fx, to_focal = b.lens.intrinsics().fx;
  std::vector<cv::Point2d> from, to;
  for (std::size_t k = 0; k < of_rays.size(); ++k) {
    const auto from_point = from_view.point(from_rays[k]), to_point = to_view.point(to_rays[k]);
    if (!from_point || !to_point) continue;
    from.emplace_back(from_focal * from_point->x(), from_focal * from_point->y());
    to.emplace_back(to_focal * to_point->x(), to_focal * to_point->y());
  }
  constexpr std::size_t kLeast = 8;
  if (from.size() < kLeast) return agrees;
  const cv::Mat found =
      cv::findFundamentalMat(from, to, cv::FM_RANSAC, max_error_px, 0.999, 5000, cv::noArray());
  if (found.rows != 3) return agrees;
  Eigen::Matrix3d fundamental;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      fundamental(row, column) = found.at<double>(row, column);
    }
  }
  // Rays in the axes of the views (y down, z ahead), in pixels per radian of each camera.
  const Vector3d to_opencv(1, -1, -1);
  const Eigen::Matrix3d of_rays_matrix = Vector3d(to_focal, to_focal, 1).asDiagonal() *
                                         fundamental *
                                         Vector3d(from_focal, from_focal, 1).asDiagonal();
  const auto error_px = [](const Vector3d& normal, const Vector3d& ray, double focal) {
    return focal * std::asin(std::min(1.0, std::abs(normal.normalized().dot(ray))));
  };
  for (std::size_t k = 0; k < of_rays.size(); ++k) {
    const Vector3d one =
        to_opencv.cwiseProduct(from_view.camera_from_view().transpose() * from_rays[k]);
    const Vector3d other =
        to_opencv.cwiseProduct(to_view.camera_from_view().transpose() * to_rays[k]);
    const bool fits = error_px(of_rays_matrix * one, other, to_focal) <= max_error_px &&
                      error_px(of_rays_matrix.transpose() * other, one, from_focal) <= max_error_px;
    agrees[of_rays[k]] = fits ? 1 : 0;
  }
  return agrees;
}

/// Returns the mutual matches that fit one epipolar geometry.
Matches matches_between(const Picture& a, const Picture& b, const FeatureMatchingOptions& options) {
  const std::vector<int> there = nearest_matches(a, b, options.max_ratio);
  const std::vector<int> back = nearest_matches(b, a, options.max_ratio);
  Matches matches;
  std::vector<cv::Point2f> from, to;
  for (std::size_t i = 0; i < there.size(); ++i) {
    if (there[i] < 0 || back[there[i]] != static_cast<int>(i)) continue;
    matches.emplace_back(static_cast<int>(i), there[i]);
    from.push_back(a.places[i].pt);
    to.push_back(b.places[there[i]].pt);
  }
  constexpr std::size_t kMin = 20;  // fewer fit any geometry
  if (matches.size() < kMin) return {};
  cv::setRNGSeed(1);
  std::vector<unsigned char> agrees;
  if (a.lens.fisheye() != nullptr || b.lens.fisheye() != nullptr) {
    agrees = fitting_rays(matches, a, b, options.max_epipolar_error_px);
  } else {
    cv::findFundamentalMat(from, to, cv::FM_RANSAC, options.max_epipolar_error_px, 0.999, 5000,
                           agrees);
  }
  Matches kept;
  for (std::size_t i = 0; i < agrees.size(); ++i) {
    if (agrees[i] != 0) kept.push_back(matches[i]);
  }
  if (kept.size() < kMin) kept.clear();
  return kept;
}

/// Union-find over the features of all pictures.
class Joined {
 public:
  explicit Joined(std::size_t count) : parent_(count) {
    std::iota(parent_.begin(), parent_.end(), std::size_t{0});
  }
  std::size_t root(std::size_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void join(std::size_t a, std::size_t b) { parent_[root(a)] = root(b); }

 private:
  std::vector<std::size_t> parent_;
};

using Point = std::vector<std::pair<int, int>>;  // camera, feature

/// Returns the points with one position per picture, those with the most cameras first.
std::vector<Point> points_of(Joined& joined, const std::vector<Picture>& pictures,
                             const FeatureMatchingOptions& options, int cameras) {
  std::map<std::size_t, Point> by_root;
  std::size_t index = 0;
  for (std::size_t c = 0; c < pictures.size(); ++c) {
    for (std::size_t i = 0; i < pictures[c].places.size(); ++i, ++index) {
      by_root[joined.root(index)].emplace_back(static_cast<int>(c), static_cast<int>(i));
    }
  }
  const auto least = static_cast<std::size_t>(std::min(options.min_cameras, cameras));
  std::vector<Point> points;
  for (const auto& [root, point] : by_root) {
    std::set<int> seen_by;
    for (const auto& [camera, feature] : point) seen_by.insert(camera);
    if (point.size() >= least && seen_by.size() == point.size()) points.push_back(point);
  }
  std::ranges::stable_sort(points, std::greater<>(), [](const Point& p) { return p.size(); });
  if (points.size() > static_cast<std::size_t>(options.max_points)) {
    points.resize(options.max_points);
  }
  return points;
}

}  // namespace

bool FeatureMatchingOptions::is_valid(std::string* reason) const {
  return is_within("features of a picture", max_features, 1, 1e6, reason) &&
         is_within("ratio of distances", max_ratio, 0, 1, reason) &&
         is_within("epipolar error (pixels)", max_epipolar_error_px, 0, 1e6, reason) &&
         is_within("cameras of a point", min_cameras, 2, 10000, reason) &&
         is_within("points", max_points, 1, 1e9, reason);
}

Detections match_features(const store::Take& take, Nanoseconds time, Nanoseconds tolerance,
                          const FeatureMatchingOptions& options,
                          const std::function<void(double)>& progress,
                          const std::stop_token& stop) {
  require_valid(options, "matching of features");
  const store::FrameSelection frames = store::select_frames(take, time, tolerance);
  if (frames.present() < 2) {
    throw Error::bad_input("fewer than two cameras have a frame at that time",
                           take.folder().string(), "Choose a time within the take")
        .concerning({"time"});
  }
  const auto count = static_cast<std::size_t>(take.camera_count());
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  for (std::size_t a = 0; a < count; ++a) {
    for (std::size_t b = a + 1; b < count; ++b) pairs.emplace_back(a, b);
  }
  std::atomic<std::size_t> done = 0;
  const auto step = [&] {
    if (stop.stop_requested()) {
      throw Error::failed("the detection of features was stopped", take.folder().string(),
                          "Start it again");
    }
    progress(static_cast<double>(++done) / (count + pairs.size()));
  };
  std::vector<Picture> pictures;
  for (std::size_t c = 0; c < count; ++c) {
    const rig::CameraModel& recorded = take.rig().cameras[c].model;
    pictures.push_back({options.lenses.empty() ? recorded
                                               : rig::CameraModel({take.document().cameras[c].id,
                                                                   recorded.width(),
                                                                   recorded.height(),
                                                                   options.lenses[c],
                                                                   {},
                                                                   {},
                                                                   {}})});
  }
  parallel_for(std::size_t{0}, count, [&](std::size_t c) {
    step();
    if (frames.frame[c] < 0) return;
    find_features(take, static_cast<int>(c), frames.frame[c], options.max_features, pictures[c]);
  });
  std::vector<Matches> matches(pairs.size());
  parallel_for(std::size_t{0}, pairs.size(), [&](std::size_t k) {
    step();
    matches[k] = matches_between(pictures[pairs[k].first], pictures[pairs[k].second], options);
  });
  std::vector<std::size_t> first(count + 1, 0);  // index of each picture's first feature
  for (std::size_t c = 0; c < count; ++c) first[c + 1] = first[c] + pictures[c].places.size();
  Joined joined(first[count]);
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    for (const auto& [a, b] : matches[k]) {
      joined.join(first[pairs[k].first] + static_cast<std::size_t>(a),
                  first[pairs[k].second] + static_cast<std::size_t>(b));
    }
  }
  Detections detections{detection_cameras(take), {}};
  int number = 0;
  for (const Point& point : points_of(joined, pictures, options, frames.present())) {
    for (const auto& [camera, feature] : point) {
      const cv::Point2f& place = pictures[camera].places[feature].pt;
      // OpenCV's pixel centres are at integers.
      detections.detections.push_back({camera, number, {place.x + 0.5, place.y + 0.5}});
    }
    ++number;
  }
  return detections;
}

}  // namespace raystage::calibrate
