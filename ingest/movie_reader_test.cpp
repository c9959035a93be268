// SPDX-License-Identifier: Apache-2.0
// Tests movies that are read directly, and movies as cameras of an import.
#include "ingest/movie_reader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "base/error.h"
#include "ingest/import_take.h"
#include "store/take.h"
#include "testing/ingest/import_test_data.h"
#include "testing/ingest/test_movie.h"
#include "testing/test_data.h"
#include "testing/test_folder.h"

namespace raystage::ingest {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

class Movie : public ::testing::Test {
 protected:
  std::filesystem::path file(const std::string& name) const { return folder_.path() / name; }
  std::filesystem::path take() const { return folder_.path() / "take"; }

  /// Writes an archive, which is a Motion JPEG movie.
  std::vector<std::string> write_mjpeg(const std::string& name, int frames) const {
    std::vector<std::string> jpegs;
    store::ArchiveWriter writer(file(name), file(name + ".journal"),
                                {.camera_id = "a", .width = 48, .height = 40, .epoch_utc = 0});
    for (int i = 0; i < frames; ++i) {
      jpegs.push_back(testing::jpeg_as_string(testing::picture(48, 40, i)));
      writer.append(std::as_bytes(std::span(jpegs.back())), i * 40'000'000LL);
    }
    writer.close();
    return jpegs;
  }
  schemas::ImportManifest manifest(const std::string& movie, int times) const {
    schemas::ImportManifest result = testing::empty_manifest();
    result.cameras.push_back(testing::camera("a", 48, 40));
    result.cameras[0].movie = movie;
    for (int i = 0; i < times; ++i) result.cameras[0].times_ns.push_back(i * 41'234'567LL);
    return result;
  }
  std::string refusal(const schemas::ImportManifest& what) const {
    try {
      import_take(what, folder_.path(), take(), {});
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kBadInput) << error.what();
      EXPECT_FALSE(std::filesystem::exists(take()));
      return error.what();
    }
    return "accepted";
  }
  testing::TestFolder folder_;
};

TEST_F(Movie, MotionJpegIsStoredByteForByte) {
  const std::vector<std::string> jpegs = write_mjpeg("m.mkv", 5);
  const schemas::ImportManifest what = manifest("m.mkv", 5);
  const ImportSummary summary = import_take(what, folder_.path(), take(), {});
  EXPECT_EQ(summary.copied, 5);
  const store::Take read(take());
  ASSERT_EQ(read.archive(0).frames().size(), 5u);
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_EQ(testing::bytes_to_string(read.archive(0).jpeg(static_cast<int>(i))), jpegs[i]);
    EXPECT_EQ(read.archive(0).frames()[i].time_ns, what.cameras[0].times_ns[i]);
  }
}

TEST_F(Movie, MotionJpegTakesRestartMarkers) {
  write_mjpeg("m.mkv", 2);
  const auto summary =
      import_take(manifest("m.mkv", 2), folder_.path(), take(), {.restart_markers = 1});
  EXPECT_EQ(summary.rewritten, 2);
  EXPECT_EQ(store::parse_jpeg_layout(store::Take(take()).archive(0).jpeg(1), "").restart_interval,
            1);
}

TEST_F(Movie, OneTimePerFrame) {
  write_mjpeg("m.mkv", 5);
  testing::write_movie(file("v.mkv"), {.width = 48, .height = 40, .frames = 5});
  for (const char* movie : {"m.mkv", "v.mkv"}) {
    for (const int times : {1, 4, 6}) {
      EXPECT_THAT(refusal(manifest(movie, times)),
                  AllOf(HasSubstr(movie), HasSubstr("the movie has 5 frames"),
                        HasSubstr("has " + std::to_string(times) + " times")));
    }
  }
}

TEST_F(Movie, RatesAreRefusedWhoseTimesNoTakeHolds) {
  write_mjpeg("m.mkv", 2);
  schemas::ImportManifest what = manifest("m.mkv", 0);
  what.nominal_fps = 1e-300;
  EXPECT_THAT(refusal(what), HasSubstr("take.json#/nominal_fps: found 1e-300"));
  what.nominal_fps = 1e-9;
  EXPECT_THAT(refusal(what), HasSubstr("outside of 0 to 104 days"));
}

/// Returns R, G, B in [0, 255] of a Y, Cb, Cr code, by the formulas of the standards.
std::array<double, 3> rgb_of(std::array<int, 3> yuv, double kr, double kb, bool full_range) {
  const double y = full_range ? yuv[0] : (yuv[0] - 16) * 255 / 219.0;
  const double scale = full_range ? 1 : 255 / 224.0;
  const double cb = (yuv[1] - 128) * scale, cr = (yuv[2] - 128) * scale;
  const double r = y + 2 * (1 - kr) * cr, b = y + 2 * (1 - kb) * cb;
  return {r, (y - kr * r - kb * b) / (1 - kr - kb), b};
}

TEST_F(Movie, MatrixAndRangeAreHonoured) {
  struct Standard {
    AVColorSpace matrix;
    double kr, kb;
  };
  constexpr std::array<int, 3> kYuv{120, 100, 160};
  for (const Standard& standard :
       {Standard{AVCOL_SPC_BT709, 0.2126, 0.0722}, Standard{AVCOL_SPC_SMPTE170M, 0.299, 0.114},
        Standard{AVCOL_SPC_UNSPECIFIED, 0.299, 0.114}}) {
    for (const AVColorRange range : {AVCOL_RANGE_MPEG, AVCOL_RANGE_JPEG}) {
      testing::write_movie(file("v.mkv"), {.width = 48,
                                           .height = 40,
                                           .frames = 1,
                                           .yuv = kYuv,
                                           .matrix = standard.matrix,
                                           .range = range});
      MovieReader reader(file("v.mkv"));
      MovieFrame frame;
      ASSERT_TRUE(reader.next(frame));
      ASSERT_EQ(frame.image.values.size(), 48u * 40 * 3);
      const auto expected = rgb_of(kYuv, standard.kr, standard.kb, range == AVCOL_RANGE_JPEG);
      for (std::size_t c = 0; c < 3; ++c) {
        EXPECT_NEAR(frame.image.values[3 * 500 + c], expected[c], 1.5)
            << "matrix " << standard.matrix << " range " << range << " channel " << c;
      }
      EXPECT_FALSE(reader.next(frame));
    }
  }
}

TEST_F(Movie, OtherCodecsAreEncoded) {
  testing::write_movie(file("v.mkv"), {.width = 48, .height = 40, .frames = 3});
  const ImportSummary summary = import_take(manifest("v.mkv", 3), folder_.path(), take(), {});
  EXPECT_EQ(summary.encoded, 3);
}

TEST_F(Movie, TheSizeMustBeTheCameras) {
  write_mjpeg("m.mkv", 1);
  testing::write_movie(file("v.mkv"), {.width = 48, .height = 40, .frames = 1});
  for (const char* movie : {"m.mkv", "v.mkv"}) {
    schemas::ImportManifest what = manifest(movie, 1);
    what.cameras[0].geometry.height = 64;
    EXPECT_THAT(refusal(what), HasSubstr("the image is 48x40, but its camera is 48x64"));
  }
}

TEST_F(Movie, WhatIsNoMovieIsRefused) {
  write_file_atomically(file("a.mp4"), "this is no movie at all");
  write_file_atomically(file("empty.mp4"), "");
  for (const char* movie : {"a.mp4", "empty.mp4"}) {
    EXPECT_THAT(refusal(manifest(movie, 1)), HasSubstr(movie));
  }
  EXPECT_THROW(MovieReader(file("none.mp4")), Error);
}

TEST_F(Movie, ACutMovieIsRefused) {
  write_mjpeg("m.mkv", 3);
  const std::string whole = read_file(file("m.mkv"));
  write_file_atomically(file("m.mkv"), whole.substr(0, whole.size() * 6 / 10));
  EXPECT_NE(refusal(manifest("m.mkv", 3)), "accepted");
}

TEST_F(Movie, RecordedWebcams) {
  const auto data = testing::test_data() / "four_webcams" / "import.json";
  if (!std::filesystem::exists(data)) GTEST_SKIP() << "no data at " << data;
  const schemas::ImportManifest what = schemas::read_import_manifest(data);
  const ImportSummary summary = import_take(what, data.parent_path(), take(), {});
  EXPECT_EQ(summary.encoded, 4 * 57);
  const store::Take read(take());
  for (int c = 0; c < 4; ++c) {
    const auto frames = read.archive(c).frames();
    ASSERT_EQ(frames.size(), 57u);
    for (std::size_t i = 0; i < frames.size(); ++i) {
      EXPECT_EQ(frames[i].time_ns, what.cameras[c].times_ns[i]);
    }
  }
}

}  // namespace
}  // namespace raystage::ingest
