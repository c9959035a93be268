// SPDX-License-Identifier: Apache-2.0
#include "store/processing/retime/motion.h"

#include <algorithm>
#include <array>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>
#include <utility>

#include "base/error.h"

namespace raystage {
namespace {

constexpr int kSmallest = 12;    // below, DIS has no pyramid
constexpr int kLargest = 32766;  // above, OpenCV cannot look pictures up

// OpenCV's matrices do not know const; the ones made here are only read.
cv::Mat luma_of(const Picture& picture) {
  return {picture.rgb.height, picture.rgb.width, CV_8UC1,
          const_cast<std::uint8_t*>(picture.luma.data())};
}

}  // namespace

Picture picture_of(RgbImage image) {
  Picture picture;
  picture.luma.resize(image.pixels.size() / 3);
  for (std::size_t i = 0; i < picture.luma.size(); ++i) {
    const std::uint8_t* p = &image.pixels[3 * i];
    picture.luma[i] = static_cast<std::uint8_t>((77 * p[0] + 150 * p[1] + 29 * p[2] + 128) >> 8);
  }
  picture.rgb = std::move(image);
  return picture;
}

void take_median_shifts(std::vector<Shift>& shift, int width, int height) {
  constexpr int kMedian = 5;  // pixels a side
  cv::Mat field(height, width, CV_32FC2, shift.data());
  std::array<cv::Mat, 2> parts;
  cv::split(field, parts.data());
  for (cv::Mat& part : parts) cv::medianBlur(part, part, kMedian);
  cv::merge(parts.data(), parts.size(), field);
}

struct MotionEstimator::State {
  // Down to the finest scale, without the variational refinement: docs/resync.md has what the other
  // settings cost and gain.
  State() {
    flow->setFinestScale(0);
    flow->setPatchSize(8);
    flow->setPatchStride(4);
    flow->setGradientDescentIterations(16);
    flow->setVariationalRefinementIterations(0);
  }
  cv::Ptr<cv::DISOpticalFlow> flow = cv::DISOpticalFlow::create();
};

MotionEstimator::MotionEstimator() : state_(std::make_unique<State>()) {}
MotionEstimator::~MotionEstimator() = default;
MotionEstimator::MotionEstimator(MotionEstimator&&) noexcept = default;
MotionEstimator& MotionEstimator::operator=(MotionEstimator&&) noexcept = default;

MotionField MotionEstimator::estimate(const Picture& from, const Picture& to) {
  const int width = from.rgb.width, height = from.rgb.height;
  if (to.rgb.width != width || to.rgb.height != height) {
    throw Error::bad_input("two pictures of one camera differ in size", "retiming",
                           "Verify the take, and decode its frames meanwhile");
  }
  if (std::max(width, height) > kLargest) {
    throw Error::bad_input("pictures of more than 32766 pixels in width or height cannot be moved",
                           "retiming", "Retime to the nearest frame, or blend")
        .concerning({"retime"});
  }
  MotionField field{width, height, std::vector<Shift>(from.luma.size())};
  if (std::min(width, height) < kSmallest) return field;
  cv::Mat shift(height, width, CV_32FC2, field.shift.data());
  state_->flow->calc(luma_of(from), luma_of(to), shift);
  if (shift.data != reinterpret_cast<unsigned char*>(field.shift.data())) {
    throw Error::failed("OpenCV wrote the motion elsewhere", "retiming", "Report this");
  }
  take_median_shifts(field.shift, width, height);
  return field;
}

void use_one_opencv_thread() { cv::setNumThreads(1); }

}  // namespace raystage
