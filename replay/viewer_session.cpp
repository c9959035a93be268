// SPDX-License-Identifier: Apache-2.0
#include "replay/viewer_session.h"

#include <atomic>
#include <mutex>
#include <utility>

#include "base/cancellation.h"
#include "base/error.h"
#include "replay/server_messages.h"
#include "replay/snapshot.h"
#include "replay/view_rendering.h"
#include "schemas/viewer_message.h"

namespace raystage::replay {

using schemas::ViewerMessage;

struct ViewerSession::State : std::enable_shared_from_this<ViewerSession::State> {
  State(const SessionServices& with_services, std::weak_ptr<Client> to_client)
      : services(with_services), client(std::move(to_client)) {
    static std::atomic<RenderScheduler::ClientId> last_id = 0;
    id = ++last_id;
  }

  const SessionServices& services;
  std::weak_ptr<Client> client;
  RenderScheduler::ClientId id = 0;
  std::mutex mutex;  // guards the members below
  std::shared_ptr<const ShownShot> shown;
  ResolutionControl resolution;

  void send(std::string text) const {
    if (const auto to = client.lock()) to->send_text(std::move(text));
  }
  void send_picture(std::vector<std::byte> message) const {
    constexpr int kStream = 0;
    if (const auto to = client.lock()) to->send_picture(kStream, std::move(message));
  }

  std::shared_ptr<const ShownShot> shown_shot() {
    const std::scoped_lock lock(mutex);
    if (!shown) {
      throw Error::bad_input("no shot is open", "", "Open a shot first");
    }
    return shown;
  }

  /// Runs a job that reports its errors to the page, or that it was dropped.
  template <class Job>
  void submit(JobKind kind, std::int64_t request, Job job) {
    services.scheduler.submit(
        id, kind,
        [self = shared_from_this(), request, job](const std::stop_token& stop) {
          try {
            job(*self, stop);
          } catch (const Cancelled&) {
            self->send(dropped_message(request));
            throw;
          } catch (const Error& error) {
            self->send(error_message(request, error));
          } catch (const std::bad_alloc&) {
            self->send(error_message(request,
                                     Error::failed("out of memory", "", "Choose a smaller view")));
          } catch (const std::exception& error) {
            self->send(
                error_message(request, Error::failed(std::string("unexpected: ") + error.what(), "",
                                                     "Please report this")));
          }
        },
        [self = shared_from_this(), request] { self->send(dropped_message(request)); });
  }

  void show(std::int64_t request, const ShotText& text) {
    schemas::ShotDocument shot = schemas::parse_shot(text.text, text.file);
    const std::filesystem::path file = services.files.path(text.file);
    compose::ShotCamera camera(shot, file);
    std::shared_ptr<const Scene> scene = services.open_scene(shot, file);
    auto opened = std::make_shared<const ShownShot>(
        ShownShot{text.file, text.text, std::move(shot), std::move(camera), std::move(scene)});
    send(shot_message({request, opened->file, opened->text, opened->scene->plan(), opened->shot,
                       opened->camera}));
    const std::scoped_lock lock(mutex);
    shown = std::move(opened);
  }

  /// Renders by the fast method, with fewer pixels if the view moves and is slow.
  void render_fast(const ViewerMessage& request, const std::stop_token& stop) {
    const auto shot = shown_shot();
    int divisor = 1;
    if (request.quality == ViewerMessage::Quality::kMoving) {
      const std::scoped_lock lock(mutex);
      divisor = resolution.divisor(request.width, request.height);
    }
    double ms = 0;
    send_picture(
        render_picture(*shot, request, shot->scene->fast_method(), divisor, true, stop, &ms));
    const std::scoped_lock lock(mutex);
    resolution.record(static_cast<double>(request.width / divisor) * (request.height / divisor),
                      ms);
  }

  /// Renders by the methods of the shot. Where depths must be estimated first, which takes seconds,
  /// plane sweep comes before.
  void refine(const ViewerMessage& request, const std::stop_token& stop) {
    const auto shot = shown_shot();
    if (shot->scene->must_estimate_depths(request.frame)) {
      send_picture(render_picture(*shot, request, "plane_sweep", 1, false, stop));
    }
    send_picture(render_picture(*shot, request, {}, 1, true, stop));
  }

  void handle(const ViewerMessage& request) {
    using Type = ViewerMessage::Type;
    switch (request.type) {
      case Type::kView:
        if (request.quality == ViewerMessage::Quality::kResting) {
          submit(JobKind::kRefinement, request.id,
                 [request](State& state, const auto& stop) { state.refine(request, stop); });
        } else {
          submit(JobKind::kMotion, request.id,
                 [request](State& state, const auto& stop) { state.render_fast(request, stop); });
        }
        break;
      case Type::kShot:
        submit(JobKind::kDocument, request.id, [request](State& state, const auto&) {
          state.show(request.id, {request.file, request.text});
        });
        break;
      case Type::kOpen:
        submit(JobKind::kDocument, request.id, [request](State& state, const auto&) {
          state.show(request.id, {request.file, state.services.files.read(request.file)});
        });
        break;
      case Type::kFocus:
        submit(JobKind::kFocus, request.id, [request](State& state, const auto& stop) {
          state.send(
              focus_message(request.id, find_focus_distance(*state.shown_shot(), request, stop)));
        });
        break;
      case Type::kProbe:
        submit(JobKind::kProbe, request.id, [request](State& state, const auto& stop) {
          state.send(probe_message(probe_pixel(*state.shown_shot(), request, stop)));
        });
        break;
      case Type::kSave:
        submit(JobKind::kFile, request.id, [request](State& state, const auto&) {
          state.services.files.write(request.file, request.text, request.replace);
          state.send(file_message(request.id, "saved", request.file));
        });
        break;
      case Type::kSnapshot:
        submit(JobKind::kFile, request.id, [request](State& state, const auto& stop) {
          write_snapshot(*state.shown_shot(), request, state.services.files.path(request.file),
                         state.services.program_version, stop);
          state.send(file_message(request.id, "written", request.file));
        });
        break;
    }
  }
};

ViewerSession::ViewerSession(const SessionServices& services, const std::shared_ptr<Client>& client,
                             const ShotText& first)
    : state_(std::make_shared<State>(services, client)) {
  state_->send(hello_message(services.program_version, services.files.folder().string()));
  state_->submit(JobKind::kDocument, 0,
                 [first](State& state, const auto&) { state.show(0, first); });
}

ViewerSession::~ViewerSession() { state_->services.scheduler.remove(state_->id); }

void ViewerSession::receive_text(std::string_view message) {
  ViewerMessage request;
  try {
    request = schemas::parse_viewer_message(message);
  } catch (const Error& error) {
    state_->send(error_message(-1, error));
    return;
  }
  state_->handle(request);
}

}  // namespace raystage::replay
