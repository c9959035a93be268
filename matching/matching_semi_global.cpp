// SPDX-License-Identifier: Apache-2.0
// Semi-global matching (Hirschmueller 2008): two sweeps of four paths each over a cost volume, in
// strips of rows if memory is short. Tiles of each sweep run in parallel waves. Input: costs (u8)
// per pixel and plane from a callback, an optional guide image. Output: plane and cost per pixel.
// Cost: pixels x planes x 8 paths. Must match semi_global_match_reference() to the bit.

#include <algorithm>
#include <memory>
#include <stdexcept>

#include "base/large_buffer.h"
#include "base/options.h"
#include "base/parallel.h"
#include "matching/matching.h"
#include "matching/path_kernels.h"

namespace raystage::matching {

int plane_stride(int planes) { return (planes + 31) / 32 * 32; }

std::vector<std::uint16_t> p2_by_guide_step(const SemiGlobalOptions& options) {
  std::vector<std::uint16_t> p2(256, static_cast<std::uint16_t>(options.p2));
  if (options.guide.empty()) return p2;
  for (std::size_t step = 0; step < p2.size(); ++step) {
    const double lowered = options.p2 / (1 + static_cast<double>(step) / options.guide_scale);
    p2[step] = static_cast<std::uint16_t>(std::max<double>(options.p1, lowered));
  }
  return p2;
}

namespace {

constexpr int kTileRows = 16, kTileColumns = kMaxPathPixels;
constexpr int kMinStripRows = kTileRows;

/// Accumulated costs of several paths, one line each (see path_kernels.h).
class Lines {
 public:
  Lines(int count, int planes)
      : planes_(planes),
        pitch_(plane_stride(planes) + kLinePadding),
        elements_(static_cast<std::size_t>(count) * pitch_ + kLinePadding, kInvalidCost),
        least_(static_cast<std::size_t>(count), 0) {
    for (int line = 0; line < count; ++line) restart(line);
  }
  static std::size_t bytes(int count, int planes) {
    return static_cast<std::size_t>(count) * (plane_stride(planes) + kLinePadding + 1) *
           sizeof(std::uint16_t);
  }

  std::uint16_t* line(int i) {
    return elements_.data() + kLinePadding + static_cast<std::ptrdiff_t>(i) * pitch_;
  }
  std::uint16_t* least(int i) { return least_.data() + i; }
  std::ptrdiff_t pitch() const { return pitch_; }

  /// Starts a path at the image's border, with cost 0 before it.
  void restart(int i) {
    std::fill_n(line(i), planes_, std::uint16_t{0});
    *least(i) = 0;
  }
  void restart_all() {
    for (std::size_t i = 0; i < least_.size(); ++i) restart(static_cast<int>(i));
  }
  void copy(int to, Lines& other, int from) {
    std::copy_n(other.line(from), planes_, line(to));
    *least(to) = *other.least(from);
  }

 private:
  int planes_;
  std::ptrdiff_t pitch_;
  std::vector<std::uint16_t> elements_, least_;
};

/// The paths that enter a row from the previous one, by the column in which they enter: straight,
/// to the right and to the left.
struct Entering {
  Entering(int width, int planes)
      : straight(width, planes), right(width, planes), left(width, planes) {}
  Lines straight, right, left;
};

/// The rows of costs and sums of a sweep of paths, in the sweep's order (column 0, row 0 first).
/// They are in the order of the image, or of the image rotated by 180 degrees.
struct Strip {
  int width = 0, rows = 0, planes = 0;
  const std::uint8_t* cost = nullptr;  ///< of the sweep's first pixel
  std::uint16_t* sums = nullptr;
  std::ptrdiff_t pixel_step = 0, row_step = 0;
  const std::uint8_t* guide = nullptr;  ///< of the sweep's first pixel, or null
  std::ptrdiff_t guide_pixel_step = 0, guide_row_step = 0;
  int rows_before = 0;  ///< rows that the sweep has processed
};

/// Half of the eight paths: those that run right, down, down to the right and down to the left in
/// the sweep's order. A diagonal path keeps its own line from entering to leaving the strip. So
/// each pixel updates four lines in place that no other pixel uses at the same time.
///
/// Pixels depend on their left neighbour and on three pixels in the row above. With columns shifted
/// right by their row number, all four lie above or to the left. So tiles of shifted columns are
/// processed in parallel waves along the diagonals of tiles.
class Sweep {
 public:
  Sweep(const Strip& strip, int p1, std::span<const std::uint16_t> p2)
      : strip_(strip),
        p1_(p1),
        p2_(p2),
        along_(strip.rows, strip.planes),
        straight_(strip.width, strip.planes),
        right_(strip.width + strip.rows - 1, strip.planes),
        left_(strip.width + strip.rows - 1, strip.planes) {}

  static std::size_t bytes(int width, int rows, int planes) {
    return Lines::bytes(rows + width + 2 * (width + rows - 1), planes);
  }

  void enter(Entering& entering) {
    const int first_right = strip_.rows - 1;
    for (int x = 0; x < strip_.width; ++x) {
      straight_.copy(x, entering.straight, x);
      right_.copy(x + first_right, entering.right, x);
      left_.copy(x, entering.left, x);
    }
  }

  /// Returns the paths that continue into the next strip.
  void leave(Entering& entering) {
    for (int x = 0; x < strip_.width; ++x) {
      entering.straight.copy(x, straight_, x);
      if (x > 0) entering.right.copy(x, right_, x - 1);
      if (x + 1 < strip_.width) entering.left.copy(x, left_, x + strip_.rows);
    }
    entering.right.restart(0);
    entering.left.restart(strip_.width - 1);
  }

  /// Calls body(x, y, run) for each run of pixels, with all fields of `run` set.
  template <class Body>
  void run(const Body& body) {
    const int tile_rows = (strip_.rows + kTileRows - 1) / kTileRows;
    const int tile_columns = (strip_.width + strip_.rows + kTileColumns - 2) / kTileColumns;
    for (int wave = 0; wave < tile_rows + tile_columns - 1; ++wave) {
      const int first = std::max(0, wave - tile_columns + 1), last = std::min(wave, tile_rows - 1);
      raystage::parallel_for(first, last + 1,
                             [&](int tile_row) { run_tile(wave - tile_row, tile_row, body); });
    }
  }

 private:
  template <class Body>
  void run_tile(int tile_column, int tile_row, const Body& body) {
    const int end_row = std::min(strip_.rows, (tile_row + 1) * kTileRows);
    std::array<std::uint16_t, static_cast<std::size_t>(kMaxPathPixels * kPathsPerPass)> p2;
    for (int y = tile_row * kTileRows; y < end_row; ++y) {
      const int begin = std::max(0, tile_column * kTileColumns - y);
      const int end = std::min(strip_.width, (tile_column + 1) * kTileColumns - y);
      if (begin >= end) continue;
      find_p2(begin, end, y, p2.data());
      body(begin, y, run_at(begin, end, y, p2.data()));
    }
  }

  PathRun run_at(int begin, int end, int y, const std::uint16_t* p2) {
    PathRun run;
    run.count = end - begin;
    run.planes = strip_.planes;
    const std::ptrdiff_t at = y * strip_.row_step + begin * strip_.pixel_step;
    run.cost = strip_.cost + at;
    run.sums = strip_.sums + at;
    run.pixel_step = strip_.pixel_step;
    const int to_right = begin - y + strip_.rows - 1, to_left = begin + y;
    run.line = {along_.line(y), straight_.line(begin), right_.line(to_right), left_.line(to_left)};
    run.least = {along_.least(y), straight_.least(begin), right_.least(to_right),
                 left_.least(to_left)};
    run.line_step = {0, straight_.pitch(), right_.pitch(), left_.pitch()};
    run.least_step = {0, 1, 1, 1};
    run.p1 = p1_;
    run.p2 = p2;
    return run;
  }

  void find_p2(int begin, int end, int y, std::uint16_t* p2) const {
    if (strip_.guide == nullptr) {
      std::fill_n(p2, (end - begin) * kPathsPerPass, p2_[0]);
      return;
    }
    const auto guide = [&](int x, int row) {
      return static_cast<int>(
          strip_.guide[row * strip_.guide_row_step + x * strip_.guide_pixel_step]);
    };
    const bool has_above = y + strip_.rows_before > 0;
    for (int x = begin; x < end; ++x) {
      const int here = guide(x, y);
      const auto from = [&](int px, int py, bool inside) {
        return p2_[inside ? std::abs(guide(px, py) - here) : 0];
      };
      *p2++ = from(x - 1, y, x > 0);
      *p2++ = from(x, y - 1, has_above);
      *p2++ = from(x - 1, y - 1, has_above && x > 0);
      *p2++ = from(x + 1, y - 1, has_above && x + 1 < strip_.width);
    }
  }

  Strip strip_;
  int p1_;
  std::span<const std::uint16_t> p2_;
  Lines along_, straight_, right_, left_;
};

/// Returns the memory for strips of this many rows.
std::size_t bytes_of_strips(const CostVolume& volume, int rows) {
  const std::size_t elements = static_cast<std::size_t>(volume.width) *
                               plane_stride(volume.planes) * static_cast<std::size_t>(rows);
  const int strips = (volume.height + rows - 1) / rows;
  return LargeBuffer<std::uint8_t>::bytes(elements) + LargeBuffer<std::uint16_t>::bytes(elements) +
         Sweep::bytes(volume.width, rows, volume.planes) +
         static_cast<std::size_t>(strips + 1) * Lines::bytes(3 * volume.width, volume.planes);
}

/// Returns the most rows that fit, or the number of rows with the least memory.
int rows_of_strip(const CostVolume& volume, std::size_t working_bytes) {
  int best = volume.height;
  for (int strips = 2; bytes_of_strips(volume, best) > working_bytes; ++strips) {
    const int rows = std::max(kMinStripRows, (volume.height + strips - 1) / strips);
    if (rows >= volume.height) break;
    if (bytes_of_strips(volume, rows) < bytes_of_strips(volume, best)) best = rows;
    if (rows == kMinStripRows) break;
  }
  return best;
}

class SemiGlobal {
 public:
  SemiGlobal(const CostVolume& volume, const FillCosts& fill, const SemiGlobalOptions& options)
      : volume_(volume), fill_(fill), options_(options), p2_(p2_by_guide_step(options)) {
    row_ = static_cast<std::size_t>(volume.width) * plane_stride(volume.planes);
    strip_rows_ = rows_of_strip(volume, options.working_bytes);
    const std::size_t elements = row_ * strip_rows_;
    costs_ = LargeBuffer<std::uint8_t>(elements, options.buffers);
    sums_ = LargeBuffer<std::uint16_t>(elements, options.buffers);
  }

  PlaneMap match() {
    PlaneMap map(volume_.width, volume_.height);
    const int strips = (volume_.height + strip_rows_ - 1) / strip_rows_;
    // Downward paths as they enter each strip. Their costs within it are computed again with the
    // upward paths.
    std::vector<std::unique_ptr<Entering>> downwards;
    downwards.push_back(std::make_unique<Entering>(volume_.width, volume_.planes));
    for (int i = 0; i + 1 < strips; ++i) {
      fill_strip(i);
      downwards.push_back(std::make_unique<Entering>(volume_.width, volume_.planes));
      sweep_down(i, *downwards[i], downwards.back().get());
    }
    Entering upwards(volume_.width, volume_.planes);
    for (int i = strips - 1; i >= 0; --i) {
      fill_strip(i);
      sweep_down(i, *downwards[i], nullptr);
      downwards.pop_back();
      sweep_up(i, upwards, map);
    }
    return map;
  }

 private:
  int first_row(int strip) const { return strip * strip_rows_; }
  int end_row(int strip) const { return std::min(volume_.height, first_row(strip) + strip_rows_); }

  void fill_strip(int strip) const {
    raystage::parallel_for(first_row(strip), end_row(strip), [&](int y) {
      fill_(y, {costs_.data() + static_cast<std::size_t>(y - first_row(strip)) * row_, row_});
    });
  }

  Strip strip_downwards(int index) const {
    Strip strip;
    strip.width = volume_.width;
    strip.rows = end_row(index) - first_row(index);
    strip.planes = volume_.planes;
    strip.cost = costs_.data();
    strip.sums = sums_.data();
    strip.pixel_step = plane_stride(volume_.planes);
    strip.row_step = static_cast<std::ptrdiff_t>(row_);
    if (!options_.guide.empty()) {
      strip.guide =
          options_.guide.data() + static_cast<std::ptrdiff_t>(first_row(index)) * volume_.width;
    }
    strip.guide_pixel_step = 1;
    strip.guide_row_step = volume_.width;
    strip.rows_before = first_row(index);
    return strip;
  }

  Strip strip_upwards(int index) const {
    Strip strip = strip_downwards(index);
    const std::ptrdiff_t last =
        (strip.rows - 1) * strip.row_step + (strip.width - 1) * strip.pixel_step;
    strip.cost += last;
    strip.sums += last;
    if (strip.guide != nullptr) {
      strip.guide += static_cast<std::ptrdiff_t>(strip.rows) * strip.width - 1;
    }
    strip.pixel_step = -strip.pixel_step;
    strip.row_step = -strip.row_step;
    strip.guide_pixel_step = -strip.guide_pixel_step;
    strip.guide_row_step = -strip.guide_row_step;
    strip.rows_before = volume_.height - end_row(index);
    return strip;
  }

  void sweep_down(int strip, Entering& entering, Entering* leaving) const {
    Sweep sweep(strip_downwards(strip), options_.p1, p2_);
    sweep.enter(entering);
    sweep.run([](int, int, const PathRun& run) { start_path_sums(run); });
    if (leaving != nullptr) sweep.leave(*leaving);
  }

  void sweep_up(int strip, Entering& entering, PlaneMap& map) const {
    Sweep sweep(strip_upwards(strip), options_.p1, p2_);
    sweep.enter(entering);
    const int last_row = end_row(strip) - 1;
    sweep.run([&](int x, int y, const PathRun& run) {
      std::array<int, kMaxPathPixels> best;
      complete_path_sums(run, best.data());
      const std::size_t at =
          static_cast<std::size_t>(last_row - y) * volume_.width + (volume_.width - 1 - x);
      for (int i = 0; i < run.count; ++i) {
        const int plane = best[i];
        const std::uint16_t* sums = run.sums + i * run.pixel_step;
        const bool between =
            options_.subplane_refinement && plane > 0 && plane + 1 < volume_.planes;
        const float offset =
            between ? parabola_vertex(sums[plane - 1], sums[plane], sums[plane + 1]) : 0;
        map.plane[at - static_cast<std::size_t>(i)] = static_cast<float>(plane) + offset;
        map.cost[at - static_cast<std::size_t>(i)] = (run.cost + i * run.pixel_step)[plane];
      }
    });
    sweep.leave(entering);
  }

  const CostVolume& volume_;
  const FillCosts& fill_;
  const SemiGlobalOptions& options_;
  std::vector<std::uint16_t> p2_;
  std::size_t row_ = 0;  // elements
  int strip_rows_ = 0;
  LargeBuffer<std::uint8_t> costs_;
  LargeBuffer<std::uint16_t> sums_;
};

void check(const CostVolume& volume, const SemiGlobalOptions& s) {
  if (volume.width < 1 || volume.height < 1 || volume.planes < 1) {
    throw std::logic_error("semi-global matching: no pixels or no planes");
  }
  const std::size_t pixels = static_cast<std::size_t>(volume.width) * volume.height;
  std::string reason;
  if (!s.is_valid(&reason)) throw std::logic_error("semi-global matching: " + reason);
  if (!s.guide.empty() && s.guide.size() != pixels) {
    throw std::logic_error("semi-global matching: the guide image has another size");
  }
}

}  // namespace

bool SemiGlobalOptions::is_valid(std::string* reason) const {
  return is_within("p2", p2, 0, 4000, reason) && is_within("p1", p1, 0, p2, reason) &&
         is_within("guide_scale", guide_scale, 1e-9, 1e9, reason);
}

std::size_t semi_global_bytes(const CostVolume& volume, std::size_t working_bytes) {
  return bytes_of_strips(volume, rows_of_strip(volume, working_bytes));
}

PlaneMap semi_global_match(const CostVolume& volume, const FillCosts& fill,
                           const SemiGlobalOptions& options) {
  check(volume, options);
  return SemiGlobal(volume, fill, options).match();
}

}  // namespace raystage::matching
