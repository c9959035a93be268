// SPDX-License-Identifier: Apache-2.0
#include "images/exr_requests.h"

#include <algorithm>

namespace raystage::images {

void write_request(sandbox::ByteWriter& writer, const ExrRequest& request) {
  writer.write(static_cast<std::uint8_t>(request.question));
  writer.write_plain(request.file);
  writer.write_plain(request.view);
  writer.write_plain(request.what_to_do);
  writer.write(std::uint64_t{request.names.size()});
  for (const std::string& name : request.names) writer.write_plain(name);
  writer.write_plain(request.fallbacks);
}

ExrRequest read_request(sandbox::ByteReader& reader) {
  ExrRequest request;
  request.question = static_cast<ExrQuestion>(reader.read<std::uint8_t>());
  reader.read_plain(request.file);
  reader.read_plain(request.view);
  reader.read_plain(request.what_to_do);
  request.names.resize(reader.read_count(sizeof(std::uint64_t)));
  for (std::string& name : request.names) reader.read_plain(name);
  reader.read_plain(request.fallbacks);
  sandbox::ByteReader::require(request.fallbacks.size() == request.names.size());
  return request;
}

void write_channel_data(sandbox::ByteWriter& writer, const ExrChannelData& data) {
  for (const int number : {data.width, data.height, data.fps_numerator, data.fps_denominator}) {
    writer.write(number);
  }
  writer.write_plain(data.time_code);
  writer.write_plain(data.color_interop_id);
  writer.write_plain(data.color_space);
  writer.write(std::uint8_t{data.is_equirectangular});
  writer.write(std::uint8_t{data.chromaticities.has_value()});
  if (data.chromaticities) writer.write(*data.chromaticities);
  writer.write_plain(data.values);
}

ExrChannelData read_channel_data(sandbox::ByteReader& reader, std::size_t channels) {
  constexpr std::int64_t kMaxPixels = std::int64_t{1} << 29;
  constexpr std::size_t kMaxText = 1000;
  ExrChannelData data;
  for (int* number : {&data.width, &data.height, &data.fps_numerator, &data.fps_denominator}) {
    reader.read(*number);
  }
  for (std::string* text : {&data.time_code, &data.color_interop_id, &data.color_space}) {
    reader.read_plain(*text);
    text->resize(std::min(text->size(), kMaxText));
  }
  data.is_equirectangular = reader.read_flag();
  if (reader.read_flag()) reader.read(data.chromaticities.emplace());
  reader.read_plain(data.values);
  const std::int64_t pixels = std::int64_t{data.width} * data.height;
  sandbox::ByteReader::require(data.width > 0 && data.height > 0 && pixels <= kMaxPixels &&
                               data.values.size() == static_cast<std::size_t>(pixels) * channels &&
                               data.fps_numerator >= 0 && data.fps_denominator >= 0 &&
                               (data.fps_numerator > 0) == (data.fps_denominator > 0));
  return data;
}

void write_inspection(sandbox::ByteWriter& writer, const ExrInspection& inspection) {
  writer.write(std::uint8_t{inspection.is_complete});
  writer.write_plain(inspection.fingerprint);
  writer.write(inspection.covered_share);
  writer.write(std::uint64_t{inspection.rotten_cameras.size()});
  for (const std::string& camera : inspection.rotten_cameras) writer.write_plain(camera);
}

ExrInspection read_inspection(sandbox::ByteReader& reader) {
  constexpr std::size_t kMaxCameras = 10'000, kMaxText = 1000;
  ExrInspection inspection;
  inspection.is_complete = reader.read_flag();
  reader.read_plain(inspection.fingerprint);
  reader.read(inspection.covered_share);
  inspection.rotten_cameras.resize(reader.read_count(sizeof(std::uint64_t)));
  for (std::string& camera : inspection.rotten_cameras) {
    reader.read_plain(camera);
    sandbox::ByteReader::require(camera.size() <= kMaxText);
  }
  sandbox::ByteReader::require(inspection.fingerprint.size() <= kMaxText &&
                               inspection.rotten_cameras.size() <= kMaxCameras &&
                               inspection.covered_share >= 0 && inspection.covered_share <= 1);
  return inspection;
}

}  // namespace raystage::images
