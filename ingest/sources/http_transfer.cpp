// SPDX-License-Identifier: Apache-2.0
#include "ingest/sources/http_transfer.h"

#include <fmt/format.h>
#include <strings.h>
#include <sys/socket.h>

#include <algorithm>
#include <charconv>
#include <cstring>
#include <new>
#include <string_view>
#include <system_error>
#include <utility>

#include "base/error.h"
#include "ingest/sources/libcurl.h"

namespace raystage::ingest {
namespace {

constexpr std::size_t kMaxHeaderBytes = 1 << 16;  // of all answers until the data, and after them
constexpr long kReceiveBytes = 1 << 18;
constexpr std::size_t kMaxWaiting = 1 << 18;
constexpr int kHttpPollMilliseconds = 100;

bool is_error(int status) { return status >= 400; }

bool is_redirection(int status) { return status >= 300 && status < 400; }

template <typename Value>
void set(CURL* easy, CURLoption option, Value value) {
  const CURLcode code = libcurl().easy_setopt(easy, option, value);
  if (code == CURLE_OUT_OF_MEMORY) throw std::bad_alloc();
  if (code != CURLE_OK) {
    throw Error::failed(
        fmt::format("libcurl lacks what is needed: {}", libcurl().easy_strerror(code)), "",
        "Install the package libcurl4 again");
  }
}

/// Reads the digits at the start of `text`.
std::optional<std::int64_t> byte_count(std::string_view text) {
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end == text.data() || value < 0) return std::nullopt;
  return value;
}

/// Reads "bytes FIRST-LAST/SIZE" or "bytes FIRST-LAST/*".
bool parse_range(std::string_view text, HttpTransfer::Answer& answer) {
  if (!text.starts_with("bytes ")) return false;
  text.remove_prefix(6);
  const std::optional<std::int64_t> first = byte_count(text);
  if (!first) return false;
  answer.start = *first;
  const std::size_t slash = text.find('/');
  answer.size = slash == text.npos ? std::nullopt : byte_count(text.substr(slash + 1));
  return true;
}

template <typename Function>
void for_each_line(const char* text, Function&& function) {
  std::string_view rest = text == nullptr ? "" : text;
  while (!rest.empty()) {
    const std::size_t end = std::min(rest.find('\n'), rest.size());
    std::string_view line = rest.substr(0, end);
    rest.remove_prefix(std::min(end + 1, rest.size()));
    while (!line.empty() && (line.back() == '\r' || line.back() == ' ')) line.remove_suffix(1);
    if (!line.empty()) function(std::string(line));
  }
}

}  // namespace

void HttpTransfer::EasyDeleter::operator()(void* easy) const { libcurl().easy_cleanup(easy); }
void HttpTransfer::MultiDeleter::operator()(void* multi) const { libcurl().multi_cleanup(multi); }
void HttpTransfer::ListDeleter::operator()(curl_slist* list) const {
  libcurl().slist_free_all(list);
}

HttpTransfer::HttpTransfer(const HttpOptions& options, std::function<bool()> stop,
                           std::string where)
    : options_(options), stop_(std::move(stop)), where_(std::move(where)) {
  multi_.reset(libcurl().multi_init());
  easy_.reset(libcurl().easy_init());
  if (!multi_ || !easy_) throw std::bad_alloc();
  error_text_.resize(CURL_ERROR_SIZE);
  waiting_.reserve(kMaxWaiting);
}

HttpTransfer::~HttpTransfer() { detach(); }

void HttpTransfer::detach() {
  if (attached_) libcurl().multi_remove_handle(multi_.get(), easy_.get());
  attached_ = false;
}

void HttpTransfer::configure(const HttpUrl& url, bool trusted, std::int64_t from) {
  CURL* easy = easy_.get();
  libcurl().easy_reset(easy);  // keeps cookies and connections
  set(easy, CURLOPT_CURLU, url.handle());
  set(easy, CURLOPT_PROTOCOLS_STR, "http,https");
  set(easy, CURLOPT_HTTP_VERSION, CURL_HTTP_VERSION_1_1);
  set(easy, CURLOPT_FOLLOWLOCATION, 0L);
  set(easy, CURLOPT_FAILONERROR, 1L);
  set(easy, CURLOPT_NOSIGNAL, 1L);
  set(easy, CURLOPT_QUICK_EXIT, 1L);  // does not wait for a name server
  set(easy, CURLOPT_BUFFERSIZE, kReceiveBytes);
  set(easy, CURLOPT_ERRORBUFFER, error_text_.data());
  set(easy, CURLOPT_HEADERFUNCTION, on_header);
  set(easy, CURLOPT_HEADERDATA, this);
  set(easy, CURLOPT_WRITEFUNCTION, on_data);
  set(easy, CURLOPT_WRITEDATA, this);
  set(easy, CURLOPT_SOCKOPTFUNCTION, on_socket);
  set(easy, CURLOPT_SOCKOPTDATA, this);
  set(easy, CURLOPT_SUPPRESS_CONNECT_HEADERS, 1L);
  // Empty: otherwise the environment's.
  set(easy, CURLOPT_PROXY, options_->http_proxy == nullptr ? "" : options_->http_proxy);
  set(easy, CURLOPT_USERAGENT, options_->user_agent);
  set(easy, CURLOPT_SSL_VERIFYPEER, static_cast<long>(options_->tls_verify));
  set(easy, CURLOPT_SSL_VERIFYHOST, options_->tls_verify != 0 ? 2L : 0L);
  if (options_->tls_verify == 0) {
    // Old cameras have short keys and old protocols, and anyone could be the server.
    set(easy, CURLOPT_SSLVERSION, static_cast<long>(CURL_SSLVERSION_TLSv1_0));
    set(easy, CURLOPT_SSL_CIPHER_LIST, "DEFAULT:@SECLEVEL=0");
  } else if (options_->ca_file != nullptr) {
    set(easy, CURLOPT_CAINFO, options_->ca_file);
    set(easy, CURLOPT_CAPATH, static_cast<const char*>(nullptr));
  }
  if (options_->seekable != 0 || from > 0) {
    // From the start, too: the answer says whether the server has ranges.
    set(easy, CURLOPT_RANGE, fmt::format("{}-", from).c_str());
  }
  if (!has_cookies_) {
    set(easy, CURLOPT_COOKIEFILE, "");  // cookies, in memory
    for_each_line(options_->cookies, [&](const std::string& cookie) {
      set(easy, CURLOPT_COOKIELIST, ("Set-Cookie: " + cookie).c_str());
    });
    has_cookies_ = true;
  }
  headers_.reset();
  if (trusted) {
    configure_secrets(url);
  } else {
    set(easy, CURLOPT_COOKIELIST, "ALL");  // forgets them
  }
}

void HttpTransfer::configure_secrets(const HttpUrl& url) {
  CURL* easy = easy_.get();
  for_each_line(options_->headers, [&](const std::string& line) {
    curl_slist* longer = libcurl().slist_append(headers_.get(), line.c_str());
    if (longer == nullptr) throw std::bad_alloc();
    if (longer != headers_.get()) {
      static_cast<void>(headers_.release());
      headers_.reset(longer);
    }
  });
  if (headers_) set(easy, CURLOPT_HTTPHEADER, headers_.get());
  if (options_->referer != nullptr) set(easy, CURLOPT_REFERER, options_->referer);
  if (options_->cert_file != nullptr) set(easy, CURLOPT_SSLCERT, options_->cert_file);
  if (options_->key_file != nullptr) set(easy, CURLOPT_SSLKEY, options_->key_file);
  if (url.user().empty() && url.password().empty()) return;
  set(easy, CURLOPT_USERNAME, url.user().c_str());
  set(easy, CURLOPT_PASSWORD, url.password().c_str());
  set(easy, CURLOPT_HTTPAUTH,
      static_cast<long>(options_->basic_at_once != 0 ? CURLAUTH_BASIC
                                                     : CURLAUTH_BASIC | CURLAUTH_DIGEST));
}

std::optional<HttpTransfer::Answer> HttpTransfer::start(const HttpUrl& url, bool trusted,
                                                        std::int64_t from) {
  detach();
  answer_.reset();
  refusal_ = nullptr;
  result_.reset();
  header_bytes_ = 0;
  paused_ = false;
  waiting_.clear();
  waiting_taken_ = 0;
  target_ = nullptr;
  target_size_ = target_filled_ = 0;
  error_text_[0] = '\0';
  configure(url, trusted, from);
  if (libcurl().multi_add_handle(multi_.get(), easy_.get()) != CURLM_OK) throw std::bad_alloc();
  attached_ = true;
  while (!answer_ && !refusal_ && !result_) {
    const int code = work();
    if (code == AVERROR_EXIT || code == AVERROR(ETIMEDOUT)) return std::nullopt;
  }
  if (refusal_) std::rethrow_exception(refusal_);
  if (answer_) return answer_;
  long status = 0;
  libcurl().easy_getinfo(easy_.get(), CURLINFO_RESPONSE_CODE, &status);
  if (*result_ == CURLE_HTTP_RETURNED_ERROR) {
    throw Error::bad_input(
        fmt::format("the source cannot be opened: the server answers {}", status), where_,
        status == 401 || status == 403 ? "Check the user name and password in the address"
                                       : "Check the address");
  }
  throw Error::bad_input("the source cannot be opened: " + failure(), where_,
                         "Check the address, and that the camera is switched on");
}

std::string HttpTransfer::failure() const {
  long number = 0;
  libcurl().easy_getinfo(easy_.get(), CURLINFO_OS_ERRNO, &number);
  if (*result_ == CURLE_COULDNT_CONNECT && number > 0) {
    return std::generic_category().message(static_cast<int>(number));
  }
  return error_text_[0] != '\0' ? error_text_.data()
                                : libcurl().easy_strerror(static_cast<CURLcode>(*result_));
}

int HttpTransfer::read(std::uint8_t* buffer, int size) {
  if (size <= 0) return AVERROR(EINVAL);
  if (stop_()) return AVERROR_EXIT;
  target_ = buffer;
  target_size_ = static_cast<std::size_t>(size);
  target_filled_ = 0;
  int count = take_waiting(buffer, size);
  if (count == 0 && paused_) {
    paused_ = false;
    libcurl().easy_pause(easy_.get(), CURLPAUSE_CONT);  // may call on_data()
  }
  int code = 0;
  while (count == 0 && target_filled_ == 0 && code == 0) {
    code = result_ ? error_code() : work();
  }
  if (count == 0) count = static_cast<int>(target_filled_);
  target_ = nullptr;
  target_size_ = target_filled_ = 0;
  return count > 0 ? count : code;
}

/// Waits until anything was received; returns 0, or a code of FFmpeg.
int HttpTransfer::work() {
  const std::int64_t timeout = options_->rw_timeout > 0 ? options_->rw_timeout : options_->timeout;
  const Clock::time_point give_up = Clock::now() + std::chrono::microseconds(timeout);
  const std::uint64_t before = received_;
  // Also asked where data come without a pause.
  if (stop_()) return AVERROR_EXIT;
  for (;;) {
    int running = 0;
    if (libcurl().multi_perform(multi_.get(), &running) != CURLM_OK) return AVERROR(EIO);
    int left = 0;
    while (const CURLMsg* message = libcurl().multi_info_read(multi_.get(), &left)) {
      if (message->msg == CURLMSG_DONE) result_ = message->data.result;
    }
    if (received_ != before || result_) return 0;
    if (stop_()) return AVERROR_EXIT;
    int milliseconds = kHttpPollMilliseconds;
    if (timeout > 0) {
      const auto remaining =
          std::chrono::ceil<std::chrono::milliseconds>(give_up - Clock::now()).count();
      if (remaining <= 0) return AVERROR(ETIMEDOUT);
      milliseconds = static_cast<int>(std::min<std::int64_t>(milliseconds, remaining));
    }
    if (libcurl().multi_poll(multi_.get(), nullptr, 0, milliseconds, nullptr) != CURLM_OK) {
      return AVERROR(EIO);
    }
  }
}

int HttpTransfer::error_code() const {
  if (*result_ == CURLE_OK) return AVERROR_EOF;
  if (*result_ == CURLE_OPERATION_TIMEDOUT) return AVERROR(ETIMEDOUT);
  long number = 0;
  libcurl().easy_getinfo(easy_.get(), CURLINFO_OS_ERRNO, &number);
  const bool by_system = *result_ == CURLE_RECV_ERROR && number > 0;
  return by_system ? AVERROR(static_cast<int>(number)) : AVERROR(EIO);
}

int HttpTransfer::take_waiting(std::uint8_t* buffer, int size) {
  const std::size_t count =
      std::min(waiting_.size() - waiting_taken_, static_cast<std::size_t>(size));
  if (count == 0) return 0;
  std::memcpy(buffer, waiting_.data() + waiting_taken_, count);
  waiting_taken_ += count;
  if (waiting_taken_ == waiting_.size()) {
    waiting_.clear();
    waiting_taken_ = 0;
  }
  return static_cast<int>(count);
}

std::size_t HttpTransfer::on_data(char* bytes, std::size_t unit, std::size_t count, void* self) {
  return static_cast<HttpTransfer*>(self)->accept(reinterpret_cast<const std::uint8_t*>(bytes),
                                                  unit * count);
}

std::size_t HttpTransfer::accept(const std::uint8_t* bytes, std::size_t count) {
  ++received_;
  const std::size_t direct = std::min(count, target_size_ - target_filled_);
  if (count - direct > kMaxWaiting - waiting_.size()) {
    paused_ = true;
    return CURL_WRITEFUNC_PAUSE;
  }
  if (direct > 0) std::memcpy(target_ + target_filled_, bytes, direct);
  target_filled_ += direct;
  waiting_.insert(waiting_.end(), bytes + direct, bytes + count);
  return count;
}

std::size_t HttpTransfer::on_header(char* text, std::size_t unit, std::size_t count, void* self) {
  auto& transfer = *static_cast<HttpTransfer*>(self);
  const std::size_t bytes = unit * count;
  ++transfer.received_;
  transfer.header_bytes_ += bytes;
  try {
    if (transfer.header_bytes_ > kMaxHeaderBytes) {
      throw Error::bad_input("the source cannot be opened: its headers do not end", transfer.where_,
                             "Check what answers at the address");
    }
    const std::string_view line(text, bytes);
    if ((line == "\r\n" || line == "\n") && !transfer.answer_) transfer.read_answer();
  } catch (...) {
    transfer.refusal_ = std::current_exception();
    return 0;
  }
  return bytes;
}

std::string HttpTransfer::header(const char* name) const {
  curl_header* found = nullptr;
  return libcurl().easy_header(easy_.get(), name, 0, CURLH_HEADER, -1, &found) == CURLHE_OK
             ? std::string(found->value)
             : std::string();
}

/// Reads the headers of an answer, at their end.
void HttpTransfer::read_answer() {
  long status = 0;
  libcurl().easy_getinfo(easy_.get(), CURLINFO_RESPONSE_CODE, &status);
  // libcurl answers a demand for a password, and reports other errors.
  if (status < 200 || is_error(static_cast<int>(status))) return;
  Answer answer;
  answer.redirects_to = header("Location");
  if (is_redirection(static_cast<int>(status))) {
    if (answer.redirects_to.empty()) {
      throw Error::bad_input(
          fmt::format("the source cannot be opened: the server answers {} without an address",
                      status),
          where_, "Check the address");
    }
    answer_ = std::move(answer);
    return;
  }
  answer.redirects_to.clear();
  // A few bytes would become many.
  for (const auto& [name, harmless] :
       {std::pair{"Content-Encoding", "identity"}, {"Transfer-Encoding", "chunked"}}) {
    curl_header* found = nullptr;
    for (std::size_t i = 0;
         libcurl().easy_header(easy_.get(), name, i, CURLH_HEADER, -1, &found) == CURLHE_OK; ++i) {
      if (strcasecmp(found->value, harmless) == 0 || strcasecmp(found->value, "identity") == 0) {
        continue;
      }
      throw Error::bad_input(fmt::format("the server compresses its data ({})", found->value),
                             where_, "Switch compression off in the camera or its server");
    }
  }
  answer.mime_type = header("Content-Type");
  if (status == 206) {
    answer.has_ranges = parse_range(header("Content-Range"), answer);
  } else {
    answer.size = byte_count(header("Content-Length"));
    answer.has_ranges = answer.size && header("Accept-Ranges").starts_with("bytes");
  }
  answer_ = std::move(answer);
}

int HttpTransfer::on_socket(void* self, int socket, int /*purpose*/) {
  const int bytes = (*static_cast<HttpTransfer*>(self)->options_).receive_buffer_size;
  if (bytes > 0) setsockopt(socket, SOL_SOCKET, SO_RCVBUF, &bytes, sizeof(bytes));
  return CURL_SOCKOPT_OK;
}

}  // namespace raystage::ingest
