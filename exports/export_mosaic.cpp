// SPDX-License-Identifier: Apache-2.0
// Tiles the cameras' frames. Frames are decoded at an 8th, 4th or half of their size by the scaled
// inverse DCT where that is at least the tile's, then reduced by area. Cost: JPEG decoding.
#include "exports/export_mosaic.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <set>
#include <utility>

#include "base/cancellation.h"
#include "base/error.h"
#include "base/frame_rate.h"
#include "base/options.h"
#include "base/parallel.h"
#include "exports/source_frames.h"
#include "images/resize.h"

namespace raystage::exports {
namespace {

constexpr int kMaxMosaicSize = 16384;  // pixels, of libx264

/// Makes the tiles of one camera.
class TileSource {
 public:
  TileSource(const store::Take& take, const CameraFrames& frames, AbsentFrames absent, int width,
             int height)
      : source_(take, frames, absent), width_(width), height_(height) {
    const rig::CameraModel& model = take.rig().cameras[frames.camera].model;
    const double scale = std::min(static_cast<double>(width) / model.width(),
                                  static_cast<double>(height) / model.height());
    picture_width_ = std::clamp(static_cast<int>(std::lround(model.width() * scale)), 1, width);
    picture_height_ = std::clamp(static_cast<int>(std::lround(model.height() * scale)), 1, height);
    for (const int divisor : {2, 4, 8}) {
      if (model.width() / divisor >= picture_width_) divisor_ = divisor;
    }
  }

  /// Reads the next frame and returns its tile.
  const store::RgbImage& next() {
    const auto ready = source_.next();
    if (ready && ready->frame.source != shown_) {
      const store::RgbImage picture =
          decoder_.decode_scaled(ready->jpeg, divisor_, source_.counts().id);
      tile_ = images::resize(picture, picture_width_, picture_height_);
      shown_ = ready->frame.source;
    }
    return tile_;
  }
  int left() const { return (width_ - picture_width_) / 2; }
  int top() const { return (height_ - picture_height_) / 2; }
  const ExportReport::Camera& counts() const { return source_.counts(); }

 private:
  SourceFrames source_;
  store::JpegDecoder decoder_;
  store::RgbImage tile_;
  int width_, height_, picture_width_ = 1, picture_height_ = 1, divisor_ = 1;
  int shown_ = -2;  // none yet
};

void copy_tile(const store::RgbImage& tile, int left, int top, store::RgbImage& mosaic) {
  for (int y = 0; y < tile.height; ++y) {
    std::ranges::copy(tile.row(y), mosaic.values.begin() +
                                       static_cast<std::ptrdiff_t>(mosaic.offset(left, top + y)));
  }
}

}  // namespace

bool MosaicExportOptions::is_valid(std::string* reason) const {
  if (frames.times != FrameTimes::kConstant) {
    *reason = "a mosaic has constant times only";
    return false;
  }
  if (codec->copies_jpeg()) {
    *reason = "a mosaic is made of decoded pictures: its codec cannot copy JPEG";
    return false;
  }
  if (frames.absent == AbsentFrames::kGap) {
    *reason = "the cameras of a mosaic share their times: a gap of one would shift it";
    return false;
  }
  return is_within("tile_width", tile_width, 16, 4096, reason) &&
         is_within("columns", columns, 0, 1000, reason);
}

MosaicLayout mosaic_layout(const rig::Rig& rig, const std::vector<int>& cameras, int columns) {
  MosaicLayout layout;
  std::set<int> used_rows, used_columns;
  std::set<std::pair<int, int>> places;
  bool is_grid = columns == 0;
  for (const int camera : cameras) {
    const rig::Rig::Camera& of_rig = rig.cameras[camera];
    is_grid = is_grid && of_rig.row && of_rig.column &&
              places.emplace(*of_rig.row, *of_rig.column).second;
    if (!is_grid) break;
    used_rows.insert(*of_rig.row);
    used_columns.insert(*of_rig.column);
  }
  const auto rank = [](const std::set<int>& values, int value) {
    return static_cast<int>(std::distance(values.begin(), values.find(value)));
  };
  if (is_grid) {
    layout.columns = static_cast<int>(used_columns.size());
    layout.rows = static_cast<int>(used_rows.size());
    for (const int camera : cameras) {
      layout.positions.push_back({rank(used_columns, *rig.cameras[camera].column),
                                  rank(used_rows, *rig.cameras[camera].row)});
    }
    return layout;
  }
  const auto count = static_cast<int>(cameras.size());
  layout.columns = columns > 0 ? std::min(columns, count)
                               : static_cast<int>(std::ceil(std::sqrt(static_cast<double>(count))));
  layout.rows = (count + layout.columns - 1) / layout.columns;
  for (int i = 0; i < count; ++i) {
    layout.positions.push_back({i % layout.columns, i / layout.columns});
  }
  return layout;
}

ExportReport export_mosaic(const store::Take& take, const MosaicExportOptions& options,
                           const std::stop_token& stop) {
  require_valid(options, options.output.string());
  movie_extension(*options.codec, options.output);
  check_output_file(options.output, options.existing, take);
  const FrameChoice choice = choose_frames(take, options.frames);
  std::vector<int> cameras;
  for (const CameraFrames& camera : choice.cameras) cameras.push_back(camera.camera);
  const MosaicLayout layout = mosaic_layout(take.rig(), cameras, options.columns);
  const rig::CameraModel& first = take.rig().cameras[cameras.front()].model;
  const int tile_height = std::max(
      1, static_cast<int>(std::lround(1.0 * options.tile_width * first.height() / first.width())));
  const std::int64_t width = std::int64_t{layout.columns} * options.tile_width;
  const std::int64_t height = std::int64_t{layout.rows} * tile_height;
  if (std::max(width, height) > kMaxMosaicSize) {
    throw Error::bad_input(fmt::format("the mosaic would have {}x{} pixels, allowed: {}", width,
                                       height, kMaxMosaicSize),
                           options.output.string(), "Choose smaller tiles or fewer cameras")
        .concerning({"tile_width"});
  }
  const std::size_t frames = choice.cameras.front().frames.size();
  const auto rate = frame_rate_from(std::round(choice.fps * 1e6) / 1e6);
  if (!rate) {
    throw Error::bad_input(fmt::format("movies cannot have {} frames per second", choice.fps),
                           options.output.string(), "Give another rate")
        .concerning({"fps"});
  }
  check_free_space(options.output,
                   options.codec->estimated_bytes(
                       0, static_cast<double>(width * height) * static_cast<double>(frames)));
  const CancellationScope scope(stop);
  MovieDescription description;
  description.name = take.document().name;
  description.width = static_cast<int>(width);
  description.height = static_cast<int>(height);
  description.epoch_utc = take.document().epoch_utc + choice.origin_ns;
  description.rate = rate;
  const auto movie = options.codec->create(options.output, description);
  std::vector<std::unique_ptr<TileSource>> tiles;
  for (const CameraFrames& camera : choice.cameras) {
    tiles.push_back(std::make_unique<TileSource>(take, camera, options.frames.absent,
                                                 options.tile_width, tile_height));
  }
  store::RgbImage mosaic(description.width, description.height);
  for (std::size_t n = 0; n < frames; ++n) {
    parallel_for(std::size_t{0}, tiles.size(), [&](std::size_t i) {
      const store::RgbImage& tile = tiles[i]->next();
      const MosaicLayout::Position& at = layout.positions[i];
      copy_tile(tile, at.column * options.tile_width + tiles[i]->left(),
                at.row * tile_height + tiles[i]->top(), mosaic);
    });
    movie->append({}, &mosaic, choice.cameras.front().frames[n].time_ns);
    options.progress(static_cast<double>(n + 1) / static_cast<double>(frames));
  }
  movie->close();
  ExportReport report;
  for (const auto& tile : tiles) report.cameras.push_back(tile->counts());
  report.fps = choice.fps;
  report.origin_ns = choice.origin_ns;
  report.notes.push_back(fmt::format("{} columns and {} rows of {}x{} pixels", layout.columns,
                                     layout.rows, options.tile_width, tile_height));
  report.status = RunStatus::kFinished;
  return report;
}

}  // namespace raystage::exports
