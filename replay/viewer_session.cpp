// SPDX-License-Identifier: Apache-2.0
#include "replay/viewer_session.h"

#include <algorithm>
#include <atomic>
#include <iterator>
#include <mutex>
#include <optional>
#include <utility>

#include "base/atomic_file.h"
#include "base/cancellation.h"
#include "base/error.h"
#include "compose/camera/camera_export.h"
#include "compose/camera/camera_keys.h"
#include "replay/live_view.h"
#include "replay/nested_ranges.h"
#include "replay/permitted_paths.h"
#include "replay/progress_reporter.h"
#include "replay/server_messages.h"
#include "replay/snapshot.h"
#include "replay/source_answers.h"
#include "replay/view_rendering.h"
#include "schemas/viewer_message.h"

namespace raystage::replay {

using schemas::ViewerMessage;

namespace {

constexpr std::int64_t kNoRequest = -1;  ///< of messages that answer no request

/// What ranges of motion depend on.
struct RangesView {
  render::VirtualCamera view;
  double interaxial = 0;
  std::weak_ptr<const Scene> scene;

  /// Returns whether the ranges are the same: wherever the views are.
  bool is_like(const RangesView& other) const {
    return scene.lock() == other.scene.lock() && interaxial == other.interaxial &&
           view.width == other.view.width && view.height == other.view.height &&
           view.intrinsics == other.view.intrinsics &&
           view.pose.world_from_camera_rotation == other.view.pose.world_from_camera_rotation;
  }
};

}  // namespace

struct ViewerSession::State : std::enable_shared_from_this<ViewerSession::State> {
  State(const SessionServices& with_services, std::weak_ptr<Client> to_client)
      : services(with_services), client(std::move(to_client)), permitted(services.files) {
    static std::atomic<RenderScheduler::ClientId> last_id = 0;
    id = ++last_id;
  }

  const SessionServices& services;
  std::weak_ptr<Client> client;
  RenderScheduler::ClientId id = 0;
  PermittedPaths permitted;
  std::mutex mutex;  // guards the members below
  std::shared_ptr<const ShownShot> shown;
  std::shared_ptr<const ShownShot> with_confidence;  // the same, with the measure; null: not opened
  ResolutionControl resolution;
  std::optional<RangesView> ranges_view;  // of `ranges`
  std::vector<NestedRange> ranges;
  std::optional<LiveView> live;  // used by jobs of one kind only, which never run at once

  void send(std::string text) const {
    if (const auto to = client.lock()) to->send_text(std::move(text));
  }
  void send_picture(PictureContent content, std::int64_t request,
                    std::vector<std::byte> message) const {
    if (const auto to = client.lock()) {
      to->send_picture(static_cast<int>(content), request, std::move(message));
    }
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

  /// Whether a shot comes from its file, or is an edit of the one that is shown.
  enum class ShotOrigin { kOpened, kEdited };

  void show(std::int64_t request, const ShotText& text, ShotOrigin origin) {
    schemas::ShotDocument shot = schemas::parse_shot(text.text, text.file);
    const std::filesystem::path file = services.files.path(text.file);
    if (origin == ShotOrigin::kOpened) {
      permitted.permit(text.file, text.text);
    } else {
      permitted.check(text.file, text.text);
    }
    compose::ShotCamera camera(shot, file);
    std::shared_ptr<const Scene> scene = services.open_scene(shot, file);
    auto opened = std::make_shared<const ShownShot>(
        ShownShot{text.file, text.text, std::move(shot), std::move(camera), std::move(scene)});
    ShotMessage message{request,      opened->file,  opened->text, opened->scene->plan(),
                        opened->shot, opened->camera};
    std::optional<Error> notes_error;
    if (origin == ShotOrigin::kOpened) {
      try {
        add_companions(text.file, message);
      } catch (const Error& error) {
        notes_error = error;  // the shot is shown nevertheless
      }
    }
    std::string answer = shot_message(message);
    {
      const std::scoped_lock lock(mutex);
      shown = opened;
      with_confidence.reset();
      ranges_view.reset();
      ranges = {};
    }
    send(std::move(answer));
    if (notes_error) send(error_message(kNoRequest, *notes_error));
  }

  /// Adds what is stored beside a shot.
  void add_companions(const std::string& file, ShotMessage& message) const {
    const auto light_fields = message.plan.light_fields();
    if (!light_fields.empty()) {
      message.measurements = find_measurements(services.files.path(file).parent_path(),
                                               light_fields.front()->take().document().name);
    }
    message.is_opened = true;
    message.notes = services.files.read_notes(file);
    message.recovered = services.files.read_autosave(file);
  }

  /// Opens a shot, or makes one of a take.
  void open(std::int64_t request, const std::string& file) {
    const std::filesystem::path path = services.files.path(file);
    if (file_exists(path / "take.json")) {
      return show(request,
                  saved_shot(services.files, open_take_shot(path, services.files.folder())),
                  ShotOrigin::kOpened);
    }
    show(request, {file, services.files.read(file)}, ShotOrigin::kOpened);
  }

  /// Returns the shown shot, with the measures that the request shows.
  std::shared_ptr<const ShownShot> shot_for(const ViewerMessage& request) {
    auto shot = shown_shot();
    if (request.look.channel != ViewerMessage::Look::Channel::kConfidence) return shot;
    {
      const std::scoped_lock lock(mutex);
      if (with_confidence) return with_confidence;
    }
    ShownShot measured = *shot;
    measured.shot.output.aovs.emplace_back("lf.confidence");
    measured.scene = services.open_scene(measured.shot, services.files.path(measured.file));
    auto result = std::make_shared<const ShownShot>(std::move(measured));
    const std::scoped_lock lock(mutex);
    if (shown == shot) with_confidence = result;
    return result;
  }

  /// Renders by the fast method, with one sample per pixel, and with fewer pixels if the view moves
  /// and is slow.
  void render_fast(const ViewerMessage& request, const std::stop_token& stop) {
    const auto shot = shot_for(request);
    PictureOptions options;
    options.preview = {shot->scene->fast_method(), 1};
    if (request.quality == ViewerMessage::Quality::kMoving) {
      const std::scoped_lock lock(mutex);
      options.divisor = resolution.divisor(request.width, request.height);
    }
    double ms = 0;
    send_picture(options.content, request.id, render_picture(*shot, request, options, stop, &ms));
    if (request.quality == ViewerMessage::Quality::kPlaying)
      shot->scene->read_ahead_of(request.frame);
    const std::scoped_lock lock(mutex);
    const int width = request.width / options.divisor, height = request.height / options.divisor;
    resolution.record(static_cast<double>(width) * height, ms);
  }

  /// Renders by the methods of the shot. Where depths must be estimated first, which takes seconds,
  /// plane sweep comes before, and the progress is reported.
  void refine(const ViewerMessage& request, const std::stop_token& stop) {
    const auto shot = shot_for(request);
    std::optional<ProgressReporter> reporter;
    if (shot->scene->must_estimate_depths(request.frame)) {
      PictureOptions first;
      first.preview.method = "plane_sweep";
      first.is_final = false;
      send_picture(first.content, request.id, render_picture(*shot, request, first, stop));
      reporter.emplace([this, id = request.id, progress = shot->scene->depth_progress()] {
        if (const auto share = progress()) send(progress_message(id, *share));
      });
    }
    PictureOptions options;
    options.is_final = !request.comparison.has_value();
    send_picture(options.content, request.id, render_picture(*shot, request, options, stop));
    reporter.reset();
    if (request.comparison) {
      const std::string& text = request.comparison->text;
      if (!text.empty()) permitted.check(shot->file, text);
      send_picture(PictureContent::kComparison, request.id,
                   render_comparison(*shot, request, services.files, services.open_scene, stop));
    }
    submit(JobKind::kRanges, request.id, [shot, request](State& state, const auto& ranges_stop) {
      state.send_ranges(*shot, request, ranges_stop);
    });
  }

  /// Computes the ranges of motion, which takes seconds, unless they are those of the last view.
  void send_ranges(const ShownShot& shot, const ViewerMessage& request,
                   const std::stop_token& stop) {
    if (shot.camera.is_equirectangular()) return;
    const RangesView view{requested_camera(shot, request, request.width, request.height).view,
                          requested_interaxial(shot, request), shot.scene};
    std::vector<NestedRange> sent;
    if (const auto& subject = request.subject) {
      sent = subject_ranges(shot.scene->plan(), Eigen::Vector3d(subject->point.data()),
                            subject->size_m, stop);
    }
    {
      const std::scoped_lock lock(mutex);
      if (ranges_view && ranges_view->is_like(view)) {
        std::ranges::copy(ranges, std::back_inserter(sent));
        return send(ranges_message(request.id, sent));
      }
    }
    if (!sent.empty()) send(ranges_message(request.id, sent));  // the others take seconds
    std::vector<NestedRange> found =
        nested_ranges(shot.scene->plan(), view.view, view.interaxial, stop);
    std::ranges::copy(found, std::back_inserter(sent));
    send(ranges_message(request.id, sent));
    const std::scoped_lock lock(mutex);
    ranges_view = view;
    ranges = std::move(found);
  }

  void export_camera(const ViewerMessage& request) {
    const std::filesystem::path file = services.files.writable_path(request.file);
    const auto shot = shown_shot();
    if (file_exists(file) && !request.replace) {
      throw Error::bad_input("the file exists", file.string(),
                             "Confirm to replace it, or choose another name");
    }
    std::vector<int> frames;
    for (int frame = shot->shot.first_frame; frame <= shot->shot.last_frame; ++frame) {
      frames.push_back(frame);
    }
    const compose::CameraExport exported{shot->camera, shot->shot, frames};
    compose::check_camera_file_losses(exported, file, "Export it as .nk, which holds it");
    write_file_atomically(file, compose::format_camera_file(exported, file));
    send(file_message(request.id, "written", request.file));
  }

  void save(const ViewerMessage& request) {
    permitted.check(request.shot.empty() ? request.file : request.shot, request.text);
    const std::string written =
        services.files.write(request.file, request.text, request.replace, request.shot);
    send(saved_message(request.id, request.file,
                       written == request.text ? std::string_view() : written));
  }

  void autosave(const ViewerMessage& request) {
    if (request.text.empty()) {
      services.files.forget_autosave(request.file);
    } else {
      permitted.check(request.file, request.text);
      services.files.write_autosave(request.file, request.text);
    }
    send(file_message(request.id, "kept", request.file));
  }

  void follow_live(const ViewerMessage& request, const std::stop_token& stop) {
    const std::filesystem::path folder = services.files.path(request.file);
    if (!live || live->folder() != folder) live.emplace(folder);
    try {
      send(live_message(request.id, live->update()));
    } catch (...) {
      live.reset();  // the next request opens the take again
      throw;
    }
    if (auto picture = live->picture(request, stop)) {
      send_picture(picture->content, request.id, std::move(picture->message));
    }
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
          state.show(request.id, {request.file, request.text}, ShotOrigin::kEdited);
        });
        break;
      case Type::kOpen:
        submit(JobKind::kDocument, request.id,
               [request](State& state, const auto&) { state.open(request.id, request.file); });
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
        submit(JobKind::kFile, request.id,
               [request](State& state, const auto&) { state.save(request); });
        break;
      case Type::kSnapshot:
        submit(JobKind::kSnapshot, request.id, [request](State& state, const auto& stop) {
          write_snapshot(*state.shown_shot(), request,
                         state.services.files.writable_path(request.file),
                         state.services.program_version, stop);
          state.send(file_message(request.id, "written", request.file));
        });
        break;
      case Type::kExport:
        submit(JobKind::kFile, request.id,
               [request](State& state, const auto&) { state.export_camera(request); });
        break;
      case Type::kAutosave:
        submit(JobKind::kFile, request.id,
               [request](State& state, const auto&) { state.autosave(request); });
        break;
      case Type::kNotes:
        submit(JobKind::kFile, request.id, [request](State& state, const auto&) {
          const ShotFiles& files = state.services.files;
          const bool is_written = files.write_notes(request.file, request.text, request.previous);
          state.send(is_written ? file_message(request.id, "noted", request.file)
                                : notes_message(request.id, files.read_notes(request.file)));
        });
        break;
      case Type::kCancel:
        submit(JobKind::kRefinement, request.id, [](State&, const auto&) {});
        break;
      case Type::kMosaic:
      case Type::kSource:
      case Type::kEpi:
        submit(JobKind::kSource, request.id, [request](State& state, const auto&) {
          const SourceAnswer answer = answer_source_request(*state.shown_shot(), request);
          state.send_picture(answer.content, request.id, answer.message);
        });
        break;
      case Type::kFolder:
        submit(JobKind::kFolder, request.id, [request](State& state, const auto&) {
          state.send(folder_message(request.id, request.file,
                                    list_folder(state.services.files.folder_path(request.file))));
        });
        break;
      case Type::kThumbnail:
        submit(JobKind::kThumbnail, request.id, [request](State& state, const auto&) {
          const SourceAnswer answer =
              answer_thumbnail_request(state.services.files.path(request.file), request);
          state.send_picture(answer.content, request.id, answer.message);
        });
        break;
      case Type::kKeys:
        submit(JobKind::kKeys, request.id, [request](State& state, const auto&) {
          const auto shot = state.shown_shot();
          schemas::ShotDocument keyed = shot->shot;
          keyed.camera = compose::keyed_camera(shot->shot.camera,
                                               compose::find_camera_keys(shot->camera, shot->shot));
          state.send(keys_message(request.id, keyed));
        });
        break;
      case Type::kLive:
        submit(JobKind::kSource, request.id,
               [request](State& state, const auto& stop) { state.follow_live(request, stop); });
        break;
    }
  }
};

ViewerSession::ViewerSession(const SessionServices& services, const std::shared_ptr<Client>& client,
                             const FirstView& first)
    : state_(std::make_shared<State>(services, client)) {
  state_->send(hello_message(services.program_version, services.files.folder().string(), first));
  if (!first.shot) return;
  state_->submit(JobKind::kDocument, 0, [first = *first.shot](State& state, const auto&) {
    const ShotText shot = saved_shot(state.services.files, first);
    state.show(0, shot, State::ShotOrigin::kOpened);
  });
}

ViewerSession::~ViewerSession() { state_->services.scheduler.remove(state_->id); }

void ViewerSession::receive_text(std::string_view message) {
  ViewerMessage request;
  try {
    request = schemas::parse_viewer_message(message);
  } catch (const Error& error) {
    state_->send(
        error_message(schemas::find_viewer_message_id(message).value_or(kNoRequest), error));
    return;
  }
  state_->handle(request);
}

}  // namespace raystage::replay
