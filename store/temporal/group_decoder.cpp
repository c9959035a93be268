// SPDX-License-Identifier: Apache-2.0
// Asks raystage-decode-group for the pictures of a group, and checks the shape of its answer.
#include "store/temporal/group_decoder.h"

#include <algorithm>
#include <bit>
#include <map>
#include <mutex>
#include <string>
#include <utility>

#include "base/error.h"
#include "base/posix_file.h"
#include "sandbox/byte_encoding.h"
#include "sandbox/decoder_pool.h"
#include "store/temporal/group_requests.h"

namespace raystage::store {
namespace {

constexpr const char* kAdvice = "Run `raystage verify` on the take, then repair it from a copy";

std::uint64_t pixels_of(GroupDecoder::Size size) {
  return static_cast<std::uint64_t>(std::max(size.width, 64)) *
         static_cast<std::uint64_t>(std::max(size.height, 64));
}

/// Up to 17 reference pictures and their motion of 16 bytes a pixel, and JPEGs of up to 6 bytes.
sandbox::DecoderOptions group_decoder_options(std::uint64_t pixels) {
  constexpr std::uint64_t kBytesPerPixel = 17 * 16 + 6 * kMaxGroupFrames;
  sandbox::DecoderOptions options;
  options.program = "raystage-decode-group";
  options.kind = "group of frames";
  options.advice = kAdvice;
  options.memory_bytes = (std::uint64_t{256} << 20) + kBytesPerPixel * pixels;
  options.result_bytes = (std::uint64_t{16} << 20) + 6 * kMaxGroupFrames * pixels;
  options.time = std::chrono::seconds(120);
  return options;
}

}  // namespace

struct GroupDecoder::State {
  // By the pixels that they accept, rounded up to a power of two.
  std::map<std::uint64_t, sandbox::DecoderPool> decoders;
  std::mutex mutex;

  const sandbox::DecoderPool& decoders_for(std::uint64_t pixels) {
    const std::uint64_t most = std::bit_ceil(pixels);
    const std::scoped_lock lock(mutex);
    return decoders.try_emplace(most, group_decoder_options(most)).first->second;
  }
};

GroupDecoder::GroupDecoder() : state_(std::make_unique<State>()) {}
GroupDecoder::~GroupDecoder() = default;
GroupDecoder::GroupDecoder(GroupDecoder&&) noexcept = default;
GroupDecoder& GroupDecoder::operator=(GroupDecoder&&) noexcept = default;

std::vector<std::vector<std::byte>> GroupDecoder::decode(
    VideoCodec codec, Size size, std::span<const std::span<const std::byte>> frames,
    const std::filesystem::path& file) const {
  sandbox::ByteWriter request;
  request.write(static_cast<std::uint8_t>(codec));
  request.write(std::int32_t{size.width});
  request.write(std::int32_t{size.height});
  request.write(static_cast<std::uint32_t>(frames.size()));
  for (const std::span<const std::byte> frame : frames) request.write_plain(frame);
  const std::vector<std::byte> answer =
      state_->decoders_for(pixels_of(size)).decode(request.take(), file, [](const std::string&) {
        return FileDescriptor(-1);  // it needs no file
      });
  std::vector<std::vector<std::byte>> jpegs(frames.size());
  try {
    sandbox::ByteReader reader(answer);
    for (std::vector<std::byte>& jpeg : jpegs) {
      reader.read_plain(jpeg);
      sandbox::ByteReader::require(!jpeg.empty());
    }
    sandbox::ByteReader::require(reader.is_at_end());
  } catch (const std::runtime_error& error) {
    throw Error::bad_input(std::string("the group of frames cannot be read: ") + error.what(),
                           file.string(), kAdvice);
  }
  return jpegs;
}

}  // namespace raystage::store
