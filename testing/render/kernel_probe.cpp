// SPDX-License-Identifier: Apache-2.0
#include "testing/render/kernel_probe.h"

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <utility>

#include "render/sampling/source_view.h"

namespace raystage::testing {
namespace {

constexpr int kCodesPerPixel = 64;  // of a coordinate picture

std::array<double, 3> as_array(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

/// Returns a picture in which red increases to the right and green downwards.
std::vector<std::uint16_t> picture_of_coordinates(int width, int height) {
  std::vector<std::uint16_t> rgba;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      rgba.push_back(static_cast<std::uint16_t>(x * kCodesPerPixel));
      rgba.push_back(static_cast<std::uint16_t>(y * kCodesPerPixel));
      rgba.push_back(0);
      rgba.push_back(65535);
    }
  }
  return rgba;
}

/// A 4 x 4 picture of one primary colour; every ray samples its middle.
struct Primary {
  render::SourceView view;
  std::array<std::uint16_t, 64> rgba{};

  explicit Primary(std::size_t channel) {
    for (std::size_t i = 0; i < rgba.size(); i += 4) rgba[i + channel] = rgba[i + 3] = 65535;
    view.ideal_from_pixel = {0, 0, 0, 0, 0, 0, 0, 0, 1};
    view.cx = view.cy = 2;
    view.width = view.height = 4;
  }
};

struct Rendered {
  std::vector<float> rgba, alpha, z;
};

Rendered blend(const render::PixelRun& run) {
  const auto pixels = static_cast<std::size_t>(run.end - run.begin);
  Rendered rendered{std::vector<float>(4 * pixels), std::vector<float>(pixels),
                    std::vector<float>(pixels)};
  render::blend_run(run, store::BlendSpace::kLinear, 1, rendered.rgba.data(), rendered.alpha.data(),
                    rendered.z.data());
  return rendered;
}

class Probe {
 public:
  Probe(const rig::Rig& rig, const render::RayCells& cells,
        const render::PlaneProjection& projection)
      : rig_(rig), cells_(cells), projection_(projection) {
    for (Primary& primary : primaries_) primary.view.rgba = primary.rgba.data();
  }

  void add(const render::RayCells::Span& span, int y, std::vector<ProbedPixel>& probed) {
    const render::RayCells::Cell& cell = cells_.cells()[span.cell];
    const std::size_t first = probed.size();
    for (int x = span.begin; x < span.end; ++x) {
      probed.emplace_back();
      probed.back().x = x;
      probed.back().y = y;
      probed.back().cell = span.cell;
    }
    const std::span<ProbedPixel> pixels(probed.begin() + static_cast<std::ptrdiff_t>(first),
                                        probed.end());
    render::PixelRun run;
    run.begin = span.begin;
    run.end = span.end;
    run.y = y;
    compute_weights(cell, run, pixels);
    for (std::size_t c = 0; c < static_cast<std::size_t>(cell.count); ++c) {
      find_positions(rig_.cameras[cell.camera[c]], c, run, pixels);
    }
  }

 private:
  void compute_weights(const render::RayCells::Cell& cell, render::PixelRun run,
                       std::span<ProbedPixel> pixels) {
    run.count = cell.count;
    for (std::size_t c = 0; c < static_cast<std::size_t>(cell.count); ++c) {
      run.source[c] = &primaries_[c].view;
      run.share[c] = as_array(cell.share[c]);
    }
    run.total = as_array(cell.total);
    run.at_infinity = true;
    run.distance = 1;
    const Rendered weights = blend(run);
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      for (std::size_t c = 0; c < 3; ++c) pixels[i].weight[c] = weights.rgba[4 * i + c];
    }
  }

  void find_positions(const rig::Rig::Camera& camera, std::size_t c, render::PixelRun run,
                      std::span<ProbedPixel> pixels) {
    render::SourceView source =
        render::make_source_view(camera.model, projection_.ideal_from_pixel(camera.pose));
    auto& picture = pictures_[{source.width, source.height}];
    if (picture.empty()) picture = picture_of_coordinates(source.width, source.height);
    source.rgba = picture.data();
    run.count = 1;
    run.source[0] = &source;
    run.share[0] = run.total = {0, 0, 1};
    run.slope = as_array(projection_.slope());
    run.distance = projection_.distance();
    run.at_infinity = projection_.at_infinity();
    const Rendered positions = blend(run);
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      const float* rgba = &positions.rgba[4 * i];
      pixels[i].seen[c] = rgba[3];
      if (c == 0) pixels[i].z = positions.z[i];
      if (rgba[3] == 0) continue;
      constexpr float kPixels = 65535.0F / kCodesPerPixel;
      pixels[i].u[c] = rgba[0] / rgba[3] * kPixels + 0.5F;
      pixels[i].v[c] = rgba[1] / rgba[3] * kPixels + 0.5F;
    }
  }

  const rig::Rig& rig_;
  const render::RayCells& cells_;
  const render::PlaneProjection& projection_;
  std::array<Primary, 3> primaries_{Primary(0), Primary(1), Primary(2)};
  std::map<std::pair<int, int>, std::vector<std::uint16_t>> pictures_;  // by size
};

}  // namespace

std::vector<ProbedPixel> probe_kernels(const render::VirtualCamera& view, const rig::Rig& rig,
                                       const render::RayCells& cells,
                                       const render::PlaneProjection& projection) {
  Probe probe(rig, cells, projection);
  std::vector<int> scratch;
  std::vector<render::RayCells::Span> spans;
  std::vector<ProbedPixel> probed;
  for (int y = 0; y < view.height; ++y) {
    cells.row_spans(y, view.width, scratch, spans);
    for (const render::RayCells::Span& span : spans) probe.add(span, y, probed);
  }
  return probed;
}

}  // namespace raystage::testing
