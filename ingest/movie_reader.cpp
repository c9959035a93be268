// SPDX-License-Identifier: Apache-2.0
#include "ingest/movie_reader.h"

#include <algorithm>
#include <utility>

#include "base/error.h"
#include "base/resources.h"
#include "sandbox/answer.h"

namespace raystage::ingest {
namespace {

constexpr const char* kKind = "movie";

sandbox::DecoderOptions movie_decoder_options() {
  sandbox::DecoderOptions options;
  options.program = "raystage-decode-movie";
  options.kind = kKind;
  options.advice = "Repair the movie, or convert it with ffmpeg";
  options.memory_bytes = std::min<std::size_t>(std::size_t{4} << 30, available_memory());
  options.result_bytes = std::size_t{1} << 30;
  options.time = std::chrono::seconds(30);
  return options;
}

}  // namespace

MovieReader::MovieReader(std::filesystem::path file)
    : file_(std::move(file)), decoder_(movie_decoder_options()) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(file_, error)) {
    throw Error::bad_input(std::filesystem::exists(file_, error)
                               ? "the movie cannot be read: it is not a regular file"
                               : "the movie cannot be read: No such file or directory",
                           file_.string(), "Check that the file exists and is a movie");
  }
  constexpr double kLargestRate = 1e6;
  format_ =
      sandbox::read_answer(ask(MovieRequest::kOpen), kKind, file_, [](sandbox::ByteReader& reader) {
        MovieFormat format;
        reader.read(format.frame_rate);
        if (!(format.frame_rate > 0 && format.frame_rate <= kLargestRate)) format.frame_rate = 0;
        reader.read(format.bits);
        const auto transfer = reader.read<std::uint8_t>();
        using Transfer = schemas::PixelEncoding::Transfer;
        sandbox::ByteReader::require(transfer <= static_cast<std::uint8_t>(Transfer::kHlg));
        format.transfer = static_cast<Transfer>(transfer);
        format.has_bt2020_primaries = reader.read_flag();
        return format;
      });
}

std::vector<std::byte> MovieReader::ask(MovieRequest request) {
  sandbox::ByteWriter writer;
  writer.write(static_cast<std::uint8_t>(request));
  writer.write_plain(file_.string());
  return decoder_.decode(writer.take(), file_, sandbox::only_file(file_));
}

bool MovieReader::next(MovieFrame& frame, bool is_deep) {
  frame.jpeg.clear();
  return sandbox::read_answer(
      ask(is_deep ? MovieRequest::kNextDeep : MovieRequest::kNext), kKind, file_,
      [&](sandbox::ByteReader& reader) {
        const auto kind = static_cast<MovieFrameKind>(reader.read<std::uint8_t>());
        if (kind == MovieFrameKind::kNone) return false;
        if (kind == MovieFrameKind::kJpeg) {
          reader.read_plain(frame.jpeg);
          sandbox::ByteReader::require(!frame.jpeg.empty());
          return true;
        }
        const auto require_size = [](int width, int height, std::size_t values) {
          constexpr int kMaxSide = 1 << 16;
          sandbox::ByteReader::require(width > 0 && width <= kMaxSide && height > 0 &&
                                       height <= kMaxSide &&
                                       values == std::size_t{3} * static_cast<std::size_t>(width) *
                                                     static_cast<std::size_t>(height));
        };
        sandbox::ByteReader::require(kind ==
                                     (is_deep ? MovieFrameKind::kDeep : MovieFrameKind::kImage));
        if (is_deep) {
          reader.read(frame.deep.width);
          reader.read(frame.deep.height);
          reader.read_plain(frame.deep.samples);
          require_size(frame.deep.width, frame.deep.height, frame.deep.samples.size());
          return true;
        }
        reader.read(frame.image.width);
        reader.read(frame.image.height);
        reader.read_plain(frame.image.values);
        require_size(frame.image.width, frame.image.height, frame.image.values.size());
        return true;
      });
}

int MovieReader::skip_rest() {
  MovieFrame frame;
  int frames = 0;
  while (next(frame)) ++frames;
  return frames;
}

}  // namespace raystage::ingest
