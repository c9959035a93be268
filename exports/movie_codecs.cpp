// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <stdexcept>
#include <utility>

#include "base/error.h"
#include "compose/preview/movie_writer.h"
#include "exports/matroska_movie.h"
#include "exports/movie_codec.h"
#include "exports/picture_encoder.h"

namespace raystage::exports {
namespace {

Nanoseconds frame_duration(const MovieDescription& description) {
  if (!description.rate) return description.typical_duration;
  return kNanosecondsPerSecond * description.rate->denominator / description.rate->numerator;
}

MatroskaDescription one_track(const MovieDescription& description) {
  MatroskaTrack track{description.name, description.width, description.height};
  if (description.rate) track.default_duration = frame_duration(description);
  MatroskaDescription result;
  result.title = description.name;
  result.epoch_utc = description.epoch_utc;
  result.tracks.push_back(std::move(track));
  return result;
}

class CopiedMov : public MovieFile {
 public:
  CopiedMov(const std::filesystem::path& file, const MovieDescription& description)
      : muxer_(file, description, nullptr) {}
  void append(std::span<const std::byte> jpeg, const store::RgbImage* /*picture*/,
              Nanoseconds time) override {
    muxer_.append(jpeg, time);
  }
  void close() override { muxer_.close(); }

 private:
  MovMuxer muxer_;
};

class CopiedMatroska : public MovieFile {
 public:
  CopiedMatroska(const std::filesystem::path& file, const MovieDescription& description)
      : movie_(file, one_track(description)) {}
  void append(std::span<const std::byte> jpeg, const store::RgbImage* /*picture*/,
              Nanoseconds time) override {
    movie_.append(0, time, jpeg);
  }
  void close() override { movie_.close(); }

 private:
  MatroskaMovie movie_;
};

class ProResMov : public MovieFile {
 public:
  ProResMov(const std::filesystem::path& file, const MovieDescription& description)
      : encoder_(IntraCodec::kProRes, description.width, description.height, file.string()),
        muxer_(file, description, &encoder_) {}
  void append(std::span<const std::byte> /*jpeg*/, const store::RgbImage* picture,
              Nanoseconds time) override {
    muxer_.append(encoder_.encode(*picture), time);
  }
  void close() override { muxer_.close(); }

 private:
  PictureEncoder encoder_;
  MovMuxer muxer_;
};

class Ffv1Matroska : public MovieFile {
 public:
  Ffv1Matroska(const std::filesystem::path& file, const MovieDescription& description)
      : encoder_(IntraCodec::kFfv1, description.width, description.height, file.string()),
        movie_(file, ffv1_track(description)) {}
  void append(std::span<const std::byte> /*jpeg*/, const store::RgbImage* picture,
              Nanoseconds time) override {
    movie_.append(0, time, encoder_.encode(*picture));
  }
  void close() override { movie_.close(); }

 private:
  MatroskaDescription ffv1_track(const MovieDescription& description) const {
    MatroskaDescription result = one_track(description);
    result.tracks.front().codec_id = "V_FFV1";
    result.tracks.front().codec_private = encoder_.extra_data();
    return result;
  }

  PictureEncoder encoder_;
  MatroskaMovie movie_;
};

class H264Movie : public MovieFile {
 public:
  H264Movie(const std::filesystem::path& file, const MovieDescription& description)
      : writer_(file, {.width = description.width,
                       .height = description.height,
                       .fps_numerator = description.rate->numerator,
                       .fps_denominator = description.rate->denominator}) {}
  void append(std::span<const std::byte> /*jpeg*/, const store::RgbImage* picture,
              Nanoseconds /*time*/) override {
    writer_.append(*picture);
  }
  void close() override { writer_.close(); }

 private:
  compose::MovieWriter writer_;
};

class CopyCodec : public MovieCodec {
 public:
  std::string_view name() const override { return "copy"; }
  std::string_view description() const override {
    return "the JPEG frames as they are, byte for byte (MJPEG), in .mov (times in 1 us) or .mkv "
           "(1 ns)";
  }
  std::vector<std::string> extensions() const override { return {".mov", ".mkv"}; }
  bool copies_jpeg() const override { return true; }
  double estimated_bytes(double source_bytes, double /*pixels*/) const override {
    return source_bytes;
  }
  std::unique_ptr<MovieFile> create(const std::filesystem::path& file,
                                    const MovieDescription& description) const override {
    if (movie_extension(*this, file) == ".mkv") {
      return std::make_unique<CopiedMatroska>(file, description);
    }
    return std::make_unique<CopiedMov>(file, description);
  }
};

class ProResCodec : public MovieCodec {
 public:
  std::string_view name() const override { return "prores"; }
  std::string_view description() const override {
    return "ProRes 422 HQ, 10 bits, Rec.709, in .mov (times in 1 us)";
  }
  std::vector<std::string> extensions() const override { return {".mov"}; }
  double estimated_bytes(double /*source_bytes*/, double pixels) const override {
    constexpr double kBytesPerPixel = 0.55;  // 220 Mbit/s at 1920x1080, 24 frames/s
    return kBytesPerPixel * pixels;
  }
  std::unique_ptr<MovieFile> create(const std::filesystem::path& file,
                                    const MovieDescription& description) const override {
    movie_extension(*this, file);
    return std::make_unique<ProResMov>(file, description);
  }
};

class Ffv1Codec : public MovieCodec {
 public:
  std::string_view name() const override { return "ffv1"; }
  std::string_view description() const override {
    return "FFV1 version 3, the decoded RGB codes without loss, in .mkv (times in 1 ns)";
  }
  std::vector<std::string> extensions() const override { return {".mkv"}; }
  double estimated_bytes(double /*source_bytes*/, double pixels) const override {
    constexpr double kBytesPerPixel = 1.5;  // half of three codes
    return kBytesPerPixel * pixels;
  }
  std::unique_ptr<MovieFile> create(const std::filesystem::path& file,
                                    const MovieDescription& description) const override {
    movie_extension(*this, file);
    return std::make_unique<Ffv1Matroska>(file, description);
  }
};

class H264Codec : public MovieCodec {
 public:
  std::string_view name() const override { return "h264"; }
  std::string_view description() const override {
    return "H.264, CRF 18, 4:2:0 (MPEG-4 without libx264), in .mp4, .mov or .mkv; constant times "
           "only";
  }
  std::vector<std::string> extensions() const override { return {".mp4", ".mov", ".mkv"}; }
  bool has_exact_times() const override { return false; }
  double estimated_bytes(double /*source_bytes*/, double pixels) const override {
    constexpr double kBytesPerPixel = 0.05;
    return kBytesPerPixel * pixels;
  }
  std::unique_ptr<MovieFile> create(const std::filesystem::path& file,
                                    const MovieDescription& description) const override {
    movie_extension(*this, file);
    if (!description.rate) {
      throw Error::bad_input("H.264 movies have constant times only", file.string(),
                             "Choose constant times or another codec")
          .concerning({"times"});
    }
    return std::make_unique<H264Movie>(file, description);
  }
};

}  // namespace

std::span<const MovieCodec* const> movie_codecs() {
  static const CopyCodec kCopy;
  static const ProResCodec kProRes;
  static const Ffv1Codec kFfv1;
  static const H264Codec kH264;
  static const std::array<const MovieCodec*, 4> kCodecs{&kCopy, &kProRes, &kFfv1, &kH264};
  return kCodecs;
}

const MovieCodec& movie_codec(std::string_view name) {
  for (const MovieCodec* codec : movie_codecs()) {
    if (codec->name() == name) return *codec;
  }
  throw std::logic_error("there is no movie codec of this name: " + std::string(name));
}

std::string movie_extension(const MovieCodec& codec, const std::filesystem::path& file) {
  const std::string extension = file.extension().string();
  const std::vector<std::string> known = codec.extensions();
  if (std::ranges::find(known, extension) != known.end()) return extension;
  std::string list;
  for (const std::string& name : known) list += (list.empty() ? "" : ", ") + name;
  throw Error::bad_input(
      "the codec " + std::string(codec.name()) + " has no container \"" + extension + "\"",
      file.string(), "Use " + list);
}

}  // namespace raystage::exports
