// SPDX-License-Identifier: Apache-2.0
// Averages frames of an evenly lit target in linear light: means over the central half, over a grid
// of cells, and per pixel. Hot pixels differ from the median of their 7x7 neighbourhood by more
// than eight robust standard deviations. Output: see FlatFieldMeasurement. Cost: pixels times
// frames.
#include "calibrate/color/flat_field_measurement.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/error.h"
#include "base/image.h"
#include "base/parallel.h"
#include "calibrate/geometry/median.h"
#include "store/jpeg/decode.h"
#include "store/linear_from_frame_code.h"

namespace raystage::calibrate {
namespace {

constexpr int kFullCode = 252;  // codes: JPEG leaves clipped areas a little below 255

using CodeLight = std::array<std::array<double, 256>, 3>;  // of each code, per channel

/// Sums over frames: R, G, B of each pixel.
using MeanPicture = Image<float, 3>;

/// The central half of a picture in width and height.
struct Middle {
  int left, top, right, bottom;
};
Middle middle_of(const MeanPicture& picture) {
  const int x = picture.width / 4, y = picture.height / 4;
  return {x, y, picture.width - x, picture.height - y};
}

/// Adds one frame to `measurement` and `sum`.
void add_frame(const store::RgbImage& image, const CodeLight& light,
               FlatFieldMeasurement& measurement, schemas::Rgb& squares, MeanPicture& sum) {
  const Middle middle = middle_of(sum);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const std::uint8_t* const rgb = &image.values[sum.offset(x, y)];
      const bool counts =
          x >= middle.left && x < middle.right && y >= middle.top && y < middle.bottom;
      for (std::size_t c = 0; c < 3; ++c) {
        const double value = light[c][rgb[c]];
        sum.at(x, y, c) += static_cast<float>(value);
        if (!counts) continue;
        measurement.mean[c] += value;
        squares[c] += value * value;
        measurement.black[c] += rgb[c] == 0 ? 1 : 0;
      }
      if (counts && std::max({rgb[0], rgb[1], rgb[2]}) >= kFullCode) measurement.clipped += 1;
    }
  }
}

std::vector<FlatFieldCell> cells_of(const MeanPicture& picture) {
  constexpr int kColumns = 32, kRows = 24;
  std::vector<FlatFieldCell> cells;
  const int width = picture.width, height = picture.height;
  const int columns = std::min(kColumns, width), rows = std::min(kRows, height);
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const int left = width * column / columns, right = width * (column + 1) / columns;
      const int top = height * row / rows, bottom = height * (row + 1) / rows;
      FlatFieldCell cell{(left + right) / 2.0, (top + bottom) / 2.0, {}};
      for (int y = top; y < bottom; ++y) {
        for (int x = left; x < right; ++x) {
          for (std::size_t c = 0; c < 3; ++c) cell.mean[c] += picture.at(x, y, c);
        }
      }
      for (double& mean : cell.mean) mean /= 1.0 * (right - left) * (bottom - top);
      cells.push_back(cell);
    }
  }
  return cells;
}

/// Returns the median of a channel over the pixels around (x, y).
float median_around(const MeanPicture& picture, int x, int y, int channel) {
  constexpr int kReach = 3;
  std::array<float, (2 * kReach + 1) * (2 * kReach + 1)> values{};
  std::size_t count = 0;
  for (int j = std::max(0, y - kReach); j <= std::min(picture.height - 1, y + kReach); ++j) {
    for (int i = std::max(0, x - kReach); i <= std::min(picture.width - 1, x + kReach); ++i) {
      values[count++] = picture.at(i, j, channel);
    }
  }
  const auto middle = values.begin() + count / 2;
  std::nth_element(values.begin(), middle, values.begin() + count);
  return *middle;
}

std::vector<schemas::HotPixel> outstanding_pixels(const MeanPicture& picture) {
  std::vector<schemas::HotPixel> pixels;
  std::vector<float> apart;  // absolute differences of all pixels and channels
  Image<float, 3> difference(picture.width, picture.height);
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x) {
      for (int c = 0; c < 3; ++c) {
        difference.at(x, y, c) = picture.at(x, y, c) - median_around(picture, x, y, c);
        apart.push_back(std::abs(difference.at(x, y, c)));
      }
    }
  }

  constexpr float kSigmas = 8, kSigmaOfMedian = 1.4826F;
  constexpr float kMin = 0.004F;  // of full scale: one code in dark greys
  const float most = std::max(kMin, kSigmas * kSigmaOfMedian * median(std::move(apart)));
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x) {
      const auto rgb = difference.pixel(x, y);
      if (std::max({std::abs(rgb[0]), std::abs(rgb[1]), std::abs(rgb[2])}) < most) continue;
      pixels.push_back({x, y, {rgb[0], rgb[1], rgb[2]}});
    }
  }
  return pixels;
}

}  // namespace

FlatFieldMeasurement measure_flat_field(const store::Take& take, int camera,
                                        const schemas::PhotometricResponse& response,
                                        int most_frames) {
  const store::ArchiveReader& archive = take.archive(camera);
  const auto frames = static_cast<int>(archive.frames().size());
  const std::string& id = take.document().cameras[camera].id;
  if (frames == 0) {
    throw Error::bad_input("camera \"" + id + "\" has no frames", take.folder().string(),
                           "Record the target with every camera");
  }
  CodeLight light{};
  for (std::size_t c = 0; c < 3; ++c) {
    for (int code = 0; code < 256; ++code) {
      light[c][code] = store::linear_from_frame_code(
          take.document(), 255 * rig::evaluate_response_curve(response.curve[c], code / 255.0));
    }
  }
  const rig::CameraModel& expected = take.rig().cameras[camera].model;
  store::JpegDecoder decoder;
  FlatFieldMeasurement measurement;
  MeanPicture picture;
  schemas::Rgb squares{};
  const int looked_at = std::min(frames, most_frames);
  int measured = 0;
  for (int k = 0; k < looked_at; ++k) {
    const auto jpeg = archive.intact_jpeg((2 * k + 1) * frames / (2 * looked_at));
    if (!jpeg) continue;
    const store::RgbImage image = decoder.decode(*jpeg, id);
    if (image.width != expected.width() || image.height != expected.height()) {
      throw Error::bad_input("frames of camera \"" + id + "\" have another size than in the rig",
                             take.folder().string(), "Record the target again");
    }
    if (measured++ == 0) {
      measurement.size = {image.width, image.height};
      picture = MeanPicture(image.width, image.height);
    }
    add_frame(image, light, measurement, squares, picture);
  }
  if (measured == 0) {
    throw Error::bad_input("no frame of camera \"" + id + "\" is as it was recorded",
                           take.folder().string(), "Run `raystage verify` on the take");
  }
  const Middle middle = middle_of(picture);
  const double count = 1.0 * measured * (middle.right - middle.left) * (middle.bottom - middle.top);
  for (std::size_t c = 0; c < 3; ++c) {
    measurement.mean[c] /= count;
    measurement.black[c] /= count;
    measurement.deviation[c] =
        std::sqrt(std::max(0.0, squares[c] / count - measurement.mean[c] * measurement.mean[c]));
  }
  measurement.clipped /= count;
  for (float& channel : picture.values) channel /= static_cast<float>(measured);
  measurement.cells = cells_of(picture);
  if (std::ranges::max(measurement.mean) <= FlatFieldMeasurement::kDark)
    measurement.hot_pixels = outstanding_pixels(picture);
  return measurement;
}

FlatFieldMeasurements measure_flat_fields(
    const store::Take& take, const std::vector<schemas::PhotometricResponse>& responses,
    const std::stop_token& stop) {
  FlatFieldMeasurements measurements(static_cast<std::size_t>(take.camera_count()));
  parallel_for(0, take.camera_count(), [&](int camera) {
    if (stop.stop_requested()) {
      throw Error::failed("the measurement was stopped", take.folder().string(), "Start it again");
    }
    measurements[camera] = measure_flat_field(
        take, camera, responses.empty() ? schemas::PhotometricResponse{} : responses[camera]);
  });
  return measurements;
}

}  // namespace raystage::calibrate
