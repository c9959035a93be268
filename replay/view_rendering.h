// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stop_token>
#include <string>
#include <vector>

#include "compose/camera/shot_camera.h"
#include "replay/scene.h"
#include "replay/server_messages.h"
#include "replay/source_pictures.h"
#include "schemas/viewer_message.h"

namespace raystage::replay {

/// A shot that a page shows.
struct ShownShot {
  std::string file, text;  ///< as ShotText
  schemas::ShotDocument shot;
  compose::ShotCamera camera;
  std::shared_ptr<const Scene> scene;
};

/// Chooses the size of pictures that must keep a rate, from the time that the latest ones took.
class ResolutionControl {
 public:
  /// Returns by which integer width and height are divided: 1 to 8.
  int divisor(int width, int height) const;
  /// Records the time of a picture of this many pixels.
  void record(double pixels, double ms);

 private:
  double ms_per_pixel_ = 0;  ///< smoothed; 0: unknown
};

/// Returns the state of a camera that is not on the path of a shot.
compose::CameraState camera_state_of(const schemas::ViewerMessage::Camera& given);

/// Returns the camera of the requested view at a size: the given one, or that of the shot.
compose::ExrCamera requested_camera(const ShownShot& shown, const schemas::ViewerMessage& request,
                                    int width, int height);

/// Returns the distance between the eyes of the requested view, metres; 0: it has one eye.
double requested_interaxial(const ShownShot& shown, const schemas::ViewerMessage& request);

/// How a requested view is rendered.
struct PictureOptions {
  compose::PreviewOptions preview = {};
  int divisor = 1;       ///< of the requested size
  bool is_final = true;  ///< no better picture of the request follows
  PictureContent content = PictureContent::kView;
};

/// Renders a view, or the views of an arrangement, into a picture of about this size. `facts`:
/// receives what is known of the views. Throws Cancelled, and Error as Scene::render().
store::RgbImage render_arranged(const ShownShot& shown, const schemas::ViewerMessage& request,
                                PictureSize size, const compose::PreviewOptions& preview,
                                const std::stop_token& stop, PictureMessage& facts);

/// Renders a view, or the views of an arrangement, and returns its message. Throws Cancelled, and
/// Error as Scene::render().
std::vector<std::byte> render_picture(const ShownShot& shown, const schemas::ViewerMessage& request,
                                      const PictureOptions& options, const std::stop_token& stop,
                                      double* elapsed_ms = nullptr);

/// Returns the distance along the optical axis of what the requested pixel shows, metres: the
/// median depth of a patch around it, which is solved by plane sweep. Throws Error (bad input) if
/// nothing there has a depth.
double find_focus_distance(const ShownShot& shown, const schemas::ViewerMessage& request,
                           const std::stop_token& stop);

/// Returns the light field whose cameras a request means: that of the requested layer, or else the
/// first one, with the frames that it shows. Throws Error (bad input) if there is none.
SourceFrames requested_source(const ShownShot& shown, const schemas::ViewerMessage& request);

/// Returns the values of the requested pixel, by the methods of the shot.
ProbeMessage probe_pixel(const ShownShot& shown, const schemas::ViewerMessage& request,
                         const std::stop_token& stop);

}  // namespace raystage::replay
