// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "render/slabs/slab_kernels.h"

namespace raystage::testing {

/// Size of the images that positions are probed in, in samples.
inline constexpr int kProbedWidth = 640, kProbedHeight = 480;

/// Images of four nodes of equal size, with the padding that the kernel reads.
class NodeImages {
 public:
  NodeImages(int width, int height) : width_(width) {
    for (auto& image : images_) {
      image.resize(static_cast<std::size_t>(width * (height + 1) + 1) * 4);
    }
  }
  void set(std::size_t node, int x, int y, std::size_t channel, int code) {
    images_[node][static_cast<std::size_t>(y * width_ + x) * 4 + channel] =
        static_cast<std::uint16_t>(code);
  }
  const std::uint16_t* of(std::size_t node) const { return images_[node].data(); }

 private:
  int width_;
  std::array<std::vector<std::uint16_t>, 4> images_;
};

/// The kernel's results for a run's pixel, derived from what it renders.
class SlabKernelProbe {
 public:
  SlabKernelProbe() {
    for (std::size_t node = 0; node < 4; ++node) {  // three primary colours and black
      for (int i = 0; i < 16; ++i) {
        if (node < 3) primaries_.set(node, i % 4, i / 4, node, 65535);
        primaries_.set(node, i % 4, i / 4, 3, 65535);
      }
    }
    for (int y = 0; y < kProbedHeight; ++y) {
      for (int x = 0; x < kProbedWidth; ++x) {
        coordinates_.set(0, x, y, 0, kCodesPerPixel * x);
        coordinates_.set(0, x, y, 1, kCodesPerPixel * y);
        coordinates_.set(0, x, y, 3, 65535);
      }
    }
  }

  /// Returns the weights of the nodes at pixel x, visible or not: upper left, upper right, lower
  /// left, lower right.
  std::array<double, 4> weights(render::SlabRun run, int x) const {
    for (std::size_t node = 0; node < 4; ++node) run.node[node] = primaries_.of(node);
    run.width = run.height = 4;
    run.u = run.v = {render::SlabRun::LinearFunction{0, 0, 2},
                     render::SlabRun::LinearFunction{0, 0, 2}};
    run.ahead = {0, 0, 1};
    run.at_infinity = true;
    const Pixel pixel = render(run, x);
    return {pixel.rgba[0], pixel.rgba[1], pixel.rgba[2],
            pixel.rgba[3] - pixel.rgba[0] - pixel.rgba[1] - pixel.rgba[2]};
  }

  /// The position of pixel x's point in a node (samples; undefined if alpha is 0), and its depth
  /// (metres).
  struct Seen {
    double u = 0, v = 0, alpha = 0, z = 0;
  };
  Seen seen(render::SlabRun run, std::size_t node, int x) const {
    run.node = {};
    run.node[node] = coordinates_.of(0);
    run.across = {0, 0, 1};
    const std::size_t row = node / 2, column = node % 2;
    run.column = {0, 0, static_cast<double>(column)};
    run.row = {0, 0, static_cast<double>(row)};
    const Pixel pixel = render(run, x);
    constexpr double kPixels = 65535.0 / kCodesPerPixel;
    return {pixel.rgba[0] / pixel.rgba[3] * kPixels + 0.5,
            pixel.rgba[1] / pixel.rgba[3] * kPixels + 0.5, pixel.rgba[3], pixel.z};
  }

 private:
  static constexpr int kCodesPerPixel = 64;
  struct Pixel {
    std::array<double, 4> rgba{};
    double z = 0;
  };
  static Pixel render(const render::SlabRun& run, int x) {
    const auto count = static_cast<std::size_t>(run.end - run.begin);
    const auto i = static_cast<std::size_t>(x - run.begin);
    std::vector<float> rgba(4 * count), z(count);
    render::sample_slab_run(run, store::BlendSpace::kLinear, 1, rgba.data(), z.data());
    Pixel pixel;
    for (std::size_t c = 0; c < 4; ++c) pixel.rgba[c] = double{rgba[4 * i + c]};
    pixel.z = double{z[i]};
    return pixel;
  }

  NodeImages primaries_{4, 4}, coordinates_{kProbedWidth, kProbedHeight};
};

}  // namespace raystage::testing
