// SPDX-License-Identifier: Apache-2.0
// An HTTP server on one thread (Boost.Asio's proactor, Boost.Beast's parser): GET and HEAD of the
// handler's files, and upgrades to WebSockets. Headers, idle times and connections are limited.
#include "replay/server/http_server.h"

#include <fmt/format.h>

#include <algorithm>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/host_name.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket/rfc6455.hpp>
#include <chrono>
#include <set>
#include <utility>

#include "base/error.h"
#include "base/options.h"
#include "replay/server/access_control.h"
#include "replay/server/web_socket_connection.h"

namespace raystage::replay {
namespace {

namespace beast = boost::beast;
namespace http = beast::http;
using boost::asio::ip::tcp;

constexpr std::chrono::seconds kIdleTime{30};
constexpr std::uint32_t kMaxHeaderBytes = 16 << 10;
constexpr std::string_view kSocketPath = "socket";
/// Pages may load nothing from elsewhere and may not be framed by other sites.
constexpr const char* kContentSecurityPolicy =
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; "
    "connect-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'";

/// What all connections of a server share.
struct Shared {
  Shared(ServerOptions with_options, RequestHandler& with_handler)
      : options(std::move(with_options)), handler(with_handler) {}

  const ServerOptions options;
  AccessRules rules;
  RequestHandler& handler;
  std::shared_ptr<int> clients = std::make_shared<int>(0);
  int connections = 0;
};

std::optional<std::string_view> header(const http::request<http::string_body>& request,
                                       http::field name) {
  const auto found = request.find(name);
  if (found == request.end() || request.count(name) > 1) return std::nullopt;
  return std::string_view(found->value().data(), found->value().size());
}

/// One connection until it ends or becomes a WebSocket.
class HttpConnection : public std::enable_shared_from_this<HttpConnection> {
 public:
  HttpConnection(tcp::socket socket, std::shared_ptr<Shared> shared)
      : stream_(std::move(socket)), shared_(std::move(shared)) {
    ++shared_->connections;
  }
  ~HttpConnection() { --shared_->connections; }
  HttpConnection(const HttpConnection&) = delete;
  HttpConnection& operator=(const HttpConnection&) = delete;

  void read() {
    parser_.emplace();
    parser_->header_limit(kMaxHeaderBytes);
    parser_->body_limit(0);
    stream_.expires_after(kIdleTime);
    http::async_read(stream_, buffer_, *parser_,
                     [self = shared_from_this()](beast::error_code error, std::size_t) {
                       if (!error) self->answer();
                     });
  }

 private:
  void answer() {
    const http::request<http::string_body>& request = parser_->get();
    const std::string_view target(request.target().data(), request.target().size());
    const bool is_web_socket = beast::websocket::is_upgrade(request);
    const AccessDecision decision =
        check_access(shared_->rules, {target, header(request, http::field::host),
                                      header(request, http::field::origin), is_web_socket});
    if (decision != AccessDecision::kGranted) {
      return respond(
          http::status::forbidden,
          {"text/plain", "Forbidden. Use the address that `raystage replay` printed.\n"});
    }
    const std::string_view path = path_in_target(shared_->rules, target);
    if (is_web_socket) {
      if (path != kSocketPath)
        return respond(http::status::not_found, {"text/plain", "No socket\n"});
      if (*shared_->clients >= shared_->options.max_clients) {
        return respond(http::status::service_unavailable, {"text/plain", "Too many viewers\n"});
      }
      std::make_shared<WebSocketConnection>(std::move(stream_), shared_->options, shared_->handler,
                                            shared_->clients)
          ->start(request);
      return;
    }
    if (request.method() != http::verb::get && request.method() != http::verb::head) {
      return respond(http::status::method_not_allowed, {"text/plain", "Only GET and HEAD\n"});
    }
    const std::optional<Resource> found = shared_->handler.find(path.empty() ? "index.html" : path);
    if (!found) return respond(http::status::not_found, {"text/plain", "Not found\n"});
    respond(http::status::ok, *found);
  }

  void respond(http::status status, const Resource& resource) {
    const http::request<http::string_body>& request = parser_->get();
    response_ = {status, request.version()};
    response_.set(http::field::content_type,
                  beast::string_view(resource.content_type.data(), resource.content_type.size()));
    response_.set(http::field::cache_control, "no-store");
    response_.set("Content-Security-Policy", kContentSecurityPolicy);
    response_.set("X-Content-Type-Options", "nosniff");
    response_.set("Referrer-Policy", "no-referrer");
    response_.set("Cross-Origin-Resource-Policy", "same-origin");
    response_.keep_alive(request.keep_alive() && status == http::status::ok);
    if (request.method() == http::verb::head) {
      response_.content_length(resource.content.size());
    } else {
      response_.body() = resource.content;
      response_.prepare_payload();
    }
    stream_.expires_after(kIdleTime);
    http::async_write(stream_, response_,
                      [self = shared_from_this()](beast::error_code error, std::size_t) {
                        if (!error && self->response_.keep_alive()) return self->read();
                        self->stream_.socket().shutdown(tcp::socket::shutdown_send, error);
                      });
  }

  beast::tcp_stream stream_;
  std::shared_ptr<Shared> shared_;
  beast::flat_buffer buffer_{kMaxHeaderBytes};
  std::optional<http::request_parser<http::string_body>> parser_;
  http::response<http::string_body> response_;
};

std::string authority(const std::string& host, std::uint16_t port) {
  const bool is_ipv6 = host.find(':') != std::string::npos;
  return is_ipv6 ? fmt::format("[{}]:{}", host, port) : fmt::format("{}:{}", host, port);
}

}  // namespace

bool ServerOptions::is_valid(std::string* reason) const {
  boost::system::error_code error;
  boost::asio::ip::make_address(address, error);
  if (error) {
    *reason = "\"" + address + "\" is no IPv4 or IPv6 address";
    return false;
  }
  return is_within("max_clients", max_clients, 1, 1000, reason) &&
         is_within("max_connections", max_connections, 1, 10'000, reason);
}

struct HttpServer::State {
  State(const ServerOptions& options, RequestHandler& handler)
      : shared(std::make_shared<Shared>(options, handler)) {
    const tcp::endpoint endpoint(boost::asio::ip::make_address(options.address), options.port);
    try {
      acceptor.open(endpoint.protocol());
      acceptor.set_option(tcp::acceptor::reuse_address(true));
      acceptor.bind(endpoint);
      acceptor.listen();
    } catch (const boost::system::system_error& error) {
      throw Error::failed("cannot listen: " + error.code().message(),
                          authority(options.address, options.port),
                          "Choose another port, or an address of this machine");
    }
    shared->rules.token = options.token.empty() ? make_random_token() : options.token;
    const std::uint16_t port = acceptor.local_endpoint().port();
    std::vector<std::string> names = options.host_names;
    names.push_back(options.address);
    if (endpoint.address().is_loopback()) names.emplace_back("localhost");
    if (endpoint.address().is_unspecified()) names.push_back(boost::asio::ip::host_name());
    constexpr std::uint16_t kDefaultPort = 80;  // which browsers do not send
    for (const std::string& name : names) {
      shared->rules.hosts.push_back(lower_case(authority(name, port)));
      if (port == kDefaultPort) shared->rules.hosts.push_back(lower_case(name));
    }
    // The address that reaches this server from outside.
    shown_name = endpoint.address().is_unspecified() ? names.back() : options.address;
  }

  void accept() {
    acceptor.async_accept([this](boost::system::error_code error, tcp::socket socket) {
      if (error == boost::asio::error::operation_aborted) return;
      if (!error && shared->connections < shared->options.max_connections) {
        boost::system::error_code ignored;
        socket.set_option(tcp::no_delay(true), ignored);
        std::make_shared<HttpConnection>(std::move(socket), shared)->read();
      }
      accept();
    });
  }

  boost::asio::io_context context{1};
  tcp::acceptor acceptor{context};
  std::shared_ptr<Shared> shared;
  std::string shown_name;
};

HttpServer::HttpServer(const ServerOptions& options, RequestHandler& handler) {
  require_valid(options, "server");
  state_ = std::make_unique<State>(options, handler);
}

HttpServer::~HttpServer() = default;

std::string HttpServer::url() const {
  return fmt::format("http://{}/{}/", authority(state_->shown_name, port()),
                     state_->shared->rules.token);
}

std::uint16_t HttpServer::port() const { return state_->acceptor.local_endpoint().port(); }

void HttpServer::run(const std::stop_token& stop) {
  state_->accept();
  const std::stop_callback on_stop(stop, [this] { state_->context.stop(); });
  if (!stop.stop_requested()) state_->context.run();
}

}  // namespace raystage::replay
