// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "testing/ingest/test_server.h"

namespace raystage::testing {

/// Sends frames as a camera of MJPEG over http.
class MultipartSender {
 public:
  /// Waits for the request and answers it.
  explicit MultipartSender(const TestConnection& client);
  /// Returns false if the client has closed the connection.
  bool send(std::span<const std::byte> jpeg) const;
  /// Sends the headers of a part, which says how many bytes follow.
  bool begin_part(const std::string& length) const;

 private:
  const TestConnection& client_;
};

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
