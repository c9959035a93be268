// SPDX-License-Identifier: Apache-2.0
#include "base/time.h"

#include <fmt/format.h>

#include <chrono>

#include "base/error.h"

namespace raystage {
namespace {

constexpr int kMaxDecimals = 9;

/// Parses fixed-width fields from the start of a text. finished() is false after any failure.
class FieldReader {
 public:
  explicit FieldReader(std::string_view text) : text_(text) {}

  int digits(int count) {
    int value = 0;
    for (int i = 0; i < count; ++i) {
      if (!starts_with_digit()) {
        good_ = false;
        return 0;
      }
      value = value * 10 + (text_.front() - '0');
      text_.remove_prefix(1);
    }
    return value;
  }
  bool accept(char c) {
    if (text_.empty() || text_.front() != c) return false;
    text_.remove_prefix(1);
    return true;
  }
  void expect(char c) { good_ = accept(c) && good_; }
  bool starts_with_digit() const {
    return !text_.empty() && text_.front() >= '0' && text_.front() <= '9';
  }
  bool finished() const { return good_ && text_.empty(); }

 private:
  std::string_view text_;
  bool good_ = true;
};

Error not_a_time(std::string_view text, std::string_view reason) {
  return Error::bad_input(
      fmt::format("\"{}\" is not a valid time: {}", text, reason), "",
      "Write UTC as 2026-01-01T00:00:00Z, with up to nine decimals of a second");
}

}  // namespace

Nanoseconds parse_utc(std::string_view text) {
  FieldReader reader(text);
  const int year = reader.digits(4);
  reader.expect('-');
  const int month = reader.digits(2);
  reader.expect('-');
  const int day = reader.digits(2);
  reader.expect('T');
  const int hour = reader.digits(2);
  reader.expect(':');
  const int minute = reader.digits(2);
  reader.expect(':');
  const int second = reader.digits(2);
  Nanoseconds fraction = 0;
  if (reader.accept('.')) {
    int decimals = 0;
    for (; decimals < kMaxDecimals && (decimals == 0 || reader.starts_with_digit()); ++decimals) {
      fraction = fraction * 10 + reader.digits(1);
    }
    for (; decimals < kMaxDecimals; ++decimals) fraction *= 10;
  }
  reader.expect('Z');
  if (!reader.finished()) throw not_a_time(text, "it does not have the required form");

  const std::chrono::year_month_day date{std::chrono::year{year},
                                         std::chrono::month{static_cast<unsigned>(month)},
                                         std::chrono::day{static_cast<unsigned>(day)}};
  if (!date.ok() || hour > 23 || minute > 59 || second > 59) {
    throw not_a_time(text, "there is no such date or time of day");
  }
  const std::int64_t days = std::chrono::sys_days{date}.time_since_epoch().count();
  std::int64_t seconds = ((days * 24 + hour) * 60 + minute) * 60 + second;
  // The earliest second of the range starts below the smallest int64. Before 1970, the fraction is
  // therefore counted back from the next second.
  if (seconds < 0 && fraction > 0) {
    seconds += 1;
    fraction -= kNanosecondsPerSecond;
  }
  Nanoseconds result = 0;
  if (__builtin_mul_overflow(seconds, kNanosecondsPerSecond, &result) ||
      __builtin_add_overflow(result, fraction, &result)) {
    throw not_a_time(text, "it is outside the years 1678 to 2261");
  }
  return result;
}

std::string format_utc(Nanoseconds since_1970) {
  Nanoseconds fraction = since_1970 % kNanosecondsPerSecond;
  std::int64_t seconds = since_1970 / kNanosecondsPerSecond;
  if (fraction < 0) {
    fraction += kNanosecondsPerSecond;
    seconds -= 1;
  }
  const std::chrono::sys_seconds time{std::chrono::seconds{seconds}};
  const auto day = std::chrono::floor<std::chrono::days>(time);
  const std::chrono::year_month_day date{day};
  const std::chrono::hh_mm_ss clock{time - day};
  std::string text =
      fmt::format("{:04}-{:02}-{:02}T{:02}:{:02}:{:02}", static_cast<int>(date.year()),
                  static_cast<unsigned>(date.month()), static_cast<unsigned>(date.day()),
                  clock.hours().count(), clock.minutes().count(), clock.seconds().count());
  if (fraction != 0) {
    text += fmt::format(".{:09}", fraction);
    text.erase(text.find_last_not_of('0') + 1);
  }
  return text + "Z";
}

}  // namespace raystage
