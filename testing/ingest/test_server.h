// SPDX-License-Identifier: Apache-2.0
// For tests: a server on loopback.
#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <functional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <thread>
#include <utility>

namespace raystage::testing {

/// The server's side of a connection on loopback.
class TestConnection {
 public:
  explicit TestConnection(int socket) : socket_(socket) {}
  void send(std::string_view text) const {
    while (!text.empty()) {
      const ssize_t sent = ::send(socket_, text.data(), text.size(), MSG_NOSIGNAL);
      if (sent <= 0) return;
      text.remove_prefix(static_cast<std::size_t>(sent));
    }
  }
  void send(std::span<const std::byte> bytes) const {
    send(std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
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

/// A server that calls `talk` with its first client, then closes the connection.
class TestServer {
 public:
  explicit TestServer(std::function<void(const TestConnection&)> talk) {
    listener_ = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof(address);
    auto* generic = reinterpret_cast<sockaddr*>(&address);
    if (listener_ < 0 || bind(listener_, generic, size) != 0 || listen(listener_, 4) != 0 ||
        getsockname(listener_, generic, &size) != 0) {
      throw std::runtime_error("no server on loopback");
    }
    port_ = ntohs(address.sin_port);
    thread_ = std::thread([this, talk = std::move(talk)] {
      client_ = accept(listener_, nullptr, nullptr);
      if (client_ < 0) return;
      talk(TestConnection(client_));
      shutdown(client_, SHUT_RDWR);
    });
  }
  ~TestServer() {
    shutdown(listener_, SHUT_RDWR);
    if (client_ >= 0) shutdown(client_, SHUT_RDWR);
    thread_.join();
    if (client_ >= 0) close(client_);
    close(listener_);
  }
  TestServer(const TestServer&) = delete;
  TestServer& operator=(const TestServer&) = delete;

  std::string url(std::string_view scheme) const {
    return std::string(scheme) + "://127.0.0.1:" + std::to_string(port_);
  }

 private:
  int listener_ = -1;
  std::atomic<int> client_ = -1;
  int port_ = 0;
  std::thread thread_;
};

}  // namespace raystage::testing
