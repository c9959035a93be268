// SPDX-License-Identifier: Apache-2.0
#include "raystage/raystage.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <utility>

#include "base/error.h"
#include "render/common/view.h"
#include "render/methods.h"
#include "render/renderer.h"
#include "rig/pose.h"
#include "rig/rig.h"
#include "store/jpeg/decode.h"
#include "store/take.h"
#include "store/timeline.h"

namespace raystage {
namespace {

/// Calls `function` and replaces Error by standard exceptions, which callers can catch without
/// symbols of this library.
template <typename Function>
auto with_standard_exceptions(Function&& function) {
  try {
    return std::forward<Function>(function)();
  } catch (const Error& error) {
    if (error.exit_code() == ExitCode::kBadInput) throw std::invalid_argument(error.what());
    throw std::runtime_error(error.what());
  }
}

PinholeCamera pinhole_camera(const std::string& id, const render::VirtualCamera& camera) {
  PinholeCamera result;
  result.id = id;
  result.width = camera.width;
  result.height = camera.height;
  result.fx = camera.intrinsics.fx;
  result.fy = camera.intrinsics.fy;
  result.cx = camera.intrinsics.cx;
  result.cy = camera.intrinsics.cy;
  result.world_from_camera = rig::matrix_from_pose(camera.pose);
  return result;
}

render::VirtualCamera virtual_camera(const PinholeCamera& camera) {
  schemas::CameraGeometry geometry;
  geometry.id = camera.id.empty() ? "the view" : camera.id;
  geometry.width = camera.width;
  geometry.height = camera.height;
  geometry.intrinsics = {camera.fx, camera.fy, camera.cx, camera.cy, {}};
  geometry.world_from_camera = camera.world_from_camera;
  const rig::CameraModel checked(geometry);  // throws if it is not a valid camera
  return render::virtual_camera_from_geometry(geometry);
}

}  // namespace

struct LightField::State {
  State(const std::filesystem::path& folder, const LightFieldOptions& settings)
      : take(folder),
        timeline(store::read_timeline(take)),
        renderer(take, renderer_options(settings)) {
    for (const rig::Rig::Camera& camera : take.rig().cameras) {
      cameras.push_back(pinhole_camera(camera.id, render::undistorted(camera.model, camera.pose)));
    }
  }

  render::RendererOptions renderer_options(const LightFieldOptions& settings) const {
    render::RendererOptions result;
    result.cache_bytes = settings.cache_bytes;
    result.cache_folder = settings.cache_folder;
    result.ticks = timeline.ticks;
    return result;
  }

  const store::FrameSelection& tick(int index) const {
    if (index < 0 || static_cast<std::size_t>(index) >= timeline.ticks.size()) {
      throw Error::bad_input("there is no tick " + std::to_string(index), take.folder().string(),
                             "Use 0 to " + std::to_string(timeline.ticks.size()) + " exclusive");
    }
    return timeline.ticks[index];
  }

  render::ReconstructionOptions reconstruction_options(const Reconstruction& reconstruction) const {
    if (!(reconstruction.focal_depth > 0)) {
      throw Error::bad_input("the focal depth is not above 0", "the reconstruction",
                             "Set the distance in front of the array in metres, or infinity");
    }
    render::ReconstructionOptions result;
    result.method = reconstruction.method;
    result.focal_plane = rig::fronto_parallel_plane(take.rig(), reconstruction.focal_depth);
    result.options = reconstruction.options;
    result.fill =
        reconstruction.fill_holes ? schemas::HoleFill::kPushPull : schemas::HoleFill::kNone;
    return result;
  }

  store::Take take;
  store::Timeline timeline;
  render::LightFieldRenderer renderer;
  std::vector<PinholeCamera> cameras;
};

PinholeCamera make_virtual_camera(int width, int height, double horizontal_fov,
                                  const std::array<double, 16>& world_from_camera) {
  return with_standard_exceptions([&] {
    if (!(horizontal_fov > 0 && horizontal_fov < std::numbers::pi) || width < 1 || height < 1) {
      throw Error::bad_input("the size or the field of view is out of range", "the view",
                             "Use at least 1 x 1 pixels and an angle between 0 and pi");
    }
    PinholeCamera camera;
    camera.width = width;
    camera.height = height;
    camera.fx = camera.fy = width / (2 * std::tan(horizontal_fov / 2));
    camera.cx = width / 2.0;
    camera.cy = height / 2.0;
    camera.world_from_camera = world_from_camera;
    virtual_camera(camera);
    return camera;
  });
}

std::vector<std::string> reconstruction_methods() {
  std::vector<std::string> names;
  for (const auto& method : render::methods()) names.emplace_back(method->name());
  return names;
}

LightField::LightField(const std::filesystem::path& take, const LightFieldOptions& settings)
    : state_(with_standard_exceptions([&] { return std::make_unique<State>(take, settings); })) {}
LightField::~LightField() = default;
LightField::LightField(LightField&&) noexcept = default;
LightField& LightField::operator=(LightField&&) noexcept = default;

const std::vector<PinholeCamera>& LightField::cameras() const { return state_->cameras; }
int LightField::tick_count() const { return static_cast<int>(state_->timeline.ticks.size()); }
double LightField::tick_rate() const { return state_->timeline.fps; }

RecordedFrame LightField::read_frame(int camera, int tick) const {
  return with_standard_exceptions([&] {
    const store::Take& take = state_->take;
    const store::FrameSelection& selection = state_->tick(tick);
    if (camera < 0 || camera >= take.camera_count()) {
      throw Error::bad_input("there is no camera " + std::to_string(camera), take.folder().string(),
                             "Use 0 to " + std::to_string(take.camera_count()) + " exclusive");
    }
    RecordedFrame result;
    const auto c = static_cast<std::size_t>(camera);
    const int frame = selection.frame[c];
    if (frame < 0) return result;
    store::RgbImage image = store::JpegDecoder().decode(take.archive(camera).jpeg(frame),
                                                        take.document().cameras[c].id);
    result.width = image.width;
    result.height = image.height;
    result.rgb = std::move(image.values);
    const Nanoseconds since_first =
        selection.time_ns + selection.difference[c] - state_->timeline.ticks.front().time_ns;
    result.time = static_cast<double>(since_first) / kNanosecondsPerSecond;
    return result;
  });
}

ReconstructedView LightField::render(const PinholeCamera& view, int tick,
                                     const Reconstruction& reconstruction) const {
  return with_standard_exceptions([&] {
    render::RenderedView rendered = state_->renderer.render(
        virtual_camera(view), state_->tick(tick), state_->reconstruction_options(reconstruction));
    ReconstructedView result;
    result.width = rendered.width;
    result.height = rendered.height;
    result.rgba.assign(rendered.rgba.begin(), rendered.rgba.end());
    result.coverage.assign(rendered.coverage.begin(), rendered.coverage.end());
    result.depth.assign(rendered.z.begin(), rendered.z.end());
    result.notes = std::move(rendered.notes);
    result.rotten_cameras = std::move(rendered.rotten_cameras);
    return result;
  });
}

std::vector<LightRaySample> LightField::sample(std::span<const LightRay> rays, int tick,
                                               const Reconstruction& reconstruction) const {
  return with_standard_exceptions([&] {
    std::vector<render::WorldRay> world(rays.size());
    std::ranges::transform(rays, world.begin(), [](const LightRay& ray) {
      const Eigen::Vector3d direction(ray.direction.data());
      return render::WorldRay{Eigen::Vector3d(ray.origin.data()), direction.stableNormalized()};
    });
    std::vector<render::RaySample> samples(rays.size());
    state_->renderer.query(world, state_->tick(tick),
                           state_->reconstruction_options(reconstruction), samples);
    std::vector<LightRaySample> result(rays.size());
    std::ranges::transform(samples, result.begin(), [](const render::RaySample& sample) {
      return LightRaySample{sample.rgba, sample.coverage, sample.depth};
    });
    return result;
  });
}

}  // namespace raystage
