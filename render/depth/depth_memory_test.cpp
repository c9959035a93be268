// SPDX-License-Identifier: Apache-2.0
// Tests of the memory of method depth, in a separate program that counts all allocated bytes.
#include <gtest/gtest.h>
#include <malloc.h>

#include <algorithm>
#include <atomic>
#include <cerrno>

#include "base/error.h"
#include "render/depth/depth_file.h"
#include "render/depth/depth_store.h"
#include "render/renderer.h"
#include "testing/render/synthetic_take.h"

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define RAYSTAGE_COUNTS_MEMORY 0
#else
#define RAYSTAGE_COUNTS_MEMORY 1
#endif

namespace {

std::atomic<std::ptrdiff_t> held{0}, peak{0};

[[maybe_unused]] void* taken(void* memory) {
  if (memory == nullptr) return nullptr;
  const auto bytes = static_cast<std::ptrdiff_t>(malloc_usable_size(memory));
  const std::ptrdiff_t now = held.fetch_add(bytes) + bytes;
  std::ptrdiff_t most = peak.load();
  while (now > most && !peak.compare_exchange_weak(most, now)) {
  }
  return memory;
}

[[maybe_unused]] void given_back(void* memory) {
  if (memory != nullptr) held -= static_cast<std::ptrdiff_t>(malloc_usable_size(memory));
}

}  // namespace

#if RAYSTAGE_COUNTS_MEMORY
// glibc's functions underneath the names that programs use.
extern "C" {
void* __libc_malloc(std::size_t bytes);                           // NOLINT
void* __libc_calloc(std::size_t count, std::size_t bytes);        // NOLINT
void* __libc_realloc(void* memory, std::size_t bytes);            // NOLINT
void* __libc_memalign(std::size_t alignment, std::size_t bytes);  // NOLINT
void __libc_free(void* memory);                                   // NOLINT

void* malloc(std::size_t bytes) { return taken(__libc_malloc(bytes)); }
void* calloc(std::size_t count, std::size_t bytes) { return taken(__libc_calloc(count, bytes)); }
void* realloc(void* memory, std::size_t bytes) {
  given_back(memory);
  return taken(__libc_realloc(memory, bytes));
}
void* memalign(std::size_t alignment, std::size_t bytes) {
  return taken(__libc_memalign(alignment, bytes));
}
void* aligned_alloc(std::size_t alignment, std::size_t bytes) { return memalign(alignment, bytes); }
int posix_memalign(void** memory, std::size_t alignment, std::size_t bytes) {
  *memory = memalign(alignment, bytes);
  return *memory == nullptr ? ENOMEM : 0;
}
void free(void* memory) {
  given_back(memory);
  __libc_free(memory);
}
}
#endif

namespace raystage::render {
namespace {

/// A take of 24 cameras, and a light field frame of it.
struct Recorded {
  static constexpr schemas::DepthRange kScene{2.2, 6};

  Recorded(int width, int height, std::size_t cache_bytes)
      : take(written(width, height, folder.path() / "take")),
        cache(take, cache_bytes, store::BlendSpace::kPerceptual) {
    instant.take = &take;
    instant.rig = &take.rig();
    instant.cache = &cache;
    instant.frame_of_camera.assign(take.rig().cameras.size(), 0);
  }

  static store::Take written(int width, int height, const std::filesystem::path& folder) {
    testing::SyntheticTake settings;
    settings.cameras = testing::camera_grid(4, 6, 0.1, width, height, {-0.1, 0.02, 0, 0, 0});
    settings.depth_range = kScene;
    write_synthetic_take(settings, folder);
    return store::Take(folder);
  }

  const testing::TestFolder folder;
  const store::Take take;
  store::FrameCache cache;
  LightFieldFrame instant;
};

TEST(DepthMemory, SolvingKeepsWithinItsBound) {
  if (RAYSTAGE_COUNTS_MEMORY == 0) GTEST_SKIP() << "sanitizers take memory of their own";
  const Recorded recorded(200, 150, std::size_t{1} << 28);
  const LightFieldFrame& instant = recorded.instant;
  DepthEstimationOptions options;
  options.scene = Recorded::kScene;
  const std::size_t plenty = std::size_t{1} << 30;
  CameraDepths warm = estimate_camera_depths(instant, options, plenty);  // frames, threads
  for (InverseDepthMap& map : warm.maps) quantise_depths(map);
  std::ptrdiff_t most = 0;
  for (const std::size_t bound :
       {std::size_t{8'000'000}, std::size_t{11'000'000}, std::size_t{30'000'000}, plenty}) {
    const std::ptrdiff_t before = held;
    peak = before;
    std::string note;
    const CameraDepths depths = load_or_estimate_camera_depths(instant, options, bound, true, note);
    EXPECT_EQ(note, "");
    const std::ptrdiff_t beside = peak - before - static_cast<std::ptrdiff_t>(depths.bytes());
    EXPECT_LT(beside, static_cast<std::ptrdiff_t>(bound));
    EXPECT_GT(beside, most / 2) << "more memory would have been of use";
    most = std::max(most, beside);
    EXPECT_EQ(depths.maps[7].values, warm.maps[7].values);
    // Reading stored depths takes less memory.
    peak = held.load();
    const std::ptrdiff_t before_reading = held;
    const CameraDepths read = load_or_estimate_camera_depths(instant, options, bound, true, note);
    EXPECT_LT(peak - before_reading - static_cast<std::ptrdiff_t>(read.bytes()), 5'000'000);
    EXPECT_EQ(read.maps[7].values, warm.maps[7].values);
    std::filesystem::remove_all(recorded.take.folder() / "depth");
  }
  EXPECT_GT(most, 10'000'000);  // so the smaller bounds were tested
}

// Pictures are opened whole, however small the parts of them are, also those without a part.
TEST(DepthMemory, SolvingSmallPartsKeepsWithinItsBound) {
  if (RAYSTAGE_COUNTS_MEMORY == 0) GTEST_SKIP() << "sanitizers take memory of their own";
  const Recorded recorded(400, 300, 1);  // keeps no decoded frame
  const LightFieldFrame& instant = recorded.instant;
  DepthEstimationOptions options;
  options.scene = Recorded::kScene;
  options.regions.resize(24);
  for (const std::size_t camera : {8U, 9U, 14U}) options.regions[camera] = {160, 112, 224, 160};
  const CameraDepths warm = estimate_camera_depths(instant, options, std::size_t{1} << 30);
  int fitting = 0;
  for (std::size_t bound = 2'000'000; bound < 60'000'000; bound = bound * 4 / 3) {
    const std::ptrdiff_t before = held;
    peak = before;
    try {
      const CameraDepths depths = estimate_camera_depths(instant, options, bound);
      EXPECT_EQ(depths.maps[9].values, warm.maps[9].values);
      EXPECT_LT(peak - before - static_cast<std::ptrdiff_t>(depths.bytes()),
                static_cast<std::ptrdiff_t>(bound));
      ++fitting;
    } catch (const Error&) {
      EXPECT_EQ(fitting, 0) << "more memory, yet not enough";
    }
  }
  EXPECT_GT(fitting, 4);
}

TEST(DepthMemory, AViewTakesWhatItSaysItTakes) {
  if (RAYSTAGE_COUNTS_MEMORY == 0) GTEST_SKIP() << "sanitizers take memory of their own";
  testing::SyntheticTake recorded;
  recorded.cameras = testing::camera_grid(3, 4, 0.1, 200, 150);
  recorded.depth_range = schemas::DepthRange{2.2, 6};
  const testing::TestFolder folder;
  write_synthetic_take(recorded, folder.path() / "take");
  const store::Take take(folder.path() / "take");
  const VirtualCamera view = virtual_camera_with_fov(900, 600, 0.7, {});
  const store::FrameSelection frames = store::select_frames(take, 0, 1);
  for (const std::size_t share : {std::size_t{1} << 30, std::size_t{15'000'000}}) {
    RendererOptions options;
    options.working_bytes = share;
    const LightFieldRenderer renderer(take, options);
    const ReconstructionOptions by_depth{"depth", {0, 0, 0, 1}};
    renderer.render(view, frames, by_depth);  // frames, depths, threads
    const std::ptrdiff_t before = held;
    peak = before;
    const RenderedView image = renderer.render(view, frames, by_depth);
    const auto said = static_cast<std::ptrdiff_t>(image.statistics.working_bytes);
    EXPECT_LE(said, static_cast<std::ptrdiff_t>(share));
    // The fusion ends before the view is allocated: the peak is the larger of both.
    const auto of_view = static_cast<std::ptrdiff_t>(view_buffer_bytes(view));
    const std::ptrdiff_t taken_at_most = peak - before;
    EXPECT_LE(taken_at_most, std::max(said, of_view) * 5 / 4 + 1'000'000);
    EXPECT_GE(taken_at_most, said * 9 / 10);
  }
}

// Fits over the positions of the cameras are kept where they fit the memory, and else computed
// again.
TEST(DepthMemory, AViewBehindGlassIsTheSameWithLittleMemory) {
  if (RAYSTAGE_COUNTS_MEMORY == 0) GTEST_SKIP() << "sanitizers take memory of their own";
  testing::SyntheticTake recorded;
  recorded.cameras = testing::camera_grid(5, 5, 0.08, 200, 150);
  recorded.depth_range = schemas::DepthRange{2.2, 6};
  recorded.scene = [](const Eigen::Vector3d& eye, const Eigen::Vector3d& ray) {
    std::array<double, 3> light{};
    for (const double depth : {4.5, 2.5}) {
      const Eigen::Vector3d hit = eye - ray * (depth / ray.z());
      const auto layer = testing::painted_plane(9 * hit.x() / depth, 9 * hit.y() / depth + depth);
      for (std::size_t c = 0; c < 3; ++c) light[c] += layer[c] / 2;
    }
    return light;
  };
  const testing::TestFolder folder;
  write_synthetic_take(recorded, folder.path() / "take");
  const store::Take take(folder.path() / "take");
  const VirtualCamera view = virtual_camera_with_fov(900, 600, 0.7, {});
  const store::FrameSelection frames = store::select_frames(take, 0, 1);
  const std::size_t of_fits = std::size_t{900} * 600 * 4 * sizeof(float);
  std::vector<RenderedView> images;
  for (const std::size_t share : {std::size_t{1} << 30, of_fits - 1}) {
    RendererOptions options;
    options.working_bytes = share;
    const LightFieldRenderer renderer(take, options);
    const ReconstructionOptions by_depth{"depth", {0, 0, 0, 1}};
    renderer.render(view, frames, by_depth);  // frames, depths, threads
    const std::ptrdiff_t before = held;
    peak = before;
    images.push_back(renderer.render(view, frames, by_depth));
    const auto said = static_cast<std::ptrdiff_t>(images.back().statistics.working_bytes);
    const auto of_view = static_cast<std::ptrdiff_t>(view_buffer_bytes(view));
    EXPECT_LE(peak - before, (of_view + said) * 5 / 4 + 1'000'000);
    if (share > of_fits) {
      EXPECT_GT(peak - before, of_view + static_cast<std::ptrdiff_t>(of_fits) / 2);
    } else {
      EXPECT_LT(peak - before, of_view + static_cast<std::ptrdiff_t>(of_fits) / 2);
    }
  }
  EXPECT_EQ(images[0].rgba, images[1].rgba);
}

}  // namespace
}  // namespace raystage::render
