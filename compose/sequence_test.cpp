// SPDX-License-Identifier: Apache-2.0
#include "compose/sequence.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfInputFile.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <OpenEXR/ImfStringVectorAttribute.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <cmath>
#include <fstream>
#include <mutex>
#include <random>

#include "compose/exr_file.h"
#include "compose/sequence_name.h"
#include "compose/shot_plan.h"
#include "schemas/atomic_file.h"
#include "schemas/test_folder.h"
#include "schemas/transfer_function.h"
#include "store/jpeg/encode.h"

namespace raystage {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr int kCameras = 4, kTicks = 6, kWidth = 64, kHeight = 48;
constexpr Nanoseconds kInterval = kNanosecondsPerSecond / 10;

/// 2 x 2 cameras 10 cm apart that look along -z at a wall whose grey rises by `kStep` per tick.
constexpr int kFirstGrey = 60, kStep = 20;

void write_wall_take(const std::filesystem::path& folder) {
  TakeDocument take;
  take.name = "wall";
  take.created_by = "test";
  take.epoch_utc = 1'700'000'000 * kNanosecondsPerSecond;
  take.nominal_fps = 10;
  take.color_space = "srgb_texture";
  take.depth_range = DepthRange{2, 6};
  RigDocument rig;
  rig.name = "four";
  for (int i = 0; i < kCameras; ++i) {
    RigDocument::Camera camera;
    CameraGeometry& g = camera.geometry;
    g.id = "c" + std::to_string(i);
    g.width = kWidth;
    g.height = kHeight;
    g.intrinsics = {60, 60, kWidth / 2.0, kHeight / 2.0, {}};
    g.world_from_camera[3] = 0.1 * (i % 2);
    g.world_from_camera[7] = -0.1 * (i / 2);
    rig.cameras.push_back(camera);
    take.cameras.push_back({g.id, "", "", ""});
  }
  TakeWriter writer(folder, take, rig);
  for (int i = 0; i < kCameras; ++i) {
    for (int tick = 0; tick < kTicks; ++tick) {
      if (i == 3 && tick == 2) continue;  // a drop
      RgbImage image{kWidth, kHeight, {}};
      image.pixels.assign(static_cast<std::size_t>(kWidth) * kHeight * 3,
                          static_cast<std::uint8_t>(kFirstGrey + kStep * tick));
      writer.archive(i).append(encode_jpeg(image, {}), kInterval + tick * kInterval + i * 1000);
    }
  }
  writer.commit();
  const Take opened(folder);
  write_timeline(build_timeline(opened, 10, 0), folder);
}

ShotDocument wall_shot() {
  ShotDocument shot;
  shot.name = "sh";
  shot.width = 40;
  shot.height = 30;
  shot.fps = shot.fps_numerator = 10;
  shot.first_frame = 101;
  shot.last_frame = 106;
  shot.camera.push_back({101, {0.03, -0.03, 0}, {1, 0, 0, 0}, 40});
  shot.camera.push_back({106, {0.04, -0.03, 0}, {1, 0, 0, 0}, 40});
  ShotDocument::Layer layer;
  layer.take = "take";
  shot.layers.push_back(layer);
  return shot;
}

class Sequence : public ::testing::Test {
 protected:
  void SetUp() override {
    write_wall_take(folder_.path() / "take");
    shot_ = wall_shot();
    options_.output = (folder_.path() / "out" / "a.####.exr").string();
    options_.program_version = "0.1.0";
    options_.say = [this](std::string_view line) {
      const std::scoped_lock lock(mutex_);
      said_.emplace_back(line);
    };
    options_.progress = [this](double done) {
      const std::scoped_lock lock(mutex_);
      progress_ = std::max(progress_, done);
    };
  }

  SequenceReport run(std::stop_token stop = {}) {
    write_shot(shot_, shot_file());
    return render_sequence(shot_file(), options_, std::move(stop));
  }
  /// The text of the Error that the run ends in.
  std::string refusal(ExitCode code = ExitCode::kBadInput) {
    try {
      run();
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), code) << error.what();
      return error.what();
    }
    return "no error";
  }
  std::filesystem::path shot_file() const { return folder_.path() / "shot.json"; }
  std::filesystem::path file(int frame) const { return SequenceName(options_.output).path(frame); }
  int files() const {
    int count = 0;
    std::error_code none;
    for (auto& entry : std::filesystem::directory_iterator(folder_.path() / "out", none)) {
      count += entry.is_regular_file() ? 1 : 0;
    }
    return count;
  }
  /// Linear value and alpha in the middle of a frame.
  std::pair<float, float> middle(int frame) const {
    const ExrImage image = read_exr(file(frame));
    const std::size_t at = (15 * 40 + 20) * 4;
    return {image.rgba.at(at), image.rgba.at(at + 3)};
  }
  static float grey(int tick) {
    return static_cast<float>(linear_from_srgb((kFirstGrey + kStep * tick) / 255.0));
  }

  TestFolder folder_;
  ShotDocument shot_;
  SequenceOptions options_;
  std::mutex mutex_;
  std::vector<std::string> said_;
  double progress_ = 0;
};

TEST_F(Sequence, AFrameThatLooksBesideDependsOnTheTicksThere) {
  const auto fingerprints = [&](bool temporal) {
    shot_.layers.front().method = "depth";
    shot_.layers.front().options = {{"temporal", temporal}};
    write_shot(shot_, shot_file());
    const ShotPlan plan(shot_file());
    std::vector<std::string> prints;
    for (const int tick : {0, 1, 2})
      prints.push_back(plan.fingerprint({101 + tick, tick}, false, false));
    return prints;
  };
  const auto alone = fingerprints(false), beside = fingerprints(true);
  Timeline timeline = read_timeline(Take(folder_.path() / "take"));
  timeline.ticks[0].frame[1] = -1;
  timeline.ticks[0].difference[1] = 0;
  write_timeline(timeline, folder_.path() / "take");
  const auto alone_now = fingerprints(false), beside_now = fingerprints(true);
  EXPECT_NE(alone_now[0], alone[0]);
  EXPECT_EQ(alone_now[1], alone[1]);
  EXPECT_NE(beside_now[1], beside[1]);
  EXPECT_EQ(beside_now[2], beside[2]);
}

/// A camera's frames anew: noise, of which a JPEG takes several pages.
void make_noisy(const std::filesystem::path& take_folder) {
  const std::filesystem::path archive = take_folder / "archive" / "c0.mkv";
  const std::filesystem::path journal = take_folder / "archive" / "c0.journal";
  ASSERT_TRUE(std::filesystem::remove(archive) && std::filesystem::remove(journal));
  ArchiveWriter writer(archive, journal,
                       {"c0", kWidth, kHeight, 1'700'000'000 * kNanosecondsPerSecond});
  std::mt19937 random(1);
  for (int tick = 0; tick < kTicks; ++tick) {
    RgbImage image{kWidth, kHeight, {}};
    image.pixels.resize(static_cast<std::size_t>(kWidth) * kHeight * 3);
    for (std::uint8_t& value : image.pixels) value = static_cast<std::uint8_t>(random());
    const auto jpeg = encode_jpeg(image, {.quality = 100});
    ASSERT_GT(jpeg.size(), 8192U);
    writer.append(jpeg, kInterval + tick * kInterval);
  }
  writer.close();
}

TEST_F(Sequence, AnArchiveThatIsCutMeanwhileCostsTheFramesThatAreLost) {
  const std::filesystem::path archive = folder_.path() / "take" / "archive" / "c0.mkv";
  make_noisy(folder_.path() / "take");
  const Take noisy(folder_.path() / "take");
  write_timeline(build_timeline(noisy, 10, 0), noisy.folder());
  const std::string whole = read_file(archive);
  for (const char* method : {"focal_plane", "depth"}) {
    write_file_atomically(archive, whole);
    shot_.layers.front().method = method;
    options_.output = (folder_.path() / method / "a.####.exr").string();
    options_.frames_in_flight = 1;
    options_.say = [&](std::string_view line) {
      if (line.starts_with("writing")) std::filesystem::resize_file(archive, whole.size() / 2);
    };
    const SequenceReport report = run();
    EXPECT_EQ(report.exit_code(), ExitCode::kSomeFramesFailed) << method;
    ASSERT_EQ(report.failures.size(), 4U) << method;
    EXPECT_EQ(report.failures.front().frame, 103);  // the one that is cut
    EXPECT_THAT(report.failures.back().what, HasSubstr("frame 5 cannot be read"));
  }
}

TEST_F(Sequence, RendersEveryFrameAtItsTime) {
  const SequenceReport report = run();
  EXPECT_EQ(report.exit_code(), ExitCode::kSuccess);
  EXPECT_EQ(report.rendered, 6);
  EXPECT_EQ(files(), 6) << "and nothing temporary";
  EXPECT_EQ(progress_, 1);
  EXPECT_THAT(report.summary(), HasSubstr("6 of 6 frames rendered"));
  for (int tick = 0; tick < kTicks; ++tick) {
    const auto [value, alpha] = middle(101 + tick);
    EXPECT_NEAR(value, grey(tick), 0.005F) << tick;
    EXPECT_NEAR(alpha, 1, 1e-3F);
  }
}

TEST_F(Sequence, StartAndSpeedChooseTheInstant) {
  ShotDocument::Layer& layer = shot_.layers[0];
  layer.start_seconds = 0.5;
  layer.speed = -0.5;
  run();
  EXPECT_NEAR(middle(101).first, grey(5), 0.005F);
  EXPECT_NEAR(middle(103).first, grey(4), 0.005F);
  EXPECT_NEAR(middle(105).first, grey(3), 0.005F);
}

TEST_F(Sequence, FramesOutsideTheShotAreLeftOutAndSaid) {
  options_.frames = {95, 102, 104, 106, 110};
  EXPECT_EQ(run().rendered, 3);
  EXPECT_EQ(files(), 3);
  EXPECT_THAT(said_, Contains(HasSubstr("2 of the frames asked for")));
  options_.frames = {1, 2};
  EXPECT_THAT(refusal(), HasSubstr("none of the frames 1-2"));
}

TEST_F(Sequence, ExistingFilesStopTheRunUnlessToldOtherwise) {
  options_.frames = {101, 102};
  run();
  const auto time = std::filesystem::last_write_time(file(101));
  EXPECT_THAT(refusal(), HasSubstr("2 of 2 frames are there already (101-102)"));
  options_.existing = ExistingFiles::kSkip;
  const SequenceReport report = run();
  EXPECT_EQ(report.skipped, 2);
  EXPECT_EQ(report.rendered, 0);
  EXPECT_EQ(report.exit_code(), ExitCode::kSuccess);
  EXPECT_EQ(std::filesystem::last_write_time(file(101)), time);
  options_.existing = ExistingFiles::kOverwrite;
  EXPECT_EQ(run().rendered, 2);
}

TEST_F(Sequence, SkipTrustsOnlyWholeFilesOfTheSameInputs) {
  run();
  options_.existing = ExistingFiles::kSkip;
  // A torn copy.
  std::filesystem::resize_file(file(103), std::filesystem::file_size(file(103)) - 7);
  EXPECT_EQ(run().rendered, 1);
  // The last key moves: the first frame's camera stays as it was, the others change.
  shot_.camera[1].position[0] += 0.001;
  EXPECT_EQ(run().rendered, 5);
  shot_.layers[0].focal_plane = {ShotDocument::FocalPlane::Kind::kDepth, 3.5, {}};
  EXPECT_EQ(run().rendered, 6);
  options_.chromaticities = true;
  EXPECT_EQ(run().rendered, 6);
  // Another calibration.
  const auto rig = folder_.path() / "take" / "rig.json";
  RigDocument document = read_rig(rig);
  document.cameras[0].photometric.contrast[0] = 1.1;
  write_rig(document, rig);
  EXPECT_EQ(run().rendered, 6);
  EXPECT_EQ(run().skipped, 6);
  // A new synchronisation with the same outcome changes nothing.
  const Take take(folder_.path() / "take");
  write_timeline(build_timeline(take, 10, 0), take.folder());
  EXPECT_EQ(run().skipped, 6);
}

TEST_F(Sequence, SkipSurvivesAMoveOfTheProject) {
  run();
  const TestFolder other;
  std::filesystem::copy(folder_.path(), other.path(), std::filesystem::copy_options::recursive);
  options_.output = (other.path() / "out" / "a.####.exr").string();
  options_.existing = ExistingFiles::kSkip;
  EXPECT_EQ(render_sequence(other.path() / "shot.json", options_, {}).skipped, 6);
}

TEST_F(Sequence, FillColoursWhatNobodySawAndTheFingerprintKnows) {
  shot_.camera[0].position[2] = shot_.camera[1].position[2] = 0.5;  // sees past the array
  options_.frames = {101};
  const auto transparent = [&] {
    const ExrImage image = read_exr(file(101));
    int count = 0;
    for (std::size_t i = 3; i < image.rgba.size(); i += 4) count += image.rgba[i] < 1 ? 1 : 0;
    return count;
  };
  run();
  EXPECT_GT(transparent(), 100);
  options_.existing = ExistingFiles::kSkip;
  options_.fill = HoleFill::kPushPull;
  EXPECT_EQ(run().rendered, 1);
  EXPECT_EQ(transparent(), 0);
  EXPECT_NEAR(read_exr(file(101)).rgba[0], grey(0), 0.005F);
  options_.fill.reset();
  shot_.layers[0].fill = HoleFill::kPushPull;
  EXPECT_EQ(run().skipped, 1);
}

TEST_F(Sequence, ATargetTakesTheMethodsPlaceAndTheFileSaysWhatWasChosen) {
  options_.frames = {101};
  options_.target = {{"target_error", 20.0}};
  run();
  const Imf::InputFile input(file(101).c_str());
  const Imf::Header& header = input.header();
  EXPECT_EQ(header.typedAttribute<Imf::StringAttribute>("lf:method").value(), "auto");
  EXPECT_EQ(header.typedAttribute<Imf::StringAttribute>("lf:methodOptions").value(),
            "target_error=20");
  const auto notes = header.typedAttribute<Imf::StringVectorAttribute>("lf:notes").value();
  EXPECT_THAT(notes, Contains(HasSubstr("auto: ")));
  options_.existing = ExistingFiles::kSkip;
  EXPECT_EQ(run().skipped, 1);
  options_.target["target_error"] = 21.0;
  EXPECT_EQ(run().rendered, 1);
}

TEST_F(Sequence, ATargetKeepsHowDeepTheLayerSaysItsSceneIs) {
  shot_.layers[0].method = "depth";
  shot_.layers[0].options = {{"near", 1.5}, {"far", 6.0}, {"neighbours", 4.0}};
  write_shot(shot_, shot_file());
  const ShotPlan plan(shot_file(), {}, {{"target_error", 30.0}});
  EXPECT_EQ(plan.reconstruction().method, "auto");
  EXPECT_EQ(text_of(plan.reconstruction().options), "far=6,near=1.5,target_error=30");
}

TEST_F(Sequence, WithoutADepthRangeAutoNeedsAPlaneOrDepths) {
  const auto file = folder_.path() / "take" / "take.json";
  std::string text = read_file(file);
  const std::size_t at = text.find("\"depth_range_m\"");
  ASSERT_NE(at, std::string::npos);
  text.replace(at, std::string("\"depth_range_m\"").size(), "\"x_range\"");
  std::ofstream(file) << text;
  const auto plane = [&] {
    write_shot(shot_, shot_file());
    return ShotPlan(shot_file(), {}, options_.target).reconstruction().focal_plane;
  };
  shot_.layers[0].method = "auto";
  EXPECT_THAT(refusal(), HasSubstr("no depth range"));
  shot_.layers[0].options = {{"near", 2.0}, {"far", 6.0}};
  EXPECT_NEAR(std::abs(plane()[3]), 3, 1e-9);
  shot_.layers[0].method = "depth";
  options_.target = {{"target_error", 30.0}};
  EXPECT_NEAR(std::abs(plane()[3]), 3, 1e-9);
}

TEST_F(Sequence, CoverageMeasuresAreChannelsOnRequest) {
  options_.frames = {101};
  const auto channels = [&] {
    const Imf::InputFile input(file(101).c_str());
    std::vector<std::string> names;
    const Imf::ChannelList& list = input.header().channels();
    for (auto it = list.begin(); it != list.end(); ++it) names.emplace_back(it.name());
    return names;
  };
  run();
  EXPECT_THAT(channels(), ElementsAre("A", "B", "G", "R", "Z", "lf.coverage"));
  options_.existing = ExistingFiles::kSkip;
  options_.coverage_measures = true;
  EXPECT_EQ(run().rendered, 1) << "the fingerprint knows the difference";
  EXPECT_THAT(channels(),
              ElementsAre("A", "B", "G", "R", "Z", "lf.cameras", "lf.coverage", "lf.nearest"));
  Imf::InputFile input(file(101).c_str());
  std::vector<float> cameras(40 * 30), nearest(40 * 30);
  Imf::FrameBuffer pixels;
  const auto insert = [&](const char* name, std::vector<float>& values) {
    pixels.insert(name, Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(values.data()),
                                   sizeof(float), sizeof(float) * 40));
  };
  insert("lf.cameras", cameras);
  insert("lf.nearest", nearest);
  input.setFrameBuffer(pixels);
  input.readPixels(0, 29);
  EXPECT_GT(cameras[15 * 40 + 20], 1.5F);
  EXPECT_LE(cameras[15 * 40 + 20], 3.0F);
  EXPECT_GT(nearest[15 * 40 + 20], 0.02F);
  EXPECT_LT(nearest[15 * 40 + 20], 0.06F);
}

TEST_F(Sequence, SameBytesForAnyNumberOfThreadsAndFramesInFlight) {
  std::vector<std::string> first;
  for (const int threads : {1, 2, 5}) {
    options_.existing = ExistingFiles::kOverwrite;
    options_.frames_in_flight = threads * 2 - 1;
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                    static_cast<std::size_t>(threads));
    tbb::task_arena arena(threads);
    EXPECT_EQ(arena.execute([&] { return run(); }).rendered, 6);
    std::vector<std::string> bytes;
    for (int frame = 101; frame <= 106; ++frame) bytes.push_back(read_file(file(frame)));
    if (first.empty()) first = bytes;
    EXPECT_EQ(bytes, first) << threads << " threads";
  }
}

TEST_F(Sequence, WhatTheTakeLacksIsAnErrorHeldOrBlack) {
  shot_.last_frame = 108;
  EXPECT_THAT(refusal(), HasSubstr("2 of 8 frames (107-108)"));
  EXPECT_EQ(files(), 0);
  options_.missing = MissingFrames::kHold;
  EXPECT_EQ(run().exit_code(), ExitCode::kSuccess);
  EXPECT_NEAR(middle(108).first, grey(5), 0.005F);
  EXPECT_THAT(said_, Contains(HasSubstr("2 frames hold")));
  options_.missing = MissingFrames::kBlack;
  options_.existing = ExistingFiles::kSkip;
  EXPECT_EQ(run().rendered, 2) << "the fingerprint knows the difference";
  EXPECT_EQ(middle(108).second, 0);
  EXPECT_EQ(middle(106).second, 1);

  shot_.layers[0].start_seconds = -0.2;
  options_.missing = MissingFrames::kHold;
  run();
  EXPECT_NEAR(middle(101).first, grey(0), 0.005F) << "held from after, where nothing is before";
}

TEST_F(Sequence, ATakeOfOneInstantIsAStill) {
  const Take take(folder_.path() / "take");
  Timeline timeline = build_timeline(take, 10, 0);
  timeline.ticks.resize(1);
  write_timeline(timeline, take.folder());
  EXPECT_EQ(run().rendered, 6);
  EXPECT_NEAR(middle(106).first, grey(0), 0.005F);
}

TEST_F(Sequence, ADamagedFrameFailsAloneAndIsNamed) {
  {
    const Take take(folder_.path() / "take");
    for (int camera = 0; camera < kCameras; ++camera) {
      // By time: camera 3 lacks one.
      const auto index = take.archive(camera).nearest_frame(kInterval * 4);
      const FrameRecord record =
          take.archive(camera).frames()[static_cast<std::size_t>(index.value())];
      std::fstream archive(folder_.path() / "take" /
                               take.document().cameras[static_cast<std::size_t>(camera)].archive,
                           std::ios::in | std::ios::out | std::ios::binary);
      archive.seekp(static_cast<std::streamoff>(record.offset));
      archive << "damaged";
    }
  }
  const SequenceReport report = run();
  EXPECT_EQ(report.exit_code(), ExitCode::kSomeFramesFailed);
  EXPECT_EQ(report.rendered, 5);
  ASSERT_EQ(report.failures.size(), 1U);
  EXPECT_EQ(report.failures[0].frame, 104);
  EXPECT_THAT(report.summary(), HasSubstr("1 failed (104)"));
  EXPECT_THAT(said_, Contains(HasSubstr("frame 104 failed")));
  EXPECT_FALSE(std::filesystem::exists(file(104)));
  EXPECT_EQ(files(), 5);
  EXPECT_EQ(progress_, 1);
}

TEST_F(Sequence, AStopDropsWhatIsUnderWay) {
  std::stop_source source;
  options_.frames_in_flight = 1;
  options_.progress = [&](double done) {
    if (done > 0.2) source.request_stop();
  };
  const SequenceReport report = run(source.get_token());
  EXPECT_TRUE(report.stopped);
  EXPECT_EQ(report.exit_code(), ExitCode::kFailed);
  EXPECT_LT(report.rendered, 6);
  EXPECT_EQ(files(), report.rendered);
}

TEST_F(Sequence, ChecksTheMethodsOptionsFirst) {
  const struct {
    const char* method;
    OptionValues options;
    const char* said;
  } cases[] = {
      {"aperture", {{"radius", 0.5}, {"f_number", 2.0}}, "both radius and f_number"},
      {"aperture", {{"depth_map", std::string("none.exr")}}, "frame 101 needs a file"},
      {"focal_plane", {{"objects", std::string("none.json")}}, "none.json"},
      {"plane_sweep", {{"p1", 50.0}, {"p2", 10.0}}, "p2 is less than p1"},
      {"plane_sweep", {{"near", 5.0}, {"far", 2.0}}, "far is nearer than near"},
      {"depth", {{"near", 5.0}, {"far", 2.0}}, "far is nearer than near"},
      {"lumigraph", {{"proxy", std::string("mesh")}}, "none is given"},
      {"lumigraph", {{"proxy", std::string("mesh")}, {"mesh", std::string("no.ply")}}, "no.ply"},
      {"visual_hull", {}, "has no mattes"},
  };
  for (const auto& wrong : cases) {
    shot_.layers[0].method = wrong.method;
    shot_.layers[0].options = wrong.options;
    EXPECT_THAT(refusal(), HasSubstr(wrong.said)) << wrong.method;
    EXPECT_EQ(files(), 0);
  }
}

TEST_F(Sequence, FramesThatAllFailByBadInputNeedNoRetry) {
  // The folder is there, and no frame's matte.
  std::filesystem::create_directories(folder_.path() / "take" / "mattes");
  shot_.layers[0].method = "visual_hull";
  const SequenceReport report = run();
  EXPECT_EQ(report.failures.size(), 6U);
  EXPECT_EQ(report.exit_code(), ExitCode::kBadInput);
  EXPECT_THAT(said_, Contains(HasSubstr("no camera has a matte")));
}

TEST_F(Sequence, ChecksEverythingFirst) {
  options_.output = (folder_.path() / "still.exr").string();
  EXPECT_THAT(refusal(), HasSubstr("same name"));
  options_.output = (folder_.path() / "a.####.png").string();
  EXPECT_THAT(refusal(), HasSubstr("only EXR"));
  options_.output = (shot_file() / "a.####.exr").string();
  EXPECT_NE(refusal(ExitCode::kFailed), "no error") << "a file where the folder should be";
  options_.output = (folder_.path() / "out" / "a.####.exr").string();
  options_.memory_bytes = 1000;
  EXPECT_THAT(refusal(), HasSubstr("--memory"));
  options_.memory_bytes = 0;
  shot_.layers[0].method = "magic";
  EXPECT_THAT(refusal(), HasSubstr("magic"));
  shot_.layers[0].method = "focal_plane";
  shot_.layers[0].take = "elsewhere";
  EXPECT_NE(refusal(), "no error");
  shot_.layers[0].take = "take";
  std::filesystem::remove(folder_.path() / "take" / "timeline.zst");
  EXPECT_THAT(refusal(), HasSubstr("raystage sync"));
  EXPECT_EQ(files(), 0);
}

TEST_F(Sequence, MemoryIsWhatTheHeaviestFrameTakesWhereverItIs) {
  options_.memory_bytes = 1000;
  options_.missing = MissingFrames::kHold;
  shot_.first_frame = 1;
  shot_.last_frame = 100;
  shot_.camera = {{1, {0.03, -0.03, 0}, {1, 0, 0, 0}, 10},
                  {100, {0.04, -0.03, 0}, {1, 0, 0, 0}, 10}};
  EXPECT_THAT(refusal(), HasSubstr("one frame needs 67.2 MB"));  // 64 MiB of cache; 1200 pixels
  const auto zoom = [](double frame, double degrees) {
    return ShotDocument::CameraKey{frame, {0.035, -0.03, 0}, {1, 0, 0, 0}, degrees};
  };
  shot_.camera.insert(shot_.camera.begin() + 1, {zoom(50, 10), zoom(51, 100), zoom(52, 10)});
  // 4 x 4 samples of 24 bytes on top.
  EXPECT_THAT(refusal(), HasSubstr("one frame needs 67.7 MB"));
}

TEST_F(Sequence, TheBestPlaneNeedsADepthRange) {
  TakeDocument take = read_take(folder_.path() / "take" / "take.json");
  take.depth_range.reset();
  write_take(take, folder_.path() / "take" / "take.json");
  const std::string text = refusal();
  EXPECT_THAT(text, HasSubstr("depth range"));
  EXPECT_THAT(text, HasSubstr("shot.json#/layers/0/focal_plane"));
}

TEST_F(Sequence, HeaderTellsWhatIsAbsentAndWhen) {
  write_shot(shot_, shot_file());
  const ShotPlan plan(shot_file());
  const auto frames = plan.plan(std::vector<int>{101, 103}, MissingFrames::kError);
  EXPECT_TRUE(plan.metadata(frames[0]).absent_cameras.empty());
  EXPECT_THAT(plan.metadata(frames[1]).absent_cameras, ElementsAre("c3"));
  const Nanoseconds first = plan.timeline().ticks[0].time_ns;
  EXPECT_EQ(plan.metadata(frames[1]).capture_utc,
            plan.take().document().epoch_utc + first + 2 * kInterval);
  EXPECT_EQ(plan.metadata(frames[0]).capture_rate, 10);
}

TEST_F(Sequence, FocalPlanesOfEveryKind) {
  write_shot(shot_, shot_file());
  const ShotPlan plan(shot_file());
  const Rig& rig = plan.take().rig();
  using Kind = ShotDocument::FocalPlane::Kind;
  const auto equation = [&](const ShotDocument::FocalPlane& plane) {
    return focal_plane_equation(plane, rig, DepthRange{2, 6}, "here");
  };
  // 2 / (1/2 + 1/6) = 3 m in front of an array that looks along -z.
  const Eigen::Vector4d best = equation({Kind::kBest, 0, {}});
  EXPECT_NEAR(std::abs(best[2]), 1, 1e-9);
  EXPECT_NEAR(best.dot(Eigen::Vector4d(0.3, 0.2, -3, 1)), 0, 1e-9);
  EXPECT_NEAR((best - equation({Kind::kDepth, 3, {}})).norm(), 0, 1e-12);
  EXPECT_EQ(equation({Kind::kInfinity, 0, {}}), Eigen::Vector4d(0, 0, 0, 1));
  EXPECT_EQ(equation({Kind::kEquation, 0, {0, 2, 0, 4}}), Eigen::Vector4d(0, 1, 0, 2));
  EXPECT_EQ(equation({Kind::kEquation, 0, {0, 0, 0, 4}}), Eigen::Vector4d(0, 0, 0, 1));
  EXPECT_THROW(equation({Kind::kEquation, 0, {0, 0, 0, 0}}), Error);
}

TEST(DefaultOutput, StandsBesideTheShotAndIsOneSafeName) {
  ShotDocument shot = wall_shot();
  shot.layers[0].name = "lf/beauty #1";
  EXPECT_EQ(default_output("p/shot.json", shot), "p/renders/sh_lf_beauty__1.####.exr");
  shot.name = shot.layers[0].name = "";
  EXPECT_EQ(default_output("shot.json", shot), "renders/shot.####.exr");
}

}  // namespace
}  // namespace raystage
