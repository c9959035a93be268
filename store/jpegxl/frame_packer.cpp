// SPDX-License-Identifier: Apache-2.0
// Runs libjxl in decoders' processes. What a process returns is checked here: the fixity is that of
// the JPEG which went in, a packed frame is unpacked by a second request and compared.
#include "store/jpegxl/frame_packer.h"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <map>
#include <mutex>

#include "base/error.h"
#include "base/posix_file.h"
#include "sandbox/byte_encoding.h"
#include "sandbox/decoder_pool.h"
#include "store/jpegxl/packed_frame.h"
#include "store/jpegxl/transcoding_requests.h"

namespace raystage::store {
namespace {

constexpr const char* kAdvice = "Run `raystage verify --decode` on the take, then repair it";

/// Most memory that libjxl takes for a picture, bytes: coefficients of three components, 4 bytes
/// each, as encoder and decoder hold them twice, context maps and histograms.
std::uint64_t memory_for(std::uint64_t pixels) {
  constexpr std::uint64_t kBytesPerPixel = 64, kOther = std::uint64_t{128} << 20;
  return kOther + kBytesPerPixel * pixels;
}

sandbox::DecoderOptions transcoder_options(std::uint64_t pixels) {
  sandbox::DecoderOptions options;
  options.program = "raystage-transcode-jpeg";
  options.kind = "packed frame";
  options.advice = kAdvice;
  options.memory_bytes = memory_for(pixels);
  options.result_bytes = std::uint64_t{kMaxFrameBytes} + 4096;
  options.time = std::chrono::seconds(60);
  return options;
}

std::uint64_t pixels_of(FramePacker::Size size) {
  return static_cast<std::uint64_t>(std::max(size.width, 1)) *
         static_cast<std::uint64_t>(std::max(size.height, 1));
}

}  // namespace

struct FramePacker::State {
  // By the pixels that they accept, rounded up to a power of two: cameras of about one size share
  // their processes.
  std::map<std::uint64_t, sandbox::DecoderPool> decoders;
  std::mutex mutex;

  const sandbox::DecoderPool& decoders_for(std::uint64_t pixels) {
    const std::uint64_t most = std::bit_ceil(pixels);
    const std::scoped_lock lock(mutex);
    return decoders.try_emplace(most, transcoder_options(most)).first->second;
  }

  /// `parameter`: effort or size.
  template <class Parameter>
  std::vector<std::byte> ask(TranscodingRequest kind, Size size, Parameter parameter,
                             std::span<const std::byte> file, const std::filesystem::path& name) {
    const std::uint64_t pixels = pixels_of(size);
    sandbox::ByteWriter request;
    request.write(static_cast<std::uint8_t>(kind));
    request.write(pixels);
    request.write(parameter);
    request.append(file);
    return decoders_for(pixels).decode(request.take(), name, [](const std::string&) {
      return FileDescriptor(-1);  // it needs no file
    });
  }
};

FramePacker::FramePacker() : state_(std::make_unique<State>()) {}
FramePacker::~FramePacker() = default;
FramePacker::FramePacker(FramePacker&&) noexcept = default;
FramePacker& FramePacker::operator=(FramePacker&&) noexcept = default;

FramePacker::Packed FramePacker::pack(std::span<const std::byte> jpeg, Size size, int effort,
                                      const std::filesystem::path& file) const {
  if (jpeg.empty() || jpeg.size() > kMaxFrameBytes) return {{}, "it has more than 256 MiB"};
  try {
    const auto container =
        state_->ask(TranscodingRequest::kPack, size, static_cast<std::uint8_t>(effort), jpeg, file);
    std::vector<std::byte> packed = add_jpeg_fixity(container, fixity_of(jpeg));
    if (packed.size() >= jpeg.size()) return {{}, "it does not get smaller"};
    const std::vector<std::byte> again = unpack(packed, size, file);
    if (!std::ranges::equal(again, jpeg)) return {{}, "it does not return bit for bit"};
    return {std::move(packed), {}};
  } catch (const Error& error) {
    if (error.exit_code() != ExitCode::kBadInput) throw;
    return {{}, error.what_happened()};
  }
}

std::vector<std::byte> FramePacker::unpack(std::span<const std::byte> packed, Size size,
                                           const std::filesystem::path& file) const {
  const auto refuse = [&](const std::string& what) {
    return Error::bad_input("the packed frame cannot be read: " + what, file.string(), kAdvice);
  };
  const auto stated = read_jpeg_fixity(packed);
  if (!stated) throw refuse("it does not begin as one");
  std::vector<std::byte> jpeg =
      state_->ask(TranscodingRequest::kUnpack, size, std::uint64_t{stated->size}, packed, file);
  if (fixity_of(jpeg) != *stated) throw refuse("its JPEG is not the recorded one: wrong XXH3");
  return jpeg;
}

}  // namespace raystage::store
