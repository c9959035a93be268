// SPDX-License-Identifier: Apache-2.0
// raystage-decode-movie, in lib/raystage: decodes a movie for its parent process, see sandbox/.
#include <memory>
#include <stdexcept>
#include <string>

#include "ingest/movie_decoding.h"
#include "sandbox/answer.h"
#include "sandbox/decoder_main.h"

namespace {

using namespace raystage;
using namespace raystage::ingest;

void write_format(const MovieFormat& format, sandbox::ByteWriter& answer) {
  answer.write(format.frame_rate);
  answer.write(format.bits);
  answer.write(static_cast<std::uint8_t>(format.transfer));
  answer.write(static_cast<std::uint8_t>(format.has_bt2020_primaries));
}

void write_next(MovieDecoder& movie, bool is_deep, sandbox::ByteWriter& answer) {
  MovieFrame frame;
  const bool is_there = movie.next(frame, is_deep);
  const MovieFrameKind kind = !is_there             ? MovieFrameKind::kNone
                              : !frame.jpeg.empty() ? MovieFrameKind::kJpeg
                              : is_deep             ? MovieFrameKind::kDeep
                                                    : MovieFrameKind::kImage;
  answer.write(static_cast<std::uint8_t>(kind));
  if (kind == MovieFrameKind::kDeep) {
    answer.write(frame.deep.width);
    answer.write(frame.deep.height);
    answer.write_plain(frame.deep.samples);
    return;
  }
  if (kind == MovieFrameKind::kJpeg) answer.write_plain(frame.jpeg);
  if (kind != MovieFrameKind::kImage) return;
  answer.write(frame.image.width);
  answer.write(frame.image.height);
  answer.write_plain(frame.image.values);
}

}  // namespace

int main(int argc, char** argv) {
  std::unique_ptr<MovieDecoder> movie;
  return sandbox::decoder_main(argc, argv, [&](std::span<const std::byte> request) {
    sandbox::ByteReader reader(request);
    const auto asked = static_cast<MovieRequest>(reader.read<std::uint8_t>());
    std::string file;
    reader.read_plain(file);
    return sandbox::answer_or_error([&](sandbox::ByteWriter& answer) {
      if (asked == MovieRequest::kOpen) {
        movie = std::make_unique<MovieDecoder>(file);
        write_format(movie->format(), answer);
        return;
      }
      if (!movie) throw std::runtime_error("it is not open");  // the decoder has crashed before
      write_next(*movie, asked == MovieRequest::kNextDeep, answer);
    });
  });
}
