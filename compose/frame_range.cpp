// SPDX-License-Identifier: Apache-2.0
// Parses and formats frame ranges. Formatting is greedy: from each frame on, the longest run of one
// step becomes a range. Cost: linear in frames, with sorting when parsing.
#include "compose/frame_range.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstdint>

#include "base/error.h"

namespace raystage::compose {
namespace {

// A typing error such as 1-1000000000 must not exhaust the memory.
constexpr std::int64_t kMaxFrames = 1'000'000;
constexpr std::int64_t kMaxFrameNumber = 99'999'999;

struct Range {
  std::int64_t first = 0, last = 0, step = 1;
};

class Parser {
 public:
  explicit Parser(std::string_view text) : text_(text) {}

  /// Returns the ranges in the order of the text.
  std::vector<Range> parse() {
    std::vector<Range> ranges;
    do {
      skip_blanks();
      ranges.push_back(parse_item());
      skip_blanks();
    } while (accept(','));
    if (at_ < text_.size()) refuse_character();
    return ranges;
  }
  /// Returns the number of frames in all ranges.
  std::int64_t count() const { return count_; }

 private:
  Range parse_item() {
    const std::int64_t first = parse_number();
    std::int64_t last = first, step = 1;
    if (accept('-')) {
      last = parse_number();
      if (accept('x') || accept('X')) {
        step = parse_number();
        if (step < 1) fail("the step is not positive", "Write a step of 1 or more after x");
      }
    }
    if (last < first) {
      fail(fmt::format("the range {}-{} is descending", first, last),
           fmt::format("Write {}-{}; frames are rendered in ascending order", last, first));
    }
    count_ += (last - first) / step + 1;
    if (count_ > kMaxFrames) {
      fail(fmt::format("there are more than {} frames", kMaxFrames), "Request fewer frames");
    }
    return {first, last, step};
  }

  std::int64_t parse_number() {
    std::int64_t value = 0;
    const char* begin = text_.data() + at_;
    const auto [end, error] = std::from_chars(begin, text_.data() + text_.size(), value);
    if (error == std::errc::invalid_argument) refuse_character();
    if (error != std::errc{} || value > kMaxFrameNumber || value < -kMaxFrameNumber) {
      fail("the number is too large", fmt::format("Frame numbers go up to {}", kMaxFrameNumber));
    }
    at_ += static_cast<std::size_t>(end - begin);
    return value;
  }

  bool accept(char wanted) {
    if (at_ >= text_.size() || text_[at_] != wanted) return false;
    ++at_;
    return true;
  }

  void skip_blanks() {
    while (at_ < text_.size() && (text_[at_] == ' ' || text_[at_] == '\t')) ++at_;
  }

  [[noreturn]] void refuse_character() const {
    if (at_ >= text_.size()) {
      fail("a frame number is missing at the end", "Write for example 1-48, 1-48x2 or 1,5,10-20");
    }
    if (text_[at_] == ':') {
      fail(
          "':' means two different things: a step in Slurm and Open Job Description, an "
          "interleaved order in OpenCue and fileseq",
          "Write 'x' for a step, for example 1-48x2");
    }
    if (text_[at_] == 'y') {
      fail("'y' (all frames but every n-th) is not supported", "List the ranges that remain");
    }
    fail(fmt::format("'{}' is not allowed here", text_[at_]),
         "Write for example 1-48, 1-48x2, 1,5,10-20x2 or -5--1");
  }

  [[noreturn]] void fail(std::string what, std::string what_to_do) const {
    throw Error::bad_input(std::move(what), fmt::format("frame range \"{}\" @{}", text_, at_),
                           std::move(what_to_do));
  }

  std::string_view text_;
  std::size_t at_ = 0;
  std::int64_t count_ = 0;
};

}  // namespace

std::vector<int> parse_frame_range(std::string_view text) {
  std::vector<int> frames;
  for (const Range& range : Parser(text).parse()) {
    for (std::int64_t frame = range.first; frame <= range.last; frame += range.step) {
      frames.push_back(static_cast<int>(frame));
    }
  }
  std::sort(frames.begin(), frames.end());
  frames.erase(std::unique(frames.begin(), frames.end()), frames.end());
  return frames;
}

std::int64_t frame_range_size(std::string_view text) {
  Parser parser(text);
  parser.parse();
  return parser.count();
}

std::string format_frame_range(std::span<const int> frames) {
  std::string text;
  for (std::size_t i = 0; i < frames.size();) {
    if (!text.empty()) text += ',';
    // The longest run of one step from here; two frames alone read better as "a,b".
    std::size_t end = i + 1;
    const std::int64_t step = end < frames.size() ? std::int64_t{frames[end]} - frames[i] : 1;
    while (end < frames.size() && std::int64_t{frames[end]} - frames[end - 1] == step) ++end;
    const std::size_t length = end - i;
    if (length >= 3 || (length == 2 && step == 1)) {
      text += fmt::format("{}-{}", frames[i], frames[end - 1]);
      if (step != 1) text += fmt::format("x{}", step);
      i = end;
    } else {
      text += fmt::format("{}", frames[i]);
      ++i;
    }
  }
  return text;
}

}  // namespace raystage::compose
