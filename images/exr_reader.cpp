// SPDX-License-Identifier: Apache-2.0
#include "images/exr_reader.h"

#include <limits>

#include "base/error.h"
#include "base/resources.h"
#include "images/exr_requests.h"
#include "sandbox/answer.h"

namespace raystage::images {
namespace {

constexpr const char* kKind = "EXR file";
constexpr float kRequired = std::numeric_limits<float>::quiet_NaN();

sandbox::DecoderOptions exr_decoder_options() {
  sandbox::DecoderOptions options;
  options.program = "raystage-decode-exr";
  options.kind = kKind;
  options.advice = "Save it again";
  options.time = std::chrono::seconds(60);
  return options;
}

/// For reading pixels that need up to `memory_bytes`.
sandbox::DecoderOptions pixel_decoder_options(std::size_t memory_bytes) {
  constexpr std::size_t kOther = std::size_t{64} << 20;
  sandbox::DecoderOptions options = exr_decoder_options();
  // Pixels of data and display window, and the result that holds them.
  options.memory_bytes = kOther + 3 * memory_bytes;
  options.result_bytes = memory_bytes + (std::size_t{1} << 20);
  return options;
}

/// For reading headers and compressed pixels, chunk by chunk.
sandbox::DecoderOptions inspector_options() {
  sandbox::DecoderOptions options = exr_decoder_options();
  options.memory_bytes = std::size_t{512} << 20;
  options.result_bytes = std::size_t{1} << 20;
  return options;
}

void require_file(const std::filesystem::path& file, const std::string& what_to_do) {
  std::error_code error;
  if (std::filesystem::is_regular_file(file, error)) return;
  throw Error::bad_input(std::filesystem::exists(file, error)
                             ? "the EXR file cannot be read: it is not a regular file"
                             : "the EXR file cannot be read: No such file or directory",
                         file.string(), what_to_do);
}

}  // namespace

struct ExrReader::Request {
  ExrQuestion question;
  const std::filesystem::path& file;
  std::span<const ExrChannel> channels;
  std::string what_to_do, view = {};
};

ExrReader::ExrReader(std::size_t memory_bytes)
    : decoders_(pixel_decoder_options(memory_bytes > 0 ? memory_bytes : available_memory() / 2)),
      inspectors_(inspector_options()) {}

std::vector<std::byte> ExrReader::decode(const sandbox::DecoderPool& decoders,
                                         const Request& request) const {
  require_file(request.file, request.what_to_do);
  ExrRequest asked{
      request.question, request.file.string(), request.view, request.what_to_do, {}, {}};
  for (const ExrChannel& channel : request.channels) {
    asked.names.emplace_back(channel.name);
    asked.fallbacks.push_back(channel.fallback.value_or(kRequired));
  }
  sandbox::ByteWriter writer;
  write_request(writer, asked);
  return decoders.decode(writer.take(), request.file, sandbox::only_file(request.file));
}

ExrChannelData ExrReader::read(const std::filesystem::path& file,
                               std::span<const ExrChannel> channels,
                               const std::string& what_to_do) const {
  const auto result = decode(decoders_, {ExrQuestion::kChannels, file, channels, what_to_do});
  return sandbox::read_answer(result, kKind, file, [&](sandbox::ByteReader& reader) {
    return read_channel_data(reader, channels.size());
  });
}

ExrChannelData ExrReader::read_view(const std::filesystem::path& file, const std::string& view,
                                    std::span<const ExrChannel> channels,
                                    const std::string& what_to_do) const {
  const auto result = decode(decoders_, {ExrQuestion::kView, file, channels, what_to_do, view});
  return sandbox::read_answer(result, kKind, file, [&](sandbox::ByteReader& reader) {
    return read_channel_data(reader, channels.size());
  });
}

std::array<int, 2> ExrReader::size(const std::filesystem::path& file,
                                   std::span<const ExrChannel> channels,
                                   const std::string& what_to_do) const {
  const auto result = decode(decoders_, {ExrQuestion::kSize, file, channels, what_to_do});
  return sandbox::read_answer(result, kKind, file, [](sandbox::ByteReader& reader) {
    std::array<int, 2> size{};
    reader.read(size);
    sandbox::ByteReader::require(size[0] > 0 && size[1] > 0);
    return size;
  });
}

bool ExrReader::has_channels(const std::filesystem::path& file,
                             std::span<const ExrChannel> channels, const std::string& view) const {
  const auto result = decode(decoders_, {ExrQuestion::kHasChannels, file, channels,
                                         "Give an EXR file, or render it again", view});
  return sandbox::read_answer(result, kKind, file,
                              [](sandbox::ByteReader& reader) { return reader.read_flag(); });
}

ExrInspection ExrReader::inspect(const std::filesystem::path& file) const {
  const auto result =
      decode(inspectors_, {ExrQuestion::kInspection, file, {}, "Render the frame again"});
  return sandbox::read_answer(result, kKind, file, read_inspection);
}

ExrChannelData read_exr_channels(const std::filesystem::path& file,
                                 std::span<const ExrChannel> channels,
                                 const std::string& what_to_do) {
  return ExrReader().read(file, channels, what_to_do);
}

}  // namespace raystage::images
