// SPDX-License-Identifier: Apache-2.0
// raystage-decode-exr, in lib/raystage: decodes EXR files for its parent process, see sandbox/.
// Reasons why a file is refused are part of the result: they come with an advice.
#include <cmath>
#include <optional>

#include "images/exr_decoding.h"
#include "images/exr_requests.h"
#include "sandbox/answer.h"
#include "sandbox/decoder_main.h"

namespace {

using namespace raystage;
using namespace raystage::images;

void answer(const ExrRequest& request, sandbox::ByteWriter& result) {
  std::vector<ExrChannel> channels;
  for (std::size_t i = 0; i < request.names.size(); ++i) {
    const float fallback = request.fallbacks[i];
    channels.push_back(
        {request.names[i].c_str(), std::isnan(fallback) ? std::nullopt : std::optional(fallback)});
  }
  switch (request.question) {
    case ExrQuestion::kChannels:
      return write_channel_data(result,
                                decode_exr_channels(request.file, channels, request.what_to_do));
    case ExrQuestion::kView:
      return write_channel_data(
          result, decode_exr_view(request.file, request.view, channels, request.what_to_do));
    case ExrQuestion::kSize:
      return result.write(decode_exr_size(request.file, channels, request.what_to_do));
    case ExrQuestion::kHasChannels:
      return result.write(std::uint8_t{decode_has_channels(request.file, channels, request.view)});
    case ExrQuestion::kInspection:
      return write_inspection(result, decode_exr_inspection(request.file));
  }
}

std::vector<std::byte> answer_bytes(std::span<const std::byte> bytes) {
  sandbox::ByteReader reader(bytes);
  const ExrRequest request = read_request(reader);
  return sandbox::answer_or_error([&](sandbox::ByteWriter& result) { answer(request, result); });
}

}  // namespace

int main(int argc, char** argv) { return sandbox::decoder_main(argc, argv, answer_bytes); }
