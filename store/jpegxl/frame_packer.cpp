// SPDX-License-Identifier: Apache-2.0
// Runs libjxl in decoders' processes. What a process returns is checked here: the fixity is that of
// the JPEG which went in, a packed frame is unpacked by a second request and compared.
#include "store/jpegxl/frame_packer.h"

#include <algorithm>
#include <bit>
#include <compare>
#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <utility>

#include "base/error.h"
#include "base/posix_file.h"
#include "sandbox/byte_encoding.h"
#include "sandbox/decoder_pool.h"
#include "sandbox/machine_limits.h"
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

/// The effort by which unpacking is limited: it takes no longer than packing at any up to this one.
constexpr int kUnpackEffort = 7;

/// Requests that may be answered by the same processes.
struct Group {
  TranscodingRequest kind;
  std::uint64_t pixels;  ///< at most
  std::chrono::seconds time;
  auto operator<=>(const Group&) const = default;
};

sandbox::DecoderOptions transcoder_options(const Group& group) {
  sandbox::DecoderOptions options;
  options.program = "raystage-transcode-jpeg";
  const bool is_packing = group.kind == TranscodingRequest::kPack;
  options.kind = is_packing ? "frame" : "packed frame";
  options.advice = kAdvice;
  options.memory_bytes = memory_for(group.pixels);
  options.result_bytes = std::uint64_t{kMaxFrameBytes} + 4096;
  options.time = group.time;
  return sandbox::within_machine(std::move(options));
}

/// Returns why a frame cannot be packed. The decoder's error says that it "cannot be read".
std::string refusal_of(const Error& error) {
  const std::string& what = error.what_happened();
  const std::size_t colon = what.find(": ");
  return "it cannot be packed: " + (colon == std::string::npos ? what : what.substr(colon + 2));
}

std::uint64_t pixels_of(FramePacker::Size size) {
  return static_cast<std::uint64_t>(std::max(size.width, 1)) *
         static_cast<std::uint64_t>(std::max(size.height, 1));
}

}  // namespace

struct FramePacker::State {
  std::map<Group, sandbox::DecoderPool> decoders;
  std::mutex mutex;
  std::optional<std::chrono::seconds> limit;

  const sandbox::DecoderPool& decoders_for(TranscodingRequest kind, std::uint64_t pixels,
                                           int effort) {
    // Rounded up: cameras of about one size share their processes.
    const std::uint64_t most = std::bit_ceil(pixels);
    const Group group{kind, most, limit.value_or(time_limit(most, effort))};
    const std::scoped_lock lock(mutex);
    return decoders.try_emplace(group, transcoder_options(group)).first->second;
  }

  /// `parameter`: effort or size.
  template <class Parameter>
  std::vector<std::byte> ask(TranscodingRequest kind, Size size, int effort, Parameter parameter,
                             std::span<const std::byte> file, const std::filesystem::path& name) {
    const std::uint64_t pixels = pixels_of(size);
    sandbox::ByteWriter request;
    request.write(static_cast<std::uint8_t>(kind));
    request.write(pixels);
    request.write(parameter);
    request.append(file);
    return decoders_for(kind, pixels, effort).decode(request.take(), name, [](const std::string&) {
      return FileDescriptor(-1);  // it needs no file
    });
  }
};

FramePacker::FramePacker() : state_(std::make_unique<State>()) {}
FramePacker::FramePacker(std::chrono::seconds limit) : FramePacker() { state_->limit = limit; }
FramePacker::~FramePacker() = default;
FramePacker::FramePacker(FramePacker&&) noexcept = default;
FramePacker& FramePacker::operator=(FramePacker&&) noexcept = default;

std::chrono::seconds FramePacker::time_limit(std::uint64_t pixels, int effort) {
  // More than ten times what two cores of 2020 take for a JPEG of 1 byte a pixel.
  constexpr std::uint64_t kStart = 60, kPerMegapixel = 4, kPerMegapixelOf8 = 8,
                          kPerMegapixelOf9 = 80, kMegapixel = 1'000'000;
  const std::uint64_t each = effort >= 9   ? kPerMegapixelOf9
                             : effort == 8 ? kPerMegapixelOf8
                                           : kPerMegapixel;
  return std::chrono::seconds(kStart + (pixels / kMegapixel + 1) * each);
}

FramePacker::Packed FramePacker::pack(std::span<const std::byte> jpeg, Size size, int effort,
                                      const std::filesystem::path& file) const {
  if (jpeg.empty() || jpeg.size() > kMaxFrameBytes) return {{}, "it has more than 256 MiB"};
  try {
    const auto container = state_->ask(TranscodingRequest::kPack, size, effort,
                                       static_cast<std::uint8_t>(effort), jpeg, file);
    std::vector<std::byte> packed = add_jpeg_fixity(container, fixity_of(jpeg));
    if (packed.size() >= jpeg.size()) return {{}, "it does not get smaller"};
    const std::vector<std::byte> again = unpack(packed, size, file);
    if (!std::ranges::equal(again, jpeg)) return {{}, "it does not return bit for bit"};
    return {std::move(packed), {}};
  } catch (const Error& error) {
    if (error.exit_code() != ExitCode::kBadInput) throw;
    return {{}, refusal_of(error)};
  }
}

std::vector<std::byte> FramePacker::unpack(std::span<const std::byte> packed, Size size,
                                           const std::filesystem::path& file) const {
  const auto refuse = [&](const std::string& what) {
    return Error::bad_input("the packed frame cannot be read: " + what, file.string(), kAdvice);
  };
  const auto stated = read_jpeg_fixity(packed);
  if (!stated) throw refuse("it does not begin as one");
  std::vector<std::byte> jpeg = state_->ask(TranscodingRequest::kUnpack, size, kUnpackEffort,
                                            std::uint64_t{stated->size}, packed, file);
  if (fixity_of(jpeg) != *stated) throw refuse("its JPEG is not the recorded one: wrong XXH3");
  return jpeg;
}

}  // namespace raystage::store
