// SPDX-License-Identifier: Apache-2.0
#include "render/evaluation/evaluation.h"

#include <algorithm>
#include <cmath>

#include "images/image_file.h"
#include "render/methods.h"
#include "render/renderer.h"
#include "schemas/atomic_file.h"
#include "schemas/error.h"
#include "store/jpeg/decode.h"
#include "store/timeline.h"

namespace raystage {
namespace {

/// A view and where its truth comes from.
struct Subject {
  std::string id;
  VirtualCamera camera;
  Nanoseconds time = 0;
  std::function<RgbImage()> truth;
};

int index_of(const Take& take, const std::string& id) {
  const int camera = take.camera_index(id);
  if (camera >= 0) return camera;
  throw Error::bad_input("the take has no camera '" + id + "'", take.folder().string(),
                         "See raystage info for the cameras' ids");
}

std::vector<Subject> subjects_of(const Take& take, const ViewsDocument& views,
                                 const std::filesystem::path& views_folder,
                                 const std::vector<std::string>& leave_out) {
  std::vector<Subject> subjects;
  for (const ViewsDocument::View& view : views.views) {
    subjects.push_back({view.geometry.id, virtual_camera_from_geometry(view.geometry), view.time_ns,
                        [file = views_folder / view.file] { return read_image(file); }});
  }
  for (const std::string& id : leave_out) {
    const int camera = index_of(take, id);
    const Rig::Camera& held_out = take.rig().cameras[static_cast<std::size_t>(camera)];
    const auto frames = take.archive(camera).frames();
    for (int frame = 0; frame < static_cast<int>(frames.size()); ++frame) {
      const CameraModel& model = held_out.model;
      const std::string name = frames.size() == 1 ? id : id + "_" + std::to_string(frame);
      subjects.push_back({name,
                          {model.width(), model.height(), model.intrinsics(), held_out.pose},
                          frames[static_cast<std::size_t>(frame)].time_ns,
                          [&take, camera, frame, name] {
                            return JpegDecoder().decode(take.archive(camera).jpeg(frame), name);
                          }});
    }
  }
  if (subjects.empty()) {
    throw Error::bad_input("there is no view to evaluate", views_folder.string(),
                           "Give a views document, or cameras by --leave-out");
  }
  return subjects;
}

std::vector<int> cameras_left_out(const Take& take, const EvaluationSettings& settings) {
  std::vector<int> left_out;
  for (const std::string& id : settings.leave_out) left_out.push_back(index_of(take, id));
  if (settings.camera_step <= 1) return left_out;
  for (int i = 0; i < take.camera_count(); ++i) {
    const Rig::Camera& camera = take.rig().cameras[static_cast<std::size_t>(i)];
    if (!camera.row || !camera.column) {
      throw Error::bad_input("camera '" + camera.id + "' has no place in a grid",
                             take.folder().string(), "Leave cameras out by name instead");
    }
    if (*camera.row % settings.camera_step != 0 || *camera.column % settings.camera_step != 0) {
      left_out.push_back(i);
    }
  }
  return left_out;
}

double focal_depth_of(const Take& take, const EvaluationSettings& settings) {
  if (settings.focal_depth) return *settings.focal_depth;
  if (!take.document().depth_range) {
    throw Error::bad_input("the take has no depth range to find the best plane from",
                           take.folder().string(), "Give --focal-depth in metres");
  }
  return best_focal_depth(*take.document().depth_range);
}

ViewEvaluation mean_of(const std::vector<ViewEvaluation>& views) {
  ViewEvaluation mean;
  mean.id = "mean";
  mean.decoded_per_needed = 0;
  double covering = 0, counted = 0;
  for (const ViewEvaluation& view : views) {
    mean.quality.covered += view.quality.covered / static_cast<double>(views.size());
    mean.decode_ms += view.decode_ms / static_cast<double>(views.size());
    mean.render_ms += view.render_ms / static_cast<double>(views.size());
    if (std::isnan(view.quality.psnr_db)) continue;
    ++covering;
    mean.quality.psnr_db += view.quality.psnr_db;
    mean.quality.ssim += view.quality.ssim;
    if (!std::isnan(view.decoded_per_needed)) {
      mean.decoded_per_needed += view.decoded_per_needed;
      ++counted;
    }
  }
  mean.quality.psnr_db /= covering;  // not-a-number when no view covers anything
  mean.quality.ssim /= covering;
  mean.decoded_per_needed /= counted;
  return mean;
}

}  // namespace

Evaluation evaluate_views(const Take& take, const ViewsDocument& views,
                          const std::filesystem::path& views_folder,
                          const EvaluationSettings& settings,
                          const std::function<void(double)>& progress, std::stop_token stop) {
  MethodOptions(method_named(settings.method).options, settings.options, settings.method);
  if (!views.views.empty() && views.color_space != "srgb_texture") {
    throw Error::bad_input("truth images in colour space '" + views.color_space + "'",
                           views_folder.string(), "Use truth images in srgb_texture");
  }
  Evaluation evaluation;
  evaluation.take = take.document().name;
  evaluation.method = settings.method;
  evaluation.focal_depth = focal_depth_of(take, settings);
  const std::vector<Subject> subjects = subjects_of(take, views, views_folder, settings.leave_out);
  const Reconstruction reconstruction{settings.method,
                                      plane_in_front_of(take.rig(), evaluation.focal_depth),
                                      settings.options, settings.fill};
  RendererSettings renderer_settings;
  renderer_settings.cache_bytes = settings.cache_bytes;
  renderer_settings.blend_space = settings.blend_space;
  renderer_settings.left_out = cameras_left_out(take, settings);
  evaluation.cameras = take.camera_count() - static_cast<int>(renderer_settings.left_out.size());
  const auto tolerance =
      static_cast<Nanoseconds>(kNanosecondsPerSecond / take.document().nominal_fps / 2);
  if (!settings.image_folder.empty()) create_folder(settings.image_folder);

  for (const Subject& subject : subjects) {
    if (stop.stop_requested()) {
      throw Error::failed("stopped", take.folder().string(), "Run the command again");
    }
    const FrameSelection frames = select_frames(take, subject.time, tolerance);
    // A renderer for each view, so that nothing is cached when its time is taken; and one that
    // counts, whose time is not.
    renderer_settings.count_needed_pixels = false;
    const RenderedView view =
        LightFieldRenderer(take, renderer_settings).render(subject.camera, frames, reconstruction);
    renderer_settings.count_needed_pixels = true;
    const RenderStatistics counts = LightFieldRenderer(take, renderer_settings)
                                        .render(subject.camera, frames, reconstruction)
                                        .statistics;
    const RgbImage image = srgb_image(view);
    if (!settings.image_folder.empty()) {
      write_image(image, settings.image_folder / (subject.id + ".png"));
    }
    ViewEvaluation result;
    result.id = subject.id;
    result.quality = compare_images(image, subject.truth(), covered_pixels(view));
    result.decode_ms = view.statistics.decode_ms;
    result.render_ms = view.statistics.plan_ms + view.statistics.render_ms;
    if (counts.pixels_needed > 0) {
      result.decoded_per_needed =
          static_cast<double>(counts.pixels_decoded) / static_cast<double>(counts.pixels_needed);
    }
    evaluation.views.push_back(result);
    progress(static_cast<double>(evaluation.views.size()) / static_cast<double>(subjects.size()));
  }
  evaluation.mean = mean_of(evaluation.views);
  return evaluation;
}

}  // namespace raystage
