// SPDX-License-Identifier: Apache-2.0
#include "exports/export_images.h"

#include <fmt/format.h>

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "base/atomic_file.h"
#include "base/cancellation.h"
#include "base/error.h"
#include "base/parallel.h"
#include "exports/exported_rig.h"
#include "exports/output_folder.h"
#include "exports/source_frames.h"
#include "schemas/import_manifest.h"
#include "schemas/rig_document.h"

namespace raystage::exports {
namespace {

double picture_pixels(const store::Take& take, const FrameChoice& choice) {
  double pixels = 0;
  for (const CameraFrames& camera : choice.cameras) {
    const rig::CameraModel& model = take.rig().cameras[camera.camera].model;
    pixels += static_cast<double>(model.width()) * model.height() *
              static_cast<double>(camera.frames.size());
  }
  return pixels;
}

}  // namespace

ExportReport export_images(const store::Take& take, const ImageExportOptions& options,
                           const std::stop_token& stop) {
  check_output_outside(options.output, take);
  const FrameChoice choice = choose_frames(take, options.frames);
  OutputFolder folder(options.output);
  check_free_space(options.output,
                   options.format->estimated_bytes(static_cast<double>(choice.source_bytes),
                                                   picture_pixels(take, choice)));
  const CancellationScope scope(stop);
  const std::size_t cameras = choice.cameras.size();
  std::vector<ExportReport::Camera> counts(cameras);
  std::vector<std::vector<FrameRow>> rows(cameras);
  FrameCounter counter(choice.frames(), options.progress);
  folder.fill([&] {
    parallel_for(std::size_t{0}, cameras, [&](std::size_t i, const ParallelLoop& loop) {
      const CameraFrames& camera = choice.cameras[i];
      const std::string& id = take.document().cameras[camera.camera].id;
      SourceFrames source(take, camera, options.frames.absent,
                          options.format->keeps_deep_pictures()
                              ? SourceFrames::DeepFrames::kPictures
                              : SourceFrames::DeepFrames::kJpeg);
      const std::unique_ptr<ImageEncoder> encoder =
          options.format->open(take, camera.camera, choice.fps, options.exr);
      create_folder(folder.working() / id);
      while (const auto ready = source.next()) {
        if (loop.failed()) return;
        const std::string file =
            fmt::format("{}/{:06}{}", id, ready->frame.number, options.format->extension());
        write_new_file(folder.working() / file, encoder->encode(*ready, source));
        rows[i].push_back({id, file, ready->frame});
        counter.add();
      }
      counts[i] = source.counts();
    });
  });
  ExportReport report;
  report.cameras = std::move(counts);
  report.fps = choice.fps;
  report.origin_ns = choice.origin_ns;
  std::vector<FrameRow> all;
  for (auto& of_camera : rows) all.insert(all.end(), of_camera.begin(), of_camera.end());
  write_file_atomically(folder.working() / "frames.csv",
                        format_frame_rows(all, take.document().epoch_utc));
  schemas::write_rig(exported_rig(take, choice), folder.working() / "rig.json");
  const std::string space = options.format->color_space(take);
  const auto manifest = exported_manifest(take, choice, all, space);
  // Import manifests know no other colour spaces.
  if (!manifest.cameras.empty() && options.exr.color.is_scene_space()) {
    schemas::write_import_manifest(manifest, folder.working() / "import.json");
  }
  folder.commit();
  report.status = RunStatus::kFinished;
  return report;
}

}  // namespace raystage::exports
