// SPDX-License-Identifier: Apache-2.0
#include "store/processing/retime/retime_take.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <optional>

#include "base/atomic_file.h"
#include "base/error.h"
#include "store/jpeg/encode.h"
#include "store/processing/sync/resync.h"
#include "testing/store/take_test_data.h"
#include "testing/store/test_scene.h"
#include "testing/test_folder.h"

namespace raystage::store {
namespace {

constexpr Nanoseconds kPeriod = 100'000'000;

// Three cameras at 10 Hz record the moving board, each at its own phase. Camera 1 loses frame 4,
// camera 2 frames 3 and 4. The journals record these losses if `recorded`. The clocks are `ahead`.
struct RetimeTake : ::testing::Test {
  void write(Nanoseconds ahead = 0, bool recorded = true) {
    schemas::TakeDocument document = testing::take_document(3, 10);
    document.name = "board";
    schemas::RigDocument rig = testing::rig_document(3);
    for (schemas::RigDocument::Camera& camera : rig.cameras) {
      camera.geometry.width = board.width;
      camera.geometry.height = board.height;
      camera.geometry.line_time_us = line_time_us;
    }
    TakeWriter writer(folder.path() / "take", document, rig);
    for (int c = 0; c < 3; ++c) {
      for (int i = 0; i < 8; ++i) {
        const Nanoseconds time = exposed(c, i);
        if ((c == 1 && i == 4) || (c == 2 && (i == 3 || i == 4))) {
          if (recorded) writer.archive(c).append_missing(FrameStatus::kTorn, time + ahead);
        } else {
          const double line = seconds(1000) * line_time_us;
          const RgbImage picture =
              line_time_us == 0 ? board.at(seconds(time)) : board.rolling_at(seconds(time), line);
          writer.archive(c).append(encode_jpeg(picture, {.quality = 97}), time + ahead);
        }
      }
    }
    writer.commit();
    take.emplace(folder.path() / "take");
    ResyncOptions options;
    options.trust_timestamps = true;
    options.fps = 10;
    options.offsets = std::vector<Nanoseconds>(3, ahead);
    options.tick_at = 2 * kPeriod;
    resync = resynchronise(camera_timestamps(*take), options, "board");
  }
  static Nanoseconds exposed(int camera, int frame) {
    return kPeriod + frame * kPeriod + (camera - 1) * 30'000'000;
  }
  static double seconds(Nanoseconds time) { return static_cast<double>(time) * 1e-9 * 4; }

  RetimeReport retime(
      RetimeMethod method, const std::string& name,
      const std::function<void(double)>& progress = [](double) {}) {
    RetimeOptions options;
    options.method = method;
    options.rotten_frames = rotten_frames;
    options.quality = 97;
    return retime_take(*take, resync.timeline, resync.times, options, folder.path() / name,
                       "test 1", progress, stop.get_token());
  }
  double psnr_of(const Take& of, int camera, int frame, Nanoseconds time) {
    const RgbImage image = JpegDecoder().decode(of.archive(camera).jpeg(frame), "test");
    return testing::psnr(image, board.at(seconds(time)));
  }

  // Damages bytes of a frame within its archive.
  void damage(int camera, int frame, std::size_t from, std::size_t count) {
    const std::filesystem::path archive =
        folder.path() / "take/archive" / ("c" + std::to_string(camera) + ".mkv");
    std::string bytes = read_file(archive);
    const FrameRecord record = take->archive(camera).frames()[frame];
    for (std::size_t i = 0; i < count; ++i) bytes[record.offset + from + i] ^= 4;
    testing::overwrite(archive, std::as_bytes(std::span(bytes)));
    take.emplace(folder.path() / "take");
  }

  double line_time_us = 0;
  RottenFrames rotten_frames = RottenFrames::kAbsent;
  testing::MovingBoard board{.left = 20, .top = 20, .speed_x = 25, .speed_y = 9};
  testing::TestFolder folder;
  std::optional<Take> take;
  ResyncResult resync;
  std::stop_source stop;
};

TEST_F(RetimeTake, MovesFramesToTheirTicks) {
  write();
  const RetimeReport report = retime(RetimeMethod::kFlow, "flow");
  EXPECT_GT(report.interpolated, 10U);
  EXPECT_GT(report.ms_per_interpolated, 0);
  const Take retimed(folder.path() / "flow");
  const Timeline timeline = read_timeline(retimed);
  ASSERT_EQ(timeline.ticks.size(), resync.timeline.ticks.size());
  std::uint64_t present = 0, missing = 0;
  for (const FrameSelection& tick : timeline.ticks) {
    for (int c = 0; c < 3; ++c) {
      const auto i = static_cast<std::size_t>(c);
      if (tick.frame[i] < 0) {
        ++missing;
        continue;
      }
      const FrameRecord& frame = retimed.archive(c).frames()[tick.frame[i]];
      EXPECT_EQ(frame.time_ns, tick.time_ns + tick.difference[i]);
      EXPECT_TRUE(retimed.archive(c).verify_frame(tick.frame[i]));
      ++present;
      // Camera 1 lost a frame: the interpolation spans twice the motion.
      const bool bridged = c == 1 && tick.time_ns == exposed(1, 4);
      EXPECT_GT(psnr_of(retimed, c, tick.frame[i], frame.time_ns), bridged ? 26 : 31)
          << tick.time_ns << " " << c;
    }
  }
  EXPECT_EQ(missing, report.missing);
  EXPECT_EQ(present, report.interpolated + report.unchanged);
  const schemas::TakeDocument& document = retimed.document();
  ASSERT_TRUE(document.derived_from);
  EXPECT_EQ(document.derived_from->take, "board");
  EXPECT_EQ(document.derived_from->by, "retime flow");
  EXPECT_EQ(document.created_by, "test 1");
}

TEST_F(RetimeTake, IsNearerToTheTruthThanTheNearestFrame) {
  write();
  retime(RetimeMethod::kNearest, "nearest");
  retime(RetimeMethod::kBlend, "blend");
  retime(RetimeMethod::kFlow, "flow");
  const auto mean_psnr = [&](const char* name) {
    const Take retimed(folder.path() / name);
    const Timeline timeline = read_timeline(retimed);
    double sum = 0;
    int count = 0;
    for (std::size_t k = 1; k + 1 < timeline.ticks.size(); ++k) {
      const FrameSelection& tick = timeline.ticks[k];
      if (tick.frame[0] < 0) continue;
      sum += psnr_of(retimed, 0, tick.frame[0], tick.time_ns);
      ++count;
    }
    return sum / count;
  };
  const double nearest = mean_psnr("nearest"), blended = mean_psnr("blend");
  const double flow = mean_psnr("flow");
  EXPECT_GT(blended, nearest);
  EXPECT_GT(flow, blended + 5);
}

// A read-out of 60 of the 100 ms between two frames.
TEST_F(RetimeTake, ARollingShutterBecomesAGlobalOne) {
  line_time_us = 500;
  board.size = 80;
  board.left = board.top = 5;
  write();
  const RetimeReport report = retime(RetimeMethod::kFlow, "flow");
  EXPECT_EQ(report.unchanged, 0U);
  EXPECT_EQ(report.uncorrected, 0U);
  const Take retimed(folder.path() / "flow");
  double corrected = 0, recorded = 0;
  int count = 0;
  for (int c = 0; c < 3; ++c) {
    EXPECT_EQ(retimed.rig().cameras[c].line_time_us, 0);
    if (c > 0) continue;  // those that lost frames
    for (std::size_t i = 0; i < retimed.archive(c).frames().size(); ++i) {
      const Nanoseconds time = retimed.archive(c).frames()[i].time_ns;
      corrected += psnr_of(retimed, c, static_cast<int>(i), time);
      recorded += testing::psnr(board.rolling_at(seconds(time), seconds(1000) * line_time_us),
                                board.at(seconds(time)));
      ++count;
    }
  }
  EXPECT_GT(corrected / count, recorded / count + 3);
  // Without optical flow frames keep their rows, and the rig says so.
  retime(RetimeMethod::kNearest, "nearest");
  EXPECT_EQ(Take(folder.path() / "nearest").rig().cameras[1].line_time_us, 500);
}

TEST_F(RetimeTake, FramesOnTheirTickAreTakenByteForByte) {
  write();
  retime(RetimeMethod::kFlow, "flow");
  const Take retimed(folder.path() / "flow");
  // Camera 1 exposes at the ticks; only its lost frame is interpolated.
  const auto& from = take->archive(1);
  const auto& to = retimed.archive(1);
  int same = 0;
  for (std::size_t i = 0; i < to.frames().size(); ++i) {
    for (std::size_t j = 0; j < from.frames().size(); ++j) {
      if (from.frames()[j].time_ns != to.frames()[i].time_ns) continue;
      EXPECT_EQ(to.frames()[i].xxh3, from.frames()[j].xxh3);
      EXPECT_EQ(to.frames()[i].sequence, j);
      ++same;
    }
  }
  EXPECT_EQ(same, 7);
  EXPECT_EQ(to.frames().size(), 8U);
}

TEST_F(RetimeTake, WhatIsMissingKeepsItsReason) {
  write();
  retime(RetimeMethod::kFlow, "flow");
  const Take retimed(folder.path() / "flow");
  int torn = 0;
  for (const FrameRecord& record : retimed.archive(2).records()) {
    torn += record.status == FrameStatus::kTorn ? 1 : 0;
  }
  EXPECT_GE(torn, 1);
}

TEST_F(RetimeTake, OfWhatNobodyRecordedNoLossIsInvented) {
  write(0, false);
  const RetimeReport report = retime(RetimeMethod::kNearest, "nearest");
  EXPECT_GE(report.missing, 3U);
  const Take retimed(folder.path() / "nearest");
  std::uint64_t absent = 0;
  for (const FrameSelection& tick : read_timeline(retimed).ticks) {
    absent += static_cast<std::uint64_t>(std::ranges::count(tick.frame, -1));
  }
  EXPECT_EQ(absent, report.missing);
  for (int c = 0; c < 3; ++c) {
    EXPECT_EQ(retimed.archive(c).records().size(), retimed.archive(c).frames().size());
  }
}

TEST_F(RetimeTake, ClocksAheadAndTimesBeforeTheEpochAreHandled) {
  write(350'000'000);  // true times of the first frames lie before the epoch
  retime(RetimeMethod::kNearest, "nearest");
  const Take retimed(folder.path() / "nearest");
  const Nanoseconds epochs = take->document().epoch_utc - retimed.document().epoch_utc;
  EXPECT_GE(epochs, 0);
  for (const FrameRecord& frame : retimed.archive(1).frames()) {
    const double place = static_cast<double>(frame.time_ns - epochs) / kPeriod;
    EXPECT_NEAR(place, std::round(place), 1e-6);
  }
  EXPECT_NO_THROW(read_timeline(retimed));
}

TEST_F(RetimeTake, BytesDoNotDependOnThreads) {
  write();
  retime(RetimeMethod::kFlow, "many");
  {
    const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
    retime(RetimeMethod::kFlow, "one");
  }
  for (const char* camera : {"c0", "c1", "c2"}) {
    for (const char* end : {".mkv", ".journal"}) {
      const std::string file = std::string("archive/") + camera + end;
      EXPECT_EQ(read_file(folder.path() / "many" / file), read_file(folder.path() / "one" / file));
    }
  }
}

TEST_F(RetimeTake, StopLeavesNothing) {
  write();
  EXPECT_THROW(retime(RetimeMethod::kBlend, "stopped", [&](double) { stop.request_stop(); }),
               Error);
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "stopped"));
  int entries = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(folder.path())) {
    ++entries;
  }
  EXPECT_EQ(entries, 1);
}

TEST_F(RetimeTake, RefusesRottenFramesOnRequestAndNamesThem) {
  write();
  damage(1, 2, 300, 1);
  rotten_frames = RottenFrames::kError;
  for (const auto method : {RetimeMethod::kNearest, RetimeMethod::kBlend, RetimeMethod::kFlow}) {
    try {
      retime(method, "new");
      FAIL() << "took a rotten frame";
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find("camera \"c1\""), std::string::npos) << error.what();
      EXPECT_NE(std::string(error.what()).find("frame 2"), std::string::npos) << error.what();
    }
    EXPECT_FALSE(std::filesystem::exists(folder.path() / "new"));
  }
}

// The take without the frame is retimed in the same way.
TEST_F(RetimeTake, RottenFramesCountAsMissing) {
  write();
  damage(1, 2, 300, 1);  // its neighbours are there
  damage(2, 2, 0, 200);  // the next two are missing
  for (const auto method : {RetimeMethod::kNearest, RetimeMethod::kBlend, RetimeMethod::kFlow}) {
    const std::string name = "new" + std::to_string(static_cast<int>(method));
    const RetimeReport report = retime(method, name);
    EXPECT_EQ(report.rotten, 2U);
    EXPECT_EQ(report.rotten_cameras, (std::vector<std::string>{"c1", "c2"}));
    EXPECT_EQ(report.unchanged + report.interpolated + report.missing,
              3 * resync.timeline.ticks.size());
    const Take retimed(folder.path() / name);
    const Timeline timeline = read_timeline(retimed);
    for (std::size_t k = 0; k < timeline.ticks.size(); ++k) {
      const FrameSelection& before = resync.timeline.ticks[k];
      const bool is_bridged = method != RetimeMethod::kNearest;
      if (before.frame[1] == 2) {
        EXPECT_EQ(timeline.ticks[k].frame[1] >= 0, is_bridged);
      }
      if (before.frame[2] == 2) {
        EXPECT_LT(timeline.ticks[k].frame[2], 0) << "the gap is too long";
        const auto records = retimed.archive(2).records();
        EXPECT_TRUE(std::ranges::any_of(records, [&](const FrameRecord& record) {
          return record.status == FrameStatus::kTorn && record.time_ns == timeline.ticks[k].time_ns;
        }));
      }
    }
    for (int c = 0; c < 3; ++c) {
      for (std::size_t i = 0; i < retimed.archive(c).frames().size(); ++i) {
        EXPECT_TRUE(retimed.archive(c).verify_frame(static_cast<int>(i)));
      }
    }
  }
}

TEST_F(RetimeTake, RefusesAFolderThatIsThere) {
  write();
  EXPECT_THROW(retime(RetimeMethod::kBlend, "take"), Error);
}

TEST_F(RetimeTake, RefusesAFolderWithinTheTake) {
  write();
  std::filesystem::create_directory_symlink(folder.path() / "take", folder.path() / "link");
  for (const char* inside : {"take/new", "take/archive/new", "link/new"}) {
    EXPECT_THROW(retime(RetimeMethod::kNearest, inside), Error) << inside;
    EXPECT_FALSE(std::filesystem::exists(folder.path() / inside));
  }
  EXPECT_NO_THROW(retime(RetimeMethod::kNearest, "take2"));
}

}  // namespace
}  // namespace raystage::store
