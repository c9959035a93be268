// SPDX-License-Identifier: Apache-2.0
// Matches SIFT features (Lowe 2004) between all pairs of pictures: ratio test in both directions,
// then the fundamental matrix of the pair by RANSAC. A union-find joins matches to points; points
// with two positions in one picture are removed. Output: detections, pixels. Cost: cameras squared
// times features squared.
#include "calibrate/detect/feature_matching.h"

#include <algorithm>
#include <atomic>
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
#include "store/jpeg/decode.h"
#include "store/timeline.h"

namespace raystage::calibrate {
namespace {

struct Picture {
  std::vector<cv::KeyPoint> places;
  cv::Mat descriptors;
};

Picture features_of(const store::Take& take, int camera, int frame, int most) {
  const auto jpeg = take.archive(camera).intact_jpeg(frame);
  if (!jpeg) return {};  // its camera counts as absent
  store::JpegDecoder decoder;
  const std::string& id = take.document().cameras[camera].id;
  store::RgbImage image = decoder.decode(*jpeg, id);
  const cv::Mat rgb(image.height, image.width, CV_8UC3, image.values.data());
  cv::Mat grey;
  cv::cvtColor(rgb, grey, cv::COLOR_RGB2GRAY);
  Picture picture;
  cv::SIFT::create(most)->detectAndCompute(grey, {}, picture.places, picture.descriptors);
  return picture;
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
  cv::findFundamentalMat(from, to, cv::FM_RANSAC, options.max_epipolar_error_px, 0.999, 5000,
                         agrees);
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
  std::vector<Picture> pictures(count);
  parallel_for(std::size_t{0}, count, [&](std::size_t c) {
    step();
    if (frames.frame[c] < 0) return;
    pictures[c] = features_of(take, static_cast<int>(c), frames.frame[c], options.max_features);
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
