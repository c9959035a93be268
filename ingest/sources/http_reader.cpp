// SPDX-License-Identifier: Apache-2.0
#include "ingest/sources/http_reader.h"

#include <fmt/format.h>

extern "C" {
#include <libavutil/avstring.h>
#include <libavutil/opt.h>
}

#include <new>
#include <utility>

#include "base/error.h"
#include "ingest/sources/configuration_error.h"

namespace raystage::ingest {

HttpReader::HttpReader(const FfmpegAddress& address, FfmpegOptions& options,
                       std::function<bool()> stop)
    : where_(address.display_url),
      limits_{address.may_redirect, address.may_redirect ? options.value("protocol_whitelist")
                                                         : std::string("http,https")},
      options_(options, where_),
      url_(address.url, where_),
      transfer_(options_, std::move(stop), where_) {
  const char* protocol = url_.is_secure() ? "https" : "http";
  if (av_match_list(protocol, limits_.protocols.c_str(), ',') <= 0) {
    throw ConfigurationError(
        Error::bad_input(fmt::format("the option protocol_whitelist lacks \"{}\"", protocol),
                         where_, "Add it to the option"));
  }
  if (!open(0)) {
    throw Error::failed("no data arrived in time", where_,
                        "Check the address, and that the camera is switched on and sends");
  }
  constexpr int kHttpBytes = 1 << 16;  // as much as libcurl receives at once
  auto* buffer = static_cast<unsigned char*>(av_malloc(kHttpBytes));
  context_ = buffer == nullptr
                 ? nullptr
                 : avio_alloc_context(buffer, kHttpBytes, 0, this, read, nullptr, seek);
  if (context_ == nullptr) {
    av_free(buffer);
    throw std::bad_alloc();
  }
  // Demuxers ask the context for the option "mime_type".
  static const AVClass with_child = [] {
    AVClass made{};
    made.class_name = "raystage http context";
    made.item_name = av_default_item_name;
    made.version = LIBAVUTIL_VERSION_INT;
    made.child_next = next_child;
    return made;
  }();
  context_->av_class = &with_child;
  const bool seekable = options_->seekable < 0 ? answer_.has_ranges : options_->seekable > 0;
  context_->seekable = seekable ? AVIO_SEEKABLE_NORMAL : 0;
}

HttpReader::~HttpReader() {
  av_freep(&context_->buffer);
  avio_context_free(&context_);
}

void HttpReader::rethrow_failure() const {
  if (failure_) std::rethrow_exception(failure_);
}

std::string HttpReader::failure() const {
  try {
    rethrow_failure();
    return "";
  } catch (const Error& error) {
    return error.what_happened();
  } catch (const std::exception& error) {
    return error.what();
  }
}

/// Asks for the data from byte `from`, and follows redirections within the limits. Returns false if
/// no answer came in time.
bool HttpReader::open(std::int64_t from) {
  is_open_ = false;
  for (int redirections = 0;; ++redirections) {
    std::optional<HttpTransfer::Answer> answer = transfer_.start(url_, trusted_, from);
    if (!answer) return false;
    if (answer->redirects_to.empty()) {
      if (answer->start != from) {
        throw Error::bad_input("the server sends another part than was asked for", where_,
                               "Set the option seekable of the source to 0");
      }
      answer_ = std::move(*answer);
      break;
    }
    HttpUrl next = url_.redirected(answer->redirects_to, limits_, where_);
    if (redirections >= options_->max_redirects) {
      throw Error::bad_input(
          fmt::format("the camera redirects more than {} times", options_->max_redirects), where_,
          "Give the address to which it leads");
    }
    trusted_ = trusted_ && url_.shares_secrets_with(next);
    url_ = std::move(next);
  }
  options_.set_answer(answer_.mime_type, url_.text());
  position_ = from;
  is_open_ = true;
  return true;
}

int HttpReader::read(void* opaque, std::uint8_t* buffer, int size) {
  auto& self = *static_cast<HttpReader*>(opaque);
  if (!self.is_open_) return self.failure_ ? AVERROR(EIO) : AVERROR_EOF;
  const int count = self.transfer_.read(buffer, size);
  if (count > 0) self.position_ += count;
  return count;
}

std::int64_t HttpReader::seek(void* opaque, std::int64_t offset, int whence) {
  auto& self = *static_cast<HttpReader*>(opaque);
  try {
    return self.seek_to(offset, whence & ~AVSEEK_FORCE);
  } catch (const std::bad_alloc&) {
    return AVERROR(ENOMEM);
  } catch (...) {
    self.failure_ = std::current_exception();
    return AVERROR(EIO);
  }
}

std::int64_t HttpReader::seek_to(std::int64_t offset, int whence) {
  if (whence == AVSEEK_SIZE) return answer_.size ? *answer_.size : AVERROR(ENOSYS);
  if (whence == SEEK_CUR) offset += position_;
  if (whence == SEEK_END) {
    if (!answer_.size) return AVERROR(ENOSYS);
    offset += *answer_.size;
  }
  if (offset < 0) return AVERROR(EINVAL);
  if (offset == position_ && is_open_) return offset;
  if (context_->seekable == 0) return AVERROR(ENOSYS);
  if (answer_.size && offset > *answer_.size) return AVERROR(EINVAL);
  const std::optional<std::int64_t> size = answer_.size;
  if (offset == size) {  // nothing to ask for
    position_ = offset;
    is_open_ = false;
    return offset;
  }
  return open(offset) ? offset : AVERROR_EXIT;
}

void* HttpReader::next_child(void* context, void* previous) {
  if (previous != nullptr) return nullptr;
  return static_cast<HttpReader*>(static_cast<AVIOContext*>(context)->opaque)->options_.object();
}

}  // namespace raystage::ingest
