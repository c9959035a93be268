// SPDX-License-Identifier: Apache-2.0
#include "ingest/sources/pipe_reader.h"

#include <fcntl.h>
#include <poll.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <utility>

#include "base/error.h"
#include "ingest/sources/configuration_error.h"

namespace raystage::ingest {
namespace {

int open_pipe(const std::string& url) {
  if (url.starts_with("file:")) {
    // Opens without a writer: read() waits for its data.
    return ::open(url.c_str() + 5, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  }
  int number = 0;
  const std::string digits = url.substr(url.find(':') + 1);
  if (!digits.empty()) {
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), number);
    if (error != std::errc{} || end != digits.data() + digits.size() || number < 0) {
      errno = EINVAL;
      return -1;
    }
  }
  return fcntl(number, F_DUPFD_CLOEXEC, 0);
}

}  // namespace

PipeReader::PipeReader(const std::string& url, std::function<bool()> stop)
    : stop_(std::move(stop)), descriptor_(open_pipe(url)) {
  if (descriptor_ < 0) {
    throw ConfigurationError(
        Error::bad_input("the pipe cannot be opened", url,
                         "Set \"pipe:0\" for standard input, or the path of a named pipe"));
  }
  constexpr int kBytes = 1 << 16;
  auto* buffer = static_cast<unsigned char*>(av_malloc(kBytes));
  context_ = buffer == nullptr
                 ? nullptr
                 : avio_alloc_context(buffer, kBytes, 0, this, read, nullptr, nullptr);
  if (context_ == nullptr) {
    av_free(buffer);
    close(descriptor_);
    throw std::bad_alloc();
  }
}

PipeReader::~PipeReader() {
  av_freep(&context_->buffer);
  avio_context_free(&context_);
  close(descriptor_);
}

int PipeReader::read(void* opaque, std::uint8_t* buffer, int size) {
  auto& self = *static_cast<PipeReader*>(opaque);
  constexpr int kPollMilliseconds = 100;
  while (!self.stop_()) {
    pollfd waiting{self.descriptor_, POLLIN, 0};
    const int ready = poll(&waiting, 1, kPollMilliseconds);
    if (ready == 0 || (ready < 0 && errno == EINTR)) continue;
    if (ready < 0) return AVERROR(errno);
    const ssize_t count = ::read(self.descriptor_, buffer, static_cast<std::size_t>(size));
    if (count > 0) return static_cast<int>(count);
    if (count == 0) return AVERROR_EOF;
    if (errno != EAGAIN && errno != EINTR) return AVERROR(errno);
  }
  return AVERROR_EXIT;
}

}  // namespace raystage::ingest
