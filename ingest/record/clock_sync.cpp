// SPDX-License-Identifier: Apache-2.0
#include "ingest/record/clock_sync.h"

#include <sys/timex.h>

#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

namespace raystage::ingest {
namespace {

std::string output_of(const char* command) {
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> pipe(popen(command, "r"), pclose);
  if (!pipe) return {};
  std::string text;
  std::array<char, 512> buffer{};
  while (std::fgets(buffer.data(), buffer.size(), pipe.get()) != nullptr) text += buffer.data();
  return text;
}

std::vector<std::string_view> fields_of(std::string_view line) {
  std::vector<std::string_view> fields;
  for (std::size_t at = 0; at <= line.size();) {
    const std::size_t comma = std::min(line.find(',', at), line.size());
    fields.push_back(line.substr(at, comma - at));
    at = comma + 1;
  }
  return fields;
}

std::optional<double> number_in(std::string_view text) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) return {};
  return value;
}

bool is_running(std::string_view program) {
  std::error_code error;
  for (std::filesystem::directory_iterator entry("/proc", error), end; !error && entry != end;
       entry.increment(error)) {
    std::ifstream file(entry->path() / "comm");
    std::string name;
    if (std::getline(file, name) && name == program) return true;
  }
  return false;
}

/// Returns the offset from the PTP master in seconds, as ptp4l reports it: phc2sys always leaves
/// the kernel's own offset at 0.
std::optional<double> ptp_offset() {
  return parse_pmc_offset(output_of("pmc -u -b 0 'GET CURRENT_DATA_SET' 2>/dev/null"));
}

}  // namespace

schemas::RecordingDocument::Clock parse_chrony_tracking(std::string_view answer) {
  // Reference ID, name, stratum, reference time, system time offset, last offset, RMS offset,
  // frequency, residual frequency, skew, root delay, root dispersion, update interval, leap status.
  constexpr std::size_t kReference = 0, kOffset = 4, kRootDelay = 10, kRootDispersion = 11;
  const auto fields = fields_of(answer);
  schemas::RecordingDocument::Clock clock;
  if (fields.size() < 14 || fields[kReference] == "00000000") return clock;
  const auto offset = number_in(fields[kOffset]), delay = number_in(fields[kRootDelay]),
             dispersion = number_in(fields[kRootDispersion]);
  if (!offset || !delay || !dispersion) return clock;
  clock.source = "chrony";
  clock.offset_s = *offset;
  // RFC 5905's error bound: offset, half the round trip, and dispersion (drift since then).
  clock.max_error_s = std::abs(*offset) + *delay / 2 + *dispersion;
  return clock;
}

std::optional<double> parse_pmc_offset(std::string_view answer) {
  constexpr std::string_view kField = "offsetFromMaster", kBlank = " \t\r\n";
  const std::size_t field = answer.find(kField);
  if (field == std::string_view::npos) return {};
  answer.remove_prefix(field + kField.size());
  const std::size_t begin = std::min(answer.find_first_not_of(kBlank), answer.size());
  answer.remove_prefix(begin);
  if (begin == 0) return {};  // only the beginning of a longer field name
  const auto nanoseconds = number_in(answer.substr(0, answer.find_first_of(kBlank)));
  if (!nanoseconds) return {};
  return *nanoseconds * 1e-9;
}

schemas::RecordingDocument::Clock query_clock_sync() {
  schemas::RecordingDocument::Clock clock =
      parse_chrony_tracking(output_of("chronyc -c tracking 2>/dev/null"));
  if (clock.source == "chrony") return clock;
  timex kernel{};
  const int state = ntp_adjtime(&kernel);
  if (state == -1 || state == TIME_ERROR || (kernel.status & STA_UNSYNC) != 0) {
    if (is_running("phc2sys")) clock.source = "ptp";
    return clock;
  }
  const double unit = (kernel.status & STA_NANO) != 0 ? 1e-9 : 1e-6;
  if (is_running("phc2sys")) {
    clock.source = "ptp";
    clock.offset_s = ptp_offset();
  } else {
    clock.source = "kernel";
    clock.offset_s = static_cast<double>(kernel.offset) * unit;
  }
  clock.max_error_s = static_cast<double>(kernel.maxerror) * 1e-6;
  return clock;
}

}  // namespace raystage::ingest
