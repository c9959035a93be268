// SPDX-License-Identifier: Apache-2.0
// Renders a take from between its first two cameras and writes the view as a PFM image (linear
// light). Prints the light of the centre pixel, and of the ray through its centre.
#include <raystage/raystage.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <fstream>
#include <stdexcept>
#include <string>

namespace {

/// Writes R, G and B as a Portable Float Map: rows from the bottom, little-endian.
void write_pfm(const raystage::ReconstructedView& view, const char* path) {
  std::ofstream file(path, std::ios::binary);
  file << "PF\n" << view.width << " " << view.height << "\n-1.0\n";
  for (int y = view.height - 1; y >= 0; --y) {
    for (int x = 0; x < view.width; ++x) {
      const auto pixel = static_cast<std::size_t>(y) * view.width + x;
      file.write(reinterpret_cast<const char*>(&view.rgba[4 * pixel]), 3 * sizeof(float));
    }
  }
  if (!file.flush()) throw std::runtime_error(std::string(path) + " cannot be written");
}

/// Returns the ray through a pixel centre.
raystage::LightRay ray_through(const raystage::PinholeCamera& camera, int x, int y) {
  const auto& m = camera.world_from_camera;
  const double right = (x + 0.5 - camera.cx) / camera.fx, up = (camera.cy - y - 0.5) / camera.fy;
  raystage::LightRay ray;
  for (std::size_t row = 0; row < 3; ++row) {
    ray.origin[row] = m[4 * row + 3];
    ray.direction[row] = right * m[4 * row] + up * m[4 * row + 1] - m[4 * row + 2];
  }
  return ray;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) {
    std::fprintf(stderr, "usage: render_view TAKE FOCAL_DEPTH_IN_METRES OUTPUT.pfm\n");
    return 2;
  }
  try {
    const raystage::LightField light_field(argv[1]);
    std::array<double, 16> world_from_camera{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    for (const std::size_t i : {3, 7, 11}) {  // between the first two cameras, along -z
      world_from_camera[i] = (light_field.cameras().at(0).world_from_camera[i] +
                              light_field.cameras().at(1).world_from_camera[i]) /
                             2;
    }
    const raystage::PinholeCamera camera =
        raystage::make_virtual_camera(161, 121, 0.8, world_from_camera);
    const int tick = light_field.tick_count() / 2;
    raystage::Reconstruction reconstruction;
    reconstruction.focal_depth = std::atof(argv[2]);
    const auto view = light_field.render(camera, tick, reconstruction);
    for (const std::string& note : view.notes) std::printf("%s\n", note.c_str());

    const int x = view.width / 2, y = view.height / 2;
    const raystage::LightRay ray = ray_through(camera, x, y);
    const auto sample = light_field.sample({&ray, 1}, tick, reconstruction).at(0);
    const auto pixel = static_cast<std::size_t>(y) * view.width + x;
    std::printf("centre: %.4f %.4f %.4f, by its ray %.4f %.4f %.4f, %.3f m away\n",
                view.rgba[4 * pixel], view.rgba[4 * pixel + 1], view.rgba[4 * pixel + 2],
                sample.rgba[0], sample.rgba[1], sample.rgba[2], sample.depth);
    write_pfm(view, argv[3]);
    std::printf("tick %d of %d\n", tick, light_field.tick_count());
    const auto frame = light_field.read_frame(0, tick);
    std::printf("the first camera's frame: %dx%d at %.4f s\n", frame.width, frame.height,
                frame.time);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
