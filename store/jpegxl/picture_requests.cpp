// SPDX-License-Identifier: Apache-2.0
#include "store/jpegxl/picture_requests.h"

#include <cmath>
#include <cstring>

namespace raystage::store {
namespace {

using schemas::PixelEncoding;

constexpr int kMaxSide = 65535;

PixelEncoding::Samples read_samples(sandbox::ByteReader& reader) {
  const auto samples = reader.read<std::uint8_t>();
  sandbox::ByteReader::require(samples <=
                               static_cast<std::uint8_t>(PixelEncoding::Samples::kInteger));
  return static_cast<PixelEncoding::Samples>(samples);
}

int read_bits(sandbox::ByteReader& reader) {
  const int bits = reader.read<std::uint8_t>();
  sandbox::ByteReader::require(bits >= PixelEncoding::kMinBits && bits <= PixelEncoding::kMaxBits);
  return bits;
}

}  // namespace

void write_encoding(sandbox::ByteWriter& writer, const PixelEncoding& encoding) {
  writer.write(static_cast<std::uint8_t>(encoding.samples));
  writer.write(static_cast<std::uint8_t>(encoding.bits));
  writer.write(static_cast<std::uint8_t>(encoding.transfer));
  writer.write(static_cast<std::uint8_t>(encoding.chromaticities ? 1 : 0));
  if (encoding.chromaticities) writer.write(*encoding.chromaticities);
  writer.write(encoding.peak);
}

PixelEncoding read_encoding(sandbox::ByteReader& reader) {
  PixelEncoding encoding;
  encoding.samples = read_samples(reader);
  encoding.bits = read_bits(reader);
  const auto transfer = reader.read<std::uint8_t>();
  sandbox::ByteReader::require(transfer <=
                               static_cast<std::uint8_t>(PixelEncoding::Transfer::kHlg));
  encoding.transfer = static_cast<PixelEncoding::Transfer>(transfer);
  if (reader.read_flag()) {
    auto& chromaticities = encoding.chromaticities.emplace();
    reader.read(chromaticities);
    for (const double value : chromaticities) sandbox::ByteReader::require(std::isfinite(value));
  }
  reader.read(encoding.peak);
  sandbox::ByteReader::require(std::isfinite(encoding.peak) && encoding.peak > 0);
  return encoding;
}

void write_picture(sandbox::ByteWriter& writer, const DeepPicture& picture) {
  writer.write(picture.width);
  writer.write(picture.height);
  writer.append(std::as_bytes(std::span(picture.samples)));
}

DeepPicture read_picture(sandbox::ByteReader& reader) {
  DeepPicture picture;
  reader.read(picture.width);
  reader.read(picture.height);
  sandbox::ByteReader::require(picture.width > 0 && picture.width <= kMaxSide &&
                               picture.height > 0 && picture.height <= kMaxSide);
  const std::span<const std::byte> bytes = reader.read_rest();
  const std::size_t count = std::size_t{3} * static_cast<std::size_t>(picture.width) *
                            static_cast<std::size_t>(picture.height);
  sandbox::ByteReader::require(bytes.size() == count * sizeof(std::uint16_t));
  picture.samples.resize(count);
  std::memcpy(picture.samples.data(), bytes.data(), bytes.size());
  return picture;
}

void write_coded_picture(sandbox::ByteWriter& writer, const CodedPicture& coded) {
  writer.write(static_cast<std::uint8_t>(coded.samples));
  writer.write(static_cast<std::uint8_t>(coded.bits));
  write_picture(writer, coded.picture);
}

CodedPicture read_coded_picture(sandbox::ByteReader& reader) {
  CodedPicture coded;
  coded.samples = read_samples(reader);
  coded.bits = read_bits(reader);
  coded.picture = read_picture(reader);
  return coded;
}

}  // namespace raystage::store
