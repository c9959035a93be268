// SPDX-License-Identifier: Apache-2.0
// Measures the resynchronisation of 30 min of 64 cameras, from time stamps to the timeline's bytes.
#include <benchmark/benchmark.h>
#include <sys/resource.h>

#include <cmath>
#include <random>

#include "store/jpeg/encode.h"
#include "store/processing/sync/luminance.h"
#include "store/processing/sync/resync.h"
#include "store/timeline_file.h"
#include "testing/store/simulated_stamps.h"

namespace raystage {
namespace {

std::vector<store::CameraTimestamps> half_an_hour(testing::SimulatedStamps::Jitter jitter) {
  return testing::cameras_of(
      testing::SimulatedStamps({.seed = 1, .seconds = 1800, .step_at_s = 936, .jitter = jitter}));
}

double peak_megabytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024;
}

// Argument: 0 for Gaussian jitter, 1 for delays.
void BM_Resynchronise(benchmark::State& state) {
  const auto cameras = half_an_hour(static_cast<testing::SimulatedStamps::Jitter>(state.range(0)));
  double frames = 0;
  for (const store::CameraTimestamps& camera : cameras)
    frames += static_cast<double>(camera.stamps.size());
  std::size_t bytes = 0, ticks = 0, steps = 0;
  for (auto _ : state) {
    const store::ResyncResult resync = store::resynchronise(cameras, {}, "bench");
    ticks = resync.timeline.ticks.size();
    steps = resync.steps.size();
    bytes = store::encode_timeline(resync.timeline, 1).size();
  }
  state.counters["frames"] = frames;
  state.counters["ticks"] = static_cast<double>(ticks);
  state.counters["steps"] = static_cast<double>(steps);
  state.counters["file MB"] = static_cast<double>(bytes) / 1e6;
  state.counters["peak RSS MB"] = peak_megabytes();
}
BENCHMARK(BM_Resynchronise)->Arg(0)->Arg(1)->Unit(benchmark::kSecond)->UseRealTime();

// Measures the cost of --flash per frame: 960x640, 4:2:0, quality 85.
void BM_MeanLuminance(benchmark::State& state) {
  std::mt19937 random(1);
  store::RgbImage image{960, 640, std::vector<std::uint8_t>()};
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < 3 * image.width; ++x) {
      const double wave = 128 + 90 * std::sin(x * 0.011) * std::cos(y * 0.023);
      image.values.push_back(static_cast<std::uint8_t>(wave + static_cast<double>(random() % 12)));
    }
  }
  const auto jpeg = store::encode_jpeg(image, {85, store::JpegEncodeOptions::Chroma::k420, 0});
  for (auto _ : state) benchmark::DoNotOptimize(store::mean_luminance(jpeg));
  state.counters["kB"] = static_cast<double>(jpeg.size()) / 1e3;
}
BENCHMARK(BM_MeanLuminance)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace raystage

BENCHMARK_MAIN();
