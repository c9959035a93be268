// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "testing/ingest/test_server.h"

namespace raystage::testing {

std::string text_of(std::span<const std::byte> bytes);
/// Waits for a request of http and answers it as a camera of MJPEG.
void begin_multipart(const TestConnection& client);
/// Sends a frame of MJPEG. Returns false if the client has closed the connection.
bool send_part(const TestConnection& client, std::span<const std::byte> jpeg);

/// A camera that attacks the recorder.
struct HostileCamera {
  std::string id;
  std::string scheme;  ///< of its address: "http" or "tcp"
  std::string format;  ///< of FFmpeg; empty: detected
  /// Attacks, after a request of http was answered, until the client closes the connection.
  std::function<void(const TestConnection& client)> attack;
  /// Attacks before a request of http is answered. It cannot follow good frames.
  bool is_answer = false;
};

/// Returns ten kinds of hostile cameras. `local_file`: one that no camera may have recorded;
/// `other_host`: an address that no camera may have visited.
std::vector<HostileCamera> hostile_cameras(const std::string& local_file,
                                           const std::string& other_host);

}  // namespace raystage::testing
