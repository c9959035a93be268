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

void write_next(MovieDecoder& movie, sandbox::ByteWriter& answer) {
  MovieFrame frame;
  const bool is_there = movie.next(frame);
  const MovieFrameKind kind = !is_there            ? MovieFrameKind::kNone
                              : frame.jpeg.empty() ? MovieFrameKind::kImage
                                                   : MovieFrameKind::kJpeg;
  answer.write(static_cast<std::uint8_t>(kind));
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
        answer.write(movie->frame_rate());
        return;
      }
      if (!movie) throw std::runtime_error("it is not open");  // the decoder has crashed before
      write_next(*movie, answer);
    });
  });
}
