// SPDX-License-Identifier: Apache-2.0
// Measures focal_plane and aperture against the same algorithms in OpenCV, and from archive to
// pixels along a moving shot. Takes: $RAYSTAGE_BENCH_TAKE (with restart markers) and
// $RAYSTAGE_BENCH_TAKE_PLAIN (without); by default 8x8 cameras of 960x640 in front of a painted
// plane. See tests/bench/run.sh.
#include <benchmark/benchmark.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_pipeline.h>

#include <cmath>
#include <numbers>
#include <opencv2/core.hpp>

#include "render/renderer.h"
#include "tests/bench/bench_take.h"
#include "tests/bench/opencv_focal_plane.h"
#include "tests/bench/run_benchmarks.h"

namespace raystage {
namespace {

constexpr int kWidth = 960, kHeight = 640;
constexpr double kFocalDepth = 8.69;
constexpr double kAllCameras = 0.75;  // metres behind the array

/// Returns the take under test, opened once; a synthetic one is deleted with the program.
class BenchTakes {
 public:
  const store::Take& restart() const { return restart_.take(); }
  const store::Take& plain() const { return plain_.take(); }

 private:
  static testing::SyntheticTake in_motion(int restart_interval) {
    testing::SyntheticTake options = make_painted_rig(8, 8);
    options.plane_depth = kFocalDepth;
    options.depth_range.reset();
    options.jpeg.restart_interval = restart_interval;
    options.frames = 8;
    return options;
  }
  BenchTake restart_{"RAYSTAGE_BENCH_TAKE", in_motion(-1)};
  BenchTake plain_{"RAYSTAGE_BENCH_TAKE_PLAIN", in_motion(0)};
};

const BenchTakes& takes() {
  static const BenchTakes opened;
  return opened;
}

/// Returns a view `distance` behind the array, to which all 64 cameras contribute.
render::VirtualCamera view_through_all(double distance) {
  rig::Pose pose;
  pose.position = {0.01, -0.02, distance};
  return render::virtual_camera_with_fov(kWidth, kHeight, 40 * std::numbers::pi / 180, pose);
}

/// Returns a view of the moving shot: sideways, down and towards the array.
render::VirtualCamera view_of_frame(int frame, int frames) {
  const double along = frames > 1 ? static_cast<double>(frame) / (frames - 1) : 0;
  rig::Pose pose;
  pose.position = {-0.06 + 0.12 * along, 0.03 - 0.05 * along, 0.30 - 0.15 * along};
  return render::virtual_camera_with_fov(kWidth, kHeight, 40 * std::numbers::pi / 180, pose);
}

render::ReconstructionOptions reconstruction(const store::Take& take) {
  return {"focal_plane", rig::fronto_parallel_plane(take.rig(), kFocalDepth)};
}

/// Returns the cameras to exclude so that rows x columns cameras, spread over the grid, contribute.
std::vector<int> excluded_except(const store::Take& take, int per_side) {
  std::vector<int> excluded_cameras;
  for (int i = 0; i < take.camera_count(); ++i) {
    const rig::Rig::Camera& camera = take.rig().cameras[i];
    const int step = per_side > 1 ? 7 / (per_side - 1) : 1;
    const bool kept = *camera.row % step == 0 && *camera.column % step == 0 &&
                      *camera.row / step < per_side && *camera.column / step < per_side;
    if (!kept) excluded_cameras.push_back(i);
  }
  return excluded_cameras;
}

void BM_FocalPlane(benchmark::State& state) {
  const store::Take& take = takes().restart();
  const tbb::global_control threads(tbb::global_control::max_allowed_parallelism,
                                    static_cast<std::size_t>(state.range(0)));
  const render::LightFieldRenderer renderer(take, {});
  const store::FrameSelection frames = store::select_frames(take, 0, kNanosecondsPerSecond);
  const render::VirtualCamera view = view_through_all(kAllCameras);
  for (int warm = 0; warm < 2; ++warm) {
    benchmark::DoNotOptimize(renderer.render(view, frames, reconstruction(take)));
  }
  double plan = 0, blend = 0, count = 0;
  for (auto _ : state) {
    const render::RenderedView image = renderer.render(view, frames, reconstruction(take));
    plan += image.statistics.plan_ms;
    blend += image.statistics.render_ms;
    ++count;
    benchmark::DoNotOptimize(image.rgba.data());
  }
  state.counters["plan_ms"] = plan / count;
  state.counters["blend_ms"] = blend / count;
}
BENCHMARK(BM_FocalPlane)->Arg(1)->Arg(2)->Unit(benchmark::kMillisecond)->UseRealTime()->MinTime(2);

/// Checks that both pictures are equal; otherwise the comparison is invalid.
void expect_same_picture(benchmark::State& state, const render::RenderedView& ours,
                         const cv::Mat& theirs) {
  double difference = 0;
  for (int y = 8; y < kHeight - 8; ++y) {
    for (int x = 8; x < kWidth - 8; ++x) {
      const std::size_t at = static_cast<std::size_t>(y * kWidth + x);
      if (ours.rgba[at * 4 + 3] < 0.999F) continue;
      for (int c = 0; c < 3; ++c) {
        difference += static_cast<double>(std::abs(ours.rgba[at * 4 + static_cast<std::size_t>(c)] -
                                                   theirs.at<cv::Vec3f>(y, x)[c]));
      }
    }
  }
  difference /= 3.0 * kWidth * kHeight;
  state.counters["mean_difference"] = difference;
  if (difference > 2e-3) state.SkipWithError("OpenCV's picture differs from ours");
}

void BM_OpenCv(benchmark::State& state) {
  const store::Take& take = takes().restart();
  static const OpenCvFocalPlane peer(take);
  cv::setNumThreads(static_cast<int>(state.range(0)));
  const bool crop = state.range(1) != 0;
  const render::VirtualCamera view = view_through_all(kAllCameras);
  const Eigen::Vector4d plane = rig::fronto_parallel_plane(take.rig(), kFocalDepth);
  for (auto _ : state) benchmark::DoNotOptimize(peer.render(view, plane, crop).data);

  const cv::Mat theirs = peer.render(view, plane, crop);
  const render::RenderedView ours = render::LightFieldRenderer(take, {}).render(
      view, store::select_frames(take, 0, kNanosecondsPerSecond), reconstruction(take));
  expect_same_picture(state, ours, theirs);
}
BENCHMARK(BM_OpenCv)
    ->ArgsProduct({{1, 2}, {0, 1}})
    ->ArgNames({"threads", "crop"})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime()
    ->MinTime(2);

constexpr double kApertureRadius = 0.178;  // 2.9 spacings: 25 cameras around one of them

/// Returns the view of a camera in the middle of the array.
render::VirtualCamera view_on_array(const store::Take& take) {
  rig::Pose pose;
  for (const rig::Rig::Camera& camera : take.rig().cameras) {
    if (camera.row == 3 && camera.column == 4) pose.position = camera.pose.position;
  }
  return render::virtual_camera_with_fov(kWidth, kHeight, 40 * std::numbers::pi / 180, pose);
}

int gathering_cameras(const store::Take& take, const render::VirtualCamera& view) {
  int count = 0;
  for (const rig::Rig::Camera& camera : take.rig().cameras) {
    count += (camera.pose.position - view.pose.position).norm() < kApertureRadius ? 1 : 0;
  }
  return count;
}

render::ReconstructionOptions aperture(const store::Take& take) {
  return {"aperture",
          rig::fronto_parallel_plane(take.rig(), kFocalDepth),
          {{"radius", kApertureRadius}}};
}

void BM_Aperture(benchmark::State& state) {
  const store::Take& take = takes().restart();
  const tbb::global_control threads(tbb::global_control::max_allowed_parallelism,
                                    static_cast<std::size_t>(state.range(0)));
  render::RendererOptions options;
  options.blend_space = store::BlendSpace::kLinear;  // as in the OpenCV version
  const render::LightFieldRenderer renderer(take, options);
  const store::FrameSelection frames = store::select_frames(take, 0, kNanosecondsPerSecond);
  const render::VirtualCamera view = view_on_array(take);
  for (int warm = 0; warm < 2; ++warm) {
    benchmark::DoNotOptimize(renderer.render(view, frames, aperture(take)));
  }
  double plan = 0, blend = 0, count = 0;
  for (auto _ : state) {
    const render::RenderedView image = renderer.render(view, frames, aperture(take));
    plan += image.statistics.plan_ms;
    blend += image.statistics.render_ms;
    ++count;
    benchmark::DoNotOptimize(image.rgba.data());
  }
  state.counters["plan_ms"] = plan / count;
  state.counters["blend_ms"] = blend / count;
  state.counters["cameras"] = gathering_cameras(take, view);
  state.counters["Msamples_per_s"] = benchmark::Counter(
      count * kWidth * kHeight * gathering_cameras(take, view) / 1e6, benchmark::Counter::kIsRate);
}
BENCHMARK(BM_Aperture)->Arg(1)->Arg(2)->Unit(benchmark::kMillisecond)->UseRealTime()->MinTime(2);

void BM_OpenCvAperture(benchmark::State& state) {
  const store::Take& take = takes().restart();
  static const OpenCvFocalPlane peer(take);
  cv::setNumThreads(static_cast<int>(state.range(0)));
  const render::VirtualCamera view = view_on_array(take);
  const Eigen::Vector4d plane = rig::fronto_parallel_plane(take.rig(), kFocalDepth);
  for (auto _ : state) {
    benchmark::DoNotOptimize(peer.render_aperture(view, plane, kApertureRadius).data);
  }
  render::RendererOptions options;
  options.blend_space = store::BlendSpace::kLinear;
  const render::RenderedView ours =
      render::LightFieldRenderer(take, options)
          .render(view, store::select_frames(take, 0, kNanosecondsPerSecond), aperture(take));
  expect_same_picture(state, ours, peer.render_aperture(view, plane, kApertureRadius));
}
BENCHMARK(BM_OpenCvAperture)
    ->Arg(1)
    ->Arg(2)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime()
    ->MinTime(2);

/// Measures from archive to pixels along a moving shot; every frame shows another instant.
void archive_to_pixels(benchmark::State& state, const store::Take& take) {
  const auto thread_count = static_cast<std::size_t>(state.range(0));
  const tbb::global_control threads(tbb::global_control::max_allowed_parallelism, thread_count);
  constexpr int kFrames = 48;
  render::RendererOptions options;
  options.excluded_cameras = excluded_except(take, static_cast<int>(state.range(1)));
  // Room for three instants, so that none is still cached when the shot repeats.
  const std::size_t cameras =
      static_cast<std::size_t>(take.camera_count()) - options.excluded_cameras.size();
  options.cache_bytes = 3 * cameras * kWidth * kHeight * 8;
  const auto instants = take.archive(0).frames();
  const auto frames_at = [&](int frame) {
    const auto instant = static_cast<std::size_t>(frame) % instants.size();
    return store::select_frames(take, instants[instant].time_ns, 1);
  };
  double decoded = 0, rendered = 0;
  const render::LightFieldRenderer renderer(take, options);
  for (auto _ : state) {
    int next = 0;
    std::atomic<std::int64_t> pixels = 0;
    tbb::parallel_pipeline(
        thread_count, tbb::make_filter<void, int>(tbb::filter_mode::serial_in_order,
                                                  [&](tbb::flow_control& control) {
                                                    if (next == kFrames) control.stop();
                                                    return next++;
                                                  }) &
                          tbb::make_filter<int, void>(tbb::filter_mode::parallel, [&](int frame) {
                            const render::RenderedView image =
                                renderer.render(view_of_frame(frame, kFrames), frames_at(frame),
                                                reconstruction(take));
                            pixels += image.statistics.pixels_decoded;
                            benchmark::DoNotOptimize(image.rgba.data());
                          }));
    decoded += static_cast<double>(pixels);
    rendered += kFrames;
  }
  state.counters["frames_per_s"] = benchmark::Counter(rendered, benchmark::Counter::kIsRate);
  state.counters["MP_decoded_per_frame"] = decoded / rendered / 1e6;

  options.count_needed_pixels = true;
  options.cache_bytes = 1;
  const render::LightFieldRenderer counting(take, options);
  std::int64_t needed = 0;
  for (int frame = 0; frame < kFrames; ++frame) {
    needed += counting.render(view_of_frame(frame, kFrames), frames_at(frame), reconstruction(take))
                  .statistics.pixels_needed;
  }
  // Relative to the pixels decoded above: the counting run plans per sample and decodes fewer.
  state.counters["decoded_per_needed"] =
      decoded / rendered / (static_cast<double>(needed) / kFrames);
}

void BM_ArchiveToPixels(benchmark::State& state) { archive_to_pixels(state, takes().restart()); }
void BM_ArchiveToPixelsWithoutMarkers(benchmark::State& state) {
  archive_to_pixels(state, takes().plain());
}
BENCHMARK(BM_ArchiveToPixels)
    ->Args({1, 8})
    ->ArgsProduct({{2}, {2, 4, 8}})
    ->ArgNames({"threads", "per_side"})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime()
    ->MinTime(3);
BENCHMARK(BM_ArchiveToPixelsWithoutMarkers)
    ->ArgsProduct({{2}, {2, 4, 8}})
    ->ArgNames({"threads", "per_side"})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime()
    ->MinTime(3);

}  // namespace
}  // namespace raystage

int main(int argc, char** argv) { return raystage::run_benchmarks(argc, argv); }
