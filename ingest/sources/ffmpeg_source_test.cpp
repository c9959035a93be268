// SPDX-License-Identifier: Apache-2.0
// Tests files: movies and numbered images.
#include "ingest/sources/ffmpeg_source.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <thread>

#include "base/atomic_file.h"
#include "base/error.h"
#include "ingest/sources/jpeg_markers.h"
#include "testing/ingest/test_pictures.h"
#include "testing/test_folder.h"

namespace raystage::ingest {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;
using Outcome = FrameSource::Outcome;

std::vector<std::vector<std::byte>> numbered(const std::filesystem::path& folder,
                                             const std::vector<int>& widths) {
  std::vector<std::vector<std::byte>> files;
  for (std::size_t i = 0; i < widths.size(); ++i) {
    files.push_back(testing::test_jpeg(widths[i], 24, static_cast<int>(40 + 10 * i)));
    write_file_atomically(folder / fmt::format("{:03}.jpg", i), files.back());
  }
  return files;
}

TEST(FfmpegFile, NumberedImagesComeByteForByte) {
  const testing::TestFolder folder;
  const auto files = numbered(folder.path(), {32, 32, 48, 32});
  const auto source = open_ffmpeg_source(
      {.url = "%03d.jpg", .format = "", .options = {}, .realtime = false}, folder.path());
  EXPECT_EQ(source->description().width, 32);
  SourceFrame frame;
  for (const auto& file : files) {
    ASSERT_EQ(source->next(frame, 2000ms), Outcome::kFrame);
    EXPECT_EQ(frame.jpeg, file);
  }
  EXPECT_EQ(source->next(frame, 2000ms), Outcome::kEnded);
  EXPECT_EQ(source->next(frame, 2000ms), Outcome::kEnded);
  EXPECT_TRUE(source->loss_reason().empty());
}

TEST(FfmpegFile, WhatWasReadAheadArrivesWhenItIsTaken) {
  const testing::TestFolder folder;
  numbered(folder.path(), std::vector<int>(20, 32));
  const auto source = open_ffmpeg_source(
      {.url = "%03d.jpg", .format = "", .options = {}, .realtime = false}, folder.path());
  EXPECT_FALSE(source->description().live);
  std::this_thread::sleep_for(50ms);
  Nanoseconds before = host_steady_now();
  SourceFrame frame;
  while (source->next(frame, 2000ms) == Outcome::kFrame) {
    EXPECT_GT(frame.arrival_steady, before);
    before = frame.arrival_steady;
  }
}

TEST(FfmpegFile, RealtimeKeepsThePaceOfTheFile) {
  const testing::TestFolder folder;
  numbered(folder.path(), {32, 32, 32, 32, 32, 32});
  const auto source = open_ffmpeg_source(
      {.url = "%03d.jpg", .format = "", .options = {{"framerate", "20"}}, .realtime = true},
      folder.path());
  EXPECT_EQ(source->description().fps, 20);
  SourceFrame frame;
  ASSERT_EQ(source->next(frame, 2000ms), Outcome::kFrame);
  const auto start = Clock::now();
  const Nanoseconds first = frame.arrival_steady;
  EXPECT_EQ(source->next(frame, 1ms), Outcome::kNoData);
  source->interrupt();
  EXPECT_EQ(source->next(frame, 1000ms), Outcome::kNoData);
  for (int i = 1; i < 6; ++i) ASSERT_EQ(source->next(frame, 2000ms), Outcome::kFrame);
  EXPECT_GE(Clock::now() - start, 240ms);
  EXPECT_GE(frame.arrival_steady - first, 240'000'000);
  EXPECT_EQ(source->next(frame, 2000ms), Outcome::kEnded);
}

TEST(FfmpegFile, MissingAndWrongFilesAreBadInput) {
  const testing::TestFolder folder;
  write_file_atomically(folder.path() / "text.mkv", std::string_view("no movie"));
  for (const char* name : {"missing.mkv", "text.mkv", "%05d.jpg"}) {
    try {
      open_ffmpeg_source({.url = name, .format = "", .options = {}, .realtime = false},
                         folder.path());
      ADD_FAILURE() << name;
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
      EXPECT_THAT(error.where(), ::testing::HasSubstr(name));
    }
  }
}

TEST(FfmpegFile, OptionsWithImpossibleValuesAreRefused) {
  const testing::TestFolder folder;
  numbered(folder.path(), {32});
  EXPECT_THROW(
      open_ffmpeg_source(
          {.url = "%03d.jpg", .format = "", .options = {{"framerate", "fast"}}, .realtime = false},
          folder.path()),
      Error);
}

}  // namespace
}  // namespace raystage::ingest
