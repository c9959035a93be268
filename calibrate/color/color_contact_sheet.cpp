// SPDX-License-Identifier: Apache-2.0
#include "calibrate/color/color_contact_sheet.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "base/error.h"
#include "store/intact_frame.h"
#include "store/processing/frames/corrected_frame.h"

namespace raystage::calibrate {
namespace {

constexpr int kTileWidth = 160, kGap = 2, kSheetGap = 12;  // pixels
constexpr int kPaper = 38;

struct Place {
  int row = 0, column = 0;
};

std::vector<Place> places_of(const schemas::RigDocument& rig) {
  std::vector<Place> places;
  const bool is_grid =
      std::ranges::all_of(rig.cameras, [](const schemas::RigDocument::Camera& camera) {
        return camera.geometry.row && camera.geometry.column;
      });
  const int columns =
      static_cast<int>(std::ceil(std::sqrt(static_cast<double>(rig.cameras.size()))));
  for (const schemas::RigDocument::Camera& camera : rig.cameras) {
    const int index = static_cast<int>(places.size());
    places.push_back(is_grid ? Place{*camera.geometry.row, *camera.geometry.column}
                             : Place{index / columns, index % columns});
  }
  return places;
}

/// A camera's frame as recorded and as corrected.
struct Pair {
  cv::Mat before, after;
};

Pair pictures_of(const store::Take& take, int camera, rig::PictureSize size,
                 const schemas::PhotometricResponse& response, const cv::Size& tile) {
  const std::string& id = take.document().cameras[camera].id;
  const int frames = static_cast<int>(take.archive(camera).frames().size());
  if (frames == 0) {
    throw Error::bad_input("camera \"" + id + "\" has no frames", take.folder().string(),
                           "Use a take in which every camera has frames");
  }
  // If all frames near the middle are rotten, decoding one says so.
  const int frame = store::intact_frame_near(take.archive(camera), frames / 2).value_or(frames / 2);
  const auto shown_by = [&](const schemas::PhotometricResponse& by) {
    store::CorrectedFrame picture =
        store::decode_corrected_frame(take, camera, frame, size, by, {});
    const cv::Mat whole(picture.height, picture.width, CV_16UC4, picture.values.data());
    cv::Mat codes, small;
    whole.convertTo(codes, CV_8UC4, 1 / 257.0);
    cv::cvtColor(codes, codes, cv::COLOR_RGBA2RGB);
    cv::resize(codes, small, tile, 0, 0, cv::INTER_AREA);
    return small;
  };
  return {shown_by({}), shown_by(response)};
}

}  // namespace

store::RgbImage make_color_contact_sheet(const store::Take& take, const schemas::RigDocument& rig) {
  const std::vector<Place> places = places_of(rig);
  const int rows = std::ranges::max(places, {}, &Place::row).row + 1;
  const int columns = std::ranges::max(places, {}, &Place::column).column + 1;
  const schemas::CameraGeometry& first = rig.cameras.front().geometry;
  const cv::Size tile(std::min(kTileWidth, first.width),
                      std::max(1, std::min(kTileWidth, first.width) * first.height / first.width));
  const int half = columns * (tile.width + kGap);
  cv::Mat sheet(rows * (tile.height + kGap) + kGap, 2 * half + kSheetGap + 2 * kGap, CV_8UC3,
                cv::Scalar::all(kPaper));
  for (std::size_t i = 0; i < rig.cameras.size(); ++i) {
    const schemas::CameraGeometry& geometry = rig.cameras[i].geometry;
    const int camera = take.camera_index(geometry.id);
    if (camera < 0) {
      throw Error::bad_input("the take has no camera \"" + geometry.id + "\" of the rig",
                             take.folder().string(), "Use a take of the cameras of the rig");
    }
    const Pair pictures = pictures_of(take, camera, {geometry.width, geometry.height},
                                      rig.cameras[i].photometric, tile);
    const int x = kGap + places[i].column * (tile.width + kGap);
    const int y = kGap + places[i].row * (tile.height + kGap);
    pictures.before.copyTo(sheet(cv::Rect(cv::Point(x, y), tile)));
    pictures.after.copyTo(sheet(cv::Rect(cv::Point(x + half + kSheetGap, y), tile)));
  }
  store::RgbImage image{sheet.cols, sheet.rows, std::vector<std::uint8_t>()};
  image.values.assign(sheet.data, sheet.data + sheet.total() * 3);
  return image;
}

}  // namespace raystage::calibrate
