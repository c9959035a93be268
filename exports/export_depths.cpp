// SPDX-License-Identifier: Apache-2.0
// Writes the depth maps of a take for view synthesis elsewhere. Imported maps are written as they
// are; estimated ones are resampled to the recorded pictures, within surfaces only
// (render/depth/recorded_depths.h). Cost: the estimation, unless depths are stored.
#include "exports/export_depths.h"

#include <OpenEXR/ImfStringAttribute.h>
#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <memory>
#include <numeric>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/atomic_file.h"
#include "base/cancellation.h"
#include "base/options.h"
#include "base/parallel.h"
#include "compose/exr/scanline_file.h"
#include "depths/depth_image.h"
#include "exports/exported_rig.h"
#include "exports/output_folder.h"
#include "render/common/faceted_frame.h"
#include "render/depth/depth.h"
#include "render/depth/imported_maps.h"
#include "schemas/rig_document.h"
#include "store/imported_depths.h"
#include "store/scene_depth_range.h"
#include "store/timeline.h"

namespace raystage::exports {
namespace {

using render::InverseDepthMap;
using ImportedMaps = schemas::ImportedDepthsDocument;

std::vector<std::byte> depth_exr(const InverseDepthMap& map, const std::string& camera,
                                 render::DepthQuantity quantity) {
  std::vector<float> z(map.values.size());
  std::ranges::transform(map.values, z.begin(), [](float value) {
    constexpr float kFarthest = 1e30F;  // a known depth at infinity is not an unknown one
    return value < 0 ? 0 : value > 0 ? std::min(1 / value, kFarthest) : kFarthest;
  });
  Imf::Header header(map.width, map.height);
  header.compression() = Imf::ZIP_COMPRESSION;
  header.insert("lf:camera", Imf::StringAttribute(camera));
  header.insert(
      "lf:depthKind",
      Imf::StringAttribute(quantity == render::DepthQuantity::kPlanar ? "planar" : "distance"));
  compose::ScanlinePart part{std::move(header), {}};
  part.channels.push_back({"Z", false, z.data(), 1, 0});
  return compose::write_scanline_file(std::span(&part, 1));
}

/// The depths of a take's recorded pictures.
class RecordedDepths {
 public:
  RecordedDepths(const store::Take& take, const DepthExportOptions& options)
      : take_(take),
        options_(options),
        imported_(store::read_imported_depths(take)),
        cache_(take, kCacheBytes, store::BlendSpace::kPerceptual),
        results_(std::size_t{1} << 30) {}

  /// Returns the map of each camera of the take; empty without a frame. Removes rotten frames from
  /// the tick.
  std::vector<InverseDepthMap> without_rotten_frames(store::FrameSelection& tick) {
    try {
      return at(tick);
    } catch (const store::RottenFrame&) {
      for (std::size_t i = 0; i < tick.frame.size(); ++i) {
        const bool is_rotten =
            tick.frame[i] >= 0 && take_.archive(static_cast<int>(i)).is_rotten(tick.frame[i]);
        if (is_rotten) tick.frame[i] = -1;
      }
      return at(tick);
    }
  }

 private:
  static constexpr std::size_t kCacheBytes = std::size_t{1} << 30;

  std::vector<InverseDepthMap> at(const store::FrameSelection& tick) {
    const auto cameras = static_cast<std::size_t>(take_.camera_count());
    std::vector<InverseDepthMap> maps(cameras);
    bool needs_estimation = false;
    parallel_for(std::size_t{0}, cameras, [&](std::size_t i) {
      const ImportedMaps::Map* map = imported_map(i, tick);
      if (map == nullptr) return;
      const rig::CameraModel& model = take_.rig().cameras[i].model;
      maps[i] = render::read_imported_map(take_, static_cast<int>(i), tick.frame[i], *map);
      render::convert_recorded_depths(maps[i], model,
                                      map->quantity == ImportedMaps::Quantity::kInverseDepth
                                          ? render::DepthQuantity::kPlanar
                                          : render::DepthQuantity::kDistance,
                                      options_.quantity);
    });
    for (std::size_t i = 0; i < cameras; ++i) {
      needs_estimation = needs_estimation || (tick.frame[i] >= 0 && maps[i].values.empty());
    }
    if (needs_estimation) add_estimated(tick, maps);
    return maps;
  }

  const ImportedMaps::Map* imported_map(std::size_t camera,
                                        const store::FrameSelection& tick) const {
    return tick.frame[camera] < 0
               ? nullptr
               : render::find_imported_map(imported_, take_, static_cast<int>(camera),
                                           tick.frame[camera]);
  }

  void add_estimated(const store::FrameSelection& tick, std::vector<InverseDepthMap>& maps) {
    if (!scene_) {
      scene_ = store::scene_depth_range(
          take_, {}, "the export of depths",
          "Measure the depth range of the take with the epipolar-plane images of plan");
    }
    render::LightFieldFrame whole;
    whole.take = &take_;
    whole.rig = &take_.rig();
    whole.cache = &cache_;
    whole.fetch_group = cache_.new_fetch_group();
    whole.time_ns = tick.time_ns;
    whole.frame_of_camera.assign(tick.frame.begin(), tick.frame.end());
    whole.included_cameras.resize(maps.size());
    std::iota(whole.included_cameras.begin(), whole.included_cameras.end(), 0);
    whole.complete = std::make_shared<const rig::Topology>(
        rig::make_topology(take_.rig(), whole.included_cameras));
    whole.present = std::make_shared<const rig::Topology>(
        rig::make_topology(take_.rig(), whole.present_cameras()));
    const render::FacetedFrame facets(whole);
    const render::LightFieldFrame& instant = facets.frame();
    render::DepthEstimationStatistics work;
    const auto depths = render::depth::depths_with_default_options(
        instant, results_, options_.working_bytes, options_.stores_depths, *scene_, work);
    const auto same_surface = static_cast<float>(render::DepthEstimationOptions{}.tolerance_px *
                                                 depths->inverse_depth_per_pixel);
    std::vector<char> is_imported(maps.size());
    std::ranges::transform(maps, is_imported.begin(),
                           [](const InverseDepthMap& map) { return map.values.empty() ? 0 : 1; });
    for (std::size_t i = 0; i < maps.size(); ++i) {
      const rig::CameraModel& model = take_.rig().cameras[i].model;
      if (is_imported[i] != 0 || tick.frame[i] < 0) continue;
      maps[i] = InverseDepthMap(model.width(), model.height(), render::kUnknownDepth);
    }
    for (std::size_t i = 0; i < depths->maps.size(); ++i) {
      const auto of_take = static_cast<std::size_t>(
          instant.camera_of_take.empty() ? static_cast<int>(i) : instant.camera_of_take[i]);
      if (depths->maps[i].values.empty() || is_imported[of_take] != 0) continue;
      render::add_recorded_depths(depths->maps[i], depths->pinholes[i],
                                  instant.rig->cameras[i].model, options_.quantity, same_surface,
                                  maps[of_take]);
    }
  }

  const store::Take& take_;
  const DepthExportOptions& options_;
  ImportedMaps imported_;
  store::FrameCache cache_;
  render::ResultCache results_;
  std::optional<schemas::DepthRange> scene_;  // once it is needed
};

}  // namespace

ExportReport export_depths(const store::Take& take, const DepthExportOptions& options,
                           const std::stop_token& stop) {
  if (options.png_range) {
    depths::DepthEncoding encoding;
    encoding.inverse_range = options.png_range;
    require_valid(encoding, "depth images");
  }
  check_output_outside(options.output, take);
  FrameChoiceOptions wanted = options.frames;
  wanted.times = FrameTimes::kConstant;
  wanted.absent = AbsentFrames::kGap;
  wanted.fps = 0;
  const FrameChoice choice = choose_frames(take, wanted);
  const store::Timeline timeline = store::read_timeline(take);
  std::map<int, std::vector<std::size_t>> cameras_of;  // indices in the choice, by frame number
  ExportReport report;
  for (std::size_t i = 0; i < choice.cameras.size(); ++i) {
    const CameraFrames& camera = choice.cameras[i];
    report.cameras.push_back({.id = take.document().cameras[camera.camera].id,
                              .frames = static_cast<int>(camera.frames.size()),
                              .absent = camera.absent});
    for (const ChosenFrame& frame : camera.frames) cameras_of[frame.number].push_back(i);
  }
  OutputFolder folder(options.output);
  const CancellationScope scope(stop);
  // As much as incompressible: 2 or 4 bytes a pixel.
  double bytes = 0;
  for (const auto& entry : cameras_of) {
    for (const auto camera : entry.second) {
      const auto& model = take.rig().cameras[choice.cameras[camera].camera].model;
      bytes += (options.png_range ? 2.0 : 4.0) * model.width() * model.height();
    }
  }
  check_free_space(options.output, bytes);
  RecordedDepths recorded(take, options);
  FrameCounter counter(choice.frames(), options.progress);
  folder.fill([&] {
    for (const ExportReport::Camera& camera : report.cameras) {
      create_folder(folder.working() / camera.id);
    }
    for (const auto& entry : cameras_of) {
      const auto number = entry.first;
      const auto& cameras = entry.second;
      store::FrameSelection tick = timeline.ticks.at(static_cast<std::size_t>(number) - 1);
      const std::vector<InverseDepthMap> maps = recorded.without_rotten_frames(tick);
      parallel_for(std::size_t{0}, cameras.size(), [&](std::size_t i) {
        const std::string& id = report.cameras[cameras[i]].id;
        const auto camera = static_cast<std::size_t>(choice.cameras[cameras[i]].camera);
        if (tick.frame[camera] < 0) {
          --report.cameras[cameras[i]].frames;
          ++report.cameras[cameras[i]].rotten;
          counter.add();
          return;
        }
        const InverseDepthMap& map = maps[camera];
        const std::string file =
            fmt::format("{}/{:06}.{}", id, number, options.png_range ? "png" : "exr");
        write_new_file(folder.working() / file,
                       options.png_range ? depths::encode_depth_png(map, *options.png_range, file)
                                         : depth_exr(map, id, options.quantity));
        counter.add();
      });
    }
  });
  report.fps = choice.fps;
  report.origin_ns = choice.origin_ns;
  schemas::write_rig(exported_rig(take, choice), folder.working() / "rig.json");
  folder.commit();
  report.status = RunStatus::kFinished;
  return report;
}

}  // namespace raystage::exports
