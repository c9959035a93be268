// SPDX-License-Identifier: Apache-2.0
#include "replay/viewer.h"

#include <algorithm>
#include <exception>
#include <memory>
#include <utility>

#include "base/atomic_file.h"
#include "base/error.h"
#include "compose/camera/shot_camera.h"
#include "replay/embedded_files.h"
#include "replay/live/live_take.h"
#include "replay/render_scheduler.h"
#include "replay/scene_cache.h"
#include "replay/shot_files.h"
#include "replay/shot_paths.h"
#include "replay/take_shot.h"
#include "replay/viewer_session.h"

namespace raystage::replay {
namespace {

namespace fs = std::filesystem;

bool is_take(const fs::path& target) { return file_exists(target / "take.json"); }

/// Returns the folder that shots are in: as the options say, or that of the target. A shot inside
/// of a take is saved beside it.
fs::path shot_folder_of(const ViewerOptions& options) {
  if (!options.shot_folder.empty()) return options.shot_folder;
  const fs::path target = fs::weakly_canonical(options.target);
  if (is_folder(target) && !is_take(target)) return target;
  return is_take(target.parent_path()) ? target.parent_path().parent_path() : target.parent_path();
}

FirstView first_view(const ViewerOptions& options, const ShotFiles& files) {
  std::error_code error;
  const fs::path target = fs::canonical(options.target, error);
  if (error) {
    throw Error::bad_input("there is no such take, shot or folder", options.target.string(),
                           "Give the folder of a take, a shot's .json file, or a folder of these");
  }
  FirstView first;
  const std::string relative = fs::relative(target, files.folder()).string();
  if (is_take(target)) {
    if (is_being_recorded(target)) {
      files.path(relative);  // fails now, and not in the page
      first.live = relative;
    } else {
      first.shot = open_take_shot(target, files.folder());
    }
    return first;
  }
  if (is_folder(target)) {
    if (relative.starts_with("..")) {
      throw Error::bad_input("the folder to list is outside of the folder of shots",
                             target.string(), "Give a folder below " + files.folder().string());
    }
    list_folder(target);  // likewise
    first.folder = relative;
    return first;
  }
  if (relative.starts_with("..")) {  // opened under its name, from elsewhere
    const ShotFiles there(target.parent_path());
    first.shot = ShotText{target.filename().string(),
                          rebase_shot_paths(there.read(target.filename().string()),
                                            target.parent_path(), files.folder())};
  } else {
    first.shot = ShotText{relative, files.read(relative)};
  }
  schemas::parse_shot(first.shot->text, target.string());  // likewise
  return first;
}

}  // namespace

struct Viewer::State : RequestHandler {
  explicit State(const ViewerOptions& options)
      : files(shot_folder_of(options)),
        scenes(options.cache_folder, options.memory_bytes),
        first(first_view(options, files)),
        scheduler(options.threads),
        services{scheduler, files,
                 [this](const schemas::ShotDocument& shot, const fs::path& shot_file) {
                   return scenes.open(shot, shot_file);
                 },
                 options.program_version},
        server(options.server, *this) {
    if (first.shot) read_first_frame();
  }
  /// Jobs send to connections of the server, which is destroyed first.
  ~State() override { scheduler.end(); }
  State(const State&) = delete;
  State& operator=(const State&) = delete;

  /// Renders the first frame while the browser starts, so that its source frames are in memory.
  void read_first_frame() {
    constexpr RenderScheduler::ClientId kNoClient = 0;  // those of pages begin at 1
    scheduler.submit(kNoClient, JobKind::kRefinement, [this](const std::stop_token& stop) {
      try {
        const fs::path file = files.path(first.shot->file);
        const schemas::ShotDocument shot = schemas::parse_shot(first.shot->text, first.shot->file);
        const std::shared_ptr<const Scene> scene = scenes.open(shot, file);
        const compose::ShotCamera camera(shot, file);
        constexpr int kWidth = 320;
        const int height = std::clamp(kWidth * shot.height / shot.width, 1, kWidth);
        scene->render({shot.first_frame,
                       make_view_camera(camera, camera.state(shot.first_frame), compose::Eye::kBoth,
                                        kWidth, height),
                       {.method = scene->fast_method(), .max_supersampling = 1}},
                      stop);
      } catch (const std::exception&) {
        // Nothing is lost: the page requests the frame again and shows what is wrong.
      }
    });
  }

  std::optional<Resource> find(std::string_view path) const override {
    for (const EmbeddedFile& file : embedded_files()) {
      if (file.name == path) return Resource{file.content_type, file.content};
    }
    return std::nullopt;
  }
  std::unique_ptr<ClientHandler> connect(std::shared_ptr<Client> client) override {
    return std::make_unique<ViewerSession>(services, client, first);
  }

  ShotFiles files;
  SceneCache scenes;
  FirstView first;
  RenderScheduler scheduler;
  SessionServices services;
  HttpServer server;
};

Viewer::Viewer(const ViewerOptions& options) : state_(std::make_unique<State>(options)) {}

Viewer::~Viewer() = default;

std::string Viewer::url() const { return state_->server.url(); }

void Viewer::run(const std::stop_token& stop) { state_->server.run(stop); }

}  // namespace raystage::replay
