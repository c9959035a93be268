// SPDX-License-Identifier: Apache-2.0
// Encodes and decodes timelines (docs/formats/timeline.md): a zstd frame with header, clocks and
// ticks. Decoding checks all sizes step by step, because a damaged file may claim any. Cost: linear
// in ticks times cameras.
#include "store/timeline_file.h"

#include <fmt/format.h>
#include <xxhash.h>
#include <zstd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cmath>
#include <memory>
#include <new>
#include <optional>
#include <string>
#include <utility>

#include "base/atomic_file.h"
#include "base/contained_path.h"
#include "base/error.h"
#include "base/frame_rate.h"
#include "base/little_endian.h"
#include "store/journal.h"
#include "store/unsynced_timeline.h"

namespace raystage::store {
namespace {

constexpr std::array<char, 8> kMagic{'R', 'A', 'Y', 'S', 'T', 'I', 'M', 'E'};
constexpr std::uint32_t kVersion = 2;  // 1 had no clocks
constexpr std::size_t kVersionAt = 8, kCamerasAt = 12, kFingerprintAt = 16, kFpsAt = 24,
                      kToleranceAt = 32, kTicksAt = 40, kHeaderBytes = 48;
constexpr std::size_t kClockBytes = 48, kStepBytes = 16;
/// Stored from byte 8 of a clock on.
constexpr std::array kClockNumbers{&CameraClock::period_ns, &CameraClock::phase_ns,
                                   &CameraClock::drift_ppm, &CameraClock::jitter_ns};
constexpr std::uint32_t kFittedFlag = 1;
constexpr int kLevel = 9;
constexpr std::uint32_t kMaxSteps = 1'000'000;
/// Their times alone need 0.7 to 1 bytes each where the period is a power of two nanoseconds, and 2
/// to 4 otherwise: more are a small file that wants much work.
constexpr std::uint64_t kMaxTicksPerByte = 4;
/// The largest time, difference, clock offset, sum of clock steps and tolerance: 36 years. Sums of
/// seven of them do not overflow.
constexpr Nanoseconds kMaxTimelineTime = Nanoseconds{1} << 60;
constexpr double kMaxClockPeriod = kNsPerS / kMinRateInFiles,
                 kMinClockPeriod = kNsPerS / kMaxRateInFiles;

struct ZstdDeleter {
  void operator()(ZSTD_DCtx* context) const { ZSTD_freeDCtx(context); }
  void operator()(ZSTD_CCtx* context) const { ZSTD_freeCCtx(context); }
};

// Decompresses a zstd frame in steps of the requested number of bytes.
class Decompressor {
 public:
  explicit Decompressor(std::span<const std::byte> file)
      : context_(ZSTD_createDCtx()), input_{file.data(), file.size(), 0} {
    if (!context_) throw std::bad_alloc();
  }

  /// Appends up to `count` bytes, fewer at the end. Returns false if the data are damaged.
  bool pull(std::size_t count, std::vector<std::byte>& bytes) {
    constexpr std::size_t kStep = std::size_t{1} << 20;
    while (count > 0 && !ended_) {
      const std::size_t filled = bytes.size();
      const std::size_t step = std::min(count, kStep);
      bytes.resize(filled + step);
      ZSTD_outBuffer output{bytes.data() + filled, step, 0};
      const std::size_t consumed = input_.pos;
      const std::size_t left = ZSTD_decompressStream(context_.get(), &output, &input_);
      bytes.resize(filled + output.pos);
      count -= output.pos;
      if (ZSTD_isError(left)) return false;
      ended_ = left == 0 || (output.pos == 0 && input_.pos == consumed);
      whole_ = left == 0;
    }
    return true;
  }
  /// Returns whether the frame ended with a correct checksum and nothing follows it.
  bool finished() {
    std::vector<std::byte> rest;
    return pull(1, rest) && rest.empty() && whole_ && input_.pos == input_.size;
  }

 private:
  std::unique_ptr<ZSTD_DCtx, ZstdDeleter> context_;
  ZSTD_inBuffer input_;
  bool ended_ = false, whole_ = false;
};

void append_clock(const CameraClock& clock, std::vector<std::byte>& payload) {
  std::size_t at = payload.size();
  payload.resize(at + kClockBytes + clock.steps.size() * kStepBytes);
  store_little_endian(payload, at, clock.offset_ns);
  for (std::size_t i = 0; i < kClockNumbers.size(); ++i) {
    const double number = clock.*kClockNumbers[i];
    store_little_endian(payload, at + 8 + 8 * i, std::bit_cast<std::uint64_t>(number));
  }
  store_little_endian(payload, at + 40, clock.fitted ? kFittedFlag : std::uint32_t{0});
  store_little_endian(payload, at + 44, static_cast<std::uint32_t>(clock.steps.size()));
  at += kClockBytes;
  for (const ClockStep& step : clock.steps) {
    store_little_endian(payload, at, step.time_ns);
    store_little_endian(payload, at + 8, step.step_ns);
    at += kStepBytes;
  }
}

bool is_timeline_time(Nanoseconds time) {
  return time >= -kMaxTimelineTime && time <= kMaxTimelineTime;
}

// Returns whether a frame with this time stamp can have this time: exactly, or within one period
// with fitted times.
bool agrees(const CameraClock& clock, Nanoseconds stamp, Nanoseconds time) {
  const Nanoseconds difference = clock.corrected(stamp) - time;
  return clock.fitted ? std::abs(static_cast<double>(difference)) <= clock.period_ns
                      : difference == 0;
}

// Returns nullopt if the bytes are not a clock.
std::optional<CameraClock> pull_clock(Decompressor& source) {
  std::vector<std::byte> bytes;
  if (!source.pull(kClockBytes, bytes) || bytes.size() != kClockBytes) return std::nullopt;
  CameraClock clock;
  clock.offset_ns = load_little_endian<std::int64_t>(bytes, 0);
  bool finite = true;
  for (std::size_t i = 0; i < kClockNumbers.size(); ++i) {
    double& number = clock.*kClockNumbers[i];
    number = std::bit_cast<double>(load_little_endian<std::uint64_t>(bytes, 8 + 8 * i));
    finite = finite && std::isfinite(number);
  }
  const auto flags = load_little_endian<std::uint32_t>(bytes, 40);
  const auto steps = load_little_endian<std::uint32_t>(bytes, 44);
  clock.fitted = (flags & kFittedFlag) != 0;
  const double period = clock.period_ns;
  const bool has_possible_period =
      period == 0 || (period >= kMinClockPeriod && period <= kMaxClockPeriod);
  if (!finite || !is_timeline_time(clock.offset_ns) || !has_possible_period ||
      clock.jitter_ns < 0 || flags > kFittedFlag || steps > kMaxSteps) {
    return std::nullopt;
  }
  bytes.clear();
  if (!source.pull(steps * kStepBytes, bytes) || bytes.size() != steps * kStepBytes) {
    return std::nullopt;
  }
  for (std::size_t at = 0; at < bytes.size(); at += kStepBytes) {
    const ClockStep step{load_little_endian<std::int64_t>(bytes, at),
                         load_little_endian<std::int64_t>(bytes, at + 8)};
    if (!clock.steps.empty() && step.time_ns <= clock.steps.back().time_ns) return std::nullopt;
    if (!is_timeline_time(step.step_ns)) return std::nullopt;
    clock.steps.add(step);
    if (!is_timeline_time(clock.steps.sum_until(step.time_ns))) return std::nullopt;
  }
  return clock;
}

}  // namespace

std::uint64_t take_fingerprint(const Take& take) {
  // Chained hashes of fixed-size blocks: the same on every machine.
  std::array<std::byte, 16> epoch{};
  store_little_endian(epoch, 0, take.document().epoch_utc);
  store_little_endian(epoch, 8, static_cast<std::int64_t>(take.camera_count()));
  std::uint64_t hash = XXH3_64bits(epoch.data(), epoch.size());
  std::vector<std::byte> table;
  for (int camera = 0; camera < take.camera_count(); ++camera) {
    const std::string& id = take.document().cameras[camera].id;
    hash = XXH3_64bits_withSeed(id.data(), id.size(), hash);
    table.clear();
    for (const FrameRecord& frame : take.archive(camera).frames()) {
      // Only fields that identify the frame: another journal version or a corrected arrival time
      // leaves the timeline valid.
      const auto record = journal::encode_record_v1(frame);
      table.insert(table.end(), record.begin(), record.end());
    }
    hash = XXH3_64bits_withSeed(table.data(), table.size(), hash);
  }
  return hash;
}

std::vector<std::byte> encode_timeline(const Timeline& timeline, std::uint64_t fingerprint) {
  const std::size_t ticks = timeline.ticks.size();
  const std::size_t cameras = ticks == 0 ? 0 : timeline.ticks[0].frame.size();
  std::vector<std::byte> payload(kHeaderBytes + ticks * (8 + cameras * 12));
  std::ranges::copy(std::as_bytes(std::span(kMagic)), payload.begin());
  store_little_endian(payload, kVersionAt, kVersion);
  store_little_endian(payload, kCamerasAt, static_cast<std::uint32_t>(cameras));
  store_little_endian(payload, kFingerprintAt, fingerprint);
  store_little_endian(payload, kFpsAt, std::bit_cast<std::uint64_t>(timeline.fps));
  store_little_endian(payload, kToleranceAt, timeline.tolerance);
  store_little_endian(payload, kTicksAt, static_cast<std::uint64_t>(ticks));
  std::size_t at = kHeaderBytes;
  for (const FrameSelection& tick : timeline.ticks) {
    store_little_endian(payload, at, tick.time_ns);
    at += 8;
  }
  // Camera by camera: its frame numbers are consecutive, which compresses well.
  for (std::size_t camera = 0; camera < cameras; ++camera) {
    for (const FrameSelection& tick : timeline.ticks) {
      assert(tick.frame.size() == cameras && tick.difference.size() == cameras);
      store_little_endian(payload, at, tick.frame[camera]);
      at += 4;
    }
  }
  for (std::size_t camera = 0; camera < cameras; ++camera) {
    for (const FrameSelection& tick : timeline.ticks) {
      store_little_endian(payload, at, tick.difference[camera]);
      at += 8;
    }
  }

  assert(timeline.clocks.empty() || timeline.clocks.size() == cameras);
  for (std::size_t camera = 0; camera < cameras; ++camera) {
    append_clock(timeline.clocks.empty() ? CameraClock{} : timeline.clocks[camera], payload);
  }

  const std::unique_ptr<ZSTD_CCtx, ZstdDeleter> context(ZSTD_createCCtx());
  if (!context) throw std::bad_alloc();
  ZSTD_CCtx_setParameter(context.get(), ZSTD_c_compressionLevel, kLevel);
  ZSTD_CCtx_setParameter(context.get(), ZSTD_c_checksumFlag, 1);
  std::vector<std::byte> file(ZSTD_compressBound(payload.size()));
  const std::size_t size =
      ZSTD_compress2(context.get(), file.data(), file.size(), payload.data(), payload.size());
  if (ZSTD_isError(size)) throw std::bad_alloc();  // the only error: the buffer is large enough
  file.resize(size);
  return file;
}

Timeline decode_timeline(std::span<const std::byte> file, std::optional<std::uint64_t> fingerprint,
                         std::size_t cameras, std::string_view name) {
  const auto refuse = [&](const std::string& what) {
    return Error::bad_input(what, std::string(name), "Run `raystage sync` on the take");
  };
  const auto damaged = [&] { return refuse("the timeline is damaged"); };
  Decompressor source(file);
  std::vector<std::byte> payload;
  if (!source.pull(kHeaderBytes, payload) || payload.size() < kHeaderBytes) throw damaged();
  if (!std::ranges::equal(std::span(payload).first<kMagic.size()>(),
                          std::as_bytes(std::span(kMagic)))) {
    throw damaged();
  }
  const auto version = load_little_endian<std::uint32_t>(payload, kVersionAt);
  if (version < 1 || version > kVersion) {
    throw refuse("the timeline has format version " + std::to_string(version) +
                 "; this program reads versions 1 to " + std::to_string(kVersion));
  }
  if ((fingerprint && load_little_endian<std::uint64_t>(payload, kFingerprintAt) != *fingerprint) ||
      load_little_endian<std::uint32_t>(payload, kCamerasAt) != cameras) {
    throw refuse("the timeline is of another take, or frames have changed since it was written");
  }
  Timeline timeline;
  timeline.fps = std::bit_cast<double>(load_little_endian<std::uint64_t>(payload, kFpsAt));
  timeline.tolerance = load_little_endian<std::int64_t>(payload, kToleranceAt);
  const auto ticks = load_little_endian<std::uint64_t>(payload, kTicksAt);
  if (!(timeline.fps >= kMinRateInFiles && timeline.fps <= kMaxRateInFiles) ||
      timeline.tolerance < 0 || timeline.tolerance > kMaxTimelineTime) {
    throw damaged();
  }
  const std::uint64_t most =
      std::min<std::uint64_t>(most_ticks(cameras), kMaxTicksPerByte * file.size());
  if (ticks > most) {
    throw refuse(
        fmt::format("the timeline has {} ticks of {} cameras, allowed: {}", ticks, cameras, most));
  }
  // Ticks have a constant rate, which exports multiply by their number.
  if (static_cast<double>(ticks) * kNsPerS / timeline.fps > 3.0 * kMaxTimelineTime) throw damaged();
  const auto count = static_cast<std::size_t>(ticks);
  const std::size_t body = count * (8 + cameras * 12);
  if (!source.pull(body, payload) || payload.size() != kHeaderBytes + body) throw damaged();
  for (std::size_t camera = 0; version >= 2 && camera < cameras; ++camera) {
    std::optional<CameraClock> clock = pull_clock(source);
    if (!clock) throw damaged();
    timeline.clocks.push_back(std::move(*clock));
  }
  if (!source.finished()) throw damaged();

  timeline.ticks.resize(count);
  std::size_t at = kHeaderBytes;
  for (FrameSelection& tick : timeline.ticks) {
    tick.time_ns = load_little_endian<std::int64_t>(payload, at);
    at += 8;
    if (!is_timeline_time(tick.time_ns)) throw damaged();
    tick.frame.resize(cameras);
    tick.difference.resize(cameras);
  }
  for (std::size_t camera = 0; camera < cameras; ++camera) {
    for (FrameSelection& tick : timeline.ticks) {
      tick.frame[camera] = load_little_endian<std::int32_t>(payload, at);
      at += 4;
      if (tick.frame[camera] < -1) throw damaged();
    }
  }
  for (std::size_t camera = 0; camera < cameras; ++camera) {
    for (FrameSelection& tick : timeline.ticks) {
      tick.difference[camera] = load_little_endian<std::int64_t>(payload, at);
      at += 8;
      if (!is_timeline_time(tick.difference[camera])) throw damaged();
    }
  }
  return timeline;
}

void write_timeline(const Timeline& timeline, const std::filesystem::path& take_folder) {
  write_timeline(timeline, Take(take_folder));
}

void write_timeline(const Timeline& timeline, const Take& take) {
  write_file_atomically(take.folder() / kTimelineFile,
                        encode_timeline(timeline, take_fingerprint(take)));
}

namespace {

std::optional<std::string> camera_with_damaged_journal(const Take& take) {
  for (int camera = 0; camera < take.camera_count(); ++camera) {
    const ArchiveReader& archive = take.archive(camera);
    if (archive.recovered_frames() > 0 || archive.damaged_records() > 0) {
      return take.document().cameras[static_cast<std::size_t>(camera)].id;
    }
  }
  return std::nullopt;
}

}  // namespace

Timeline read_timeline(const Take& take) {
  const std::filesystem::path path = take.folder() / kTimelineFile;
  if (!exists(take.file(kTimelineFile))) {
    if (auto timeline = timeline_without_sync(take)) return *std::move(timeline);
    throw Error::bad_input("the take has no timeline", path.string(),
                           "Run `raystage sync` on the take");
  }
  const std::string bytes = read_file(take.file(kTimelineFile));
  // The fingerprint covers all archives; the checks below need none.
  bool is_complete = !take.are_archives_unknown();
  for (int camera = 0; camera < take.camera_count(); ++camera) {
    is_complete = is_complete && !take.is_missing(camera);
  }
  Timeline timeline;
  try {
    timeline = decode_timeline(std::as_bytes(std::span(bytes)),
                               is_complete ? std::optional(take_fingerprint(take)) : std::nullopt,
                               static_cast<std::size_t>(take.camera_count()), path.string());
  } catch (const Error& error) {
    const auto camera = is_complete ? camera_with_damaged_journal(take) : std::nullopt;
    if (!camera) throw;
    // A new timeline would use frames that nothing checks, because their records are damaged.
    throw Error::bad_input(
        error.what_happened() + "; the journal of camera \"" + *camera + "\" is damaged",
        path.string(), "Run `raystage repair` on the take");
  }
  if (take.are_archives_unknown()) return timeline;
  // With a matching fingerprint, every entry must be a frame of this take at its time.
  for (std::size_t camera = 0; camera < static_cast<std::size_t>(take.camera_count()); ++camera) {
    if (take.is_missing(static_cast<int>(camera))) {
      for (FrameSelection& tick : timeline.ticks) {
        tick.frame[camera] = -1;
        tick.difference[camera] = 0;
      }
      continue;
    }
    const auto frames = take.archive(static_cast<int>(camera)).frames();
    const CameraClock clock = timeline.clocks.empty() ? CameraClock{} : timeline.clocks[camera];
    for (const FrameSelection& tick : timeline.ticks) {
      const std::int32_t frame = tick.frame[camera];
      if (frame < 0) continue;
      if (static_cast<std::size_t>(frame) >= frames.size() ||
          !agrees(clock, frames[frame].time_ns, tick.time_ns + tick.difference[camera])) {
        throw Error::bad_input("the timeline refers to a frame that the take does not have",
                               path.string(), "Run `raystage sync` on the take");
      }
    }
  }
  return timeline;
}

std::optional<Timeline> read_timeline_if_present(const Take& take) {
  if (!exists(take.file(kTimelineFile))) return timeline_without_sync(take);
  return read_timeline(take);
}

}  // namespace raystage::store
