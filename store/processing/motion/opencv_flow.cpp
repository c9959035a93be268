// SPDX-License-Identifier: Apache-2.0
// Computes dense optical flow between two frames of one camera by DIS (Kroeger et al., ECCV 2016)
// at full resolution: 8x8 patches every 4 pixels, 16 descent iterations, no variational refinement.
// A 5x5 median filter removes outliers. Input: 8-bit luma, 0.30 R + 0.59 G + 0.11 B. Output: a
// displacement in pixels for each pixel. docs/resync.md has cost and accuracy.
#include "store/processing/motion/opencv_flow.h"

#include <algorithm>
#include <array>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

#include "base/error.h"

namespace raystage::store {
namespace {

constexpr int kMinSide = 12;     // pixels; DIS cannot build a pyramid below
constexpr int kMaxSide = 32766;  // pixels; OpenCV cannot remap larger images

// Returns luma as a matrix without a copy. cv::Mat has no const data; these matrices are only read.
cv::Mat matrix_of(const Luma& luma) {
  return {luma.height, luma.width, CV_8UC1, const_cast<std::uint8_t*>(luma.values.data())};
}

class InverseSearchFlow final : public FlowAlgorithm {
 public:
  // Finest scale, no variational refinement: docs/resync.md has cost and accuracy of other
  // settings.
  InverseSearchFlow() {
    flow_->setFinestScale(0);
    flow_->setPatchSize(8);
    flow_->setPatchStride(4);
    flow_->setGradientDescentIterations(16);
    flow_->setVariationalRefinementIterations(0);
  }

  FlowField estimate(const Luma& from, const Luma& to) override {
    const int width = from.width, height = from.height;
    if (to.width != width || to.height != height) {
      throw Error::bad_input(
          "two frames of one camera differ in size", "optical flow",
          "Verify the take; use its recorded frames (time \"tick\") until it is repaired");
    }
    if (std::max(width, height) > kMaxSide) {
      throw Error::bad_input(
          "optical flow does not support frames wider or higher than 32766 pixels", "optical flow",
          "Use the recorded frames: time \"tick\" of a layer, or sync --retime nearest")
          .concerning({"retime"});
    }
    FlowField field(width, height);
    if (std::min(width, height) < kMinSide) return field;
    cv::Mat shift(height, width, CV_32FC2, field.values.data());
    flow_->calc(matrix_of(from), matrix_of(to), shift);
    if (shift.data != reinterpret_cast<unsigned char*>(field.values.data())) {
      throw Error::failed("OpenCV did not write the flow to the given memory", "optical flow",
                          "Report this as a bug");
    }
    median_filter_flow(field);
    return field;
  }

 private:
  cv::Ptr<cv::DISOpticalFlow> flow_ = cv::DISOpticalFlow::create();
};

}  // namespace

void median_filter_flow(FlowField& field) {
  constexpr int kMedian = 5;  // pixels per side
  cv::Mat both(field.height, field.width, CV_32FC2, field.values.data());
  std::array<cv::Mat, 2> parts;
  cv::split(both, parts.data());
  for (cv::Mat& part : parts) cv::medianBlur(part, part, kMedian);
  cv::merge(parts.data(), parts.size(), both);
}

std::unique_ptr<FlowAlgorithm> make_opencv_flow() { return std::make_unique<InverseSearchFlow>(); }

}  // namespace raystage::store
