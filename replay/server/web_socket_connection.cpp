// SPDX-License-Identifier: Apache-2.0
// The WebSocket of one client. Texts are sent in order; pictures are sent between them, and a newer
// picture of a stream replaces one that waits. Memory: one message being received, one being sent,
// the texts that wait (limited) and one picture per stream.
#include "replay/server/web_socket_connection.h"

#include <boost/asio/post.hpp>
#include <boost/beast/websocket/rfc6455.hpp>
#include <utility>

namespace raystage::replay {
namespace {

namespace beast = boost::beast;
namespace websocket = beast::websocket;

}  // namespace

WebSocketConnection::WebSocketConnection(beast::tcp_stream stream, const ServerOptions& options,
                                         RequestHandler& handler, std::shared_ptr<int> clients)
    : stream_(std::move(stream)),
      max_queued_bytes_(options.max_queued_bytes),
      handler_(handler),
      clients_(std::move(clients)) {
  ++*clients_;
  beast::get_lowest_layer(stream_).expires_never();  // the WebSocket has time limits of its own
  websocket::stream_base::timeout limits =
      websocket::stream_base::timeout::suggested(beast::role_type::server);
  limits.keep_alive_pings = true;
  stream_.set_option(limits);
  stream_.read_message_max(options.max_message_bytes);
  stream_.auto_fragment(false);
  stream_.write_buffer_bytes(std::size_t{1} << 16);
}

WebSocketConnection::~WebSocketConnection() { --*clients_; }

void WebSocketConnection::start(const beast::http::request<beast::http::string_body>& upgrade) {
  stream_.async_accept(upgrade, [self = shared_from_this()](beast::error_code error) {
    if (error) return;
    self->of_client_ = self->handler_.connect(self);
    self->read();
  });
}

void WebSocketConnection::read() {
  stream_.async_read(incoming_, [self = shared_from_this()](beast::error_code error, std::size_t) {
    // Too long and torn messages are errors, too.
    if (error || self->is_closed_ || !self->stream_.got_text()) return self->close();
    const auto bytes = self->incoming_.cdata();
    self->of_client_->receive_text({static_cast<const char*>(bytes.data()), bytes.size()});
    self->incoming_.consume(bytes.size());
    self->incoming_.shrink_to_fit();
    self->read();
  });
}

void WebSocketConnection::send_text(std::string message) {
  bool is_full = false;
  {
    const std::scoped_lock lock(mutex_);
    queued_bytes_ += message.size();
    is_full = queued_bytes_ > max_queued_bytes_;
    if (!is_full) texts_.push_back(std::move(message));
  }
  boost::asio::post(stream_.get_executor(), [self = shared_from_this(), is_full] {
    if (is_full) return self->close();
    self->write();
  });
}

void WebSocketConnection::send_picture(int stream, std::int64_t request,
                                       std::vector<std::byte> message) {
  {
    const std::scoped_lock lock(mutex_);
    pictures_.push(stream, request, std::move(message));
  }
  boost::asio::post(stream_.get_executor(), [self = shared_from_this()] { self->write(); });
}

std::int64_t WebSocketConnection::pictures_dropped() const {
  const std::scoped_lock lock(mutex_);
  return pictures_.dropped();
}

std::optional<WebSocketConnection::Message> WebSocketConnection::next_message() {
  const std::scoped_lock lock(mutex_);
  std::optional<Message> message;
  if (!texts_.empty()) {
    queued_bytes_ -= texts_.front().size();
    message = std::move(texts_.front());
    texts_.pop_front();
  } else if (std::optional<std::vector<std::byte>> picture = pictures_.pop()) {
    message = std::move(*picture);
  }
  return message;
}

void WebSocketConnection::write() {
  if (is_writing_ || is_closed_) return;
  std::optional<Message> message = next_message();
  if (!message) return;
  sending_ = std::move(*message);
  boost::asio::const_buffer bytes;
  if (const auto* text = std::get_if<std::string>(&sending_)) {
    bytes = boost::asio::buffer(*text);
    stream_.text(true);
  } else {
    bytes = boost::asio::buffer(std::get<std::vector<std::byte>>(sending_));
    stream_.binary(true);
  }
  is_writing_ = true;
  stream_.async_write(bytes, [self = shared_from_this()](beast::error_code error, std::size_t) {
    self->is_writing_ = false;
    self->sending_ = {};
    if (error) return self->close();
    self->write();
  });
}

void WebSocketConnection::close() {
  if (std::exchange(is_closed_, true)) return;
  {
    const std::scoped_lock lock(mutex_);
    texts_.clear();
    pictures_.clear();
  }
  of_client_.reset();
  beast::get_lowest_layer(stream_).close();  // cancels the operations under way
}

}  // namespace raystage::replay
