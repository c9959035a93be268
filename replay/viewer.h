// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <memory>
#include <stop_token>
#include <string>
#include <string_view>

#include "replay/server/http_server.h"

namespace raystage::replay {

struct ViewerOptions {
  std::filesystem::path target;  ///< a take's folder, a shot's file, or a folder of these
  /// Folder in which shots are opened and saved; empty: that of the shot, or the one that holds the
  /// take.
  std::filesystem::path shot_folder;
  std::filesystem::path cache_folder;  ///< for derived data; empty: each take's folder
  std::size_t memory_bytes = 0;        ///< of all open shots; 0: half of available_memory()
  int threads = 0;                     ///< of the renderers; 0: all
  std::string program_version;
  ServerOptions server;
};

/// Serves a viewer to browsers.
class Viewer {
 public:
  /// Reads the target and listens. Throws Error (bad input) if the target cannot be shown, and as
  /// HttpServer.
  explicit Viewer(const ViewerOptions& options);
  ~Viewer();

  /// Returns the address for a browser, with the token.
  std::string url() const;
  /// Serves until a stop is requested.
  void run(const std::stop_token& stop);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace raystage::replay
