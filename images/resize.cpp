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
  const bool shrinks = width <= image.width && height <= image.height;
  cv::resize(from, to, to.size(), 0, 0, shrinks ? cv::INTER_AREA : cv::INTER_LINEAR);
  return result;
}

}  // namespace raystage::images
