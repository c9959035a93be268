// SPDX-License-Identifier: Apache-2.0
#include "exports/export_model.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "base/atomic_file.h"
#include "base/cancellation.h"
#include "base/error.h"
#include "base/parallel.h"
#include "exports/output_folder.h"
#include "exports/resample_lens.h"
#include "exports/source_frames.h"
#include "render/common/view.h"
#include "schemas/rig_document.h"
#include "store/jpeg/encode.h"

namespace raystage::exports {
namespace {

/// Returns the first frame that most of the cameras have.
int fullest_frame(const store::Take& take, const std::vector<std::string>& cameras) {
  const store::Timeline timeline = store::read_timeline(take);
  const auto present = [&](const store::FrameSelection& tick) {
    int count = 0;
    for (std::size_t i = 0; i < tick.frame.size(); ++i) {
      const std::string& id = take.document().cameras[i].id;
      const bool is_chosen = cameras.empty() || std::ranges::find(cameras, id) != cameras.end();
      if (is_chosen && tick.frame[i] >= 0) ++count;
    }
    return count;
  };
  const auto fullest = std::ranges::max_element(timeline.ticks, {}, present);
  return static_cast<int>(std::distance(timeline.ticks.begin(), fullest)) + 1;
}

bool holds_lens(const ingest::RigFormat& format, const schemas::RigDocument::Camera& camera) {
  schemas::RigDocument alone;
  alone.cameras = {camera};
  try {
    format.format(alone);
    return true;
  } catch (const Error&) {
    return false;
  }
}

/// Returns the geometry of a pinhole without distortion that shows what the camera sees.
schemas::CameraGeometry pinhole_of(const schemas::CameraGeometry& geometry) {
  const render::VirtualCamera view = render::undistorted(
      rig::CameraModel(geometry), rig::pose_from_matrix(geometry.world_from_camera));
  schemas::CameraGeometry pinhole = geometry;
  pinhole.width = view.width;
  pinhole.height = view.height;
  pinhole.intrinsics = view.intrinsics;
  return pinhole;
}

schemas::CameraGeometry plain_fisheye_of(const schemas::CameraGeometry& geometry) {
  schemas::CameraGeometry fisheye = geometry;
  fisheye.intrinsics.projection = schemas::Projection::kFisheye;
  fisheye.intrinsics.radial_distortion = {};
  fisheye.intrinsics.distortion = {};
  return fisheye;
}

/// Returns the geometry with which a camera is exported: its own if all formats hold it.
schemas::CameraGeometry exported_geometry(const schemas::RigDocument::Camera& camera,
                                          const ModelExportOptions& options) {
  const bool is_held = std::ranges::all_of(options.formats, [&](const ingest::RigFormat* format) {
    return holds_lens(*format, camera);
  });
  if (options.undistorts) return pinhole_of(camera.geometry);
  return is_held ? camera.geometry : plain_fisheye_of(camera.geometry);
}

std::vector<std::byte> resampled_jpeg(SourceFrames& source, const schemas::CameraGeometry& from,
                                      const schemas::CameraGeometry& to) {
  store::JpegEncodeOptions jpeg;
  jpeg.quality = 98;
  jpeg.restart_interval = 0;
  return store::encode_jpeg(
      resample_lens(source.picture(), rig::CameraModel(from), rig::CameraModel(to)), jpeg);
}

}  // namespace

std::vector<ModelFormat> model_formats() {
  return {{&ingest::rig_format("colmap"), "sparse/0"}, {&ingest::rig_format("nerf"), ""}};
}

ExportReport export_model(const store::Take& take, const ModelExportOptions& options,
                          const std::stop_token& stop) {
  check_output_outside(options.output, take);
  FrameChoiceOptions frames;
  frames.cameras = options.cameras;
  frames.times = FrameTimes::kConstant;
  frames.absent = AbsentFrames::kGap;
  frames.frames = std::vector{options.frame.value_or(0)};
  if (!options.frame) frames.frames = std::vector{fullest_frame(take, options.cameras)};
  const FrameChoice choice = choose_frames(take, frames);
  OutputFolder folder(options.output);
  check_free_space(options.output, static_cast<double>(choice.source_bytes));
  const CancellationScope scope(stop);
  const schemas::RigDocument rig = schemas::read_rig(take.file("rig.json"));
  create_folder(folder.working() / "images");

  const std::size_t count = choice.cameras.size();
  ExportReport report;
  report.cameras.resize(count);
  std::vector<std::optional<schemas::RigDocument::Camera>> exported(count);
  std::vector<char> is_resampled(count, 0);
  std::vector<std::vector<FrameRow>> rows(count);
  FrameCounter counter(choice.frames(), options.progress);
  folder.fill([&] {
    parallel_for(std::size_t{0}, count, [&](std::size_t i) {
      const CameraFrames& of_take = choice.cameras[i];
      SourceFrames source(take, of_take, AbsentFrames::kGap);
      if (const auto ready = source.next()) {
        schemas::RigDocument::Camera camera = rig.cameras[of_take.camera];
        const schemas::CameraGeometry own = camera.geometry;
        camera.geometry = exported_geometry(camera, options);
        const std::string file = "images/" + own.id + ".jpg";
        if (camera.geometry == own) {
          write_new_file(folder.working() / file, ready->jpeg);
        } else {
          write_new_file(folder.working() / file, resampled_jpeg(source, own, camera.geometry));
          is_resampled[i] = 1;
        }
        rows[i].push_back({own.id, file, ready->frame});
        exported[i] = std::move(camera);
        counter.add();
      }
      report.cameras[i] = source.counts();
    });
  });
  schemas::RigDocument model;
  model.name = rig.name;
  model.topology = rig.topology;
  for (const auto& camera : exported) {
    if (camera) model.cameras.push_back(*camera);
  }
  if (model.cameras.empty()) {
    throw Error::bad_input("no camera has an intact frame then", take.folder().string(),
                           "Choose another frame")
        .concerning({"frame"});
  }
  for (const ModelFormat& of_model : model_formats()) {
    if (std::ranges::find(options.formats, of_model.format) == options.formats.end()) continue;
    const ingest::ExportedRig files = of_model.format->format(model);
    create_folder(folder.working() / of_model.folder);
    for (const ingest::NamedText& file : files.files) {
      write_file_atomically(folder.working() / of_model.folder / file.name, file.text);
    }
    for (const std::string& note : files.notes) {
      if (std::ranges::find(report.notes, note) == report.notes.end()) report.notes.push_back(note);
    }
  }
  const auto resampled = std::ranges::count(is_resampled, 1);
  if (resampled > 0) {
    report.notes.push_back(fmt::format(
        "the images of {} cameras were resampled to {}", resampled,
        options.undistorts ? "pinholes without distortion" : "fisheyes without distortion"));
  }
  std::vector<FrameRow> all;
  for (auto& of_camera : rows) all.insert(all.end(), of_camera.begin(), of_camera.end());
  write_file_atomically(folder.working() / "frames.csv",
                        format_frame_rows(all, take.document().epoch_utc));
  folder.commit();
  report.fps = choice.fps;
  report.origin_ns = choice.origin_ns;
  report.status = RunStatus::kFinished;
  return report;
}

}  // namespace raystage::exports
