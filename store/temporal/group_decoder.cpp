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
#include "sandbox/machine_limits.h"
#include "store/temporal/group_requests.h"

namespace raystage::store {
namespace {

constexpr const char* kAdvice = "Run `raystage verify` on the take, then repair it from a copy";

std::uint64_t pixels_of(GroupDecoder::Size size) {
  return static_cast<std::uint64_t>(std::max(size.width, 64)) *
         static_cast<std::uint64_t>(std::max(size.height, 64));
}

/// Up to 17 reference pictures and their motion of 16 bytes a pixel, and JPEGs of up to 6 bytes.
/// More than ten times what a core of 2020 takes for a frame.
sandbox::DecoderOptions group_decoder_options(std::uint64_t pixels, std::uint64_t frames) {
  constexpr std::uint64_t kStartSeconds = 60, kSecondsPerMegapixel = 2, kMegapixel = 1'000'000;
  const std::uint64_t bytes_per_pixel = 17 * 16 + 6 * frames;
  sandbox::DecoderOptions options;
  options.program = "raystage-decode-group";
  options.kind = "group of frames";
  options.advice = kAdvice;
  options.memory_bytes = (std::uint64_t{256} << 20) + kMaxGroupBytes + bytes_per_pixel * pixels;
  options.result_bytes = (std::uint64_t{16} << 20) + 6 * frames * pixels;
  options.time = std::chrono::seconds(kStartSeconds +
                                      (pixels * frames / kMegapixel + 1) * kSecondsPerMegapixel);
  return sandbox::within_machine(std::move(options));
}

}  // namespace

struct GroupDecoder::State {
  // By the pixels and frames that they accept, rounded up to powers of two.
  std::map<std::pair<std::uint64_t, std::uint64_t>, sandbox::DecoderPool> decoders;
  std::mutex mutex;

  const sandbox::DecoderPool& decoders_for(std::uint64_t pixels, std::size_t frames) {
    const std::pair most{std::bit_ceil(pixels), std::bit_ceil(std::uint64_t{frames})};
    const std::scoped_lock lock(mutex);
    return decoders.try_emplace(most, group_decoder_options(most.first, most.second)).first->second;
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
  const std::vector<std::byte> answer = state_->decoders_for(pixels_of(size), frames.size())
                                            .decode(request.take(), file, [](const std::string&) {
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
