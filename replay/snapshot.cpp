// SPDX-License-Identifier: Apache-2.0
#include "replay/snapshot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "base/atomic_file.h"
#include "base/error.h"
#include "compose/exr/exr_file.h"
#include "compose/preview/display.h"
#include "images/png_file.h"
#include "replay/multiview.h"
#include "replay/picture.h"

namespace raystage::replay {

namespace {

using SeveralViews = schemas::ViewerMessage::Arrangement;

/// Returns the size of a picture whose views have the size of the shot, or as much as fits into
/// 2^24 pixels.
PictureSize arranged_size(const schemas::ShotDocument& shot, SeveralViews arrangement) {
  constexpr double kMaxPixels = 1 << 24;
  const int columns = arrangement == SeveralViews::kQuilt        ? kQuiltColumns
                      : arrangement == SeveralViews::kSideBySide ? 2
                                                                 : 1;
  const int rows = arrangement == SeveralViews::kQuilt ? kQuiltRows : 1;
  const double pixels = static_cast<double>(shot.width) * columns * shot.height * rows;
  const double scale = std::min(1.0, std::sqrt(kMaxPixels / pixels));
  return {std::max(1, static_cast<int>(shot.width * scale)) * columns,
          std::max(1, static_cast<int>(shot.height * scale)) * rows};
}

}  // namespace

void write_snapshot(const ShownShot& shown, const schemas::ViewerMessage& request,
                    const std::filesystem::path& file, const std::string& program_version,
                    const std::stop_token& stop) {
  const bool is_exr = file.extension() == ".exr";
  if (!is_exr && file.extension() != ".png") {
    throw Error::bad_input("a snapshot is an .exr or a .png file", file.string(),
                           "Change its extension");
  }
  if (file_exists(file) && !request.replace) {
    throw Error::bad_input("the file exists", file.string(),
                           "Confirm to replace it, or choose another name");
  }
  const schemas::ShotDocument& shot = shown.shot;
  if (request.arrangement != SeveralViews::kSingle) {
    if (is_exr) {
      throw Error::bad_input("several views in one picture are written as .png only", file.string(),
                             "Change its extension, or choose a single view");
    }
    PictureMessage facts;
    return images::write_png(
        render_arranged(shown, request, arranged_size(shot, request.arrangement), {}, stop, facts),
        file);
  }
  const compose::ShotPlan& plan = shown.scene->plan();
  std::vector<compose::ExrCamera> cameras;
  std::vector<compose::LayerImage> images;
  std::set<std::string> rotten;
  const bool is_stereo = is_exr && shown.camera.is_stereo();
  using Eye = schemas::ViewerMessage::Eye;
  const std::vector<Eye> eyes =
      is_stereo ? std::vector{Eye::kLeft, Eye::kRight} : std::vector{request.eye};
  for (const Eye eye : eyes) {
    schemas::ViewerMessage of_eye = request;
    of_eye.eye = eye;
    cameras.push_back(requested_camera(shown, of_eye, shot.width, shot.height));
    compose::add_overscan(cameras.back(), shot.output.overscan);
    compose::CompositedView view = shown.scene->render({request.frame, cameras.back(), {}}, stop);
    images.push_back(std::move(view.picture));
    rotten.insert(view.rotten_cameras.begin(), view.rotten_cameras.end());
  }
  std::vector<compose::ExrView> views;
  for (std::size_t i = 0; i < images.size(); ++i) {
    views.push_back(compose::exr_view(images[i], !is_stereo              ? ""
                                                 : eyes[i] == Eye::kLeft ? "left"
                                                                         : "right"));
  }
  const compose::PlannedFrame planned = shown.scene->planned(request.frame);
  // Without a fingerprint: `raystage render --existing skip` must not take it for a rendered frame.
  compose::ExrMetadata metadata = plan.metadata(planned);
  metadata.program_version = program_version;
  metadata.notes = images.front().notes;
  metadata.rotten_cameras.assign(rotten.begin(), rotten.end());
  const std::vector<std::byte> exr = compose::encode_exr(views, cameras, metadata);
  if (is_exr) return write_file_atomically(file, exr);
  // Through the file, whose colours are of half precision, as `raystage preview` reads it.
  const TemporaryFile through(file.parent_path() / (file.stem().string() + ".exr"));
  write_file_atomically(through.path(), exr);
  compose::DisplayOptions display;
  display.exposure = request.look.exposure;
  display.background =
      request.look.black ? compose::Background::kBlack : compose::Background::kChecker;
  display.colors = plan.colors().studio;
  display.monitor = request.look.display;
  display.view = request.look.view;
  images::write_png(compose::display(compose::read_exr(through.path()), display), file);
}

}  // namespace raystage::replay
