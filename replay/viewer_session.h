// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "replay/render_scheduler.h"
#include "replay/scene.h"
#include "replay/server/http_server.h"
#include "replay/shot_files.h"

namespace raystage::replay {

/// What all sessions of a viewer share.
struct SessionServices {
  RenderScheduler& scheduler;
  const ShotFiles& files;
  /// Returns the scene of a shot, opened if it is not open yet. Throws Error (bad input).
  std::function<std::shared_ptr<const Scene>(const schemas::ShotDocument& shot,
                                             const std::filesystem::path& shot_file)>
      open_scene;
  std::string program_version;
};

/// A shot as text, with the file that it is or would be in, relative to the viewer's folder.
struct ShotText {
  std::string file, text;
};

/// The conversation with one page: shows shots, renders views, answers questions, writes files.
/// Work is done by jobs of the scheduler, which send the answers.
class ViewerSession final : public ClientHandler {
 public:
  /// Greets the page and shows `first`.
  ViewerSession(const SessionServices& services, const std::shared_ptr<Client>& client,
                const ShotText& first);
  ~ViewerSession() override;

  /// Handles a message. A message that is not valid is answered with an error.
  void receive_text(std::string_view message) override;

 private:
  struct State;
  std::shared_ptr<State> state_;  ///< jobs that run when the session ends keep it alive
};

}  // namespace raystage::replay
