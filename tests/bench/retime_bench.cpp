// SPDX-License-Identifier: Apache-2.0
// Measures the error of pictures between two frames for each retiming method. Input: four cameras
// of the simulated stage, pairs of frames 1/15 s apart (and 2/15 s: one frame lost).
// Usage: retime_bench [WIDTH HEIGHT [FOLDER]]: size of a picture, pixels (default 640 480); FOLDER:
// for the pictures of the first pair.
#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <vector>

#include "images/image_file.h"
#include "rig/rig.h"
#include "simulate/camera_renderer.h"
#include "simulate/scene.h"
#include "simulate/sensor_model.h"
#include "simulate/simulated_rig.h"
#include "store/processing/motion/frame_interpolation.h"

namespace raystage {
namespace {

using Clock = std::chrono::steady_clock;

constexpr double kFrameTime = 1.0 / 15;
constexpr int kPairs = 6;

double milliseconds_since(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

/// Squared errors in codes, over all pixels and over those that move.
struct Error2 {
  double all = 0, moving = 0;
  double count = 0, moving_count = 0;
  void add(const store::RgbImage& image, const store::RgbImage& truth,
           const std::vector<bool>& moves) {
    for (std::size_t i = 0; i < moves.size(); ++i) {
      for (std::size_t c = 0; c < 3; ++c) {
        const double difference = image.values[3 * i + c] - truth.values[3 * i + c];
        all += difference * difference;
        ++count;
        if (!moves[i]) continue;
        moving += difference * difference;
        ++moving_count;
      }
    }
  }
  static double psnr(double sum, double number) {
    return 10 * std::log10(255.0 * 255.0 * number / sum);
  }
};

/// Returns the pixels at which the noise-free pictures differ by more than four codes.
std::vector<bool> moving_pixels(const store::RgbImage& a, const store::RgbImage& b) {
  std::vector<bool> moves(a.values.size() / 3);
  for (std::size_t i = 0; i < moves.size(); ++i) {
    for (std::size_t c = 0; c < 3; ++c) {
      if (std::abs(a.values[3 * i + c] - b.values[3 * i + c]) > 4) moves[i] = true;
    }
  }
  return moves;
}

class Stage {
 public:
  Stage(int width, int height)
      : scene_(simulate::make_scene("stage")), geometry_(scene_), world_(geometry_) {
    simulate::SimulationOptions options;
    options.width = width;
    options.height = height;
    const rig::Rig rig = rig::rig_from_document(simulate::make_simulated_rig(options).truth);
    for (const int camera : {0, 7, 27, 63}) {
      const auto& c = rig.cameras[camera];
      cameras_.push_back({simulate::PixelRays(c.model, c.pose), simulate::StaticSampleCache()});
    }
  }
  std::size_t cameras() const { return cameras_.size(); }

  store::RgbImage picture(std::size_t camera, double time, bool noise) {
    world_.set_time(time);
    renderer_.render(world_, cameras_[camera].rays, 4, cameras_[camera].cache, image_);
    if (!noise) return simulate::develop(image_);
    return simulate::SensorModel({}, {image_.width, image_.height}, 0.005).develop(image_, ++seed_);
  }

 private:
  struct Camera {
    simulate::PixelRays rays;
    simulate::StaticSampleCache cache;
  };
  simulate::Scene scene_;
  simulate::SceneGeometry geometry_;
  simulate::World world_;
  simulate::CameraRenderer renderer_;
  simulate::LinearImage image_;
  std::vector<Camera> cameras_;
  std::uint64_t seed_ = 0;
};

void compare(Stage& stage, double gap, const std::filesystem::path& folder) {
  Error2 nearest, blended, flowed;
  double blend_ms = 0, motion_ms = 0, between_ms = 0;
  int pictures = 0;
  store::OpticalFlowEstimator estimator;
  for (std::size_t camera = 0; camera < stage.cameras(); ++camera) {
    for (int pair = 0; pair < kPairs; ++pair) {
      const double begin = 0.5 + 0.43 * pair;
      const store::FlowImage a = store::make_flow_image(stage.picture(camera, begin, true));
      const store::FlowImage b = store::make_flow_image(stage.picture(camera, begin + gap, true));
      auto start = Clock::now();
      const store::FlowField b_from_a = estimator.estimate(a.luma, b.luma),
                             a_from_b = estimator.estimate(b.luma, a.luma);
      motion_ms += milliseconds_since(start);
      for (const double part : {0.1, 0.3, 0.5, 0.7, 0.9}) {
        const store::RgbImage truth = stage.picture(camera, begin + part * gap, false);
        const store::RgbImage nearer =
            stage.picture(camera, begin + (part <= 0.5 ? 0 : gap), false);
        const std::vector<bool> moves = moving_pixels(truth, nearer);
        start = Clock::now();
        const store::RgbImage blend_image = store::blend(a.rgb, b.rgb, part);
        blend_ms += milliseconds_since(start);
        start = Clock::now();
        const store::RgbImage flow_image =
            store::interpolate_frame(a, b, b_from_a, a_from_b, {part, 0});
        between_ms += milliseconds_since(start);
        const store::RgbImage& near_image = part <= 0.5 ? a.rgb : b.rgb;
        nearest.add(near_image, truth, moves);
        blended.add(blend_image, truth, moves);
        flowed.add(flow_image, truth, moves);
        ++pictures;
        if (folder.empty() || pictures > 5) continue;
        const std::string name = fmt::format("gap{:.0f}_part{:.0f}_", gap * 1e3, part * 100);
        images::write_image(truth, folder / (name + "truth.png"));
        images::write_image(near_image, folder / (name + "nearest.png"));
        images::write_image(blend_image, folder / (name + "blend.png"));
        images::write_image(flow_image, folder / (name + "flow.png"));
      }
    }
  }
  const auto row = [&](const char* name, const Error2& e, double ms) {
    fmt::print("| {:.0f} | {} | {:.2f} | {:.2f} | {:.1f} |\n", gap * 1e3, name,
               Error2::psnr(e.all, e.count), Error2::psnr(e.moving, e.moving_count), ms);
  };
  row("nearest", nearest, 0);
  row("blend", blended, blend_ms / pictures);
  row("flow", flowed, motion_ms / (pictures / 5.0) + between_ms / pictures);
  fmt::print("  motion {:.1f} ms both ways, picture {:.1f} ms; {:.1f} % of the pixels move\n",
             motion_ms / (pictures / 5.0), between_ms / pictures,
             100 * nearest.moving_count / nearest.count);
}

}  // namespace
}  // namespace raystage

int main(int argc, char** argv) {
  using namespace raystage;
  const int width = argc > 2 ? std::atoi(argv[1]) : 640;
  const int height = argc > 2 ? std::atoi(argv[2]) : 480;
  const std::filesystem::path folder = argc > 3 ? argv[3] : "";
  if (!folder.empty()) std::filesystem::create_directories(folder);
  store::use_one_opencv_thread();
  Stage stage(width, height);
  fmt::print("| gap ms | method | PSNR dB | of moving pixels | ms |\n");
  compare(stage, kFrameTime, folder);
  compare(stage, 2 * kFrameTime, folder);
}
