// SPDX-License-Identifier: Apache-2.0
#include "planning/epipolar/epipolar_image.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "render/depth/inverse_depth_map.h"

namespace raystage::planning {
namespace {

/// A picture of a camera in which a line along the axis is addressed by its position.
struct Lines {
  const render::VirtualCamera& camera;
  std::span<const std::uint8_t> luma;
  EpipolarAxis axis;

  bool is_row() const { return axis == EpipolarAxis::kRow; }
  int length() const { return is_row() ? camera.width : camera.height; }
  int count() const { return is_row() ? camera.height : camera.width; }
  std::uint8_t code(int along, int position) const {
    const int x = is_row() ? along : position, y = is_row() ? position : along;
    if (x < 0 || y < 0 || x >= camera.width || y >= camera.height) return 0;
    return luma[static_cast<std::size_t>(y) * static_cast<std::size_t>(camera.width) +
                static_cast<std::size_t>(x)];
  }
};

/// Returns the line with the largest sum of differences of adjacent pixels, in the middle half.
int most_structured_line(const Lines& lines) {
  int best = lines.count() / 2;
  long most = -1;
  for (int position = lines.count() / 4; position < lines.count() - lines.count() / 4; ++position) {
    long sum = 0;
    for (int along = 1; along < lines.length(); ++along) {
      sum += std::abs(lines.code(along, position) - lines.code(along - 1, position));
    }
    if (sum > most) {
      most = sum;
      best = position;
    }
  }
  return best;
}

}  // namespace

EpipolarImage make_epipolar_image(std::span<const render::VirtualCamera> pinholes,
                                  std::span<const std::vector<std::uint8_t>> luma,
                                  std::span<const int> line, int middle, EpipolarAxis axis) {
  const auto lines_of = [&](int camera) {
    const auto at = static_cast<std::size_t>(camera);
    return Lines{pinholes[at], luma[at], axis};
  };
  const Lines from = lines_of(middle);
  EpipolarImage image;
  image.axis = axis;
  image.position = most_structured_line(from);
  image.luma = Image<std::uint8_t>(from.length(), static_cast<int>(line.size()));
  for (int row = 0; row < image.luma.height; ++row) {
    const Lines to = lines_of(line[static_cast<std::size_t>(row)]);
    const render::PixelTransfer transfer = render::pixel_transfer(to.camera, from.camera);
    const auto& m = transfer.direction;
    for (int along = 0; along < image.luma.width; ++along) {
      const double u = (from.is_row() ? along : image.position) + 0.5;
      const double v = (from.is_row() ? image.position : along) + 0.5;
      const double w = m[6] * u + m[7] * v + m[8];
      if (!(w > 0)) continue;
      const double x = (m[0] * u + m[1] * v + m[2]) / w, y = (m[3] * u + m[4] * v + m[5]) / w;
      if (!(x >= 0 && y >= 0 && x < to.camera.width && y < to.camera.height)) continue;
      const int column = static_cast<int>(x), line_of_pixels = static_cast<int>(y);
      image.luma.at(along, row) =
          from.is_row() ? to.code(column, line_of_pixels) : to.code(line_of_pixels, column);
    }
    // Where a point in the middle of the line lies in this picture, traced back to the line. The
    // parallax of the opposite transfer has the opposite sign.
    const auto& back = render::pixel_transfer(from.camera, to.camera).parallax;
    const double middle_of_line = from.length() / 2.0;
    image.shift_at_one_metre.push_back(middle_of_line * back[2] - back[from.is_row() ? 0 : 1]);
  }
  return image;
}

}  // namespace raystage::planning
