// SPDX-License-Identifier: Apache-2.0
#include "replay/source_answers.h"

#include "base/error.h"
#include "replay/epipolar_image.h"
#include "replay/folder_listing.h"
#include "replay/server_messages.h"
#include "store/jpeg/encode.h"

namespace raystage::replay {
namespace {

using schemas::ViewerMessage;

SourcePictureMessage header_for(PictureContent content, const ViewerMessage& request,
                                const store::RgbImage& picture) {
  SourcePictureMessage header;
  header.content = content;
  header.id = request.id;
  header.frame = request.frame;
  header.width = picture.width;
  header.height = picture.height;
  return header;
}

SourceAnswer answer_mosaic(const SourceFrames& source, const ViewerMessage& request) {
  const Mosaic mosaic = make_mosaic(source, request.width, request.height);
  SourcePictureMessage header = header_for(PictureContent::kMosaic, request, mosaic.picture);
  header.mosaic = &mosaic;
  return {header.content, source_picture_message(header, encode_source_picture(mosaic.picture))};
}

SourceAnswer answer_camera(const SourceFrames& source, const ViewerMessage& request) {
  const int camera = source.take.camera_index(request.camera_id);
  if (camera < 0) {
    throw Error::bad_input("the take has no camera " + request.camera_id,
                           source.take.folder().string(), "Choose one of the mosaic");
  }
  const store::RgbImage picture = source_picture(source, camera, request.width, request.height);
  SourcePictureMessage header = header_for(PictureContent::kSource, request, picture);
  header.camera_id = request.camera_id;
  return {header.content, source_picture_message(header, encode_source_picture(picture))};
}

SourceAnswer answer_epi(const ShownShot& shown, const SourceFrames& source,
                        const ViewerMessage& request) {
  constexpr double kWithoutFocus = 5;  // metres, as the page assumes
  constexpr int kHeight = 160;         // pixels
  const compose::ExrCamera camera = requested_camera(shown, request, request.width, request.height);
  const EpipolarImage epi =
      make_epipolar_image(source, camera.view, Eigen::Vector2d(request.pixel.data()),
                          camera.focus_m.value_or(kWithoutFocus), {request.width, kHeight});
  SourcePictureMessage header = header_for(PictureContent::kEpi, request, epi.picture);
  header.epi = &epi;
  return {header.content, source_picture_message(header, encode_source_picture(epi.picture))};
}

}  // namespace

std::vector<std::byte> encode_source_picture(const store::RgbImage& picture) {
  store::JpegEncodeOptions options;
  options.restart_interval = 0;
  options.quality = 88;
  return store::encode_jpeg(picture, options);
}

SourceAnswer answer_source_request(const ShownShot& shown, const ViewerMessage& request) {
  const SourceFrames source = requested_source(shown, request);
  switch (request.type) {
    case ViewerMessage::Type::kMosaic:
      return answer_mosaic(source, request);
    case ViewerMessage::Type::kEpi:
      return answer_epi(shown, source, request);
    default:
      return answer_camera(source, request);
  }
}

SourceAnswer answer_thumbnail_request(const std::filesystem::path& take,
                                      const ViewerMessage& request) {
  const store::RgbImage picture = take_thumbnail(take, request.width, request.height);
  const SourcePictureMessage header = header_for(PictureContent::kThumbnail, request, picture);
  return {header.content, source_picture_message(header, encode_source_picture(picture))};
}

}  // namespace raystage::replay
