// SPDX-License-Identifier: Apache-2.0
// Measures every method in the same view with one and two threads, and the machine's limits. Take:
// $RAYSTAGE_BENCH_TAKE; by default 8x8 cameras of 960x640 in front of a painted plane.
#include <benchmark/benchmark.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <ctime>
#include <limits>
#include <numbers>
#include <numeric>
#include <random>

#include "evaluation/bench.h"
#include "render/common/ray_cells.h"
#include "render/methods.h"
#include "render/renderer.h"
#include "render/sampling/depth_sampling.h"
#include "rig/plenoptic_sampling.h"
#include "testing/render/test_matte.h"
#include "tests/bench/bench_take.h"
#include "tests/bench/run_benchmarks.h"

namespace raystage {
namespace {

using Clock = std::chrono::steady_clock;

double ms_since(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

const store::Take& take() {
  static const BenchTake opened("RAYSTAGE_BENCH_TAKE", make_painted_rig(8, 8));
  return opened.take();
}

/// Returns a take for visual_hull, with mattes of a disk of 2 m on the painted plane. It is always
/// synthetic, because captured takes have no mattes.
const store::Take& take_with_mattes() {
  static const testing::SyntheticTake settings = make_painted_rig(8, 8);
  static const BenchTake opened(settings);
  [[maybe_unused]] static const bool written = [] {
    for (const schemas::CameraGeometry& camera : settings.cameras) {
      const rig::CameraModel model(camera);
      const rig::Pose pose = rig::pose_from_matrix(camera.world_from_camera);
      std::vector<std::uint8_t> codes;
      for (int y = 0; y < camera.height; ++y) {
        for (int x = 0; x < camera.width; ++x) {
          const Eigen::Vector3d ray = *model.unproject({x + 0.5, y + 0.5});
          const Eigen::Vector3d hit = pose.position - ray * (settings.plane_depth / ray.z());
          codes.push_back(std::hypot(hit.x(), hit.y()) < 1 ? 255 : 0);
        }
      }
      testing::write_matte(opened.take().folder(), camera.id, 0, camera.width, camera.height,
                           codes);
    }
    return true;
  }();
  return opened.take();
}

/// Returns a rotated view slightly behind the array, between camera positions; at least a dozen
/// cameras contribute. `part`: size of its middle part that is rendered, relative on both axes.
render::VirtualCamera bench_view(const store::Take& take, int part = 1) {
  rig::Pose pose;
  pose.position = take.rig().centre() + Eigen::Vector3d(0.017, -0.011, 0.1);
  const double tangent = std::tan(22.5 * std::numbers::pi / 180) / part;
  return render::virtual_camera_with_fov(960 / part, 640 / part, 2 * std::atan(tangent), pose);
}

/// Returns the range of disparities of neighbouring cameras over the depth range, px (eq. 2.1).
double disparity_of(const store::Take& take) {
  std::vector<int> all(static_cast<std::size_t>(take.camera_count()));
  std::iota(all.begin(), all.end(), 0);
  double longest = 0;
  for (const rig::Rig::Camera& camera : take.rig().cameras) {
    longest = std::max({longest, camera.model.intrinsics().fx, camera.model.intrinsics().fy});
  }
  return rig::disparity_range(
      longest, rig::max_neighbour_baseline(take.rig(), rig::make_topology(take.rig(), all)),
      *take.document().depth_range);
}

/// Measures the shortest time with one and with two threads. They alternate, so that other
/// processes affect both equally.
void BM_Threads(benchmark::State& state, const store::Take& take,
                const evaluation::BenchSetting& setting) {
  render::RendererOptions settings;
  settings.cache_bytes = settings.result_cache_bytes = std::size_t{2} << 30;
  settings.result_cache = std::make_shared<render::ResultCache>(settings.result_cache_bytes);
  const render::LightFieldRenderer renderer(take, settings);
  const store::FrameSelection frames = store::select_frames(take, 0, kNanosecondsPerSecond);
  // Rays of the hull cost 20 us each; a part of the view suffices to compare threads.
  const render::VirtualCamera view = bench_view(take, setting.method == "visual_hull" ? 8 : 1);
  const render::ReconstructionOptions reconstruction{
      setting.method,
      rig::fronto_parallel_plane(take.rig(),
                                 rig::optimal_focal_depth(*take.document().depth_range)),
      setting.options};
  const auto render = [&] {
    const render::RenderedView image = renderer.render(view, frames, reconstruction);
    benchmark::DoNotOptimize(image.rgba.data());
    return image.statistics;
  };
  for (int warm = 0; warm < 2; ++warm) render();
  double least_ms[2] = {std::numeric_limits<double>::infinity(),
                        std::numeric_limits<double>::infinity()};
  std::clock_t least_cpu = std::numeric_limits<std::clock_t>::max();
  render::RenderStatistics statistics;
  for (auto _ : state) {
    for (std::size_t threads : {1, 2}) {
      const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
      const auto start = Clock::now();
      const std::clock_t cpu_start = std::clock();
      statistics = render();
      least_ms[threads - 1] = std::min(least_ms[threads - 1], ms_since(start));
      if (threads == 1) least_cpu = std::min(least_cpu, std::clock() - cpu_start);
    }
  }
  state.counters["ms_1"] = least_ms[0];
  state.counters["ms_2"] = least_ms[1];
  state.counters["gain"] = least_ms[0] / least_ms[1];
  // The estimates of render/automatic/automatic_method.cpp for the candidates of `auto`.
  state.counters["cpu_ns_per_px"] = 1e9 / CLOCKS_PER_SEC * static_cast<double>(least_cpu) /
                                    (static_cast<double>(view.width) * view.height);
  state.counters["disparity_px"] = disparity_of(take);
  // The least memory traffic: each source pixel with a weight once, and the view's channels.
  render::RendererOptions counting = settings;
  counting.count_needed_pixels = true;
  const render::RenderStatistics counts =
      render::LightFieldRenderer(take, counting).render(view, frames, reconstruction).statistics;
  constexpr double kSourceBytes = 8, kViewBytes = 24;
  state.counters["MB"] = (static_cast<double>(counts.pixels_needed) * kSourceBytes +
                          view.width * view.height * kViewBytes) /
                         1e6;
  // The number of samples blended per pixel.
  render::RendererOptions measuring = settings;
  measuring.measure_coverage = true;
  const render::RenderedView measured =
      render::LightFieldRenderer(take, measuring).render(view, frames, reconstruction);
  state.counters["cameras_per_px"] =
      std::accumulate(measured.cameras.begin(), measured.cameras.end(), 0.0) /
      static_cast<double>(std::max<std::size_t>(1, measured.cameras.size()));
  state.counters["plan_ms"] = statistics.plan_ms;
  state.counters["cameras"] = statistics.cameras_used;
}

/// Returns the rays of a view, or unordered rays as a rough surface in front of the array reflects
/// them: from many positions in many directions.
std::vector<render::WorldRay> some_rays(bool of_view) {
  constexpr int kRays = 1 << 17;
  std::vector<render::WorldRay> rays;
  if (of_view) {
    const render::VirtualCamera view = bench_view(take());
    const Eigen::Matrix3d ray_from_pixel = render::world_ray_from_pixel(view);
    for (int i = 0; i < kRays; ++i) {
      const int row = i / view.width, column = i % view.width;
      const Eigen::Vector3d pixel(column + 0.5, row + 200.5, 1);
      rays.push_back({view.pose.position, (ray_from_pixel * pixel).normalized()});
    }
    return rays;
  }
  std::mt19937 random(1);
  std::uniform_real_distribution<double> any(-1, 1);
  const rig::Rig& rig = take().rig();
  for (int i = 0; i < kRays; ++i) {
    const Eigen::Vector3d place(0.2 * any(random), 0.2 * any(random), 0.05 * any(random));
    const Eigen::Vector3d direction(0.3 * any(random), 0.2 * any(random), -1);
    rays.push_back({rig.centre() + place, direction.normalized()});
  }
  return rays;
}

void BM_RayQuery(benchmark::State& state) {
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                  static_cast<std::size_t>(state.range(0)));
  const render::LightFieldRenderer renderer(take(), {});
  const store::FrameSelection frames = store::select_frames(take(), 0, kNanosecondsPerSecond);
  const render::ReconstructionOptions reconstruction{
      "lumigraph", rig::fronto_parallel_plane(
                       take().rig(), rig::optimal_focal_depth(*take().document().depth_range))};
  const std::vector<render::WorldRay> rays = some_rays(state.range(1) != 0);
  std::vector<render::RaySample> samples(rays.size());
  renderer.query(rays, frames, reconstruction, samples);  // decodes
  for (auto _ : state) renderer.query(rays, frames, reconstruction, samples);
  state.counters["rays_per_s"] = benchmark::Counter(static_cast<double>(rays.size()),
                                                    benchmark::Counter::kIsIterationInvariantRate);
  state.counters["answered"] =
      static_cast<double>(std::ranges::count_if(
          samples, [](const render::RaySample& sample) { return sample.coverage > 0; })) /
      static_cast<double>(samples.size());
}
BENCHMARK(BM_RayQuery)
    ->ArgsProduct({{1, 2}, {0, 1}})
    ->ArgNames({"threads", "of_view"})
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime()
    ->UseRealTime();

constexpr std::size_t kProbeBytes = std::size_t{256} << 20;  // much larger than the caches
constexpr std::size_t kProbePiece = std::size_t{1} << 20;

/// Measures the memory bandwidth for a number of threads, the limit of every method whose frames do
/// not fit into the caches.
template <class Piece>
void probe_memory(benchmark::State& state, const Piece& on_piece) {
  const auto threads = static_cast<std::size_t>(state.range(0));
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
  double least_ms = std::numeric_limits<double>::infinity();
  for (auto _ : state) {
    const auto start = Clock::now();
    tbb::parallel_for(std::size_t{0}, kProbeBytes / kProbePiece, on_piece);
    least_ms = std::min(least_ms, ms_since(start));
  }
  state.counters["GB_per_s"] = static_cast<double>(kProbeBytes) / 1e6 / least_ms;
}

void BM_MemoryRead(benchmark::State& state) {
  const std::vector<std::uint64_t> data(kProbeBytes / 8, 1);
  probe_memory(state, [&](std::size_t piece) {
    const auto begin = data.begin() + static_cast<std::ptrdiff_t>(piece * kProbePiece / 8);
    benchmark::DoNotOptimize(
        std::accumulate(begin, begin + std::ptrdiff_t{kProbePiece / 8}, std::uint64_t{0}));
  });
}
void BM_MemoryWrite(benchmark::State& state) {
  std::vector<char> data(kProbeBytes, 1);
  probe_memory(state, [&](std::size_t piece) {
    std::memset(data.data() + piece * kProbePiece, 2, kProbePiece);
    benchmark::ClobberMemory();
  });
}
BENCHMARK(BM_MemoryRead)->Arg(1)->Arg(2)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(BM_MemoryWrite)->Arg(1)->Arg(2)->Unit(benchmark::kMillisecond)->UseRealTime();

/// Measures the rate of the sampling kernel alone. One frame in the cache is sampled along its rows
/// at its own scale with an offset of a quarter of a pixel.
void BM_SampleRate(benchmark::State& state) {
  const auto threads = static_cast<std::size_t>(state.range(0));
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
  const render::Interpolation interpolation =
      state.range(1) != 0 ? render::Interpolation::kCubic : render::Interpolation::kLinear;
  constexpr int kSide = 128, kPictures = 64;
  rig::Pose pose;
  const render::VirtualCamera view = render::virtual_camera_with_fov(kSide, kSide, 1, pose);
  schemas::CameraGeometry geometry;
  geometry.id = "probe";
  geometry.width = geometry.height = kSide;
  geometry.intrinsics = view.intrinsics;
  geometry.intrinsics.cx += 0.25;
  geometry.intrinsics.cy += 0.25;
  const rig::Rig::Camera camera{"probe", rig::CameraModel(geometry), pose, {}, {}, {}};
  store::DecodedFrame frame;
  frame.width = frame.height = kSide;
  frame.rgba = std::make_unique<std::uint16_t[]>(4 * (kSide * (kSide + 1) + 1));
  render::DepthSource source = render::depth_source(view, camera);
  source.camera.rgba = frame.rgba.get();
  const std::vector<float> inverse_depth(kSide, 0.2F), weight(kSide, 1.0F);
  double least_ms = std::numeric_limits<double>::infinity();
  for (auto _ : state) {
    const auto start = Clock::now();
    tbb::parallel_for(0, kPictures, [&](int) {
      std::vector<float> sums(4 * kSide);
      for (int y = 0; y < kSide; ++y) {
        render::add_samples_at_depth(source, 0, y, inverse_depth, weight, interpolation, sums);
      }
      benchmark::DoNotOptimize(sums.data());
    });
    least_ms = std::min(least_ms, ms_since(start));
  }
  state.counters["M_samples_per_s"] = kPictures * kSide * kSide / 1e3 / least_ms;
}
BENCHMARK(BM_SampleRate)
    ->ArgsProduct({{1, 2}, {0, 1}})
    ->ArgNames({"threads", "cubic"})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

}  // namespace
}  // namespace raystage

int main(int argc, char** argv) {
  for (const raystage::evaluation::BenchSetting& setting :
       raystage::evaluation::default_bench_settings()) {
    benchmark::RegisterBenchmark(("BM_Threads/" + setting.label).c_str(),
                                 [setting](benchmark::State& state) {
                                   raystage::BM_Threads(state,
                                                        setting.method == "visual_hull"
                                                            ? raystage::take_with_mattes()
                                                            : raystage::take(),
                                                        setting);
                                 })
        ->Unit(benchmark::kMillisecond)
        ->MinTime(1)
        ->UseRealTime();
  }
  return raystage::run_benchmarks(argc, argv);
}
