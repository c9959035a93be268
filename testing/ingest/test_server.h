// SPDX-License-Identifier: Apache-2.0
// For tests: a server on loopback.
#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <functional>
#include <mutex>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

namespace raystage::testing {

/// The server's side of a connection on loopback.
class TestConnection {
 public:
  explicit TestConnection(int socket) : socket_(socket) {}
  /// Returns false if the client has closed the connection.
  bool send(std::string_view text) const {
    while (!text.empty()) {
      const ssize_t sent = ::send(socket_, text.data(), text.size(), MSG_NOSIGNAL);
      if (sent <= 0) return false;
      text.remove_prefix(static_cast<std::size_t>(sent));
    }
    return true;
  }
  bool send(std::span<const std::byte> bytes) const {
    return send(std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
  }
  /// Reads an HTTP request up to its empty line.
  std::string request() const {
    std::string text;
    char c = 0;
    while (!text.ends_with("\r\n\r\n") && recv(socket_, &c, 1, 0) == 1) text += c;
    return text;
  }
  void wait_for_end() const {
    char c = 0;
    while (recv(socket_, &c, 1, 0) > 0) {
    }
  }

 private:
  int socket_;
};

/// A server that calls `talk` with its clients, one after another, then closes each connection. It
/// listens on one address of loopback only.
class TestServer {
 public:
  static constexpr int kEveryClient = 1 << 30;

  explicit TestServer(std::function<void(const TestConnection&)> talk, int clients = 1,
                      const char* host = "127.0.0.1")
      : host_(host) {
    listener_ = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    inet_pton(AF_INET, host, &address.sin_addr);
    socklen_t size = sizeof(address);
    auto* generic = reinterpret_cast<sockaddr*>(&address);
    if (listener_ < 0 || bind(listener_, generic, size) != 0 || listen(listener_, 4) != 0 ||
        getsockname(listener_, generic, &size) != 0) {
      throw std::runtime_error("no server on loopback");
    }
    port_ = ntohs(address.sin_port);
    thread_ = std::thread([this, clients, talk = std::move(talk)] {
      while (connections_ < clients) {
        const int client = accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
        if (client < 0) return;
        ++connections_;
        if (!keep(client)) return;
        talk(TestConnection(client));
        shutdown(client, SHUT_RDWR);
      }
    });
  }
  ~TestServer() {
    shutdown(listener_, SHUT_RDWR);
    {
      const std::scoped_lock lock(mutex_);
      ending_ = true;
      for (const int client : clients_) shutdown(client, SHUT_RDWR);
    }
    thread_.join();
    for (const int client : clients_) close(client);
    close(listener_);
  }
  TestServer(const TestServer&) = delete;
  TestServer& operator=(const TestServer&) = delete;

  std::string url(std::string_view scheme) const {
    return std::string(scheme) + "://" + host_ + ":" + std::to_string(port_);
  }
  int port() const { return port_; }
  /// Returns the number of connections made, including those that no one has spoken on.
  int connections() const { return connections_; }

 private:
  bool keep(int client) {
    const std::scoped_lock lock(mutex_);
    clients_.push_back(client);
    return !ending_;
  }

  std::string host_;
  int listener_ = -1;
  int port_ = 0;
  std::mutex mutex_;
  std::vector<int> clients_;
  bool ending_ = false;
  std::atomic<int> connections_ = 0;
  std::thread thread_;
};

}  // namespace raystage::testing
