// SPDX-License-Identifier: Apache-2.0
// Decodes any bytes as a picture of more than 8 bits: as what raystage-transcode-jpeg is asked and
// answers (our own form), and as a JPEG XL file by libjxl. What is read has the number of samples
// that its size states, and comes back the same.
#include <cstdint>
#include <cstdlib>
#include <exception>
#include <span>
#include <stdexcept>

#include "sandbox/byte_encoding.h"
#include "store/jpegxl/picture_coding.h"
#include "store/jpegxl/picture_requests.h"

namespace {

using namespace raystage;
using namespace raystage::store;
constexpr std::uint64_t kMaxPixels = 64 * 64;

bool has_its_samples(const DeepPicture& picture) {
  return picture.width > 0 && picture.height > 0 &&
         picture.samples.size() == std::size_t{3} * static_cast<std::size_t>(picture.width) *
                                       static_cast<std::size_t>(picture.height);
}

void read_answer(std::span<const std::byte> bytes) {
  sandbox::ByteReader reader(bytes);
  const CodedPicture coded = read_coded_picture(reader);
  if (!has_its_samples(coded.picture)) std::abort();
  sandbox::ByteWriter writer;
  write_coded_picture(writer, coded);
  const std::vector<std::byte> again = writer.take();
  sandbox::ByteReader second(again);
  if (read_coded_picture(second).picture != coded.picture) std::abort();
}

void read_request(std::span<const std::byte> bytes) {
  sandbox::ByteReader reader(bytes);
  const schemas::PixelEncoding encoding = read_encoding(reader);
  if (encoding.bits < schemas::PixelEncoding::kMinBits ||
      encoding.bits > schemas::PixelEncoding::kMaxBits) {
    std::abort();
  }
  if (!has_its_samples(read_picture(reader))) std::abort();
}

void read_file(std::span<const std::byte> bytes) {
  const CodedPicture coded = decode_picture(bytes, kMaxPixels);
  const auto pixels = static_cast<std::uint64_t>(coded.picture.width) *
                      static_cast<std::uint64_t>(coded.picture.height);
  if (!has_its_samples(coded.picture) || pixels > kMaxPixels) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::span bytes(reinterpret_cast<const std::byte*>(data), size);
  for (const auto& read : {read_answer, read_request, read_file}) {
    try {
      read(bytes);
    } catch (const std::exception&) {  // refused
    }
  }
  return 0;
}
