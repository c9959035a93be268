// SPDX-License-Identifier: Apache-2.0
#include "exports/export_mosaic.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "images/resize.h"
#include "store/jpeg/decode.h"
#include "testing/exports/export_test_data.h"

namespace raystage::exports::export_mosaic_test {
namespace {

using testing::ExportTake;
using testing::output_of_program;

rig::Rig grid_rig(const std::vector<std::pair<int, int>>& places) {
  schemas::RigDocument document = testing::rig_document(static_cast<int>(places.size()));
  for (std::size_t i = 0; i < places.size(); ++i) {
    document.cameras[i].geometry.row = places[i].first;
    document.cameras[i].geometry.column = places[i].second;
  }
  return rig::rig_from_document(document);
}

void expect_positions(const MosaicLayout& layout, const std::vector<std::pair<int, int>>& places) {
  ASSERT_EQ(layout.positions.size(), places.size());
  for (std::size_t i = 0; i < places.size(); ++i) {
    EXPECT_EQ(layout.positions[i].row, places[i].first) << i;
    EXPECT_EQ(layout.positions[i].column, places[i].second) << i;
  }
}

TEST(MosaicLayout, CamerasAreWhereTheGridHasThem) {
  const rig::Rig rig = grid_rig({{2, 5}, {4, 1}, {2, 1}, {4, 9}});
  const MosaicLayout layout = mosaic_layout(rig, {0, 1, 2, 3}, 0);
  EXPECT_EQ(layout.rows, 2);
  EXPECT_EQ(layout.columns, 3);
  expect_positions(layout, {{0, 1}, {1, 0}, {0, 0}, {1, 2}});
  expect_positions(mosaic_layout(rig, {3, 1}, 0), {{0, 1}, {0, 0}});
}

TEST(MosaicLayout, OthersAreInTheirOrder) {
  const rig::Rig rig = grid_rig({{0, 0}, {0, 1}, {0, 1}, {1, 0}, {1, 1}});  // two at one place
  const MosaicLayout layout = mosaic_layout(rig, {0, 1, 2, 3, 4}, 0);
  EXPECT_EQ(layout.rows, 2);
  EXPECT_EQ(layout.columns, 3);
  expect_positions(layout, {{0, 0}, {0, 1}, {0, 2}, {1, 0}, {1, 1}});
  expect_positions(mosaic_layout(rig, {4, 3, 2}, 2), {{0, 0}, {0, 1}, {1, 0}});
}

TEST(ExportMosaic, TilesAreTheFramesOfATick) {
  const ExportTake data;
  const store::Take take = data.take();
  MosaicExportOptions options;
  options.output = data.out("all.mkv");
  options.codec = &movie_codec("ffv1");
  options.frames.times = FrameTimes::kConstant;
  options.frames.absent = AbsentFrames::kBlack;
  options.tile_width = 24;
  options.columns = 2;
  const ExportReport report = export_mosaic(take, options, {});
  EXPECT_EQ(report.cameras[2].absent, 2);
  output_of_program({"ffmpeg", "-nostdin", "-v", "error", "-y", "-i", options.output.string(), "-f",
                     "rawvideo", "-pix_fmt", "rgb24", data.out("raw").string()});
  const std::string raw = read_file(data.out("raw"));
  constexpr int kWidth = 48, kHeight = 32, kTileWidth = 24, kTileHeight = 16;
  constexpr std::size_t kBytes = std::size_t{3} * kWidth * kHeight;
  ASSERT_EQ(raw.size(), 8 * kBytes);
  store::JpegDecoder decoder;
  for (int tick = 0; tick < ExportTake::kFrames; ++tick) {
    store::RgbImage expected(kWidth, kHeight);
    for (int camera = 0; camera < ExportTake::kCameras; ++camera) {
      if (!ExportTake::has_frame(camera, tick)) continue;
      const store::RgbImage tile =
          images::resize(decoder.decode_scaled(ExportTake::jpeg(camera, tick), 2, "frame"),
                         kTileWidth, kTileHeight);
      for (int y = 0; y < kTileHeight; ++y) {
        for (int x = 0; x < kTileWidth; ++x) {
          std::ranges::copy(
              tile.pixel(x, y),
              expected.pixel(x + camera % 2 * kTileWidth, y + camera / 2 * kTileHeight).begin());
        }
      }
    }
    const std::string frame = raw.substr(static_cast<std::size_t>(tick) * kBytes, kBytes);
    EXPECT_TRUE(frame == std::string(expected.values.begin(), expected.values.end())) << tick;
  }
}

TEST(ExportMosaic, IsAMovieWithTheRateOfTheTake) {
  const ExportTake data;
  MosaicExportOptions options;
  options.output = data.out("all.mp4");
  options.frames.times = FrameTimes::kConstant;
  options.tile_width = 64;
  export_mosaic(data.take(), options, {});
  const auto probed = nlohmann::json::parse(
      output_of_program({"ffprobe", "-v", "error", "-count_frames", "-show_streams", "-of", "json",
                         options.output.string()}));
  EXPECT_EQ(probed["streams"][0]["width"], 128);  // two columns
  EXPECT_EQ(probed["streams"][0]["height"], 86);  // two rows of 43
  EXPECT_EQ(probed["streams"][0]["nb_read_frames"], "8");
  EXPECT_EQ(probed["streams"][0]["r_frame_rate"], "15/1");
  EXPECT_THROW(export_mosaic(data.take(), options, {}), Error);  // exists
  options.existing = ExistingFiles::kOverwrite;
  options.tile_width = 16;
  export_mosaic(data.take(), options, {});
  options.output = data.out("new.mp4");
  options.codec = &movie_codec("copy");
  EXPECT_THROW(export_mosaic(data.take(), options, {}), Error);
  options.codec = &movie_codec("prores");
  EXPECT_THROW(export_mosaic(data.take(), options, {}), Error);  // not in .mp4
  options.codec = &movie_codec("h264");
  options.frames.times = FrameTimes::kRecorded;
  EXPECT_THROW(export_mosaic(data.take(), options, {}), Error);
  EXPECT_FALSE(std::filesystem::exists(options.output));
}

}  // namespace
}  // namespace raystage::exports::export_mosaic_test
