// SPDX-License-Identifier: Apache-2.0
#include "compose/preview/preview.h"

#include "compose/exr/exr_file.h"
#include "testing/compose/test_exr_view.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
}
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"
#include "base/transfer_function.h"
#include "compose/preview/contact_sheet.h"
#include "compose/preview/movie_writer.h"
#include "compose/sequence_name.h"
#include "images/image_reader.h"
#include "testing/test_folder.h"

namespace raystage::compose {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr int kWidth = 161, kHeight = 91;  // odd, as a crop may be

/// Returns a view of one colour, transparent in the right half.
render::RenderedView flat_view(float r, float g, float b, int width = kWidth,
                               int height = kHeight) {
  render::RenderedView view;
  view.width = width;
  view.height = height;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const float alpha = x < width / 2 ? 1.0F : 0.0F;
      view.rgba.insert(view.rgba.end(), {alpha * r, alpha * g, alpha * b, alpha});
      view.coverage.push_back(alpha);
      view.z.push_back(2);
    }
  }
  return view;
}

struct Movie {
  int width = 0, height = 0, frames = 0;
  AVRational rate{};
  AVColorSpace colorspace{};
  AVColorRange range{};
  std::vector<int> luma;  ///< of a pixel in the left half, per frame
  int cb = 0, cr = 0;     ///< of this pixel in the first frame
};

/// Reads a movie with FFmpeg's demuxer and decoder.
Movie read_movie(const std::filesystem::path& file) {
  Movie movie;
  AVFormatContext* format = nullptr;
  EXPECT_EQ(avformat_open_input(&format, file.c_str(), nullptr, nullptr), 0);
  if (format == nullptr) return movie;
  EXPECT_GE(avformat_find_stream_info(format, nullptr), 0);
  EXPECT_EQ(format->nb_streams, 1U);
  const AVStream& stream = *format->streams[0];
  movie.rate = stream.avg_frame_rate;
  AVCodecContext* codec = avcodec_alloc_context3(avcodec_find_decoder(stream.codecpar->codec_id));
  avcodec_parameters_to_context(codec, stream.codecpar);
  EXPECT_EQ(avcodec_open2(codec, nullptr, nullptr), 0);
  AVPacket* packet = av_packet_alloc();
  AVFrame* frame = av_frame_alloc();
  bool reading = true;
  while (reading) {
    reading = av_read_frame(format, packet) >= 0;
    EXPECT_GE(avcodec_send_packet(codec, reading ? packet : nullptr), 0);
    while (avcodec_receive_frame(codec, frame) >= 0) {
      movie.luma.push_back(frame->data[0][20 * frame->linesize[0] + 20]);
      if (movie.frames++ == 0) {
        movie.width = frame->width;
        movie.height = frame->height;
        movie.colorspace = frame->colorspace;
        movie.range = frame->color_range;
        movie.cb = frame->data[1][10 * frame->linesize[1] + 10];
        movie.cr = frame->data[2][10 * frame->linesize[2] + 10];
      }
    }
    av_packet_unref(packet);
  }
  av_frame_free(&frame);
  av_packet_free(&packet);
  avcodec_free_context(&codec);
  avformat_close_input(&format);
  return movie;
}

class Preview : public ::testing::Test {
 protected:
  void write_frame(int frame, const render::RenderedView& view) {
    ExrMetadata metadata;
    metadata.fps_numerator = 30;
    const ExrCamera camera{.view = render::virtual_camera_with_fov(view.width, view.height, 1, {})};
    testing::write_exr({{testing::exr_view(view)}}, {{camera}}, metadata,
                       SequenceName(options_.pictures_of.sequences.front()).path(frame));
  }
  std::string refusal() {
    try {
      make_preview(options_, {});
    } catch (const Error& error) {
      return error.what();
    }
    return "accepted";
  }

  testing::TestFolder folder_;
  PreviewOptions options_ = [this] {
    PreviewOptions options;
    options.pictures_of.sequences = {(folder_.path() / "a.####.exr").string()};
    options.movie = folder_.path() / "a.mp4";
    return options;
  }();
};

TEST_F(Preview, MovieHasTheFramesColoursAndRateOfTheSequence) {
  const float grey = static_cast<float>(linear_from_srgb(0.5));
  for (int i = 1; i <= 6; ++i) write_frame(i, flat_view(grey, grey, grey));
  write_frame(7, flat_view(1, 0, 0));
  const PreviewReport report = make_preview(options_, {});
  EXPECT_EQ(report.frames, 7);
  EXPECT_EQ(report.fps, 30);
  const Movie movie = read_movie(options_.movie);
  EXPECT_EQ(movie.frames, 7);
  EXPECT_EQ(movie.width, kWidth + 1);
  EXPECT_EQ(movie.height, kHeight + 1);
  EXPECT_EQ(movie.rate.num, 30);
  EXPECT_EQ(movie.rate.den, 1);
  EXPECT_EQ(movie.colorspace, AVCOL_SPC_BT709);
  EXPECT_EQ(movie.range, AVCOL_RANGE_MPEG);
  EXPECT_NEAR(movie.luma.front(), 16 + 219 * 0.5, 3) << "sRGB curve and limited range";
  EXPECT_NEAR(movie.cb, 128, 2);
  EXPECT_NEAR(movie.cr, 128, 2);
  EXPECT_NEAR(movie.luma.back(), 16 + 219 * 0.2126, 3) << "the red of Rec.709, not of Rec.601";
}

TEST_F(Preview, StepsInASequenceKeepItsSpeed) {
  for (const int i : {1, 3, 5}) write_frame(i, flat_view(1, 1, 1));
  EXPECT_EQ(make_preview(options_, {}).fps, 15);
  EXPECT_EQ(read_movie(options_.movie).frames, 3);
  options_.fps = 23.976;
  make_preview(options_, {});
  EXPECT_EQ(read_movie(options_.movie).rate.num, 24000);
}

TEST_F(Preview, MissingFramesAreNamedOrHeld) {
  for (const int i : {1, 2, 4}) write_frame(i, flat_view(1, 1, 1));
  EXPECT_THAT(refusal(), HasSubstr("1 of 4 frames are missing (3)"));
  EXPECT_FALSE(std::filesystem::exists(options_.movie));
  options_.hold_missing = true;
  const PreviewReport report = make_preview(options_, {});
  EXPECT_EQ(report.frames, 4);
  EXPECT_EQ(report.held, 1);
  EXPECT_EQ(read_movie(options_.movie).frames, 4);
}

TEST_F(Preview, ContactSheetShowsThePicturesInOrder) {
  for (int i = 1; i <= 5; ++i) write_frame(i, flat_view(i == 5 ? 1.0F : 0.0F, 0, 0));
  options_.movie.clear();
  options_.contact_sheet = folder_.path() / "sheet.png";
  options_.sheet_columns = 3;
  options_.pictures_of.display.background = Background::kBlack;
  make_preview(options_, {});
  const store::RgbImage sheet = images::ImageReader().read_rgb(options_.contact_sheet);
  EXPECT_EQ(sheet.width, 8 + 3 * (kWidth + 8));
  EXPECT_EQ(sheet.height, 8 + 2 * (kHeight + 16 + 8));
  const auto red = [&](int column, int row) {
    const auto x = static_cast<std::size_t>(8 + column * (kWidth + 8) + 10);
    const auto y = static_cast<std::size_t>(8 + row * (kHeight + 24) + 10);
    return static_cast<int>(sheet.values[(y * static_cast<std::size_t>(sheet.width) + x) * 3]);
  };
  EXPECT_EQ(red(0, 0), 0);
  EXPECT_EQ(red(0, 1), 0);
  EXPECT_EQ(red(1, 1), 255);
  EXPECT_EQ(red(2, 1), 38) << "an empty place";
}

TEST_F(Preview, PicturesMayCarryTheirFrameNumbers) {
  for (const int i : {7, 8}) write_frame(i, flat_view(0, 0, 0));
  options_.movie.clear();
  options_.pictures = (folder_.path() / "png" / "p.###.png").string();
  options_.pictures_of.display.background = Background::kBlack;
  const auto light = [&](int frame) {
    const store::RgbImage picture = images::ImageReader().read_rgb(
        folder_.path() / "png" / ("p.00" + std::to_string(frame) + ".png"));
    EXPECT_EQ(picture.width, kWidth);
    return std::ranges::count(picture.values, 220);
  };
  EXPECT_EQ(make_preview(options_, {}).frames, 2);
  EXPECT_EQ(light(7), 0);
  options_.burn_in = true;
  make_preview(options_, {});
  // "7  00:00:00:00", the time code: seven dots of the 7, twelve of each 0, two of a colon.
  EXPECT_EQ(light(7), 3 * (7 + 8 * 12 + 3 * 2));
  EXPECT_GT(light(8), light(7));
  options_.pictures = (folder_.path() / "one.png").string();
  EXPECT_THAT(refusal(), HasSubstr("the same name"));
}

TEST_F(Preview, RefusesWhatItCannotShowAndLeavesNothing) {
  EXPECT_THAT(refusal(), HasSubstr("no file of this sequence"));
  write_frame(1, flat_view(1, 1, 1));
  write_frame(2, flat_view(1, 1, 1, 50, 40));
  EXPECT_THAT(refusal(), HasSubstr("a.0002.exr"));
  write_frame(2, flat_view(1, 1, 1));
  options_.movie = folder_.path() / "a.txt";
  EXPECT_THAT(refusal(), HasSubstr("extension"));
  options_.movie = folder_.path() / "missing" / "a.mp4";
  EXPECT_NE(refusal(), "accepted");
  int files = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(folder_.path())) {
    ++files;
  }
  EXPECT_EQ(files, 2) << "nothing but the two frames";
}

TEST_F(Preview, AStopLeavesNothing) {
  write_frame(1, flat_view(1, 1, 1));
  std::stop_source source;
  source.request_stop();
  EXPECT_EQ(make_preview(options_, source.get_token()).status, RunStatus::kStopped);
  EXPECT_FALSE(std::filesystem::exists(options_.movie));
}

TEST(Display, CompositesExposesAndEncodes) {
  ExrImage image;
  image.width = 3;
  image.height = 1;
  image.rgba = {0.25F, 0.5F, 9.0F, 1, 0, 0, 0, 0, 0.1F, NAN, -1.0F, 1};
  store::RgbImage shown = display(image, {});
  EXPECT_THAT(shown.values, ElementsAre(137, 188, 255, 118, 118, 118, 89, 0, 0));
  shown = display(image, {1, Background::kBlack});
  EXPECT_THAT(shown.values, ElementsAre(188, 255, 255, 0, 0, 0, 124, 0, 0));
}

TEST(Display, ShowsOtherPrimariesAsTheyLook) {
  ExrImage image;
  image.width = 4;
  image.height = 1;
  image.rgba = {0.25F, 0.5F, 0.1F, 1, 0.9F, 0.02F, 0.3F, 1, 0, 0, 1, 1, 0.3F, 0.3F, 0.3F, 1};
  const store::RgbImage expected = display(image, {});
  ColorConfig::built_in().to_space("ACEScg").apply(image.rgba);
  const auto expect_shown = [&](const DisplayOptions& settings, int most) {
    const store::RgbImage shown = display(image, settings);
    for (std::size_t i = 0; i < shown.values.size(); ++i) {
      EXPECT_NEAR(shown.values[i], expected.values[i], most) << i;
    }
  };
  image.color_interop_id = "lin_ap1_scene";
  expect_shown({}, 1);
  EXPECT_EQ(downscale(image, 2, 1).color_interop_id, "lin_ap1_scene");
  image.color_interop_id = "unknown";
  image.color_space = "ACEScg";
  expect_shown({}, 1);
  image.color_space.clear();
  DisplayOptions told;
  told.space = "ACEScg";
  expect_shown(told, 1);
  told.view = "ACES 1.0 SDR";
  EXPECT_NE(display(image, told).values, expected.values);
  told.monitor = "nowhere";
  EXPECT_THROW(display(image, told), Error);
}

TEST(Display, ReducingKeepsTheMeanLight) {
  ExrImage image;
  image.width = 7;
  image.height = 5;
  double sum = 0;
  for (int i = 0; i < 35; ++i) {
    image.rgba.insert(image.rgba.end(), {static_cast<float>(i), 0, 0, 1});
    sum += i;
  }
  const ExrImage small = downscale(image, 3, 2);
  EXPECT_EQ(small.width, 3);
  EXPECT_EQ(small.height, 2);
  double small_sum = 0;
  for (std::size_t i = 0; i < 6; ++i) {
    small_sum += small.rgba[i * 4];
    EXPECT_NEAR(small.rgba[i * 4 + 3], 1, 1e-6);
  }
  EXPECT_NEAR(small_sum / 6, sum / 35, 1e-4);
  EXPECT_EQ(downscale(image, 100, 100).rgba, image.rgba);
}

TEST(ContactSheet, SpreadsItsFrames) {
  const std::vector<int> frames{1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11};
  EXPECT_THAT(evenly_spaced_frames(frames, 3), ElementsAre(1, 6, 11));
  EXPECT_THAT(evenly_spaced_frames(frames, 1), ElementsAre(1));
  EXPECT_EQ(evenly_spaced_frames(frames, 20), frames);
}

}  // namespace
}  // namespace raystage::compose
