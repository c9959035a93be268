// SPDX-License-Identifier: Apache-2.0
// Makes pictures from frames of one or more EXR sequences: of their colours, or of one channel in
// greys or false colours (depth: linear in inverse depth), side by side, with a wipe or as their
// difference. Input: scene-linear values; output: 8-bit R, G, B. Cost: linear in pixels.
#include "compose/preview/frame_pictures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>

#include "base/error.h"
#include "base/options.h"
#include "compose/preview/false_color.h"
#include "compose/sequence_name.h"
#include "images/exr_reader.h"
#include "images/resize.h"

namespace raystage::compose {
namespace {

constexpr const char* kDepth = "Z";
constexpr int kLineWidth = 2, kSequenceGap = 8;  // pixels
constexpr std::uint8_t kLine = 220, kGapColor = 38;

/// A channel that has a short name in previews.
struct NamedChannel {
  std::string_view name;
  std::array<const char*, 2> in_files;  ///< names in files: the first that a file has is read
  bool is_share;                        ///< from 0 to 1
};
constexpr std::array kNamedChannels{
    NamedChannel{"alpha", {"A", "A"}, true}, NamedChannel{"Z", {"Z", "depth.Z"}, false},
    NamedChannel{"coverage", {"coverage.V", "lf.coverage"}, true},
    NamedChannel{"confidence", {"confidence.V", "lf.confidence"}, true}};

const NamedChannel* named_channel(std::string_view name) {
  const auto* const found = std::ranges::find(kNamedChannels, name, &NamedChannel::name);
  return found == kNamedChannels.end() ? nullptr : found;
}

constexpr const char* kWhatToDo =
    "Give a channel of the files (`oiiotool --info -v FILE` lists them), or render it (the shot's "
    "output.aovs)";

/// Reads a channel, of a view if one is named.
images::ExrChannelData read_channel(const images::ExrReader& reader,
                                    const std::filesystem::path& file, const std::string& view,
                                    const std::string& channel) {
  const auto read = [&](const char* name) {
    const std::array wanted{images::ExrChannel{name}};
    return view.empty() ? reader.read(file, wanted, kWhatToDo)
                        : reader.read_view(file, view, wanted, kWhatToDo);
  };
  const NamedChannel* const named = named_channel(channel);
  if (named == nullptr) return read(channel.c_str());
  for (const char* name : named->in_files) {
    const std::array wanted{images::ExrChannel{name}};
    if (reader.has_channels(file, wanted, view)) return read(name);
  }
  throw Error::bad_input(fmt::format("the file has no channel {}", channel), file.string(),
                         kWhatToDo);
}

std::string size_text(const ExrImage& image) {
  return fmt::format("{} x {}", image.width, image.height);
}

/// Returns the value below which a share of the finite values is; 0 if there is none.
float percentile(std::span<const float> values, double share) {
  std::vector<float> finite;
  std::ranges::copy_if(values, std::back_inserter(finite),
                       [](float v) { return std::isfinite(v); });
  if (finite.empty()) return 0;
  const auto place = finite.begin() + std::lround(share * static_cast<double>(finite.size() - 1));
  std::nth_element(finite.begin(), place, finite.end());
  return *place;
}

void show_grey(std::span<const float> values, const std::array<double, 2>& range,
               std::span<std::uint8_t> codes) {
  const double span = range[1] - range[0];
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double share = (double{values[i]} - range[0]) / span;
    const double code = share > 0 ? 255 * std::min(share, 1.0) : 0;  // also NaN
    std::fill_n(&codes[3 * i], 3, static_cast<std::uint8_t>(std::lround(code)));
  }
}

/// Copies the columns [from, to) of a picture to another one at `column`.
void copy_columns(const store::RgbImage& source, int from, int to, int column,
                  store::RgbImage& target) {
  for (int y = 0; y < source.height; ++y) {
    std::ranges::copy(source.row(y).subspan(3 * static_cast<std::size_t>(from),
                                            3 * static_cast<std::size_t>(to - from)),
                      target.row(y).subspan(3 * static_cast<std::size_t>(column)).begin());
  }
}

store::RgbImage side_by_side(const std::vector<store::RgbImage>& pictures) {
  if (pictures.size() == 1) return pictures.front();
  const int count = static_cast<int>(pictures.size());
  const int width = pictures.front().width;
  store::RgbImage row(count * width + (count - 1) * kSequenceGap, pictures.front().height);
  std::ranges::fill(row.values, kGapColor);
  for (int i = 0; i < count; ++i)
    copy_columns(pictures[i], 0, width, i * (width + kSequenceGap), row);
  return row;
}

store::RgbImage wipe(const store::RgbImage& left, const store::RgbImage& right, double position) {
  store::RgbImage picture = right;
  const int line = static_cast<int>(std::lround(position * left.width));
  copy_columns(left, 0, line, 0, picture);
  for (int y = 0; y < picture.height; ++y) {
    for (int x = std::max(0, line - kLineWidth / 2);
         x < std::min(picture.width, line + kLineWidth / 2); ++x) {
      std::ranges::fill(picture.row(y).subspan(3 * static_cast<std::size_t>(x), 3), kLine);
    }
  }
  return picture;
}

/// Returns the rows of two views of the same size as one picture. `row`: values of a row.
std::vector<float> pack(std::span<const float> left, std::span<const float> right, std::size_t row,
                        StereoPacking packing) {
  std::vector<float> packed;
  packed.reserve(left.size() + right.size());
  const std::size_t run = packing == StereoPacking::kTopBottom ? left.size() : row;
  for (std::size_t at = 0; at < left.size(); at += run) {
    for (const std::span<const float> view : {left, right}) {
      const std::span<const float> values = view.subspan(at, run);
      packed.insert(packed.end(), values.begin(), values.end());
    }
  }
  return packed;
}

float absolute_difference(float a, float b) {
  if (a == b) return 0;  // also of infinite depths
  if (std::isnan(a) && std::isnan(b)) return 0;
  const float apart = std::abs(a - b);
  return std::isnan(apart) ? std::numeric_limits<float>::infinity() : apart;
}

}  // namespace

bool FramePictureOptions::is_valid(std::string* reason) const {
  const auto refuse = [reason](const char* why) {
    if (reason != nullptr) *reason = why;
    return false;
  };
  if (sequences.empty()) return refuse("no sequence is given");
  if (sequences.size() > 16) return refuse("more than 16 sequences are given");
  if (arrangement != Arrangement::kSideBySide && sequences.size() != 2) {
    return refuse("a wipe or difference needs two sequences");
  }
  if (range && channel.empty()) return refuse("only a channel has a range of values");
  if (range &&
      !(std::isfinite((*range)[0]) && std::isfinite((*range)[1]) && (*range)[0] < (*range)[1])) {
    return refuse("the range of values is empty or not finite");
  }
  if (range && shows_depth_channel() && !((*range)[0] > 0)) {
    return refuse("a range of depths begins above 0 m");
  }
  return is_within("position of the wipe", wipe_position, 0, 1, reason);
}

bool FramePictureOptions::shows_depth_channel() const {
  return channel == kDepth && arrangement != Arrangement::kDifference;
}

void FramePictures::read(int frame) {
  std::vector<Frame> next;
  for (const std::string& sequence : options_.sequences) {
    const std::filesystem::path file = SequenceName(sequence).path(frame);
    Frame one = options_.stereo == StereoPacking::kNone ? read_view(file, "") : read_stereo(file);
    const ExrImage* const other = !next.empty()      ? &next.front().image
                                  : !frames_.empty() ? &frames_.front().image
                                                     : nullptr;
    if (other != nullptr &&
        (other->width != one.image.width || other->height != one.image.height)) {
      throw Error::bad_input(
          fmt::format("the frame has {} pixels, {} {}", size_text(one.image),
                      next.empty() ? "the previous one" : "that of the first sequence",
                      size_text(*other)),
          file.string(), "Render the frames at one size");
    }
    next.push_back(std::move(one));
  }
  frames_ = std::move(next);
}

FramePictures::Frame FramePictures::read_view(const std::filesystem::path& file,
                                              const std::string& view) const {
  if (options_.channel.empty()) return {read_exr(reader_, file, view), {}};
  Frame one;
  images::ExrChannelData data = read_channel(reader_, file, view, options_.channel);
  one.values = std::move(data.values);
  one.image.width = data.width;
  one.image.height = data.height;
  one.image.time_code = data.time_code;
  one.image.is_equirectangular = data.is_equirectangular;
  if (data.fps_numerator > 0) {
    one.image.fps_numerator = data.fps_numerator;
    one.image.fps_denominator = data.fps_denominator;
  }
  return one;
}

FramePictures::Frame FramePictures::read_stereo(const std::filesystem::path& file) const {
  Frame packed = read_view(file, "left");
  const Frame right = read_view(file, "right");
  ExrImage& image = packed.image;
  if (image.width != right.image.width || image.height != right.image.height) {
    throw Error::bad_input("the views of the file differ in size", file.string(),
                           "Render the frame again");
  }
  const auto width = static_cast<std::size_t>(image.width);
  image.rgba = pack(image.rgba, right.image.rgba, 4 * width, options_.stereo);
  packed.values = pack(packed.values, right.values, width, options_.stereo);
  (options_.stereo == StereoPacking::kTopBottom ? image.height : image.width) *= 2;
  return packed;
}

store::RgbImage FramePictures::picture() { return arrange(frames_); }

store::RgbImage FramePictures::thumbnail(int width) {
  const ExrImage& whole = frame();
  const int small_width = std::min(width, whole.width);
  const int height = std::max(1, static_cast<int>(std::lround(static_cast<double>(whole.height) *
                                                              small_width / whole.width)));
  if (!options_.channel.empty()) {
    const store::RgbImage shown = picture();
    return images::resize(
        shown,
        std::max(1, static_cast<int>(
                        std::lround(static_cast<double>(shown.width) * small_width / whole.width))),
        height);
  }
  // Pictures are reduced as light, and differences after they were made: details do not cancel out.
  if (options_.arrangement == Arrangement::kDifference) {
    return show({downscale(difference(frames_).image, small_width, height), {}});
  }
  std::vector<Frame> small;
  for (const Frame& one : frames_) small.push_back({downscale(one.image, small_width, height), {}});
  return arrange(small);
}

store::RgbImage FramePictures::arrange(const std::vector<Frame>& frames) {
  if (options_.arrangement == Arrangement::kDifference) {
    const Frame apart = difference(frames);
    set_range(apart);
    return show(apart);
  }
  set_range(frames.front());
  std::vector<store::RgbImage> pictures;
  for (const Frame& one : frames) pictures.push_back(show(one));
  if (options_.arrangement == Arrangement::kWipe) {
    return wipe(pictures[0], pictures[1], options_.wipe_position);
  }
  return side_by_side(pictures);
}

FramePictures::Frame FramePictures::difference(const std::vector<Frame>& frames) const {
  Frame result = frames.front();
  const Frame& other = frames.back();
  for (std::size_t i = 0; i < result.values.size(); ++i) {
    result.values[i] = absolute_difference(result.values[i], other.values[i]);
  }
  for (std::size_t i = 0; i < result.image.rgba.size(); ++i) {
    result.image.rgba[i] =
        i % 4 == 3 ? 1.0F : absolute_difference(result.image.rgba[i], other.image.rgba[i]);
  }
  return result;
}

void FramePictures::set_range(const Frame& first) {
  if (range_ || options_.channel.empty()) return;
  const NamedChannel* const named = named_channel(options_.channel);
  if (options_.range) {
    range_ = options_.range;
  } else if (options_.shows_depth_channel()) {
    const InverseDepthSpan span = inverse_depth_span(first.values);
    range_ = {1 / span.near, 1 / std::max(span.far, 1e-9)};
  } else if (named != nullptr && named->is_share) {
    range_ = {0.0, 1.0};
  } else {
    const bool is_difference = options_.arrangement == Arrangement::kDifference;
    const double low = is_difference ? 0 : double{percentile(first.values, 0.01)};
    double high = double{percentile(first.values, 0.99)};
    if (!(high > low)) high = double{percentile(first.values, 1)};  // few pixels differ
    range_ = {low, high > low ? high : low + 1};
  }
}

store::RgbImage FramePictures::show(const Frame& frame) const {
  if (options_.channel.empty()) return display(frame.image, options_.display);
  store::RgbImage shown(frame.image.width, frame.image.height);
  if (options_.shows_depth_channel()) {
    show_depth(frame.values, {1 / (*range_)[1], 1 / (*range_)[0]}, shown.values);
  } else {
    show_grey(frame.values, *range_, shown.values);
  }
  return shown;
}

std::string FramePictures::range_text() const {
  if (!range_) return {};
  if (options_.shows_depth_channel()) {
    return fmt::format("Z from {:.4g} m (red) to {:.4g} m (blue)", (*range_)[0], (*range_)[1]);
  }
  const bool is_difference = options_.arrangement == Arrangement::kDifference;
  return fmt::format("{}{} from {:.4g} (black) to {:.4g} (white)",
                     is_difference ? "difference of " : "", options_.channel, (*range_)[0],
                     (*range_)[1]);
}

}  // namespace raystage::compose
