// SPDX-License-Identifier: Apache-2.0
// raystage-transcode-jpeg, in lib/raystage: recompresses JPEG to JPEG XL and back, and encodes and
// decodes pictures of more than 8 bits, for its parent process, see sandbox/.
#include <cstdint>
#include <stdexcept>

#include "sandbox/byte_encoding.h"
#include "sandbox/decoder_main.h"
#include "store/jpegxl/picture_coding.h"
#include "store/jpegxl/picture_requests.h"
#include "store/jpegxl/transcoding.h"
#include "store/jpegxl/transcoding_requests.h"

namespace {

using namespace raystage;
using namespace raystage::store;

std::vector<std::byte> answer(std::span<const std::byte> request) {
  sandbox::ByteReader reader(request);
  const auto kind = static_cast<TranscodingRequest>(reader.read<std::uint8_t>());
  const auto max_pixels = reader.read<std::uint64_t>();
  if (kind == TranscodingRequest::kPack) {
    const int effort = reader.read<std::uint8_t>();
    return transcode_jpeg(reader.read_rest(), effort);
  }
  if (kind == TranscodingRequest::kEncodePicture) {
    const schemas::PixelEncoding encoding = read_encoding(reader);
    PictureCompression compression;
    reader.read(compression.distance);
    compression.effort = reader.read<std::uint8_t>();
    return encode_picture(read_picture(reader), encoding, compression);
  }
  if (kind == TranscodingRequest::kDecodePicture) {
    sandbox::ByteWriter result;
    write_coded_picture(result, decode_picture(reader.read_rest(), max_pixels));
    return result.take();
  }
  if (kind != TranscodingRequest::kUnpack) throw std::runtime_error("the request is not known");
  const auto size = reader.read<std::uint64_t>();
  return reconstruct_jpeg(reader.read_rest(), static_cast<std::size_t>(size), max_pixels);
}

}  // namespace

int main(int argc, char** argv) { return sandbox::decoder_main(argc, argv, answer); }
