// SPDX-License-Identifier: Apache-2.0
#include "render/hull/visual_hull.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "render/hull/carving.h"
#include "render/lumigraph/lumigraph.h"
#include "schemas/error.h"
#include "schemas/parallel.h"

namespace raystage {
namespace {

constexpr int kReferenceSteps = 4096;

std::shared_ptr<const Matte> kept_matte(const ViewRequest& request, int camera, int frame,
                                        double threshold) {
  const auto file = matte_file(*request.instant.take, camera, frame);
  const CameraModel& model = request.instant.rig->cameras[static_cast<std::size_t>(camera)].model;
  return request.kept.get<Matte>(
      fmt::format("matte {} {}", threshold, file.string()), [&](std::size_t& bytes) {
        auto matte = std::make_shared<const Matte>(read_matte(file, model, threshold));
        bytes = matte->bytes();
        return matte;
      });
}

/// Of the cameras that have a frame and a matte of it.
std::vector<Silhouette> silhouettes_of(const ViewRequest& request) {
  std::vector<Silhouette> silhouettes;
  const Take& take = *request.instant.take;
  for (const int camera : request.instant.members) {
    const int frame = request.instant.frame_of_camera[static_cast<std::size_t>(camera)];
    if (frame < 0 || !std::filesystem::exists(matte_file(take, camera, frame))) continue;
    silhouettes.push_back({camera, nullptr});
  }
  if (silhouettes.empty()) {
    throw Error::bad_input("no camera has a matte at this instant",
                           (take.folder() / "mattes").string(),
                           "Write TAKE/mattes/CAMERA/FRAME.png, see docs/formats/mattes.md");
  }
  const double threshold = request.options.number("threshold");
  raystage::parallel_for(std::size_t{0}, silhouettes.size(), [&](std::size_t i) {
    const int camera = silhouettes[i].camera;
    silhouettes[i].matte =
        kept_matte(request, camera,
                   request.instant.frame_of_camera[static_cast<std::size_t>(camera)], threshold);
  });
  return silhouettes;
}

int least_seeing(const ViewRequest& request, const std::vector<Silhouette>& silhouettes) {
  const double share = request.options.number("seen_by");
  return std::max(1, static_cast<int>(std::ceil(share * static_cast<double>(silhouettes.size()))));
}

RenderedView by_hull(const ViewRequest& request) {
  const std::vector<Silhouette> silhouettes = silhouettes_of(request);
  return render_lumigraph(
      request,
      hull_surface(*request.instant.rig, silhouettes, least_seeing(request, silhouettes),
                   request.options.number("nearest")),
      ray_weighing(request.options), WeightField::kPerPixel);
}

RenderedView by_hull_reference(const ViewRequest& request) {
  const std::vector<Silhouette> silhouettes = silhouettes_of(request);
  return render_lumigraph_reference(
      request,
      hull_surface_reference(*request.instant.rig, silhouettes, least_seeing(request, silhouettes),
                             request.options.number("nearest"), kReferenceSteps),
      ray_weighing(request.options));
}

std::vector<std::filesystem::path> mattes_read(const MethodOptions&, const Take& take,
                                               const FrameSelection& frames) {
  std::vector<std::filesystem::path> files;
  for (int camera = 0; camera < take.camera_count(); ++camera) {
    const int frame = frames.frame[static_cast<std::size_t>(camera)];
    if (frame < 0) continue;
    const auto file = matte_file(take, camera, frame);
    if (std::filesystem::exists(file)) files.push_back(file);
  }
  return files;
}

}  // namespace

Method visual_hull_method() {
  static const std::vector<OptionSpec> options = [] {
    std::vector<OptionSpec> all = ray_weighing_options();
    all.push_back(number_option("threshold", 0.5, 0, 1,
                                "share of a matte's full scale from which a pixel is foreground"));
    all.push_back(
        number_option("seen_by", 0.5, 0, 1,
                      "share of the cameras with mattes that must see a point of the hull"));
    all.push_back(number_option("nearest", 0.1, 1e-6, 1e6,
                                "metres from the eye; what is nearer is not looked for"));
    return all;
  }();
  return {"visual_hull",
          "the foreground within all cameras' mattes, alone",
          options,
          by_hull,
          by_hull_reference,
          mattes_read,
          true,
          {},
          false,
          false};
}

}  // namespace raystage
