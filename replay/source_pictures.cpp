// SPDX-License-Identifier: Apache-2.0
// Decodes source frames at 1/8 to 1/1 of their size by the JPEG decoder's scaled transform, which
// costs little more than entropy decoding, and resamples the rest by OpenImageIO.
#include "replay/source_pictures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>

#include "base/error.h"
#include "base/parallel.h"
#include "images/resize.h"
#include "store/jpeg/decode.h"

namespace raystage::replay {
namespace {

constexpr std::uint8_t kBackground = 24;
constexpr int kGap = 2;  // pixels between cells

/// A camera's place in the grid, from the top left.
struct GridPlace {
  int row = 0, column = 0;
};

/// Returns the mean change of a coordinate along `axis` from one index to the next: its sign says
/// whether indices rise along the axis.
double rise_of(const rig::Rig& rig, const Eigen::Vector3d& axis,
               std::optional<int> rig::Rig::Camera::*index) {
  double covariance = 0, mean_index = 0;
  const Eigen::Vector3d centre = rig.centre();
  for (const rig::Rig::Camera& camera : rig.cameras) mean_index += *(camera.*index);
  mean_index /= static_cast<double>(rig.cameras.size());
  for (const rig::Rig::Camera& camera : rig.cameras) {
    covariance += (*(camera.*index) - mean_index) * axis.dot(camera.pose.position - centre);
  }
  return covariance;
}

/// Returns the places by the rows and columns of the rig, or nullopt if these are not a grid.
std::optional<std::vector<GridPlace>> places_in_rig(const rig::Rig& rig) {
  std::set<int> rows, columns;
  std::set<std::pair<int, int>> taken;
  for (const rig::Rig::Camera& camera : rig.cameras) {
    if (!camera.row || !camera.column) return std::nullopt;
    rows.insert(*camera.row);
    columns.insert(*camera.column);
    if (!taken.insert({*camera.row, *camera.column}).second) return std::nullopt;
  }
  const Eigen::Vector3d ahead = rig.mean_viewing_direction();
  const Eigen::Vector3d right = ahead.cross(Eigen::Vector3d::UnitY());
  const bool mirror_rows = rise_of(rig, Eigen::Vector3d::UnitY(), &rig::Rig::Camera::row) > 0;
  const bool mirror_columns = rise_of(rig, right, &rig::Rig::Camera::column) < 0;
  const auto place = [](const std::set<int>& all, int value, bool mirror) {
    const auto index = static_cast<int>(std::distance(all.begin(), all.find(value)));
    return mirror ? static_cast<int>(all.size()) - 1 - index : index;
  };
  std::vector<GridPlace> places;
  for (const rig::Rig::Camera& camera : rig.cameras) {
    places.push_back(
        {place(rows, *camera.row, mirror_rows), place(columns, *camera.column, mirror_columns)});
  }
  return places;
}

/// Returns places in lines, so many that cells of this shape fill a picture best.
std::vector<GridPlace> places_in_lines(std::size_t count, double cell_aspect, double aspect) {
  const double columns = std::sqrt(static_cast<double>(count) * aspect / cell_aspect);
  const int per_line =
      std::clamp(static_cast<int>(std::lround(columns)), 1, static_cast<int>(count));
  std::vector<GridPlace> places;
  for (int i = 0; i < static_cast<int>(count); ++i) places.push_back({i / per_line, i % per_line});
  return places;
}

int divisor_for(PictureSize whole, PictureSize wanted) {
  int divisor = 8;
  while (divisor > 1 &&
         (whole.width < wanted.width * divisor || whole.height < wanted.height * divisor)) {
    divisor /= 2;
  }
  return divisor;
}

store::RgbImage decode_reduced(const SourceFrames& source, int camera, PictureSize size) {
  const rig::CameraModel& model = source.take.rig().cameras[camera].model;
  store::RgbImage picture =
      decode_source_frame(source, camera, divisor_for({model.width(), model.height()}, size));
  if (picture.width == size.width && picture.height == size.height) return picture;
  return images::resize(picture, size.width, size.height);
}

}  // namespace

store::RgbImage decode_source_frame(const SourceFrames& source, int camera, int divisor) {
  const rig::Rig::Camera& of = source.take.rig().cameras[camera];
  const std::string name = "camera " + of.id;
  const store::FrameBytes jpeg = source.take.archive(camera).jpeg(source.frames.frame[camera]);
  const store::JpegLayout layout = store::parse_jpeg_layout(jpeg, name);
  if (layout.width != of.model.width() || layout.height != of.model.height()) {
    throw Error::bad_input(
        fmt::format("a frame of {}x{} pixels, the camera has {}x{}", layout.width, layout.height,
                    of.model.width(), of.model.height()),
        name, "Verify the take");
  }
  return store::JpegDecoder().decode_scaled(jpeg, divisor, name);
}

std::vector<MosaicCell> mosaic_cells(const store::Take& take, int width, int height) {
  const rig::Rig& rig = take.rig();
  const rig::CameraModel& first = rig.cameras.front().model;
  const double cell_aspect = static_cast<double>(first.width()) / first.height();
  const std::vector<GridPlace> places = places_in_rig(rig).value_or(
      places_in_lines(rig.cameras.size(), cell_aspect, static_cast<double>(width) / height));
  const int rows = std::ranges::max_element(places, {}, &GridPlace::row)->row + 1;
  const int columns = std::ranges::max_element(places, {}, &GridPlace::column)->column + 1;
  const PictureSize room{std::max(1, width / columns - kGap), std::max(1, height / rows - kGap)};
  const PictureSize largest = fitting_size({first.width(), first.height()}, room);
  const int left = (width - columns * (largest.width + kGap)) / 2;
  const int top = (height - rows * (largest.height + kGap)) / 2;
  std::vector<MosaicCell> cells;
  for (std::size_t i = 0; i < rig.cameras.size(); ++i) {
    const rig::CameraModel& model = rig.cameras[i].model;
    const PictureSize size = fitting_size({model.width(), model.height()}, largest);
    MosaicCell cell{rig.cameras[i].id};
    cell.x = std::clamp(left + places[i].column * (largest.width + kGap), 0, width - size.width);
    cell.y = std::clamp(top + places[i].row * (largest.height + kGap), 0, height - size.height);
    cell.width = size.width;
    cell.height = size.height;
    cells.push_back(std::move(cell));
  }
  return cells;
}

Mosaic make_mosaic(const SourceFrames& source, int width, int height) {
  Mosaic mosaic{store::RgbImage(width, height), mosaic_cells(source.take, width, height)};
  std::ranges::fill(mosaic.picture.values, kBackground);
  parallel_for(std::size_t{0}, mosaic.cells.size(), [&](std::size_t i) {
    MosaicCell& cell = mosaic.cells[i];
    cell.is_absent = source.frames.frame[i] < 0;
    if (cell.is_absent) return;
    try {
      const auto camera = static_cast<int>(i);
      copy_into(decode_reduced(source, camera, {cell.width, cell.height}), cell.x, cell.y,
                mosaic.picture);
    } catch (const Error&) {
      cell.is_absent = true;  // one damaged frame does not hide the others
    }
  });
  return mosaic;
}

store::RgbImage source_picture(const SourceFrames& source, int camera, int width, int height) {
  const rig::Rig::Camera& of = source.take.rig().cameras[camera];
  if (source.frames.frame[camera] < 0) {
    throw Error::bad_input(fmt::format("camera {} has no frame at this instant", of.id),
                           source.take.folder().string(), "Choose another frame");
  }
  const PictureSize whole{of.model.width(), of.model.height()};
  const PictureSize room{std::min(width, whole.width), std::min(height, whole.height)};
  return decode_reduced(source, camera, fitting_size(whole, room));
}

}  // namespace raystage::replay
