// SPDX-License-Identifier: Apache-2.0
// The thesis' own case (4.4: 64 cameras of 320x240; a view of 512x512 from archives in the page
// cache), and how the time goes with cameras, threads and resolution. The take is written anew:
// 17x17 cameras 6 cm apart, 62 degrees, that look at a painted plane; fewer cameras are its middle.
#include <benchmark/benchmark.h>
#include <tbb/global_control.h>
#include <tbb/parallel_pipeline.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <numbers>

#include "render/renderer.h"
#include "tests/bench/bench_take.h"
#include "tests/bench/run_benchmarks.h"

namespace raystage {
namespace {

constexpr int kSide = 17, kInstants = 8;
constexpr double kSpacing = 0.06, kFov = 40 * std::numbers::pi / 180;
constexpr const char* kMethods[] = {"focal_plane", "slabs",       "aperture",
                                    "lumigraph",   "plane_sweep", "depth"};

const Take& bench_take() {
  static const BenchTake opened([] {
    testing::SyntheticTake settings;
    settings.cameras = testing::camera_grid(kSide, kSide, kSpacing, 320, 240);
    settings.jpeg = {85, JpegEncodeSettings::Chroma::k420, -1};
    settings.frames = kInstants;
    settings.depth_range = DepthRange{2, 20};
    return settings;
  }());
  return opened.take();
}

/// Leaves per_side x per_side cameras in.
std::vector<int> all_but_middle(int per_side) {
  std::vector<int> excluded_cameras;
  const int first = (kSide - per_side) / 2;
  const auto in_middle = [&](int place) { return place >= first && place < first + per_side; };
  for (int i = 0; i < kSide * kSide; ++i) {
    if (!in_middle(i / kSide) || !in_middle(i % kSide)) excluded_cameras.push_back(i);
  }
  return excluded_cameras;
}

/// Behind the array, so far that all of it is in view: every camera contributes. `frame` moves it.
VirtualCamera view_of(int per_side, int size, int frame = 0) {
  const int first = (kSide - per_side) / 2;
  const double middle = (first + (per_side - 1) / 2.0 - (kSide - 1) / 2.0) * kSpacing;
  Pose pose;
  pose.position = {middle + 0.003 + 0.001 * frame, -middle - 0.002,
                   0.9 * (per_side - 1) * kSpacing / (2 * std::tan(kFov / 2))};
  return virtual_camera_with_fov(size, size, kFov, pose);
}

ReconstructionSettings reconstruction(std::int64_t method) {
  return {kMethods[method], fronto_parallel_plane(bench_take().rig(), 4)};
}

/// Every frame shows another instant, which is decoded for it.
void BM_FromArchives(benchmark::State& state) {
  const auto thread_count = static_cast<std::size_t>(state.range(1));
  const tbb::global_control threads(tbb::global_control::max_allowed_parallelism, thread_count);
  const Take& take = bench_take();
  RendererSettings settings;
  settings.excluded_cameras = all_but_middle(8);
  settings.cache_bytes = std::size_t{3} * 64 * 320 * 240 * 8;  // of three instants
  settings.result_cache_bytes = settings.cache_bytes;
  const LightFieldRenderer renderer(take, settings);
  constexpr int kFrames = 48;
  double rendered = 0, decoded = 0;
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
                            const auto time = (frame % kInstants) * kNanosecondsPerSecond / 15;
                            const RenderedView image = renderer.render(
                                view_of(8, 512, frame), select_frames(take, time, 1'000'000),
                                reconstruction(state.range(0)));
                            pixels += image.statistics.pixels_decoded;
                            benchmark::DoNotOptimize(image.rgba.data());
                          }));
    rendered += kFrames;
    decoded += static_cast<double>(pixels);
  }
  state.SetLabel(kMethods[state.range(0)]);
  state.counters["frames_per_s"] = benchmark::Counter(rendered, benchmark::Counter::kIsRate);
  state.counters["MP_decoded_per_frame"] = decoded / rendered / 1e6;
}
BENCHMARK(BM_FromArchives)
    ->ArgsProduct({{0, 1}, {1, 2}})
    ->ArgNames({"method", "threads"})
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime()
    ->UseRealTime()
    ->MinTime(2);

/// One instant, in memory.
void BM_FromMemory(benchmark::State& state) {
  const tbb::global_control threads(tbb::global_control::max_allowed_parallelism,
                                    static_cast<std::size_t>(state.range(2)));
  const int per_side = static_cast<int>(state.range(1)), size = static_cast<int>(state.range(3));
  RendererSettings settings;
  settings.excluded_cameras = all_but_middle(per_side);
  const LightFieldRenderer renderer(bench_take(), settings);
  const FrameSelection frames = select_frames(bench_take(), 0, 1'000'000);
  const VirtualCamera view = view_of(per_side, size);
  for (int warm = 0; warm < 3; ++warm) {
    renderer.render(view, frames, reconstruction(state.range(0)));
  }
  double cameras = 0, best_ms = std::numeric_limits<double>::infinity();
  for (auto _ : state) {
    const auto start = std::chrono::steady_clock::now();
    const RenderedView image = renderer.render(view, frames, reconstruction(state.range(0)));
    const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - start;
    best_ms = std::min(best_ms, took.count());  // where others share the machine
    cameras = image.statistics.cameras_used;
    benchmark::DoNotOptimize(image.rgba.data());
  }
  state.counters["best_ms"] = best_ms;
  state.SetLabel(kMethods[state.range(0)]);
  state.counters["cameras_used"] = cameras;
}
BENCHMARK(BM_FromMemory)  // by cameras, by threads, by resolution
    ->ArgsProduct({{0, 1, 2, 3, 4, 5}, {2, 4, 8, 12, 17}, {2}, {512}})
    ->ArgsProduct({{0, 1, 2, 3, 4, 5}, {8}, {1}, {512}})
    ->ArgsProduct({{0, 1, 2, 3, 4, 5}, {8}, {2}, {256, 1024, 2048}})
    ->ArgNames({"method", "per_side", "threads", "size"})
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime()
    ->UseRealTime();

/// slabs upright and with the view rolled by a quarter turn, so that neighbouring pixels lie in
/// different rows of the nodes' images: what tiles instead of rows could gain at most.
void BM_Rolled(benchmark::State& state) {
  const tbb::global_control threads(tbb::global_control::max_allowed_parallelism, 1);
  RendererSettings settings;
  settings.excluded_cameras = all_but_middle(8);
  const LightFieldRenderer renderer(bench_take(), settings);
  const FrameSelection frames = select_frames(bench_take(), 0, 1'000'000);
  VirtualCamera view = view_of(8, 512);
  if (state.range(0) != 0) view.pose.world_from_camera_rotation << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  renderer.render(view, frames, reconstruction(1));
  double best_ms = std::numeric_limits<double>::infinity();
  for (auto _ : state) {
    const auto start = std::chrono::steady_clock::now();
    benchmark::DoNotOptimize(renderer.render(view, frames, reconstruction(1)).rgba.data());
    const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - start;
    best_ms = std::min(best_ms, took.count());
  }
  state.counters["best_ms"] = best_ms;
}
BENCHMARK(BM_Rolled)
    ->Arg(0)
    ->Arg(1)
    ->ArgName("rolled")
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime()
    ->UseRealTime();

/// What a new instant costs slabs before its first view: all 64 cameras decoded and rectified, or
/// rectified alone where `decoded`.
void BM_Rectify(benchmark::State& state) {
  const tbb::global_control threads(tbb::global_control::max_allowed_parallelism, 2);
  RendererSettings settings;
  settings.excluded_cameras = all_but_middle(8);
  settings.result_cache_bytes = 1;  // nothing stays
  if (state.range(0) == 0) settings.cache_bytes = 1;
  const LightFieldRenderer renderer(bench_take(), settings);
  const FrameSelection frames = select_frames(bench_take(), 0, 1'000'000);
  const VirtualCamera view = view_of(8, 512);
  double milliseconds = 0;
  for (auto _ : state) {
    milliseconds += renderer.render(view, frames, reconstruction(1)).statistics.decode_ms;
  }
  state.counters["instant_ms"] =
      benchmark::Counter(milliseconds, benchmark::Counter::kAvgIterations);
}
BENCHMARK(BM_Rectify)
    ->Arg(0)
    ->Arg(1)
    ->ArgName("decoded")
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime()
    ->UseRealTime();

}  // namespace
}  // namespace raystage

int main(int argc, char** argv) { return raystage::run_benchmarks(argc, argv); }
