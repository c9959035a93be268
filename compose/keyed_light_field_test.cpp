// SPDX-License-Identifier: Apache-2.0
// Compares a new view of an actor, keyed from a blue screen in every camera, with the traced figure
// over the same background.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "simulate/simulate.h"
#include "testing/compose/sequence_test_data.h"
#include "testing/ingest/test_moving_coverage.h"

namespace raystage::compose {
namespace {

constexpr std::array<double, 3> kBehind{0.2, 0.35, 0.1};  // linear light

class KeyedLightField : public ::testing::Test {
 protected:
  KeyedLightField() {
    simulate::SimulationOptions simulation;
    simulation.scene = "blue_screen";
    simulation.rows = simulation.columns = 5;
    simulation.spacing = 0.07;
    simulation.width = 240;
    simulation.height = 180;
    simulation.seconds = 0.2;
    simulation.startup_loss_s = simulation.drop_probability = 0;
    simulation.jitter = simulation.period_error_ppm = simulation.clock_offset = 0;
    simulation.edge_samples = 36;
    simulation.truth_views = 0;
    simulate::simulate(simulation, folder_.path() / "take", "test");
    store::write_timeline(
        store::build_timeline(store::Take(folder_.path() / "take"), simulation.fps, 0),
        folder_.path() / "take");
    shot_.width = 200;
    shot_.height = 150;
    shot_.merge = schemas::ShotDocument::Merge::kDepth;
    shot_.camera.keys = {testing::camera_key(1, {0.05, 0.03, -0.1}, 50)};
    schemas::ShotDocument::Layer background;
    background.solid = schemas::ShotDocument::Solid{kBehind, 1, 50};
    schemas::ShotDocument::Layer actor;
    actor.take = "take";
    actor.method = "depth";
    actor.speed = 0;
    actor.matte = schemas::MatteSettings{};
    shot_.layers = {background, actor};
  }

  /// Renders the shot's one frame and returns it.
  ExrImage render() {
    schemas::write_shot(shot_, folder_.path() / "shot.json");
    SequenceOptions options;
    options.output = (folder_.path() / "out.exr").string();
    options.existing = ExistingFiles::kOverwrite;
    EXPECT_EQ(render_sequence(folder_.path() / "shot.json", options, {}).rendered, 1);
    return read_exr(options.output);
  }

  /// Returns the picture and the figure's coverage of each pixel.
  std::pair<simulate::LinearImage, std::vector<double>> traced(const std::string& scene_name,
                                                               const render::VirtualCamera& view,
                                                               double seconds) {
    const simulate::Scene scene = simulate::make_scene(scene_name);
    const simulate::SceneGeometry geometry(scene);
    simulate::World world(geometry);
    world.set_time(seconds);
    const simulate::PixelRays rays(
        rig::CameraModel({"view", view.width, view.height, view.intrinsics, {}, {}, {}}),
        view.pose);
    simulate::LinearImage image;
    simulate::CameraRenderer().render_supersampled(world, rays, 100, image);
    return {std::move(image), testing::moving_part_coverage(world, rays)};
  }

  testing::TestFolder folder_;
  schemas::ShotDocument shot_;
};

TEST_F(KeyedLightField, AnActorStandsBeforeAnythingAsIfTakenThere) {
  const ExrImage found = render();
  const ShotPlan plan(folder_.path() / "shot.json");
  const render::VirtualCamera view = plan.camera(1, plan.eyes().front());
  const store::Timeline timeline = store::read_timeline(store::Take(folder_.path() / "take"));
  const double seconds = static_cast<double>(timeline.ticks.front().time_ns) * 1e-9;
  const auto [with, alpha] = traced("blue_screen", view, seconds);
  const simulate::LinearImage empty = traced("empty_blue_screen", view, seconds).first;
  double squares = 0, of_actor = 0;
  std::size_t actor = 0;
  const auto code = [](double light) { return srgb_from_linear(std::clamp(light, 0.0, 1.0)); };
  for (std::size_t i = 0; i < alpha.size(); ++i) {
    double square = 0;
    for (std::size_t c = 0; c < 3; ++c) {
      // Replaces the screen's light by the background colour.
      const auto channel = static_cast<int>(c);
      const double truth =
          static_cast<double>(with.light[i][channel]) +
          (1 - alpha[i]) * (kBehind[c] - static_cast<double>(empty.light[i][channel]));
      square += std::pow(code(truth) - code(static_cast<double>(found.rgba[4 * i + c])), 2) / 3;
    }
    squares += square;
    if (alpha[i] == 0) continue;
    of_actor += square;
    ++actor;
  }
  const double psnr = -10 * std::log10(squares / static_cast<double>(alpha.size()));
  const double psnr_of_actor = -10 * std::log10(of_actor / static_cast<double>(actor));
  std::printf("keyed light field over a colour: %.2f dB; where the actor is, hair included, %.2f\n",
              psnr, psnr_of_actor);
  EXPECT_GT(actor, 2000U);
  EXPECT_GT(psnr, 36);
  EXPECT_GT(psnr_of_actor, 29);
}

TEST_F(KeyedLightField, WithoutItsMatteTheScreenStands) {
  shot_.layers[1].matte.reset();
  const ExrImage opaque = render();
  EXPECT_GT(opaque.rgba[4 * 10 + 2], 0.2F);  // blue
  shot_.layers[1].matte = schemas::MatteSettings{};
  const ExrImage keyed = render();
  for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(keyed.rgba[4 * 10 + c], kBehind[c], 1e-3);
}

}  // namespace
}  // namespace raystage::compose
