// SPDX-License-Identifier: Apache-2.0
#include "store/packing/sequence_encoder.h"

#include <cmath>
#include <iterator>
#include <string>
#include <utility>

#include "base/error.h"
#include "base/stopwatch.h"
#include "store/jpegxl/packed_frame.h"

namespace raystage::store {

SequenceEncoder::SequenceEncoder(const Take& take, std::filesystem::path folder,
                                 const VideoSettings& video, bool keeps_decoded,
                                 std::stop_token stop)
    : take_(take),
      folder_(std::move(folder)),
      video_(video),
      keeps_decoded_(keeps_decoded),
      stop_(std::move(stop)) {}

void SequenceEncoder::require_not_stopped() const {
  if (!stop_.stop_requested()) return;
  throw Error::failed("packing was stopped", folder_.string(), "Start it again; no files remain");
}

FrameBytes SequenceEncoder::jpeg_of(const FrameRef& frame) const {
  return take_.archive(frame.camera).jpeg(frame.frame);
}

Planes SequenceEncoder::planes_of(const FrameRef& frame, const FrameBytes& jpeg,
                                  ChromaStep chroma) const {
  const ArchiveWriter::Description& camera = take_.archive(frame.camera).description();
  return planes_of_jpeg(
      jpeg, camera.width, camera.height,
      "frame " + std::to_string(frame.frame) + " of camera \"" + camera.camera_id + "\"", chroma);
}

void SequenceEncoder::encode(Sequence& sequence) const {
  const Stopwatch encoding;
  make_frames(sequence);
  encode_us_ += std::llround(encoding.seconds() * 1e6);
  const Stopwatch decoding;
  compare(sequence);
  decode_us_ += std::llround(decoding.seconds() * 1e6);
}

void SequenceEncoder::make_frames(Sequence& sequence) const {
  VideoEncoder encoder(video_);
  std::vector<JpegFixity> sources;
  for (const FrameRef& frame : sequence.frames) {
    require_not_stopped();
    const FrameBytes jpeg = jpeg_of(frame);
    if (sources.empty() && can_encode_444(video_.codec)) {
      sequence.chroma = chroma_of_jpeg(jpeg, "the first frame of a sequence");
    }
    sources.push_back(fixity_of(jpeg));
    encoder.push(planes_of(frame, jpeg, sequence.chroma));
  }
  FrameLink link;
  for (const VideoPacket& packet : encoder.finish()) {
    const std::size_t i = sequence.stored.size();
    if (packet.is_key) link = {};
    if (link.position >= kMaxGroupFrames) {
      throw Error::failed("the encoder made a group of too many frames", folder_.string(),
                          "Use shorter groups");
    }
    link.source_bytes = sources[i].size;
    link.source_xxh3 = sources[i].xxh3;
    sequence.stored.push_back(make_temporal_frame(video_.codec, link, packet.bytes));
    ++link.position;
    link.previous = hash_of_stored(sequence.stored.back());
  }
}

void SequenceEncoder::compare(Sequence& sequence) const {
  const std::vector<std::vector<std::byte>>& stored = sequence.stored;
  for (std::size_t begin = 0; begin < stored.size();) {
    require_not_stopped();
    std::vector<std::span<const std::byte>> group{stored[begin]};
    while (begin + group.size() < stored.size() && !is_key_frame(stored[begin + group.size()])) {
      group.emplace_back(stored[begin + group.size()]);
    }
    const ArchiveWriter::Description& camera =
        take_.archive(sequence.frames[begin].camera).description();
    auto jpegs = decoder_.decode(video_.codec, {camera.width, camera.height}, group, folder_);
    for (std::size_t i = 0; i < jpegs.size(); ++i) {
      const Planes decoded =
          planes_of_jpeg(jpegs[i], camera.width, camera.height, "a decoded frame", sequence.chroma);
      const FrameRef& frame = sequence.frames[begin + i];
      const Planes source = planes_of(frame, jpeg_of(frame), sequence.chroma);
      sequence.errors.push_back(mean_square_error(source, decoded, camera.width, camera.height));
    }
    begin += group.size();
    if (keeps_decoded_) std::ranges::move(jpegs, std::back_inserter(sequence.decoded));
  }
}

}  // namespace raystage::store
