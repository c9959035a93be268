// SPDX-License-Identifier: Apache-2.0
#include "render/renderer.h"

#include <algorithm>
#include <map>
#include <mutex>

#include "render/methods.h"
#include "render/view/instant.h"
#include "schemas/error.h"
#include "store/frames/frame_cache.h"

namespace raystage {

struct LightFieldRenderer::State {
  State(const Take& of_take, const RendererSettings& with_settings)
      : take(of_take),
        settings(with_settings),
        cache(of_take, with_settings.cache_bytes, with_settings.blend_space),
        kept(with_settings.kept ? with_settings.kept
                                : std::make_shared<KeptResults>(with_settings.kept_bytes)) {}

  const Take& take;
  RendererSettings settings;
  FrameCache cache;
  std::shared_ptr<KeptResults> kept;
  std::vector<int> members;  // cameras not left out
  std::mutex mutex;
  std::map<std::vector<int>, std::shared_ptr<const Topology>> topologies;  // by cameras present

  std::shared_ptr<const Topology> topology(const std::vector<int>& cameras) {
    const std::scoped_lock lock(mutex);
    auto& known = topologies[cameras];
    if (!known) known = std::make_shared<const Topology>(topology_of(take.rig(), cameras));
    return known;
  }
};

LightFieldRenderer::LightFieldRenderer(const Take& take, const RendererSettings& settings)
    : state_(std::make_unique<State>(take, settings)) {
  for (int camera = 0; camera < take.camera_count(); ++camera) {
    const auto& left_out = settings.left_out;
    if (std::find(left_out.begin(), left_out.end(), camera) == left_out.end()) {
      state_->members.push_back(camera);
    }
  }
  if (state_->members.empty()) {
    throw Error::bad_input("every camera is left out", take.folder().string(),
                           "Leave at least one camera in");
  }
}

LightFieldRenderer::~LightFieldRenderer() = default;

RenderedView LightFieldRenderer::render(const VirtualCamera& view, const FrameSelection& frames,
                                        const Reconstruction& reconstruction) const {
  const Method& method = method_named(reconstruction.method);
  const MethodOptions options(method.options, reconstruction.options,
                              "method " + reconstruction.method);
  Instant instant;
  instant.take = &state_->take;
  instant.time_ns = frames.time_ns;
  instant.rig = &state_->take.rig();
  instant.cache = &state_->cache;
  instant.frame_of_camera.assign(static_cast<std::size_t>(state_->take.camera_count()), -1);
  std::vector<int> present;
  for (const int camera : state_->members) {
    const int frame = frames.frame[static_cast<std::size_t>(camera)];
    instant.frame_of_camera[static_cast<std::size_t>(camera)] = frame;
    if (frame >= 0) present.push_back(camera);
  }
  if (present.empty()) return empty_view(view);
  instant.present = state_->topology(present);
  instant.complete =
      present == state_->members ? instant.present : state_->topology(state_->members);

  const bool distorted = !(view.intrinsics.distortion == Distortion{});
  const ViewRequest request{view,
                            instant,
                            reconstruction.focal_plane,
                            options,
                            *state_->kept,
                            state_->settings.working_bytes,
                            state_->settings.count_needed_pixels};
  return state_->settings.reference || distorted ? method.render_reference(request)
                                                 : method.render(request);
}

}  // namespace raystage
