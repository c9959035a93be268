// SPDX-License-Identifier: Apache-2.0
// Lists the views to evaluate: those of a document, and one per frame of an excluded camera, with
// the frames that each shows. Truths are functions that read or decode an image when called. Cost:
// linear in views and ticks.
#include "evaluation/evaluation_cases.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "base/contained_path.h"
#include "base/error.h"
#include "images/exr_reader.h"
#include "images/image_reader.h"
#include "render/common/exact_times.h"
#include "store/exact_frames.h"
#include "store/processing/frames/blend_space.h"
#include "store/processing/frames/corrected_frame.h"

namespace raystage::evaluation {
namespace {

store::FrameSelection nothing_at(Nanoseconds time, const store::Take& take) {
  const auto cameras = static_cast<std::size_t>(take.camera_count());
  return {time, std::vector<std::int32_t>(cameras, -1), std::vector<Nanoseconds>(cameras, 0)};
}

store::FrameSelection by_stamps(Nanoseconds time, const store::Take& take) {
  return store::select_frames(take, time,
                              store::default_frame_tolerance(take.document().nominal_fps));
}

store::FrameSelection instant_at(Nanoseconds time, const store::Take& take,
                                 const store::Timeline* timeline, bool exact) {
  if (timeline == nullptr) return by_stamps(time, take);
  if (exact) return store::frames_at_time(*timeline, take.rig(), time);
  const auto tick = store::nearest_tick(timeline->ticks, time);
  return tick ? timeline->ticks[*tick] : nothing_at(time, take);
}

/// Returns the instants at which a camera has a frame, with their numbers.
std::vector<std::pair<std::size_t, store::FrameSelection>> instants_of(
    int camera, const store::Take& take, const store::Timeline* timeline) {
  std::vector<std::pair<std::size_t, store::FrameSelection>> instants;
  if (timeline == nullptr) {
    for (const store::FrameRecord& frame : take.archive(camera).frames()) {
      instants.emplace_back(instants.size(), by_stamps(frame.time_ns, take));
    }
    return instants;
  }
  for (std::size_t tick = 0; tick < timeline->ticks.size(); ++tick) {
    const store::FrameSelection& frames = timeline->ticks[tick];
    if (frames.frame[camera] >= 0) instants.emplace_back(tick, frames);
  }
  return instants;
}

/// Returns a camera's frame, photometrically calibrated as renderings are.
store::RgbImage codes_of(const store::Take& take, const rig::Rig::Camera& of, int camera,
                         int frame) {
  const store::CorrectedFrame picture = store::decode_corrected_frame(
      take, camera, frame, {of.model.width(), of.model.height()}, of.photometric, {});
  store::RgbImage image{picture.width, picture.height, std::vector<std::uint8_t>()};
  image.values.reserve(picture.values.size() / 4 * 3);
  for (std::size_t i = 0; i < picture.values.size(); ++i) {
    constexpr unsigned kPerCode = 257;
    if (i % 4 == 3) continue;
    image.values.push_back(
        static_cast<std::uint8_t>((picture.values[i] + kPerCode / 2) / kPerCode));
  }
  return image;
}

/// Returns the linear light of a camera's frame, likewise calibrated, R, G, B per pixel; empty if
/// the camera has 8 bits.
std::vector<float> light_of(const store::Take& take, const rig::Rig::Camera& of, int camera,
                            int frame) {
  const auto& pixels = take.document().cameras[static_cast<std::size_t>(camera)].pixels;
  if (!pixels) return {};
  const rig::PictureSize size{of.model.width(), of.model.height()};
  const store::CodeScale scale{
      store::BlendSpace::kHighRange,
      std::max(1.0, store::max_linear_light(of.photometric, size, *pixels))};
  const store::CorrectedFrame picture =
      store::decode_corrected_frame(take, camera, frame, size, of.photometric, scale);
  std::vector<float> light;
  light.reserve(picture.values.size() / 4 * 3);
  for (std::size_t i = 0; i < picture.values.size(); ++i) {
    if (i % 4 == 3) continue;
    light.push_back(static_cast<float>(
        scale.full_scale * store::part_from_value(scale.space, picture.values[i] / 65535.0)));
  }
  return light;
}

/// Throws Error (bad input) if the truth has not the size of its view, which can be much larger.
void require_size(const store::RgbImage& truth, const schemas::CameraGeometry& view,
                  const std::filesystem::path& file) {
  if (truth.width == view.width && truth.height == view.height) return;
  throw Error::bad_input(fmt::format("found {}x{} pixels, but the view '{}' has {}x{}", truth.width,
                                     truth.height, view.id, view.width, view.height),
                         file.string(), "Give a truth image of the view's size");
}

/// Reads the true linear light of a view.
void read_light(const std::filesystem::path& file, GroundTruth& truth) {
  constexpr images::ExrChannel kChannels[]{{"R"}, {"G"}, {"B"}};
  images::ExrChannelData data =
      images::read_exr_channels(file, kChannels, "Give the linear light as channels R, G and B");
  if (data.width != truth.image.width || data.height != truth.image.height) {
    throw Error::bad_input(
        fmt::format("found {}x{} pixels, allowed: {}x{} as the truth image", data.width,
                    data.height, truth.image.width, truth.image.height),
        file.string(), "Give the light of the view");
  }
  truth.light = std::move(data.values);
}

/// Reads the true depths and surfaces of a view's pixels.
void read_depths(const std::filesystem::path& file, GroundTruth& truth) {
  constexpr float kAbsent = -1;
  constexpr images::ExrChannel kChannels[]{
      {"Z"}, {"front.A", kAbsent}, {"front.Z", kAbsent}, {"behind.Z", kAbsent}};
  const store::RgbImage& image = truth.image;
  const images::ExrChannelData data =
      images::read_exr_channels(file, kChannels, "Give the planar depths as channel Z");
  if (data.width != image.width || data.height != image.height) {
    throw Error::bad_input(fmt::format("found {}x{} depths, allowed: {}x{} as the truth image",
                                       data.width, data.height, image.width, image.height),
                           file.string(), "Give the depths of the view");
  }
  const std::size_t pixels = data.values.size() / std::size(kChannels);
  for (std::size_t i = 0; i < pixels; ++i) {
    const float* values = &data.values[std::size(kChannels) * i];
    truth.z.push_back(values[0]);
    if (values[1] == kAbsent || values[2] == kAbsent || values[3] == kAbsent) continue;
    truth.surfaces.push_back({values[1], values[2], values[3]});
  }
  if (truth.surfaces.size() != pixels) truth.surfaces = {};
}

void add_camera(int camera, const store::Take& take, const store::Timeline* timeline, bool exact,
                std::vector<EvaluationCase>& subjects) {
  const rig::Rig::Camera& excluded = take.rig().cameras[camera];
  const std::size_t instants =
      timeline != nullptr ? timeline->ticks.size() : take.archive(camera).frames().size();
  // Without distortion, so that the fast renderers are evaluated.
  const render::VirtualCamera pinhole = render::undistorted(excluded.model, excluded.pose);
  for (auto& [number, frames] : instants_of(camera, take, timeline)) {
    if (timeline != nullptr && exact) {
      const int frame_of_camera = frames.frame[camera];
      frames =
          store::frames_at_time(*timeline, take.rig(), frames.time_ns + frames.difference[camera]);
      frames.frame[camera] = frame_of_camera;
      if (frames.is_interpolated(static_cast<std::size_t>(camera))) frames.second[camera] = {};
    }
    const std::string name =
        instants == 1 ? excluded.id : excluded.id + "_" + std::to_string(number);
    const int frame = frames.frame[camera];
    const auto truth = [&take, &excluded, camera, frame, pinhole] {
      store::RgbImage image = codes_of(take, excluded, camera, frame);
      std::vector<float> light = light_of(take, excluded, camera, frame);
      if (excluded.model.has_distortion()) {
        return undistorted_ground_truth(image, excluded.model, pinhole, light);
      }
      return GroundTruth{.image = std::move(image), .known = {}, .light = std::move(light)};
    };
    subjects.push_back({name, pinhole, std::move(frames), truth});
  }
}

}  // namespace

int camera_named(const store::Take& take, const std::string& id) {
  const int camera = take.camera_index(id);
  if (camera >= 0) return camera;
  throw Error::bad_input("the take has no camera '" + id + "'", take.folder().string(),
                         "Use a camera id of rig.json (`raystage info` prints them)");
}

schemas::ViewsDocument read_views_with_truths(const std::filesystem::path& file) {
  schemas::ViewsDocument document = schemas::read_views(file);
  for (schemas::ViewsDocument::View& view : document.views) {
    for (std::string* const truth : {&view.file, &view.depth_file, &view.light_file}) {
      if (truth->empty()) continue;
      const ContainedPath contained{file.parent_path(), *truth};
      if (!permits_links()) require_contained(contained);
      *truth = contained.path().string();
    }
  }
  return document;
}

std::vector<EvaluationCase> make_evaluation_cases(const store::Take& take,
                                                  const store::Timeline* timeline,
                                                  const schemas::ViewsDocument& views,
                                                  const std::filesystem::path& views_folder,
                                                  const EvaluationOptions& options) {
  if (options.exact_times && (timeline == nullptr || timeline->ticks.empty())) {
    throw Error::bad_input("exact times need a timeline", take.folder().string(),
                           "Run `raystage sync`")
        .concerning({"exact_times"});
  }
  if (options.exact_times) render::require_plausible_line_times(take, *timeline);
  std::vector<EvaluationCase> subjects;
  const auto reader = std::make_shared<const images::ImageReader>();
  for (const schemas::ViewsDocument::View& view : views.views) {
    subjects.push_back({view.geometry.id, render::virtual_camera_from_geometry(view.geometry),
                        instant_at(view.time_ns, take, timeline, options.exact_times),
                        [reader, view, views_folder] {
                          const std::filesystem::path file = views_folder / view.file;
                          GroundTruth truth{reader->read_rgb(file), {}};
                          require_size(truth.image, view.geometry, file);
                          if (!view.depth_file.empty()) {
                            read_depths(views_folder / view.depth_file, truth);
                          }
                          if (!view.light_file.empty()) {
                            read_light(views_folder / view.light_file, truth);
                          }
                          return truth;
                        }});
  }
  for (const std::string& id : options.excluded_camera_ids) {
    add_camera(camera_named(take, id), take, timeline, options.exact_times, subjects);
  }
  std::vector<EvaluationCase> chosen;
  for (std::size_t i = 0; i < subjects.size(); i += static_cast<std::size_t>(options.view_step)) {
    chosen.push_back(std::move(subjects[i]));
  }
  if (chosen.empty()) {
    throw Error::bad_input("there is no view to evaluate", views_folder.string(),
                           "Give a views document, or ids of cameras to exclude")
        .concerning({"exclude_cameras"});
  }
  return chosen;
}

}  // namespace raystage::evaluation
