// SPDX-License-Identifier: Apache-2.0
#include "store/processing/frames/corrected_frame.h"

#include <fmt/format.h>

#include <string>

#include "base/error.h"
#include "store/jpeg/decode.h"

namespace raystage::store {

schemas::PhotometricResponse curve_and_hot_pixels_only(
    const schemas::PhotometricResponse& response) {
  schemas::PhotometricResponse result;
  result.curve = response.curve;
  result.hot_pixels = response.hot_pixels;
  return result;
}

std::array<std::uint16_t, 3> levels_from_code(const Take& take,
                                              const schemas::PhotometricResponse& response,
                                              const CodeScale& scale, std::uint8_t code) {
  schemas::PhotometricResponse without_hot_pixels = response;
  without_hot_pixels.hot_pixels.clear();
  return PhotometricCorrection::reference(without_hot_pixels, {1, 1}, take.document(), scale, 0, 0,
                                          {code, code, code});
}

CorrectedFrame decode_corrected_frame(const Take& take, int camera, int frame,
                                      rig::PictureSize expected,
                                      const schemas::PhotometricResponse& response,
                                      const CodeScale& scale, const LevelTable& levels) {
  const std::string& id = take.document().cameras[camera].id;
  if (const auto& pixels = take.document().cameras[camera].pixels) {
    const DeepPicture deep = take.archive(camera).picture(frame);  // has the size in take.json
    CorrectedFrame picture(deep.width, deep.height);
    PhotometricCorrection(response, expected, *pixels, scale, levels).convert(deep, picture.values);
    return picture;
  }
  const auto jpeg = take.archive(camera).jpeg(frame);
  const JpegLayout layout = parse_jpeg_layout(jpeg, id);
  if (layout.width != expected.width || layout.height != expected.height) {
    throw Error::bad_input(
        fmt::format("camera \"{}\" has frames of {}x{} pixels, but {}x{} in its rig", id,
                    layout.width, layout.height, expected.width, expected.height),
        take.folder().string(), "Use the rig with which the take was recorded");
  }
  const McuMask all(static_cast<std::size_t>(layout.mcu_count()), 1);
  CorrectedFrame picture(layout.width, layout.height);
  const PhotometricCorrection correction(response, expected, take.document(), scale, levels);
  JpegDecoder().decode_region(jpeg, layout, all, correction.table(), picture.values, id);
  correction.correct(picture.values, layout, all);
  return picture;
}

}  // namespace raystage::store
