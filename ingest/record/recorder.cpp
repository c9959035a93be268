// SPDX-License-Identifier: Apache-2.0
// Runs a recording on one node: a capture thread per source, encoder threads and a writer thread,
// connected by one queue per camera within a common memory budget. Audits the frame counts at the
// end.
#include "ingest/record/recorder.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <new>
#include <optional>
#include <thread>
#include <utility>

#include "base/error.h"
#include "base/options.h"
#include "base/resources.h"
#include "ingest/record/clock_sync.h"
#include "ingest/record/host_clock.h"
#include "ingest/record/memory_ceiling.h"

namespace raystage::ingest {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr auto kSourcePollInterval = 20ms;
constexpr std::size_t kMinFramesPerCamera = 4;
constexpr std::size_t kRecordsFraction = 32;  // 1/32 of memory is for records of missing frames

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

void describe(const SourceDescription& source, schemas::RecordingDocument::Camera& camera) {
  camera.source = source.what;
  camera.clock = source.clock;
  camera.timestamp_event = source.timestamp_event;
}

std::vector<RecordingTake*> all_copies(RecordingTake& take, RecordingTake* mirror) {
  std::vector<RecordingTake*> copies{&take};
  if (mirror != nullptr) copies.push_back(mirror);
  return copies;
}

/// The threads of the cameras: begin together, and are stopped and joined however the scope is
/// left.
class CaptureThreads {
 public:
  CaptureThreads() = default;
  ~CaptureThreads() {
    stop_.request_stop();
    begin();
  }
  CaptureThreads(const CaptureThreads&) = delete;
  CaptureThreads& operator=(const CaptureThreads&) = delete;

  /// `capture(stop)` runs from begin() on. Throws std::system_error if no thread can be started.
  template <class Capture>
  void add(Capture capture) {
    threads_.emplace_back([this, capture = std::move(capture)] {
      has_begun_.wait(false);
      capture(stop_.get_token());
    });
  }
  void begin() {
    has_begun_ = true;
    has_begun_.notify_all();
  }

 private:
  std::stop_source stop_;
  std::atomic<bool> has_begun_ = false;
  std::vector<std::jthread> threads_;  // last: they use all of the above
};

}  // namespace

struct Recorder::State {
  State(const RecorderOptions& with_options, std::vector<RecorderCamera> with_cameras,
        std::vector<RecordingTake*> into, std::string by_program)
      : settings(with_options),
        cameras(std::move(with_cameras)),
        takes(std::move(into)),
        program(std::move(by_program)),
        memory(limit() - limit() / kRecordsFraction),
        records(limit() / kRecordsFraction) {}

  std::size_t limit() const;
  CameraCapture::Options capture_options(std::size_t camera, Nanoseconds start_utc) const;
  schemas::RecordingDocument::Session make_session() const;
  RecorderStatus status(const RecordingCopies& copies);

  const RecorderOptions settings;
  std::vector<RecorderCamera> cameras;
  const std::vector<RecordingTake*> takes;
  const RecordingTake& take = *takes.front();
  const std::string program;
  HostClock host_clock;
  MemoryBudget memory, records;
  std::vector<FrameQueue> queues = std::vector<FrameQueue>(cameras.size());
  std::vector<CameraCounters> counters = std::vector<CameraCounters>(cameras.size());
  std::vector<SourceDescription> descriptions;

  // Values of the previous status, for rates.
  Clock::time_point start, last_status;
  std::vector<std::uint64_t> last_arrived = std::vector<std::uint64_t>(cameras.size());
  std::uint64_t last_bytes = 0;
  std::size_t last_memory = 0;
};

std::size_t frame_bytes(std::size_t pixels, bool jpeg) { return jpeg ? pixels / 2 : pixels * 3; }

std::size_t Recorder::State::limit() const {
  std::size_t in_capture = 0, least = 0;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const bool jpeg = cameras[i].source->description().delivers_jpeg;
    const schemas::CameraGeometry& geometry = take.rig().cameras[i].geometry;
    const std::size_t bytes = frame_bytes(
        static_cast<std::size_t>(geometry.width) * static_cast<std::size_t>(geometry.height), jpeg);
    in_capture += bytes;
    least += kMinFramesPerCamera * bytes;
  }
  if (settings.memory_bytes < in_capture + least) {
    throw Error::bad_input(
        fmt::format("{:.0f} MB of memory are too few for {} cameras, allowed: {:.0f} MB or more",
                    static_cast<double>(settings.memory_bytes) / 1e6, cameras.size(),
                    static_cast<double>(in_capture + least) / 1e6),
        "memory_mb", "Give the recording more memory, or record fewer cameras on this node");
  }
  return settings.memory_bytes - in_capture;
}

CameraCapture::Options Recorder::State::capture_options(std::size_t camera,
                                                        Nanoseconds start_utc) const {
  const schemas::CameraGeometry& geometry = take.rig().cameras[camera].geometry;
  CameraCapture::Options capture;
  capture.epoch_utc = take.document().epoch_utc;
  capture.last_time = take.last_time(camera);
  capture.start_utc = start_utc;
  capture.width = geometry.width;
  capture.height = geometry.height;
  capture.drop_oldest = settings.drop_oldest;
  // With buffer_in_memory no memory is freed before the end.
  if (descriptions[camera].waits && !settings.hold)
    capture.wait_for_memory = settings.wait_for_memory;
  capture.when_lost = settings.when_lost;
  capture.lost_after = settings.lost_after;
  capture.absence = cameras[camera].absence;
  return capture;
}

schemas::RecordingDocument::Session Recorder::State::make_session() const {
  schemas::RecordingDocument::Session session;
  session.program = program;
  session.started_utc = host_utc_now();
  session.start_at_utc = settings.start_utc;
  session.memory_bytes = settings.memory_bytes;
  session.memory_ceiling_bytes = settings.memory_ceiling;
  session.held = settings.hold;
  session.clock = query_clock_sync();
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    schemas::RecordingDocument::Camera camera;
    camera.id = cameras[i].id;
    describe(descriptions[i], camera);
    session.cameras.push_back(std::move(camera));
  }
  return session;
}

RecorderStatus Recorder::State::status(const RecordingCopies& copies) {
  RecorderStatus status;
  const double interval = std::max(1e-3, seconds_since(last_status));
  last_status = Clock::now();
  status.seconds = seconds_since(start);
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    RecorderStatus::Camera camera;
    camera.id = cameras[i].id;
    camera.arrived = counters[i].arrived;
    camera.fps =
        static_cast<double>(camera.arrived - std::exchange(last_arrived[i], camera.arrived)) /
        interval;
    camera.dropped = counters[i].dropped + queues[i].encoder_failures();
    camera.skipped_by_source = counters[i].skipped_by_source;
    camera.stored = copies.written(i, store::FrameStatus::kStored);
    camera.in_memory = queues[i].size_for_all();
    camera.state = counters[i].state;
    status.cameras.push_back(std::move(camera));
  }
  status.memory_used = memory.used();
  status.memory_limit = memory.limit();
  const std::uint64_t bytes = copies.bytes_written();
  status.write_bytes_per_s =
      static_cast<double>(bytes - std::exchange(last_bytes, bytes)) / interval;
  status.write_error = copies.write_error();
  if (takes.size() > 1) status.copies = copies.status();
  const double filled = static_cast<double>(status.memory_used) -
                        static_cast<double>(std::exchange(last_memory, status.memory_used));
  if (settings.hold) {
    if (filled > 0) {
      status.seconds_left =
          static_cast<double>(status.memory_limit - status.memory_used) / (filled / interval);
    }
  } else if (status.write_bytes_per_s > 0) {
    for (const std::filesystem::path& folder : copies.active_folders()) {
      std::error_code error;
      const auto space = std::filesystem::space(folder, error);
      if (error) continue;
      const double left = static_cast<double>(space.available) / status.write_bytes_per_s;
      status.seconds_left = std::min(left, status.seconds_left.value_or(left));
    }
  }
  return status;
}

bool RecorderOptions::is_valid(std::string* reason) const {
  return is_within("threads", threads, 1, 100000, reason) &&
         is_within("status interval (s)", status_interval_s, 0, 1e6, reason) &&
         is_within("flush interval (s)", flush_interval_s, 0, 1e6, reason) &&
         is_within("drain timeout (s)", drain_timeout_s, 0, 1e6, reason) &&
         is_within("duration (s)", duration_s.value_or(0), 0, 1e9, reason) && jpeg.is_valid(reason);
}

Recorder::Recorder(const RecorderOptions& settings, std::vector<RecorderCamera> cameras,
                   RecordingTake& take, std::string program, RecordingTake* mirror)
    : state_(std::make_unique<State>(settings, std::move(cameras), all_copies(take, mirror),
                                     std::move(program))) {
  require_valid(settings, "recording");
  for (const RecorderCamera& camera : state_->cameras) {
    state_->descriptions.push_back(camera.source->description());
  }
}

Recorder::~Recorder() = default;

std::size_t Recorder::memory_for_frames() const { return state_->memory.limit(); }

schemas::RecordingDocument::Session Recorder::run(
    const std::stop_token& stop, const std::function<void(const RecorderStatus&)>& status,
    const std::function<void(double)>& writing) {
  State& s = *state_;
  schemas::RecordingDocument::Session session = s.make_session();
  for (RecordingTake* take : s.takes) {
    take->write_session(session, true);
    take->reserve_disk_space();
  }
  for (std::size_t i = 0; i < s.cameras.size(); ++i) {
    s.counters[i].is_absent = !s.cameras[i].absence.empty();
  }
  RecordingCopies copies(s.takes, {s.queues, s.counters, s.memory},
                         {.hold = s.settings.hold,
                          .drain_timeout_s = s.settings.drain_timeout_s,
                          .flush_interval_s = s.settings.flush_interval_s});
  EncoderPool encoders(s.settings.jpeg, s.settings.threads);
  std::optional<MemoryCeiling> ceiling;
  const bool all_survive = std::ranges::all_of(s.cameras, [](const RecorderCamera& camera) {
    return camera.source->survives_failed_allocations();
  });

  // Frames that waited in a source since it was opened are too old. The epoch is in the future if a
  // take is resumed that was stopped before its start time.
  const Nanoseconds start_utc =
      std::max(s.settings.start_utc.value_or(s.host_clock.utc_now()), s.take.document().epoch_utc);
  std::atomic<bool> a_camera_asks = false;
  std::vector<std::atomic<bool>> is_finished(s.cameras.size());
  s.start = s.last_status = Clock::now();
  {
    CaptureThreads threads;
    for (std::size_t i = 0; i < s.cameras.size(); ++i) {
      auto capture = std::make_unique<CameraCapture>(
          s.capture_options(i, start_utc), std::move(s.cameras[i].source), s.cameras[i].reopen,
          CameraCapture::Pipeline{s.queues[i], s.memory, s.records, encoders, s.counters[i],
                                  s.host_clock, [&a_camera_asks] { a_camera_asks = true; },
                                  [&copies] { return copies.free_memory(); }});
      threads.add([&finished = is_finished[i], &counters = s.counters[i],
                   capture = std::move(capture)](const std::stop_token& stop_camera) {
        // An exception that leaves a thread would end the process and lose all frames in memory.
        const std::string failure = exception_message([&] { capture->run(stop_camera); });
        if (!failure.empty()) counters.state = CameraCounters::State::kLost;
        finished = true;
      });
    }
    // Under the ceiling no thread may be startable, so all of them exist now.
    if (s.settings.memory_ceiling) {
      ceiling.emplace(*s.settings.memory_ceiling, s.memory, all_survive);
    }
    threads.begin();
    const auto all_are_over = [&] {
      for (std::size_t i = 0; i < s.cameras.size(); ++i) {
        // Absent cameras, which may never come, do not keep a recording of files going.
        const bool is_absent =
            !s.cameras[i].absence.empty() && s.counters[i].state == CameraCounters::State::kLost;
        if (!is_finished[i] && !is_absent) return false;
      }
      return true;
    };
    const auto why_over = [&]() -> std::string {  // empty: go on
      if (stop.stop_requested()) return "stopped as asked";
      if (a_camera_asks) return "a camera was lost";
      if (all_are_over()) return "every source has ended";
      if (!s.settings.duration_s) return {};
      const double done = s.settings.start_utc || start_utc > session.started_utc
                              ? static_cast<double>(s.host_clock.utc_now() - start_utc) * 1e-9
                              : seconds_since(s.start);
      return done >= *s.settings.duration_s ? "the duration is over" : "";
    };
    const auto look = std::min<std::chrono::duration<double>>(
        kSourcePollInterval, std::chrono::duration<double>(s.settings.status_interval_s));
    while ((session.stop_reason = why_over()).empty()) {
      std::this_thread::sleep_for(look);
      try {
        copies.watch();
        if (status && seconds_since(s.last_status) >= s.settings.status_interval_s)
          status(s.status(copies));
      } catch (const std::bad_alloc&) {  // no status is worth the recording
      }
    }
  }  // stops and joins the cameras' threads
  for (std::size_t i = 0; i < s.cameras.size(); ++i) {
    if (const auto opened = s.counters[i].description()) describe(*opened, session.cameras[i]);
  }
  encoders.wait();
  session.stopped_utc = host_utc_now();
  // The sources are closed, so memory only becomes less. A failed allocation would cost frames now.
  ceiling.reset();
  copies.drain(writing);
  if (status) status(s.status(copies));

  // Before the audit, which maps the archives: pages of files count as resident.
  session.process_peak_bytes = peak_resident_memory();
  session.memory_peak_bytes = s.memory.peak() + s.records.peak();
  std::vector<std::string> problems;
  copies.close(problems);
  copies.finish(session, std::move(problems));
  return session;
}

std::optional<double> measure_data_rate(std::vector<RecorderCamera>& cameras,
                                        const store::JpegEncodeOptions& jpeg, double seconds) {
  for (const RecorderCamera& camera : cameras) {
    if (!camera.source->description().live) return std::nullopt;
  }
  std::atomic<std::uint64_t> sum = 0;
  const auto present = std::ranges::count_if(
      cameras, [](const RecorderCamera& camera) { return camera.absence.empty(); });
  const auto start = Clock::now();
  {
    std::vector<std::jthread> threads;
    for (RecorderCamera& camera : cameras) {
      if (!camera.absence.empty()) continue;
      threads.emplace_back([&] {
        store::RawJpegEncoder encoder(jpeg);
        std::vector<std::byte> bytes;
        std::uint64_t frames = 0;
        for (SourceFrame frame; seconds_since(start) < seconds; frame = {}) {
          const auto outcome = camera.source->next(frame, 100ms);
          if (outcome == FrameSource::Outcome::kEnded || outcome == FrameSource::Outcome::kLost) {
            break;
          }
          if (outcome != FrameSource::Outcome::kFrame) continue;
          constexpr int kSample = 4;  // only every fourth raw frame is encoded
          ++frames;
          if (!frame.jpeg.empty()) {
            sum += frame.jpeg.size();
          } else if (frames % kSample == 1 && frame.raw.planes[0].data != nullptr) {
            encoder.encode(frame.raw, bytes);
            sum += kSample * bytes.size();
          }
        }
      });
    }
  }
  if (present == 0) return 0;
  // Absent cameras count as much as the mean of the others: they may come at any time.
  const double all_per_present = static_cast<double>(cameras.size()) / static_cast<double>(present);
  return all_per_present * static_cast<double>(sum) / std::max(1e-3, seconds_since(start));
}

}  // namespace raystage::ingest
