// SPDX-License-Identifier: Apache-2.0
#include "replay/comparison.h"

#include <utility>

#include "base/stopwatch.h"
#include "compose/exr/exr_file.h"
#include "compose/preview/display.h"
#include "compose/sequence_name.h"
#include "replay/picture_layout.h"
#include "store/jpeg/encode.h"

namespace raystage::replay {
namespace {

using schemas::ViewerMessage;

/// Returns the frame of a sequence in the look of the request, reduced to its size.
std::vector<std::byte> picture_of_file(const ShownShot& shown, const ViewerMessage& request,
                                       const ShotFiles& files) {
  const Stopwatch total;
  const compose::SequenceName name(request.comparison->sequence);
  compose::ExrImage image = compose::read_exr(files.path(name.path(request.frame).string()));
  const PictureSize size =
      fitting_size({image.width, image.height},
                   {std::min(request.width, image.width), std::min(request.height, image.height)});
  if (size.width < image.width) image = compose::downscale(image, size.width, size.height);
  const compose::DisplayOptions display =
      display_options(request.look, shown.scene->plan().colors());
  const store::RgbImage picture = compose::display(image, display);
  store::JpegEncodeOptions jpeg;
  jpeg.quality = 95;
  PictureMessage message;
  message.content = PictureContent::kComparison;
  message.id = request.id;
  message.frame = request.frame;
  message.width = picture.width;
  message.height = picture.height;
  message.quality = "resting";
  const std::vector<std::byte> encoded = store::encode_jpeg(picture, jpeg);
  message.picture_ms = total.ms();
  return picture_message(message, encoded);
}

}  // namespace

std::vector<std::byte> render_comparison(const ShownShot& shown, const ViewerMessage& request,
                                         const ShotFiles& files, const OpenScene& open_scene,
                                         const std::stop_token& stop) {
  const ViewerMessage::Comparison& with = *request.comparison;
  if (!with.sequence.empty()) return picture_of_file(shown, request, files);
  const std::string file = with.file.empty() ? shown.file : with.file;
  std::string text = with.file.empty() ? with.text : files.read(with.file);
  schemas::ShotDocument shot = schemas::parse_shot(text, file);
  const std::filesystem::path path = files.path(file);
  compose::ShotCamera camera(shot, path);
  std::shared_ptr<const Scene> scene = open_scene(shot, path);
  const ShownShot other{file, std::move(text), std::move(shot), std::move(camera),
                        std::move(scene)};
  PictureOptions options;
  options.content = PictureContent::kComparison;
  return render_picture(other, request, options, stop);
}

}  // namespace raystage::replay
