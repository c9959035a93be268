// SPDX-License-Identifier: Apache-2.0
// Compares mattes keyed from a simulated blue screen with the true coverage of the figure.
#include <gtest/gtest.h>

#include <cmath>

#include "simulate/exposure_schedule.h"
#include "simulate/simulate.h"
#include "store/processing/frames/frame_cache.h"
#include "store/processing/mattes/take_matte.h"
#include "testing/ingest/test_moving_coverage.h"
#include "testing/test_folder.h"

namespace raystage::simulate {
namespace {

SimulationOptions settings_of(const std::string& scene) {
  SimulationOptions settings;
  settings.scene = scene;
  settings.rows = 1;
  settings.columns = 2;
  settings.spacing = 0.3;
  settings.seconds = 0.3;
  settings.startup_loss_s = 0;
  settings.drop_probability = 0;
  settings.truth_views = 0;
  settings.edge_samples = 64;
  return settings;
}

/// Mean absolute differences of alpha.
struct AlphaError {
  double all = 0;    ///< of the picture
  double mixed = 0;  ///< of pixels that are covered in part
  double solid = 0;  ///< of those that are covered
};

AlphaError error_of(const std::string& scene_name, const schemas::MatteSettings& settings,
                    const std::filesystem::path& folder) {
  const SimulationOptions simulation = settings_of(scene_name);
  const store::Take take(folder / scene_name);
  const ExposureSchedule schedule = make_exposure_schedule(simulation);
  const Scene scene = make_scene(scene_name);
  const SceneGeometry geometry(scene);
  AlphaError error;
  int pixels = 0, mixed = 0, solid = 0;
  store::FrameCache cache(take, std::size_t{1} << 26, store::BlendSpace::kPerceptual,
                          std::make_shared<store::TakeMatte>(take, settings, folder));
  for (int camera = 0; camera < take.camera_count(); ++camera) {
    constexpr int kFrame = 2;
    const auto i = static_cast<std::size_t>(camera);
    World world(geometry);
    world.set_time(static_cast<double>(schedule.cameras[i].frames[kFrame].true_time) * 1e-9);
    const rig::Rig::Camera& source = take.rig().cameras[i];
    const std::vector<double> truth =
        testing::moving_part_coverage(world, PixelRays(source.model, source.pose));
    std::int64_t decoded = 0;
    const auto frame = cache.fetch(camera, kFrame, {}, decoded);
    for (std::size_t at = 0; at < truth.size(); ++at) {
      const double off = std::abs(frame->rgba[4 * at + 3] / 65535.0 - truth[at]);
      error.all += off;
      ++pixels;
      if (truth[at] > 0.02 && truth[at] < 0.98) {
        error.mixed += off;
        ++mixed;
      }
      if (truth[at] == 1) {
        error.solid += off;
        ++solid;
      }
    }
  }
  error.all /= pixels;
  error.mixed /= mixed;
  error.solid /= solid;
  std::printf("%s: alpha error %.4f, where a pixel is covered in part (%.1f %%) %.4f, all %.4f\n",
              scene_name.c_str(), error.all, 100.0 * mixed / pixels, error.mixed, error.solid);
  return error;
}

class BlueScreens : public ::testing::Test {
 protected:
  void simulate_scene(const std::string& name) {
    simulate(settings_of(name), folder_.path() / name, "test");
  }
  testing::TestFolder folder_;
};

TEST_F(BlueScreens, AreKeyedToTheTruthWithHair) {
  simulate_scene("blue_screen");
  simulate_scene("empty_blue_screen");
  schemas::MatteSettings settings;
  AlphaError error = error_of("blue_screen", settings, folder_.path());
  EXPECT_LT(error.all, 0.03);
  EXPECT_LT(error.mixed, 0.15);
  EXPECT_LT(error.solid, 0.03);
  settings.clean_plate_take = "empty_blue_screen";
  error = error_of("blue_screen", settings, folder_.path());
  EXPECT_LT(error.all, 0.03);
  EXPECT_LT(error.mixed, 0.15);
}

TEST_F(BlueScreens, MayBeGreen) {
  simulate_scene("green_screen");
  schemas::MatteSettings settings;
  settings.kind = schemas::MatteSettings::Kind::kGreenScreen;
  const AlphaError error = error_of("green_screen", settings, folder_.path());
  EXPECT_LT(error.all, 0.03);
  EXPECT_LT(error.mixed, 0.15);
}

}  // namespace
}  // namespace raystage::simulate
