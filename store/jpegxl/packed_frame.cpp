// SPDX-License-Identifier: Apache-2.0
// The bytes of a packed frame: a JPEG XL container (ISO/IEC 18181-2) whose third box, of type
// "uuid", holds size and XXH3-64 of the JPEG, both little-endian. Its place is fixed, so that the
// hash of a frame is read without the frame. Decoders of JPEG XL skip boxes that they do not know.
#include "store/jpegxl/packed_frame.h"

#include <xxhash.h>

#include <algorithm>
#include <array>

#include "base/error.h"
#include "base/little_endian.h"

namespace raystage::store {
namespace {

// Signature box and file type box: these 32 bytes begin every container that libjxl writes.
constexpr std::array<unsigned char, 32> kContainerStart{
    0,   0,   0,   0x0C, 'J', 'X', 'L', ' ', 0x0D, 0x0A, 0x87, 0x0A, 0,   0,   0,   0x14,
    'f', 't', 'y', 'p',  'j', 'x', 'l', ' ', 0,    0,    0,    0,    'j', 'x', 'l', ' '};
constexpr std::size_t kSignatureBytes = 12;

// The box: its size (big-endian, as all of ISO/IEC 14496-12), "uuid", and our UUID.
constexpr std::array<unsigned char, 24> kFixityBox{0,    0,    0,    40,   'u',  'u',  'i',  'd',
                                                   0x5b, 0x0c, 0x8e, 0x8d, 0x0e, 0x2d, 0x4c, 0x59,
                                                   0x9a, 0x6b, 0x72, 0x61, 0x79, 0x73, 0x74, 0x67};
constexpr std::size_t kFixityAt = kContainerStart.size();
constexpr std::size_t kHashAt = kFixityAt + kFixityBox.size(), kSizeAt = kHashAt + 8,
                      kReservedAt = kSizeAt + 4;
static_assert(kReservedAt + 4 == kPackedHeaderBytes);

template <std::size_t kSize>
bool has_at(std::span<const std::byte> bytes, std::size_t at,
            const std::array<unsigned char, kSize>& expected, std::size_t count = kSize) {
  return bytes.size() >= at + count &&
         std::ranges::equal(bytes.subspan(at, count),
                            std::as_bytes(std::span(expected)).first(count));
}

}  // namespace

JpegFixity fixity_of(std::span<const std::byte> jpeg) {
  return {static_cast<std::uint32_t>(jpeg.size()), XXH3_64bits(jpeg.data(), jpeg.size())};
}

bool is_jpeg_xl(std::span<const std::byte> bytes) {
  return has_at(bytes, 0, kContainerStart, kSignatureBytes);
}

std::vector<std::byte> add_jpeg_fixity(std::span<const std::byte> container,
                                       const JpegFixity& fixity) {
  if (!has_at(container, 0, kContainerStart)) {
    throw Error::bad_input("the JPEG XL container does not begin as expected", "",
                           "Report this with the version of libjxl");
  }
  std::vector<std::byte> packed(kPackedHeaderBytes);
  std::ranges::copy(std::as_bytes(std::span(kContainerStart)), packed.begin());
  std::ranges::copy(std::as_bytes(std::span(kFixityBox)), packed.begin() + kFixityAt);
  store_little_endian(packed, kHashAt, fixity.xxh3);
  store_little_endian(packed, kSizeAt, fixity.size);
  const auto rest = container.subspan(kContainerStart.size());
  packed.insert(packed.end(), rest.begin(), rest.end());
  return packed;
}

std::optional<JpegFixity> read_jpeg_fixity(std::span<const std::byte> packed) {
  if (packed.size() < kPackedHeaderBytes || !has_at(packed, 0, kContainerStart) ||
      !has_at(packed, kFixityAt, kFixityBox) ||
      load_little_endian<std::uint32_t>(packed, kReservedAt) != 0) {
    return std::nullopt;
  }
  const JpegFixity fixity{load_little_endian<std::uint32_t>(packed, kSizeAt),
                          load_little_endian<std::uint64_t>(packed, kHashAt)};
  if (fixity.size == 0 || fixity.size > kMaxFrameBytes) return std::nullopt;
  return fixity;
}

}  // namespace raystage::store
