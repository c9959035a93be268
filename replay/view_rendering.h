// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stop_token>
#include <string>
#include <vector>

#include "compose/camera/shot_camera.h"
#include "replay/scene.h"
#include "replay/server_messages.h"
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

/// Returns the camera of the requested view at a size: the given one, or that of the shot.
compose::ExrCamera requested_camera(const ShownShot& shown, const schemas::ViewerMessage& request,
                                    int width, int height);

/// Renders a view and returns its message. `method`: as SceneView::preview_method; `divisor`: of
/// the requested size. Throws Cancelled, and Error as Scene::render().
std::vector<std::byte> render_picture(const ShownShot& shown, const schemas::ViewerMessage& request,
                                      const std::string& method, int divisor, bool is_final,
                                      const std::stop_token& stop, double* elapsed_ms = nullptr);

/// Returns the distance along the optical axis of what the requested pixel shows, metres: the
/// median depth of a patch around it, which is solved by plane sweep. Throws Error (bad input) if
/// nothing there has a depth.
double find_focus_distance(const ShownShot& shown, const schemas::ViewerMessage& request,
                           const std::stop_token& stop);

/// Returns the values of the requested pixel, by the methods of the shot.
ProbeMessage probe_pixel(const ShownShot& shown, const schemas::ViewerMessage& request,
                         const std::stop_token& stop);

}  // namespace raystage::replay
