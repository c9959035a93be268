// SPDX-License-Identifier: Apache-2.0
#include "calibrate/corrected_picture.h"

#include <string>

#include "store/frames/photometric_correction.h"
#include "store/jpeg/decode.h"

namespace raystage {

CorrectedPicture corrected_picture(const Take& take, int camera, int frame,
                                   const PhotometricResponse& response, const CodeScale& scale) {
  const std::string& id = take.document().cameras[static_cast<std::size_t>(camera)].id;
  const auto jpeg = take.archive(camera).jpeg(frame);
  const JpegLayout layout = parse_jpeg_layout(jpeg, id);
  const McuMask all(static_cast<std::size_t>(layout.mcu_count()), 1);
  CorrectedPicture picture{{layout.width, layout.height}, {}};
  picture.rgba.resize(4 * static_cast<std::size_t>(layout.width) *
                      static_cast<std::size_t>(layout.height));
  const PhotometricCorrection correction(response, picture.size, take.document(), scale);
  JpegDecoder().decode_region(jpeg, layout, all, correction.table(), picture.rgba, id);
  correction.correct(picture.rgba, layout, all);
  return picture;
}

}  // namespace raystage
