// SPDX-License-Identifier: Apache-2.0
// Exported movies as FFmpeg, MKVToolNix and mpv read them.
#include "exports/export_movies.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "exports/export_multiview.h"
#include "store/jpeg/decode.h"
#include "testing/exports/export_test_data.h"

namespace raystage::exports::export_movies_test {
namespace {

using nlohmann::json;
using ::testing::ElementsAre;
using testing::ExportTake;
using ::testing::HasSubstr;
using testing::lines_of;
using testing::output_of_program;

json probe(const std::filesystem::path& file, const std::string& stream = "v:0") {
  return json::parse(
      output_of_program({"ffprobe", "-v", "error", "-select_streams", stream, "-count_frames",
                         "-show_streams", "-show_packets", "-of", "json", file.string()}));
}

std::vector<std::int64_t> packet_times(const json& probed) {
  std::vector<std::int64_t> times;
  for (const json& packet : probed["packets"]) times.push_back(packet["pts"].get<std::int64_t>());
  return times;
}

/// Returns the recorded times of a camera in units of 1 / `per_second`, rounded.
std::vector<std::int64_t> recorded_times(int camera, std::int64_t per_second) {
  std::vector<std::int64_t> times;
  for (int frame = 0; frame < ExportTake::kFrames; ++frame) {
    if (!ExportTake::has_frame(camera, frame)) continue;
    times.push_back(std::llround(ExportTake::time_of(camera, frame) * (per_second / 1e9L)));
  }
  return times;
}

/// Returns the packets of a stream as FFmpeg copies them.
std::string copied_packets(const std::filesystem::path& file, const std::string& stream,
                           const std::filesystem::path& to) {
  output_of_program({"ffmpeg", "-nostdin", "-v", "error", "-y", "-i", file.string(), "-map",
                     "0:" + stream, "-c", "copy", "-f", "data", to.string()});
  return read_file(to);
}

std::string joined_jpegs(int camera) {
  std::string all;
  for (int frame = 0; frame < ExportTake::kFrames; ++frame) {
    if (!ExportTake::has_frame(camera, frame)) continue;
    const auto jpeg = ExportTake::jpeg(camera, frame);
    all.append(reinterpret_cast<const char*>(jpeg.data()), jpeg.size());
  }
  return all;
}

TEST(ExportMovies, CopiedFramesAreTheRecordedBytesAtTheRecordedTimes) {
  const ExportTake data(false);
  const store::Take take = data.take();
  for (const auto& [extension, unit] : {std::pair{".mov", std::int64_t{1'000'000}},
                                        std::pair{".mkv", std::int64_t{1'000'000'000}}}) {
    MovieExportOptions options;
    options.output = data.out(std::string("movies") + extension);
    options.extension = extension;
    const ExportReport report = export_movies(take, options, {});
    EXPECT_EQ(report.exit_code(), ExitCode::kSuccess);
    EXPECT_EQ(report.frames(), 21);
    EXPECT_EQ(report.cameras[1].absent, 1);
    for (int camera = 0; camera < ExportTake::kCameras; ++camera) {
      const auto file = options.output / ("c" + std::to_string(camera) + extension);
      const json probed = probe(file);
      EXPECT_EQ(probed["streams"][0]["codec_name"], "mjpeg");
      EXPECT_EQ(probed["streams"][0]["time_base"], "1/" + std::to_string(unit));
      EXPECT_EQ(probed["streams"][0]["nb_read_frames"],
                std::to_string(report.cameras[camera].frames));
      EXPECT_EQ(packet_times(probed), recorded_times(camera, unit)) << file;
      EXPECT_EQ(copied_packets(file, "v:0", data.out("packets")), joined_jpegs(camera)) << file;
    }
    const std::string table = read_file(options.output / "frames.csv");
    const auto times = testing::csv_column(table, "time_ns");
    ASSERT_EQ(times.size(), 21);
    EXPECT_EQ(times[9], std::to_string(ExportTake::time_of(1, 1)));
    EXPECT_EQ(testing::csv_column(table, "source_utc")[0], "2026-01-01T00:00:01.000000001Z");
    EXPECT_EQ(schemas::read_rig(options.output / "rig.json").cameras.size(), 3);
  }
}

TEST(ExportMovies, ConstantTimesHoldAbsentFrames) {
  const ExportTake data;
  MovieExportOptions options;
  options.output = data.out("movies");
  options.frames.times = FrameTimes::kConstant;
  options.frames.cameras = {"c2", "c0"};
  const ExportReport report = export_movies(data.take(), options, {});
  EXPECT_EQ(report.cameras[0].id, "c2");
  EXPECT_EQ(report.cameras[0].held, 2);
  const json probed = probe(options.output / "c2.mov");
  EXPECT_EQ(probed["streams"][0]["r_frame_rate"], "15/1");
  EXPECT_EQ(probed["streams"][0]["nb_read_frames"], "8");
  EXPECT_THAT(packet_times(probed), ElementsAre(0, 1, 2, 3, 4, 5, 6, 7));
  EXPECT_EQ(schemas::read_rig(options.output / "rig.json").cameras.at(0).geometry.id, "c2");
  EXPECT_THAT(
      testing::csv_column(read_file(options.output / "frames.csv"), "held"),
      ElementsAre("0", "0", "0", "0", "1", "1", "0", "0", "0", "0", "0", "0", "0", "0", "0", "0"));
}

TEST(ExportMovies, Ffv1IsLossless) {
  const ExportTake data(false);
  MovieExportOptions options;
  options.output = data.out("movies");
  options.codec = &movie_codec("ffv1");
  export_movies(data.take(), options, {});
  const auto file = options.output / "c1.mkv";
  const json probed = probe(file);
  EXPECT_EQ(probed["streams"][0]["codec_name"], "ffv1");
  EXPECT_EQ(packet_times(probed), recorded_times(1, 1'000'000'000));
  output_of_program({"ffmpeg", "-nostdin", "-v", "error", "-y", "-i", file.string(), "-fps_mode",
                     "passthrough", "-f", "rawvideo", "-pix_fmt", "rgb24",
                     data.out("raw").string()});
  const std::string raw = read_file(data.out("raw"));
  std::string expected;
  store::JpegDecoder decoder;
  for (int frame = 0; frame < ExportTake::kFrames; ++frame) {
    if (!ExportTake::has_frame(1, frame)) continue;
    const store::RgbImage picture = decoder.decode(ExportTake::jpeg(1, frame), "frame");
    expected.append(picture.values.begin(), picture.values.end());
  }
  EXPECT_TRUE(raw == expected);
  // The slices have checksums, which FFmpeg verifies.
  std::string damaged = read_file(file);
  const json packet = probed["packets"][3];
  const std::size_t middle = std::stoul(packet["pos"].get<std::string>()) +
                             std::stoul(packet["size"].get<std::string>()) / 2;
  damaged.at(middle) = static_cast<char>(damaged.at(middle) ^ 1);
  write_file_atomically(data.out("damaged.mkv"), damaged);
  const ChildResult result = run_child({"ffmpeg", "-nostdin", "-v", "error", "-i",
                                        data.out("damaged.mkv").string(), "-f", "null", "-"});
  EXPECT_THAT(result.out, HasSubstr("CRC"));
}

TEST(ExportMovies, ProResShowsThePictures) {
  const ExportTake data(false);
  MovieExportOptions options;
  options.output = data.out("movies");
  options.codec = &movie_codec("prores");
  options.frames.starts_at_zero = true;
  const ExportReport report = export_movies(data.take(), options, {});
  EXPECT_EQ(report.origin_ns, ExportTake::time_of(0, 0));
  const json stream = probe(options.output / "c0.mov")["streams"][0];
  EXPECT_EQ(stream["codec_name"], "prores");
  EXPECT_EQ(stream["profile"], "HQ");
  EXPECT_EQ(stream["pix_fmt"], "yuv422p10le");
  EXPECT_EQ(stream["color_space"], "bt709");
  EXPECT_EQ(stream["color_range"], "tv");
  EXPECT_EQ(stream["nb_read_frames"], "8");
  const auto times = packet_times(probe(options.output / "c2.mov"));
  ASSERT_EQ(times.size(), 6);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(times[i],
              std::llround(
                  (ExportTake::time_of(2, static_cast<int>(i)) - ExportTake::time_of(0, 0)) / 1e3));
  }
  // Colours in flat areas are those of the frame, through the Rec.709 matrix.
  output_of_program({"ffmpeg", "-nostdin", "-v", "error", "-y", "-i",
                     (options.output / "c0.mov").string(), "-frames:v", "1", "-sws_flags",
                     "accurate_rnd+full_chroma_int", "-vf", "scale=in_color_matrix=bt709", "-f",
                     "rawvideo", "-pix_fmt", "rgb24", data.out("raw").string()});
  const std::string raw = read_file(data.out("raw"));
  const store::RgbImage picture = store::JpegDecoder().decode(ExportTake::jpeg(0, 0), "frame");
  ASSERT_EQ(raw.size(), picture.values.size());
  double worst = 0;
  for (int y = 2; y < 14; ++y) {  // the gradient at (24, 0), in blocks without other contents
    for (int x = 34; x < 46; ++x) {
      for (int c = 0; c < 3; ++c) {
        const auto i = picture.offset(x, y) + static_cast<std::size_t>(c);
        worst = std::max(worst, std::abs(static_cast<unsigned char>(raw[i]) -
                                         static_cast<double>(picture.values[i])));
      }
    }
  }
  EXPECT_LE(worst, 4);
}

TEST(ExportMovies, H264HasConstantTimesOnly) {
  const ExportTake data;
  MovieExportOptions options;
  options.output = data.out("movies");
  options.codec = &movie_codec("h264");
  EXPECT_THROW(export_movies(data.take(), options, {}), Error);
  EXPECT_FALSE(std::filesystem::exists(options.output));
  options.frames.times = FrameTimes::kConstant;
  options.frames.fps = 30000.0 / 1001;
  export_movies(data.take(), options, {});
  const json stream = probe(options.output / "c1.mp4")["streams"][0];
  EXPECT_EQ(stream["r_frame_rate"], "30000/1001");
  EXPECT_EQ(stream["nb_read_frames"], "16");
  options.output = data.out("other");
  options.extension = ".avi";
  EXPECT_THROW(export_movies(data.take(), options, {}), Error);
}

TEST(ExportMovies, RottenFramesAreAbsent) {
  const ExportTake data;
  data.rot(0, 2);
  MovieExportOptions options;
  options.output = data.out("gap");
  options.frames.cameras = {"c0"};
  options.frames.absent = AbsentFrames::kGap;
  ExportReport report = export_movies(data.take(), options, {});
  EXPECT_EQ(report.exit_code(), ExitCode::kFellShort);
  EXPECT_EQ(report.rotten(), 1);
  EXPECT_EQ(report.frames(), 7);
  EXPECT_THAT(testing::csv_column(read_file(options.output / "frames.csv"), "source_frame"),
              ElementsAre("0", "1", "3", "4", "5", "6", "7"));
  options.output = data.out("held");
  options.frames.times = FrameTimes::kConstant;
  options.frames.absent = AbsentFrames::kHold;
  report = export_movies(data.take(), options, {});
  EXPECT_EQ(report.exit_code(), ExitCode::kFellShort);
  EXPECT_EQ(report.frames(), 8);
  EXPECT_EQ(report.cameras[0].held, 1);
  EXPECT_THAT(testing::csv_column(read_file(options.output / "frames.csv"), "source_frame"),
              ElementsAre("0", "1", "1", "3", "4", "5", "6", "7"));
  options.output = data.out("black");
  options.frames.absent = AbsentFrames::kBlack;
  options.codec = &movie_codec("ffv1");
  export_movies(data.take(), options, {});
  output_of_program({"ffmpeg", "-nostdin", "-v", "error", "-y", "-i",
                     (options.output / "c0.mkv").string(), "-f", "rawvideo", "-pix_fmt", "rgb24",
                     data.out("raw").string()});
  const std::string raw = read_file(data.out("raw"));
  const std::size_t size = std::size_t{3} * ExportTake::kWidth * ExportTake::kHeight;
  ASSERT_EQ(raw.size(), 8 * size);
  EXPECT_EQ(raw.substr(2 * size, size), std::string(size, '\0'));
  EXPECT_NE(raw.substr(3 * size, size), std::string(size, '\0'));
}

TEST(ExportMovies, TheFolderAppearsWhole) {
  const ExportTake data(false);
  const store::Take take = data.take();
  MovieExportOptions options;
  options.output = data.out("movies");
  std::stop_source stop;
  stop.request_stop();
  EXPECT_ANY_THROW(export_movies(take, options, stop.get_token()));
  EXPECT_THAT(data.names(), ElementsAre("take"));
  std::filesystem::create_directory(options.output);
  EXPECT_THROW(export_movies(take, options, {}), Error);
  EXPECT_TRUE(std::filesystem::is_empty(options.output));
  options.output = data.path() / "movies";
  EXPECT_THROW(export_movies(take, options, {}), Error);
  EXPECT_FALSE(std::filesystem::exists(options.output));
}

TEST(ExportMultiview, AllTracksHaveTheirFramesAndTimes) {
  const ExportTake data(false);
  MultiviewExportOptions options;
  options.output = data.out("all.mkv");
  const ExportReport report = export_multiview(data.take(), options, {});
  EXPECT_EQ(report.frames(), 21);
  const json tracks = json::parse(output_of_program({"mkvmerge", "-J", options.output.string()}));
  ASSERT_EQ(tracks["tracks"].size(), 3);
  EXPECT_TRUE(tracks["warnings"].empty());
  EXPECT_EQ(tracks["attachments"][1]["file_name"], "take.json");
  for (int camera = 0; camera < ExportTake::kCameras; ++camera) {
    EXPECT_EQ(tracks["tracks"][camera]["properties"]["track_name"], "c" + std::to_string(camera));
    EXPECT_EQ(tracks["tracks"][camera]["codec"], "V_MJPEG");
    const std::string stream = "v:" + std::to_string(camera);
    EXPECT_EQ(packet_times(probe(options.output, stream)), recorded_times(camera, 1'000'000'000));
    EXPECT_EQ(copied_packets(options.output, stream, data.out("packets")), joined_jpegs(camera));
  }
  // mpv opens every track, and seeks.
  for (const char* track : {"1", "2", "3"}) {
    const std::string shown =
        output_of_program({"mpv", "--no-config", "--vo=null", "--ao=null", "--frames=3",
                           std::string("--vid=") + track, "--start=1.2", options.output.string()});
    EXPECT_THAT(shown, HasSubstr("VO: [null] 48x32"));
    EXPECT_THAT(shown, HasSubstr("'c2' (mjpeg 48x32)"));
  }
  EXPECT_THROW(export_multiview(data.take(), options, {}), Error);  // exists
  options.existing = ExistingFiles::kOverwrite;
  options.frames.times = FrameTimes::kRecorded;
  options.frames.cameras = {"c1"};
  export_multiview(data.take(), options, {});
  EXPECT_EQ(
      json::parse(output_of_program({"mkvmerge", "-J", options.output.string()}))["tracks"].size(),
      1);
  options.output = data.out("all.mp4");
  EXPECT_THROW(export_multiview(data.take(), options, {}), Error);
}

}  // namespace
}  // namespace raystage::exports::export_movies_test
