// SPDX-License-Identifier: Apache-2.0
// Measures the mean luminance (code 0 to 255) of frames for flash detection, by libjpeg-turbo's
// decode at an eighth of the size: each 8x8 block contributes its mean. Cost: one entropy decode
// per frame, without inverse DCT or chroma; cameras run in parallel.
#include "store/processing/sync/luminance.h"

#include <turbojpeg.h>

#include <atomic>
#include <limits>
#include <memory>
#include <new>
#include <numeric>

#include "base/error.h"
#include "base/parallel.h"
#include "store/jpeg/layout.h"

namespace raystage::store {
namespace {

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
constexpr tjscalingfactor kEighth{1, 8};

struct HandleDeleter {
  void operator()(void* handle) const { tjDestroy(handle); }
};

// Reuses its decoder and memory from frame to frame.
class LuminanceMeter {
 public:
  LuminanceMeter() : handle_(tjInitDecompress()) {
    if (!handle_) throw std::bad_alloc();
  }
  double measure(std::span<const std::byte> jpeg) {
    const auto* bytes = reinterpret_cast<const unsigned char*>(jpeg.data());
    int width = 0, height = 0, sampling = 0, colour = 0;
    try {
      parse_jpeg_layout(jpeg, "");  // limits the size and the scans
    } catch (const Error&) {
      return kUnknown;
    }
    if (tjDecompressHeader3(handle_.get(), bytes, jpeg.size(), &width, &height, &sampling,
                            &colour) != 0) {
      return kUnknown;
    }
    const int columns = TJSCALED(width, kEighth), rows = TJSCALED(height, kEighth);
    pixels_.resize(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows));
    if (pixels_.empty() || tjDecompress2(handle_.get(), bytes, jpeg.size(), pixels_.data(), columns,
                                         0, rows, TJPF_GRAY, TJFLAG_FASTDCT) != 0) {
      return kUnknown;
    }
    return static_cast<double>(std::accumulate(pixels_.begin(), pixels_.end(), std::uint64_t{0})) /
           static_cast<double>(pixels_.size());
  }

 private:
  std::unique_ptr<void, HandleDeleter> handle_;
  std::vector<unsigned char> pixels_;
};

}  // namespace

double mean_luminance(std::span<const std::byte> jpeg) { return LuminanceMeter().measure(jpeg); }

std::vector<std::vector<double>> measure_luminance(
    const Take& take, const std::vector<std::vector<Nanoseconds>>& times, Nanoseconds begin,
    Nanoseconds end, const std::function<void(double)>& progress, std::stop_token stop) {
  std::vector<std::vector<double>> luminance(times.size());
  std::atomic<std::size_t> done = 0;
  parallel_for(std::size_t{0}, times.size(), [&](std::size_t c) {
    const ArchiveReader& archive = take.archive(static_cast<int>(c));
    luminance[c].assign(times[c].size(), kUnknown);
    LuminanceMeter meter;
    for (std::size_t i = 0; i < times[c].size() && !stop.stop_requested(); ++i) {
      if (times[c][i] < begin || times[c][i] > end) continue;
      const auto jpeg = archive.intact_jpeg(static_cast<int>(i));
      if (jpeg) luminance[c][i] = meter.measure(*jpeg);
    }
    progress(static_cast<double>(++done) / static_cast<double>(times.size()));
  });
  return luminance;
}

}  // namespace raystage::store
