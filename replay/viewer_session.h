// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "replay/comparison.h"
#include "replay/render_scheduler.h"
#include "replay/server/http_server.h"
#include "replay/server_messages.h"
#include "replay/shot_files.h"

namespace raystage::replay {

/// What all sessions of a viewer share.
struct SessionServices {
  RenderScheduler& scheduler;
  const ShotFiles& files;
  OpenScene open_scene;
  std::string program_version;
};

/// The conversation with one page: shows shots, renders views, answers questions, writes files.
/// Work is done by jobs of the scheduler, which send the answers.
class ViewerSession final : public ClientHandler {
 public:
  /// Greets the page and shows `first`.
  ViewerSession(const SessionServices& services, const std::shared_ptr<Client>& client,
                const FirstView& first);
  ~ViewerSession() override;

  /// Handles a message. A message that is not valid is answered with an error.
  void receive_text(std::string_view message) override;

 private:
  struct State;
  std::shared_ptr<State> state_;  ///< jobs that run when the session ends keep it alive
};

}  // namespace raystage::replay
