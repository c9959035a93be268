// SPDX-License-Identifier: Apache-2.0
#include "ingest/sources/simulated_source.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <thread>

#include "base/error.h"
#include "ingest/sources/jpeg_markers.h"
#include "ingest/sources/shared_simulation.h"

namespace raystage::ingest {
namespace {

using namespace std::chrono_literals;
using Outcome = FrameSource::Outcome;

schemas::RecordConfig::SimulatedSource small(int index) {
  schemas::RecordConfig::SimulatedSource source;
  source.rows = 1;
  source.columns = 2;
  source.index = index;
  source.width = 32;
  source.height = 24;
  source.fps = 50;
  source.seconds = 0.1;
  return source;
}

TEST(SimulatedSource, CamerasRunFreelyAtTheirOwnTimes) {
  const auto left = open_simulated_source(small(0)), right = open_simulated_source(small(1));
  EXPECT_EQ(left->description().clock, "simulated");
  EXPECT_FALSE(left->description().delivers_jpeg);
  SourceFrame frame;
  std::vector<double> phases;
  for (FrameSource* source : {left.get(), right.get()}) {
    Nanoseconds first = 0, last = 0;
    std::uint64_t first_number = 0;
    for (int i = 0; i < 25; ++i) {  // more than two loops of ten
      ASSERT_EQ(source->next(frame, 2000ms), Outcome::kFrame);
      ASSERT_TRUE(frame.sequence && frame.device_time);
      EXPECT_EQ(frame.raw.format, store::PixelFormat::kYuv420);
      EXPECT_EQ(frame.raw.width, 32);
      if (i == 0) first = *frame.device_time, first_number = *frame.sequence;
      last = *frame.device_time;
    }
    const auto periods = static_cast<double>(*frame.sequence - first_number);
    // Within the jitter and the error of the camera's own rate.
    EXPECT_NEAR(static_cast<double>(last - first) / periods, 20e6, 0.1e6);
    phases.push_back(std::fmod(static_cast<double>(last), 20e6));
  }
  EXPECT_GT(std::abs(phases[0] - phases[1]), 0.3e6);
}

TEST(SimulatedSource, WhatWaitedArrivedWhenItWasExposed) {
  const auto source = open_simulated_source(small(0));
  std::this_thread::sleep_for(100ms);  // five frames wait in the source
  SourceFrame frame;
  std::optional<Nanoseconds> offset;
  for (int i = 0; i < 10; ++i) {
    ASSERT_EQ(source->next(frame, 2000ms), Outcome::kFrame);
    if (i == 0) {
      EXPECT_LT(frame.arrival_steady, host_steady_now() - 40'000'000);
      offset = frame.arrival_steady - *frame.device_time;
    }
    EXPECT_NEAR(static_cast<double>(frame.arrival_steady - *frame.device_time - *offset), 0, 5e6);
  }
}

TEST(SimulatedSource, TheSceneRunsToAndFro) {
  auto settings = small(0);
  settings.fps = 20;
  settings.seconds = 2;
  SharedSimulation stage(settings);
  const auto loop = stage.loop(0);
  ASSERT_EQ(loop->exposures.size(), 80U);  // forwards and backwards
  const auto difference = [&](std::size_t a, std::size_t b) {
    const store::RawImage::Plane pa = loop->exposures[a].raw.planes[0],
                                 pb = loop->exposures[b].raw.planes[0];
    int sum = 0;
    for (std::size_t y = 0; y < 24; ++y) {
      for (std::size_t x = 0; x < 32; ++x) {
        sum += std::abs(std::to_integer<int>(pa.data[y * pa.stride + x]) -
                        std::to_integer<int>(pb.data[y * pb.stride + x]));
      }
    }
    return sum;
  };
  // Backwards, the scene repeats the positions of the way forwards.
  EXPECT_GT(2 * difference(10, 40), 3 * difference(10, 69));
  EXPECT_EQ(stage.loop(0), loop) << "rendered twice";
}

TEST(SimulatedSource, AllCamerasOfTheSameSettingsShareOneStage) {
  const auto first = SharedSimulation::shared(small(0));
  EXPECT_EQ(SharedSimulation::shared(small(1)), first);
  auto other = small(0);
  other.seed = 2;
  EXPECT_NE(SharedSimulation::shared(other), first);
}

TEST(SimulatedSource, MemoryBesideIsThatOfThePicturesAndAPartOfTheStage) {
  auto settings = small(0);
  const auto first = open_simulated_source(settings);
  const std::size_t stage = SharedSimulation::shared(settings)->memory();
  // Ten pictures of 32 x 24, with rows of chroma padded to 64 bytes.
  constexpr std::size_t kPictures = std::size_t{10} * (24 * 64 + 2 * 12 * 64);
  EXPECT_EQ(first->memory_overhead(), kPictures + stage);
  const auto second = open_simulated_source(small(1));
  EXPECT_EQ(first->memory_overhead(), kPictures + stage / 2);
}

TEST(SimulatedSource, DeliversJpegAsAWebcamDoes) {
  auto settings = small(1);
  settings.jpeg = true;
  const auto source = open_simulated_source(settings);
  EXPECT_TRUE(source->description().delivers_jpeg);
  SourceFrame frame;
  ASSERT_EQ(source->next(frame, 2000ms), Outcome::kFrame);
  const JpegMarkerInfo markers = scan_jpeg_markers(frame.jpeg);
  EXPECT_TRUE(markers.whole);
  EXPECT_EQ(markers.width, 32);
  EXPECT_EQ(markers.height, 24);
}

TEST(SimulatedSource, ALateReaderLosesFramesAndTheCounterShowsIt) {
  const auto source = open_simulated_source(small(0));
  SourceFrame frame;
  ASSERT_EQ(source->next(frame, 2000ms), Outcome::kFrame);
  const std::uint64_t before = *frame.sequence;
  std::this_thread::sleep_for(400ms);  // 20 exposures
  ASSERT_EQ(source->next(frame, 2000ms), Outcome::kFrame);
  EXPECT_GE(*frame.sequence, before + 10);
}

TEST(SimulatedSource, PatienceEndsAndInterruptsAreHeard) {
  auto slow = small(0);
  slow.fps = 0.5;
  slow.seconds = 2;
  const auto source = open_simulated_source(slow);
  SourceFrame frame;
  while (source->next(frame, 0ms) == Outcome::kFrame) {
  }
  const auto start = std::chrono::steady_clock::now();
  std::thread other([&] {
    std::this_thread::sleep_for(20ms);
    source->interrupt();
  });
  source->next(frame, 10s);
  EXPECT_LT(std::chrono::steady_clock::now() - start, 2500ms);
  other.join();
}

TEST(SimulatedSource, WhatCannotBeIsRefused) {
  auto settings = small(2);
  EXPECT_THROW(open_simulated_source(settings), Error);
  settings = small(0);
  settings.scene = "nowhere";
  EXPECT_THROW(open_simulated_source(settings), Error);
}

}  // namespace
}  // namespace raystage::ingest
