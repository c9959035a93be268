// SPDX-License-Identifier: Apache-2.0
#include "store/processing/frames/corrected_picture.h"

#include <fmt/format.h>

#include <string>

#include "base/error.h"
#include "store/jpeg/decode.h"

namespace raystage {

PhotometricResponse as_shown(const PhotometricResponse& response) {
  PhotometricResponse shown;
  shown.curve = response.curve;
  shown.hot_pixels = response.hot_pixels;
  return shown;
}

std::array<std::uint16_t, 3> level_of_code(const Take& take, const PhotometricResponse& response,
                                           const CodeScale& scale, std::uint8_t code) {
  PhotometricResponse anywhere = response;
  anywhere.hot_pixels.clear();
  return PhotometricCorrection::reference(anywhere, {1, 1}, take.document(), scale, 0, 0,
                                          {code, code, code});
}

CorrectedPicture corrected_picture(const Take& take, int camera, int frame, PictureSize expected,
                                   const PhotometricResponse& response, const CodeScale& scale,
                                   const LevelTable& levels) {
  const std::string& id = take.document().cameras[static_cast<std::size_t>(camera)].id;
  const auto jpeg = take.archive(camera).jpeg(frame);
  const JpegLayout layout = parse_jpeg_layout(jpeg, id);
  if (layout.width != expected.width || layout.height != expected.height) {
    throw Error::bad_input(
        fmt::format("camera \"{}\" has frames of {}x{} pixels, and its rig says "
                    "{}x{}",
                    id, layout.width, layout.height, expected.width, expected.height),
        take.folder().string(), "Give the rig of these frames");
  }
  const McuMask all(static_cast<std::size_t>(layout.mcu_count()), 1);
  CorrectedPicture picture{expected, {}};
  picture.rgba.resize(4 * static_cast<std::size_t>(layout.width) *
                      static_cast<std::size_t>(layout.height));
  const PhotometricCorrection correction(response, expected, take.document(), scale, levels);
  JpegDecoder().decode_region(jpeg, layout, all, correction.table(), picture.rgba, id);
  correction.correct(picture.rgba, layout, all);
  return picture;
}

}  // namespace raystage
