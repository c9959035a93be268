// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>
#include <vector>

namespace raystage::replay {

struct ServerOptions {
  std::string address = "127.0.0.1";  ///< IPv4 or IPv6 address to listen at
  std::uint16_t port = 0;             ///< 0: any free port
  std::string token;                  ///< see AccessRules; empty: a random one
  /// Host names by which browsers may address the server, besides its address and, where it listens
  /// at this machine only, "localhost".
  std::vector<std::string> host_names = {};
  int max_clients = 32;       ///< WebSockets; further ones are refused
  int max_connections = 256;  ///< of any kind; further ones are closed at once
  std::size_t max_message_bytes = std::size_t{4} << 20;  ///< of a client; longer ones end it
  /// Messages that wait for one client; more end the connection. Pictures do not count: a newer
  /// picture replaces the one that waits.
  std::size_t max_queued_bytes = std::size_t{16} << 20;
  bool is_valid(std::string* reason) const;
};

/// A file of the server.
struct Resource {
  std::string_view content_type;
  std::string_view content;  ///< lives as long as the handler
};

/// Sends messages to one browser over its WebSocket. Thread-safe; does not block. Messages after
/// the connection has ended are dropped.
class Client {
 public:
  virtual ~Client() = default;
  virtual void send_text(std::string message) = 0;
  /// Sends the picture of a request; newer requests have larger numbers. It replaces a picture of
  /// the same stream that is still waiting, so that a slow connection shows fewer pictures and not
  /// older ones. It is dropped if a newer request of the stream was answered already.
  virtual void send_picture(int stream, std::int64_t request, std::vector<std::byte> message) = 0;
  /// Returns the pictures that were replaced or dropped before they were sent.
  virtual std::int64_t pictures_dropped() const = 0;
};

/// Receives the messages of one client. Called on the server's thread, which it must not block.
/// Destroyed when the connection ends.
class ClientHandler {
 public:
  virtual ~ClientHandler() = default;
  virtual void receive_text(std::string_view message) = 0;
};

/// What a server serves. Called on the server's thread, which it must not block.
class RequestHandler {
 public:
  virtual ~RequestHandler() = default;
  /// Returns the file with this path behind the token; nullopt: there is none.
  virtual std::optional<Resource> find(std::string_view path) const = 0;
  virtual std::unique_ptr<ClientHandler> connect(std::shared_ptr<Client> client) = 0;
};

/// Serves files by HTTP and one kind of WebSocket (at TOKEN/socket) with Boost.Beast, on the thread
/// that calls run(). Requests that check_access() does not grant get 403 and no further hint.
class HttpServer {
 public:
  /// Listens. Keeps a reference to the handler. Throws Error: bad input for invalid options or an
  /// address that is not one of this machine, failed if the port is in use.
  HttpServer(const ServerOptions& options, RequestHandler& handler);
  ~HttpServer();

  /// Returns the address with the token, for a browser: "http://127.0.0.1:8080/TOKEN/".
  std::string url() const;
  std::uint16_t port() const;
  /// Serves until a stop is requested; then closes all connections.
  void run(const std::stop_token& stop);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace raystage::replay
