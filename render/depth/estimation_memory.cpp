// SPDX-License-Identifier: Apache-2.0
// Divides the working memory of depth estimation: halves the group of cameras, starting from all,
// until the images and new maps of a group and the memory of one camera fit. Input: which images
// and maps each camera reads in each pass, pixels per map, bytes per camera. Output:
// EstimationMemory, bytes. Cost: O(cameras^2) per size of group.
#include "render/depth/estimation_memory.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.h"

namespace raystage::render {
namespace {

/// Returns the largest number of bytes of images and new maps, for groups of `group` cameras.
std::size_t bytes_held(const EstimationPass& pass, const std::vector<std::size_t>& pixels,
                       std::size_t group) {
  constexpr std::size_t kImage = 6, kMap = 4;  // bytes per pixel
  const std::size_t count = pixels.size();
  const std::vector<std::size_t> last_readers = pass.last_readers();
  std::size_t most = 0;
  for (std::size_t begin = 0; begin < count; begin += group) {
    const std::size_t end = std::min(count, begin + group);
    std::vector<bool> is_shown(count, group >= count);  // a single group keeps its images
    std::size_t held = 0;
    for (std::size_t i = 0; i < end; ++i) {
      if (i >= begin && pass.images) {
        is_shown[i] = true;
        for (const std::size_t other : pass.reads[i]) is_shown[other] = true;
      }
      if (pass.maps && last_readers[i] >= begin) held += kMap * pixels[i];
    }
    for (std::size_t i = 0; i < count; ++i) held += is_shown[i] ? kImage * pixels[i] : 0;
    most = std::max(most, held);
  }
  return most;
}

}  // namespace

std::vector<std::size_t> EstimationPass::last_readers() const {
  std::vector<std::size_t> last(reads.size());
  for (std::size_t i = 0; i < reads.size(); ++i) {
    last[i] = std::max(last[i], i);
    if (!maps) continue;
    for (const std::size_t other : reads[i]) last[other] = std::max(last[other], i);
  }
  return last;
}

EstimationMemory plan_estimation_memory(const std::vector<EstimationPass>& passes,
                                        const std::vector<std::size_t>& pixels, CameraMemory camera,
                                        std::size_t working_bytes) {
  const std::size_t plenty = std::max(camera.minimum, camera.sufficient);
  std::size_t least = 0;
  for (std::size_t group = std::max<std::size_t>(1, pixels.size());; group = (group + 1) / 2) {
    std::size_t held = 0;
    for (const EstimationPass& pass : passes)
      held = std::max(held, bytes_held(pass, pixels, group));
    least = held + camera.minimum;
    const std::size_t room = working_bytes - std::min(working_bytes, held);
    if (room >= plenty || (group == 1 && room >= camera.minimum)) {
      const std::size_t in_flight = std::clamp<std::size_t>(room / plenty, 1, group);
      return {group, in_flight, room / in_flight, held};
    }
    if (group == 1) break;
  }
  throw Error::bad_input(
      fmt::format(
          "the depth estimation of {} cameras needs at least {:.0f} MB of memory; {:.0f} MB "
          "are allowed",
          pixels.size(), static_cast<double>(least) / 1e6 + 0.5,
          static_cast<double>(working_bytes) / 1e6),
      "method depth", "Allow more memory, or lower the options neighbours and support_views");
}

}  // namespace raystage::render
