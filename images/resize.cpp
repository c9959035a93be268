// SPDX-License-Identifier: Apache-2.0
#include "images/resize.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

namespace raystage::images {

store::RgbImage resize(const store::RgbImage& image, int width, int height) {
  store::RgbImage values = image;  // OpenCV wraps memory that may be written
  const cv::Mat from(image.height, image.width, CV_8UC3, values.values.data());
  store::RgbImage result(width, height);
  cv::Mat to(height, width, CV_8UC3, result.values.data());
  // First what shrinks, then what grows: each direction has its filter.
  const cv::Size smaller(std::min(width, image.width), std::min(height, image.height));
  cv::Mat small = smaller == to.size() ? to : cv::Mat();
  cv::resize(from, small, smaller, 0, 0, cv::INTER_AREA);
  if (smaller != to.size()) cv::resize(small, to, to.size(), 0, 0, cv::INTER_LINEAR);
  return result;
}

}  // namespace raystage::images
