// SPDX-License-Identifier: Apache-2.0
// Internal to replay/server/.
#pragma once

#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http/message.hpp>
#include <boost/beast/http/string_body.hpp>
#include <boost/beast/websocket/stream.hpp>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "replay/server/http_server.h"
#include "replay/server/picture_queue.h"

namespace raystage::replay {

/// The WebSocket of one client. All members except those of Client are called on the server's
/// thread. Lives until the connection ends.
class WebSocketConnection final : public Client,
                                  public std::enable_shared_from_this<WebSocketConnection> {
 public:
  /// `clients`: counted up while the connection lives.
  WebSocketConnection(boost::beast::tcp_stream stream, const ServerOptions& options,
                      RequestHandler& handler, std::shared_ptr<int> clients);
  ~WebSocketConnection() override;

  /// Answers the upgrade request and starts to read.
  void start(const boost::beast::http::request<boost::beast::http::string_body>& upgrade);

  void send_text(std::string message) override;
  void send_picture(int stream, std::int64_t request, std::vector<std::byte> message) override;
  std::int64_t pictures_dropped() const override;

 private:
  using Message = std::variant<std::string, std::vector<std::byte>>;

  void read();
  /// Returns the next message to send; nullopt: none waits.
  std::optional<Message> next_message();
  void write();
  /// Ends the connection: the peer broke a limit or is gone.
  void close();

  boost::beast::websocket::stream<boost::beast::tcp_stream> stream_;
  const std::size_t max_queued_bytes_;
  RequestHandler& handler_;
  std::shared_ptr<int> clients_;
  std::unique_ptr<ClientHandler> of_client_;
  boost::beast::flat_buffer incoming_;
  Message sending_;
  bool is_writing_ = false, is_closed_ = false;

  mutable std::mutex mutex_;       // guards the queues, which keep the order of all threads
  std::deque<std::string> texts_;  ///< wait to be sent
  PictureQueue pictures_;
  std::size_t queued_bytes_ = 0;  ///< of `texts_`
};

}  // namespace raystage::replay
