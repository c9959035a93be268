// SPDX-License-Identifier: Apache-2.0
// Depths that are stored before a shot is rendered, and where they are stored.
#include "compose/derived_data.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <fstream>
#include <map>

#include "base/atomic_file.h"
#include "simulate/simulate.h"
#include "testing/compose/sequence_test_data.h"

namespace raystage::compose {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using testing::kTicks;

/// Returns the bytes of all files below a folder, by relative path; folders have none.
std::map<std::string, std::string> contents(const fs::path& folder) {
  std::map<std::string, std::string> files;
  std::error_code none;
  for (const auto& entry : fs::recursive_directory_iterator(folder, none)) {
    const std::string path = entry.path().lexically_relative(folder).string();
    files[path] = entry.is_regular_file() ? read_file(entry.path()) : "";
  }
  return files;
}

class Preparation : public testing::SequenceTest {
 protected:
  Preparation() {
    shot_.layers.front().method = "depth";
    options_.existing = ExistingFiles::kOverwrite;
    options_.cache_folder = cache("rendered");
  }
  fs::path cache(const std::string& name) const { return folder_.path() / name; }

  /// The plan of the shot, and the derived data of all frames.
  struct Needed {
    std::unique_ptr<const ShotPlan> plan;
    std::vector<PlannedFrame> frames;
    std::vector<DerivedFrameData> instants;
  };
  Needed needed(const fs::path& cache_folder) {
    schemas::write_shot(shot_, shot_file());
    ShotPlanOptions options;
    options.cache_folder = cache_folder;
    Needed all{std::make_unique<const ShotPlan>(shot_file(), options), {}, {}};
    std::vector<int> numbers;
    for (int frame = shot_.first_frame; frame <= shot_.last_frame; ++frame) {
      numbers.push_back(frame);
    }
    all.frames = all.plan->plan(numbers, MissingFrames::kHold);
    all.instants = list_derived_data(*all.plan, all.frames);
    return all;
  }
  PrepareReport prepare(const fs::path& cache_folder, std::stop_token stop = {}) {
    const Needed all = needed(cache_folder);
    return prepare_derived_data(*all.plan, all.instants, {}, std::move(stop));
  }
  /// Expects that prepared data is what rendering would store, and that rendering estimates
  /// nothing.
  void expect_prepared(int solved) {
    const PrepareReport prepared = prepare(cache("prepared"));
    EXPECT_EQ(prepared.derived, solved);
    EXPECT_EQ(prepared.exit_code(), ExitCode::kSuccess);
    const auto stored = contents(cache("prepared"));
    EXPECT_EQ(stored.size(), static_cast<std::size_t>(solved) + 2);  // depth/ and the set
    EXPECT_EQ(run().light_field_frames_estimated, solved);
    EXPECT_TRUE(contents(cache("rendered")) == stored);

    options_.cache_folder = cache("prepared");
    const SequenceReport after = run();
    EXPECT_EQ(after.rendered, after.requested);
    EXPECT_EQ(after.light_field_frames_estimated, 0);
    EXPECT_EQ(after.light_field_frames_loaded, solved);
    EXPECT_TRUE(contents(cache("prepared")) == stored);
  }
  /// Writes a take of an actor in front of a blue screen, 3 x 3 cameras.
  void write_actor_take(double spacing = 0.07) {
    simulate::SimulationOptions simulation;
    simulation.scene = "blue_screen";
    simulation.rows = simulation.columns = 3;
    simulation.spacing = spacing;
    simulation.width = 96;
    simulation.height = 72;
    simulation.seconds = 0.2;
    simulation.startup_loss_s = simulation.drop_probability = 0;
    simulation.jitter = simulation.period_error_ppm = simulation.clock_offset = 0;
    simulation.truth_views = 0;
    simulate::simulate(simulation, folder_.path() / "actor", "test");
    store::write_timeline(
        store::build_timeline(store::Take(folder_.path() / "actor"), simulation.fps, 0),
        folder_.path() / "actor");
  }
  /// Returns a mesh in front of the camera, which light fields may light.
  schemas::ShotDocument::Layer mesh() const {
    std::ofstream(folder_.path() / "square.obj")
        << "v -0.5 -0.5 0\nv 0.5 -0.5 0\nv 0.5 0.5 0\nv -0.5 0.5 0\nf 1 2 3 4\n";
    schemas::ShotDocument::Layer layer;
    layer.geometry = schemas::ShotDocument::Geometry{
        .file = "square.obj",
        .material = schemas::ShotDocument::Material{.kind = "mirror"},
        .keys = {{.frame = 101, .position = {{0, 0, -2}}}}};
    return layer;
  }
};

TEST_F(Preparation, StoresTheFilesThatRenderingStores) { expect_prepared(kTicks); }

/// The grey wall has no depths; a keyed actor has.
TEST_F(Preparation, StoresTheSameDepthsOfAKeyedSceneWithLittleMemoryAndOneThread) {
  write_actor_take();
  shot_.layers.front().take = "actor";
  shot_.layers.front().matte = schemas::MatteSettings{};
  shot_.layers.front().speed = 0;
  shot_.layers.front().options = {{"temporal", true}};
  shot_.last_frame = 101;
  const Needed all = needed(cache("prepared"));
  ASSERT_EQ(all.instants.size(), 2U);  // the first tick, and that after it
  PrepareOptions little;
  little.memory_bytes = 6 << 20;
  tbb::task_arena alone(1);
  const PrepareReport prepared = alone.execute(
      [&] { return prepare_derived_data(*all.plan, all.instants, little, std::stop_token()); });
  ASSERT_EQ(prepared.derived, 2) << prepared.failures.front().what;
  EXPECT_EQ(run().light_field_frames_estimated, 2);
  EXPECT_TRUE(contents(cache("rendered")) == contents(cache("prepared")));
  for (const DerivedFrameData& instant : all.instants) {
    EXPECT_GT(fs::file_size(instant.file), 9U * 96 * 72 / 4) << "depths compress worse than none";
  }
  EXPECT_EQ(run().light_field_frames_estimated, 0);
}

TEST_F(Preparation, StoresAdjacentTicksForTemporal) {
  shot_.layers.front().options = {{"temporal", true}};
  shot_.last_frame = 102;  // ticks 0 and 1, and after them 2
  expect_prepared(3);
  const Needed all = needed(cache("prepared"));
  ASSERT_EQ(all.instants.size(), 3U);
  EXPECT_THAT(all.instants[0].frames, ElementsAre(101, 102));
  EXPECT_THAT(all.instants[2].frames, ElementsAre(102));
}

/// Returns the bytes of each frame, rendered in these chunks with depths of their own.
std::map<std::string, std::string> rendered_in(const std::vector<std::vector<int>>& chunks,
                                               const fs::path& folder, const fs::path& shot,
                                               SequenceOptions options) {
  for (std::size_t i = 0; i < chunks.size(); ++i) {
    options.frames = chunks[i];
    options.output = (folder / "a.####.exr").string();
    options.cache_folder = folder.string() + std::to_string(i);
    EXPECT_EQ(render_sequence(shot, options, {}).rendered, static_cast<int>(chunks[i].size()));
  }
  return contents(folder);
}

/// Of a moving take only parts are estimated: those that all frames of the shot read.
TEST_F(Preparation, OfAMovingTakeFramesAreTheSameInChunksOfAnySize) {
  write_actor_take(0.05);
  shot_.layers.front().take = "actor";
  shot_.layers.front().speed = 0.5;
  shot_.fps = shot_.fps_numerator = 15;
  shot_.last_frame = 104;
  shot_.camera.keys = {testing::camera_key(101, {-0.05, 0.05, 0}, 12),
                       testing::camera_key(104, {0.04, -0.05, 0}, 12)};
  for (auto& key : shot_.camera.keys) key.shutter_deg = 180;
  for (const bool exact : {false, true}) {
    using Time = schemas::ShotDocument::Layer::Time;
    shot_.layers.front().time = exact ? Time::kExact : Time::kTick;
    const Needed all = needed(cache("prepared"));
    ASSERT_FALSE(all.instants.empty());
    for (const DerivedFrameData& instant : all.instants) {
      EXPECT_EQ(instant.file.stem().extension().string().size(), 17U) << "INSTANT.REGIONS.zst";
    }
    const std::string name = exact ? "exact" : "ticks";
    const auto whole =
        rendered_in({{101, 102, 103, 104}}, cache(name + "whole"), shot_file(), options_);
    EXPECT_EQ(whole.size(), 4U);
    EXPECT_TRUE(rendered_in({{103, 104}, {101}, {102}}, cache(name + "chunks"), shot_file(),
                            options_) == whole);
    // And all that they read was prepared.
    EXPECT_EQ(prepare(cache(name)).exit_code(), ExitCode::kSuccess);
    options_.cache_folder = cache(name);
    EXPECT_EQ(run().light_field_frames_estimated, 0);
  }
}

TEST_F(Preparation, StoresTheProxyOfLumigraph) {
  shot_.layers.front().method = "lumigraph";
  shot_.layers.front().options = {{"proxy", std::string("depth")}};
  expect_prepared(kTicks);
}

TEST_F(Preparation, LayersOfOneTakeShareItsFiles) {
  shot_.layers.push_back(shot_.layers.front());
  shot_.layers.front().clips = {{.screen = {.left = 0.5}}};
  const Needed all = needed(cache("prepared"));
  ASSERT_EQ(all.instants.size(), static_cast<std::size_t>(kTicks));
  EXPECT_THAT(all.instants.front().frames, ElementsAre(101));
  EXPECT_EQ(prepare(cache("prepared")).derived, kTicks);
  options_.cache_folder = cache("prepared");
  EXPECT_EQ(run().light_field_frames_estimated, 0);
}

TEST_F(Preparation, StoresWhatALightIsAskedFor) {
  for (const char* method : {"plane_sweep", "depth"}) {
    shot_ = testing::wall_shot();
    shot_.last_frame = 102;
    shot_.layers.front().method = method;
    shot_.layers.front().name = "wall";
    shot_.layers.push_back(mesh());
    shot_.lights = {{.light_field = "wall"}};
    EXPECT_EQ(prepare(cache(method)).derived, 2) << method;
    options_.cache_folder = cache(method);
    const SequenceReport report = run();
    EXPECT_EQ(report.rendered, 2) << method;
    EXPECT_EQ(report.light_field_frames_estimated, 0) << method;
    EXPECT_EQ(report.light_field_frames_loaded, 2) << method;
  }
  shot_.layers.front().method = "plane_sweep";
  shot_.layers.pop_back();
  shot_.lights.clear();
  EXPECT_TRUE(needed(cache("views")).instants.empty()) << "views of plane_sweep store nothing";
}

TEST_F(Preparation, MethodsThatStoreNothingNeedNothing) {
  shot_.layers.front().method = "focal_plane";
  const PrepareReport report = prepare(cache("prepared"));
  EXPECT_EQ(report.requested, 0);
  EXPECT_EQ(report.exit_code(), ExitCode::kSuccess);
  shot_.layers.front().method = "depth";
  shot_.layers.front().options = {{"store_depths", false}};
  EXPECT_TRUE(needed(cache("prepared")).instants.empty());
}

TEST_F(Preparation, LayersThatShowNothingNeedNothing) {
  shot_.layers.front().first_frame = 105;
  const Needed all = needed(cache("prepared"));
  ASSERT_EQ(all.instants.size(), 2U);
  EXPECT_EQ(all.instants.front().tick, 4);
  EXPECT_THAT(all.instants.front().frames, ElementsAre(105));
}

TEST_F(Preparation, OfTicksThatAreNamedOnlyTheseAreFound) {
  const Needed all = needed(cache("prepared"));
  const std::vector<LayerTick> wanted = {{0, 4}, {0, 1}};
  const auto found = list_derived_data(*all.plan, all.frames, wanted);
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0].tick, 1);
  EXPECT_EQ(found[0].file, all.instants[1].file);
  EXPECT_EQ(found[1].file, all.instants[4].file);
  const std::vector<LayerTick> unknown = {{0, 1}, {0, kTicks}};
  EXPECT_THROW(list_derived_data(*all.plan, all.frames, unknown), Error);
}

TEST_F(Preparation, WhatIsStoredIsLeftAndWhatIsDamagedIsStoredAnew) {
  shot_.last_frame = 103;
  ASSERT_EQ(prepare(cache("prepared")).derived, 3);
  const auto stored = contents(cache("prepared"));
  const Needed all = needed(cache("prepared"));
  for (const DerivedFrameData& instant : all.instants) EXPECT_TRUE(instant.is_stored);
  fs::resize_file(all.instants[1].file, fs::file_size(all.instants[1].file) - 1);
  fs::remove(all.instants[2].file);
  const PrepareReport report = prepare(cache("prepared"));
  EXPECT_EQ(report.stored_before, 1);
  EXPECT_EQ(report.derived, 2);
  EXPECT_TRUE(contents(cache("prepared")) == stored);
}

TEST_F(Preparation, WhatCannotBeStoredIsAFailure) {
  shot_.last_frame = 102;
  write_file_atomically(cache("prepared"), std::string_view("no folder"));
  const PrepareReport report = prepare(cache("prepared"));
  EXPECT_EQ(report.failures.size(), 2U);
  EXPECT_EQ(report.derived, 0);
  EXPECT_EQ(report.exit_code(), ExitCode::kFailed);
}

TEST_F(Preparation, ExitCodesTellRetriesFromBadInput) {
  PrepareReport report;
  EXPECT_EQ(report.exit_code(), ExitCode::kFailed);  // nothing has run
  report.status = RunStatus::kFinished;
  report.requested = 1;
  report.failures = {{0, 3, "disk full"}};
  EXPECT_EQ(report.exit_code(), ExitCode::kFailed);
  report.failures[0].is_bad_input = true;
  EXPECT_EQ(report.exit_code(), ExitCode::kBadInput);
  report.requested = 3;
  report.derived = 2;
  EXPECT_EQ(report.exit_code(), ExitCode::kSomeFramesFailed);
  report.status = RunStatus::kStopped;
  EXPECT_EQ(report.exit_code(), ExitCode::kFailed);
}

TEST_F(Preparation, StopsBetweenLightFieldFrames) {
  const Needed all = needed(cache("prepared"));
  std::stop_source source;
  PrepareOptions options;
  options.progress = [&](double done) {
    if (done > 0) source.request_stop();
  };
  const PrepareReport report =
      prepare_derived_data(*all.plan, all.instants, options, source.get_token());
  EXPECT_EQ(report.status, RunStatus::kStopped);
  EXPECT_EQ(report.derived, 1);
  EXPECT_EQ(report.exit_code(), ExitCode::kFailed);
}

TEST_F(Preparation, PinsTheFoldersOfFiles) {
  const Needed all = needed(cache("prepared"));
  std::vector<fs::path> files;
  for (const DerivedFrameData& instant : all.instants) files.push_back(instant.file);
  const fs::path pin = files.front().parent_path() / "pin.job-7";
  pin_derived_data(files, "job-7");
  EXPECT_TRUE(fs::exists(pin));
  unpin_derived_data(files, "job-7");
  EXPECT_FALSE(fs::exists(pin));
  unpin_derived_data(files, "job-7");
  EXPECT_THROW(pin_derived_data(files, "../job"), Error);
}

TEST_F(Preparation, RenderingWithACacheLeavesTheTakeAsItIs) {
  const auto take = contents(folder_.path() / "take");
  const auto used = fs::last_write_time(folder_.path() / "take");
  EXPECT_EQ(run().light_field_frames_estimated, kTicks);
  const SequenceReport second = run();
  EXPECT_EQ(second.light_field_frames_estimated, 0);
  EXPECT_EQ(second.light_field_frames_loaded, kTicks);
  EXPECT_TRUE(contents(folder_.path() / "take") == take);
  EXPECT_EQ(fs::last_write_time(folder_.path() / "take"), used);
}

TEST_F(Preparation, TheMethodThatAutoChoosesUsesTheCacheToo) {
  write_actor_take(0.4);  // so far apart that auto measures, and chooses depth
  const auto take = contents(folder_.path() / "actor");
  shot_.layers.front().take = "actor";
  shot_.last_frame = 102;
  shot_.layers.front().method = "auto";
  shot_.layers.front().options = {{"target_error", 60.0}};
  const SequenceReport first = run();
  EXPECT_GT(first.light_field_frames_estimated, 0);
  const SequenceReport second = run();
  EXPECT_EQ(second.light_field_frames_estimated, 0);
  EXPECT_EQ(second.light_field_frames_loaded, first.light_field_frames_estimated);
  EXPECT_TRUE(contents(folder_.path() / "actor") == take);
}

TEST_F(Preparation, TheCacheIsNoPartOfTheFingerprint) {
  EXPECT_EQ(run().rendered, kTicks);
  options_.existing = ExistingFiles::kSkip;
  options_.cache_folder = cache("another");
  EXPECT_EQ(run().skipped, kTicks);
  EXPECT_FALSE(fs::exists(cache("another")));
}

TEST_F(Preparation, WithoutACacheTheTakeHoldsTheDepths) {
  EXPECT_EQ(prepare({}).derived, kTicks);
  EXPECT_TRUE(fs::is_directory(folder_.path() / "take" / "depth"));
  options_.cache_folder.clear();
  EXPECT_EQ(run().light_field_frames_estimated, 0);
}

}  // namespace
}  // namespace raystage::compose
