// SPDX-License-Identifier: Apache-2.0
// Measures plane_sweep against the same in OpenCV: 96 planes, 4 cameras, 5x5 box, best plane,
// blend. Take: $RAYSTAGE_BENCH_TAKE; by default 4x4 cameras of 960x640 in front of a painted plane.
#include <benchmark/benchmark.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "base/transfer_function.h"
#include "render/common/blending_field.h"
#include "render/common/plane_projection.h"
#include "render/renderer.h"
#include "store/jpeg/decode.h"
#include "tests/bench/bench_take.h"
#include "tests/bench/run_benchmarks.h"

namespace raystage {
namespace {

constexpr int kWidth = 960, kHeight = 640, kPlanes = 96;
constexpr double kTruncation = 40;

const store::Take& take() {
  static const BenchTake opened("RAYSTAGE_BENCH_TAKE", make_painted_rig(4, 4));
  return opened.take();
}

/// Returns a view in the centre of the four middle cameras, which contribute equally to every ray.
render::VirtualCamera middle_view() {
  rig::Pose pose;
  pose.position = take().rig().centre();
  return render::virtual_camera_with_fov(kWidth, kHeight, 50 * std::numbers::pi / 180, pose);
}

render::ReconstructionOptions sweep(schemas::OptionValues options) {
  options["planes"] = static_cast<double>(kPlanes);
  return {"plane_sweep", {0, 0, 0, 1}, std::move(options)};
}

schemas::OptionValues as_opencv() {
  return {{"aggregation", std::string("box")},
          {"interpolation", std::string("linear")},
          {"subplane_refinement", false}};
}

render::RenderedView render(const render::LightFieldRenderer& renderer,
                            const schemas::OptionValues& options) {
  return renderer.render(middle_view(), store::select_frames(take(), 0, kNanosecondsPerSecond),
                         sweep(options));
}

/// The OpenCV version: warps every camera onto every plane.
class OpenCvSweep {
 public:
  OpenCvSweep() {
    const rig::Rig& rig = take().rig();
    const render::VirtualCamera view = middle_view();
    const schemas::DepthRange scene = *take().document().depth_range;
    std::vector<int> all;
    for (int i = 0; i < take().camera_count(); ++i) all.push_back(i);
    const render::InverseDepthRange range = render::inverse_depth_range_in_view(view, rig, scene);
    planes_ = render::evenly_spaced_planes(range, kPlanes);
    const render::BlendingField field(view, rig, all, range, 4);
    store::JpegDecoder decoder;
    for (const int i : field.tile(field.columns() / 2, field.rows() / 2).best) {
      const store::RgbImage image = decoder.decode(take().archive(i).jpeg(0), "frame");
      cv::Mat frame(image.height, image.width, CV_8UC3);
      std::copy(image.values.begin(), image.values.end(), frame.data);
      frames_.push_back(frame);
      cameras_.push_back(i);
    }
  }

  /// Returns the colour codes and the plane of each pixel.
  cv::Mat render(cv::Mat& best_plane) const {
    cv::Mat best_cost(kHeight, kWidth, CV_32F, cv::Scalar(1e9)), colour(kHeight, kWidth, CV_32FC3);
    best_plane = cv::Mat(kHeight, kWidth, CV_32S, cv::Scalar(0));
    std::vector<cv::Mat> warped(frames_.size());
    for (int plane = 0; plane < kPlanes; ++plane) {
      cv::Mat mean = cv::Mat::zeros(kHeight, kWidth, CV_32FC3);
      for (std::size_t k = 0; k < frames_.size(); ++k) {
        cv::Mat codes;
        cv::warpPerspective(frames_[k], codes, frame_from_view(k, plane), {kWidth, kHeight},
                            cv::INTER_LINEAR | cv::WARP_INVERSE_MAP, cv::BORDER_REPLICATE);
        codes.convertTo(warped[k], CV_32F);
        mean += warped[k];
      }
      mean /= static_cast<double>(frames_.size());
      cv::Mat cost = cv::Mat::zeros(kHeight, kWidth, CV_32F), off, off_mean;
      for (const cv::Mat& image : warped) {
        cv::absdiff(image, mean, off);
        cv::transform(off, off_mean, cv::Matx13f(1 / 3.0F, 1 / 3.0F, 1 / 3.0F));
        cv::min(off_mean, kTruncation, off_mean);
        cost += off_mean;
      }
      cv::boxFilter(cost, cost, CV_32F, {5, 5});
      const cv::Mat better = cost < best_cost;
      cost.copyTo(best_cost, better);
      mean.copyTo(colour, better);
      best_plane.setTo(plane, better);
    }
    return colour;
  }

 private:
  cv::Mat frame_from_view(std::size_t k, int plane) const {
    const render::VirtualCamera view = middle_view();
    const rig::Rig::Camera& camera = take().rig().cameras[cameras_[k]];
    const double depth = 1 / planes_.inverse_depth(plane);
    const Eigen::Vector3d axis = view.pose.viewing_direction();
    const render::PlaneProjection projection(
        view, {axis.x(), axis.y(), axis.z(), -axis.dot(view.pose.position) - depth});
    const schemas::Intrinsics& i = camera.model.intrinsics();
    Eigen::Matrix3d pixel_from_ideal;
    pixel_from_ideal << i.fx, 0, i.cx - 0.5, 0, i.fy, i.cy - 0.5, 0, 0, 1;
    Eigen::Matrix3d centre;  // pixel centres at integers, as in OpenCV
    centre << 1, 0, 0.5, 0, 1, 0.5, 0, 0, 1;
    const Eigen::Matrix3d m = pixel_from_ideal * projection.ideal_from_pixel(camera.pose) * centre;
    cv::Mat result(3, 3, CV_64F);
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) result.at<double>(r, c) = m(r, c);
    }
    return result;
  }

  render::SweepPlanes planes_;
  std::vector<int> cameras_;
  std::vector<cv::Mat> frames_;
};

void BM_OpenCv(benchmark::State& state) {
  const OpenCvSweep peer;
  cv::setNumThreads(static_cast<int>(state.range(0)));
  cv::Mat planes, codes;
  for (auto _ : state) {
    codes = peer.render(planes);
    benchmark::DoNotOptimize(codes.data);
  }
  // Check that the pictures are equal.
  const render::LightFieldRenderer renderer(take(), {});
  const render::RenderedView ours = render(renderer, as_opencv());
  double squares = 0, count = 0;
  for (int y = 8; y < kHeight - 8; ++y) {
    for (int x = 8; x < kWidth - 8; ++x) {
      const std::size_t at = static_cast<std::size_t>(y * kWidth + x) * 4;
      if (ours.rgba[at + 3] < 0.999F) continue;
      const auto& code = codes.at<cv::Vec3f>(y, x);
      for (std::size_t c = 0; c < 3; ++c) {
        const double own = srgb_from_linear(static_cast<double>(ours.rgba[at + c])) * 255;
        const double off = own - static_cast<double>(code[static_cast<int>(c)]);
        squares += off * off;
        ++count;
      }
    }
  }
  state.counters["to_ours_dB"] = 10 * std::log10(255.0 * 255.0 / (squares / count));
}
BENCHMARK(BM_OpenCv)->Arg(1)->Arg(2)->Unit(benchmark::kMillisecond)->UseRealTime()->Iterations(2);

/// Alternates one and two threads, so that other processes affect both equally.
void BM_PlaneSweep(benchmark::State& state, const schemas::OptionValues& options) {
  const render::LightFieldRenderer renderer(take(), {});
  for (int warm = 0; warm < 2; ++warm) benchmark::DoNotOptimize(render(renderer, options));
  double least_ms[2] = {1e9, 1e9};
  for (auto _ : state) {
    for (std::size_t threads : {1, 2}) {
      const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
      const render::RenderedView image = render(renderer, options);
      const render::RenderStatistics& took = image.statistics;
      least_ms[threads - 1] =
          std::min(least_ms[threads - 1], took.plan_ms + took.decode_ms + took.render_ms);
      benchmark::DoNotOptimize(image.rgba.data());
    }
  }
  state.counters["ms_1"] = least_ms[0];
  state.counters["ms_2"] = least_ms[1];
  state.counters["gain"] = least_ms[0] / least_ms[1];
}
BENCHMARK_CAPTURE(BM_PlaneSweep, box_as_opencv, as_opencv())
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime()
    ->Iterations(8);
BENCHMARK_CAPTURE(BM_PlaneSweep, semi_global, schemas::OptionValues{})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime()
    ->Iterations(8);

}  // namespace
}  // namespace raystage

int main(int argc, char** argv) { return raystage::run_benchmarks(argc, argv); }
