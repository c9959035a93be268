// SPDX-License-Identifier: Apache-2.0
// Follows a recording. Of each journal only the new records are read; frames are read from the
// archive at the offset that their record states, so that no index of a long archive is built.
#include "replay/live/live_take.h"

#include <sched.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>
#include <xxhash.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <deque>
#include <utility>

#include "base/error.h"
#include "base/posix_file.h"
#include "schemas/recording_document.h"
#include "store/journal_tail.h"
#include "store/jpegxl/frame_packer.h"
#include "store/jpegxl/packed_frame.h"
#include "store/unpacked_frames.h"

namespace raystage::replay {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kFirstRecords = 10'000;                  // of each journal, when it is opened
constexpr std::size_t kFramesHeld = 16, kMaxFramesHeld = 512;  // records of stored frames
constexpr Nanoseconds kLatestTime = Nanoseconds{1} << 62;
/// A recorder that writes nothing for so long has been killed.
constexpr auto kSilence = std::chrono::seconds(60);
constexpr Nanoseconds kRateWindow = 5'000'000'000;
/// Cameras whose latest frame is older than this and than two of their frames, compared with the
/// newest one, are not waited for.
constexpr Nanoseconds kStalled = 700'000'000, kMostPatience = 5'000'000'000;
constexpr std::uint32_t kMaxFrameBytes = std::uint32_t{64} << 20;

/// The frames of an archive that is being written, by their records. Those that were there before a
/// packed take was continued are packed.
class ArchiveTail final : public store::RemoteFrames {
 public:
  ArchiveTail(ContainedPath archive, std::vector<store::FrameRecord> records, int camera,
              const store::ArchiveWriter::Description& description,
              std::shared_ptr<store::UnpackedFrames> unpacked)
      : archive_(std::move(archive)),
        records_(std::move(records)),
        camera_(camera),
        size_{description.width, description.height},
        unpacked_(std::move(unpacked)) {}

  store::FrameBytes jpeg(int frame) const override {
    const store::FrameRecord& record = records_.at(static_cast<std::size_t>(frame));
    auto bytes = std::make_shared<std::vector<std::byte>>(std::min(record.size, kMaxFrameBytes));
    if (read_file_part(archive_, record.offset, *bytes) < bytes->size()) {
      throw Error::bad_input("a frame of the recording cannot be read", archive_.path().string(),
                             "Try again");
    }
    if (XXH3_64bits(bytes->data(), bytes->size()) != record.xxh3 && record.xxh3 != 0) {
      throw Error::bad_input("a frame of the recording is not as it was recorded (XXH3)",
                             archive_.path().string(), "Check the disk");
    }
    if (store::is_jpeg_xl(*bytes)) return unpack(*bytes, record);
    return store::FrameBytes(std::shared_ptr<const std::vector<std::byte>>(std::move(bytes)));
  }
  store::JpegLayout layout(int frame) const override {
    return store::parse_jpeg_layout(jpeg(frame), archive_.path().string());
  }
  store::FrameBytes jpeg_part(int frame, const store::JpegLayout& /*layout*/,
                              const store::McuMask& /*wanted*/) const override {
    return jpeg(frame);
  }

 private:
  store::FrameBytes unpack(std::span<const std::byte> packed,
                           const store::FrameRecord& record) const {
    // The number of a frame changes with each update, its place does not.
    const store::UnpackedFrames::Key key{record.offset, camera_};
    if (auto known = unpacked_->find(key)) return *known;
    store::FrameBytes jpeg(std::make_shared<const std::vector<std::byte>>(
        unpacked_->packer().unpack(packed, size_, archive_.path())));
    unpacked_->insert(key, jpeg);
    return jpeg;
  }

  ContainedPath archive_;
  std::vector<store::FrameRecord> records_;
  int camera_;
  store::FramePacker::Size size_;
  std::shared_ptr<store::UnpackedFrames> unpacked_;
};

/// What is known of a camera.
struct CameraTail {
  CameraTail(ContainedPath archive_file, ContainedPath journal_file)
      : archive(std::move(archive_file)), journal(std::move(journal_file), kFirstRecords) {}

  ContainedPath archive;
  store::JournalTail journal;
  std::deque<store::FrameRecord> latest;    // stored frames
  std::deque<Nanoseconds> times_of_stored;  // within kRateWindow
  std::int64_t dropped = 0;

  void update() {
    for (const store::FrameRecord& record : journal.read()) {
      // Hostile journals may state any time.
      if (record.time_ns < 0 || record.time_ns > kLatestTime) continue;
      if (record.status == store::FrameStatus::kStored) {
        if (!latest.empty() && record.time_ns <= latest.back().time_ns) continue;  // damaged
        latest.push_back(record);
        times_of_stored.push_back(record.time_ns);
      } else if (record.status != store::FrameStatus::kStartUp) {
        ++dropped;
      }
      // Frames of the times at which slower cameras may still be.
      while (latest.size() > kMaxFramesHeld ||
             (latest.size() > kFramesHeld &&
              latest.front().time_ns < latest.back().time_ns - kMostPatience)) {
        latest.pop_front();
      }
      while (!times_of_stored.empty() &&
             times_of_stored.front() < times_of_stored.back() - kRateWindow) {
        times_of_stored.pop_front();
      }
    }
  }
  /// Returns how much older than the newest frame of all cameras this camera's may be.
  Nanoseconds patience() const {
    const double rate = fps();
    if (rate <= 0) return kStalled;
    return std::clamp(static_cast<Nanoseconds>(2e9 / rate), kStalled, kMostPatience);
  }
  double fps() const {
    if (times_of_stored.size() < 2) return 0;
    return static_cast<double>(times_of_stored.size() - 1) * 1e9 /
           static_cast<double>(times_of_stored.back() - times_of_stored.front());
  }
};

/// Opens archives that have the latest frames only.
class TailArchives final : public store::RemoteArchives {
 public:
  TailArchives(const std::vector<CameraTail>& cameras, const schemas::TakeDocument& take,
               const rig::Rig& rig, std::shared_ptr<store::UnpackedFrames> unpacked)
      : unpacked_(std::move(unpacked)) {
    for (std::size_t i = 0; i < cameras.size(); ++i) {
      const rig::CameraModel& model = rig.cameras[i].model;
      descriptions_.push_back({take.cameras[i].id, model.width(), model.height(), take.epoch_utc});
      records_.emplace_back(cameras[i].latest.begin(), cameras[i].latest.end());
      archives_.push_back(cameras[i].archive);
    }
  }

  std::optional<store::ArchiveReader> open(int camera) const override {
    const auto index = static_cast<std::size_t>(camera);
    auto frames = std::make_shared<const ArchiveTail>(archives_[index], records_[index], camera,
                                                      descriptions_[index], unpacked_);
    return std::optional<store::ArchiveReader>(std::in_place, descriptions_[index], records_[index],
                                               std::move(frames));
  }
  bool is_missing(int /*camera*/) const override { return false; }

 private:
  std::vector<store::ArchiveWriter::Description> descriptions_;
  std::vector<std::vector<store::FrameRecord>> records_;
  std::vector<ContainedPath> archives_;
  std::shared_ptr<store::UnpackedFrames> unpacked_;
};

/// Returns whether nothing was written into a take's archives and accounts for kSilence.
bool is_silent(const fs::path& take) {
  const auto recently = fs::file_time_type::clock::now() - kSilence;
  for (const char* folder : {"archive", "recording"}) {
    std::error_code error;
    for (fs::directory_iterator entry(take / folder, error), end; !error && entry != end;
         entry.increment(error)) {
      std::error_code of_file;
      const fs::file_time_type written = entry->last_write_time(of_file);
      if (!of_file && written > recently) return false;
    }
  }
  return true;
}

/// Reads what the recorders of a take state about themselves.
void read_sessions(const fs::path& take, LiveStatus& status) {
  bool is_any = false, is_any_open = false;
  status.is_held = false;
  std::error_code error;
  for (fs::directory_iterator entry(take / "recording", error), end; !error && entry != end;
       entry.increment(error)) {
    if (entry->path().extension() != ".json") continue;
    try {
      const schemas::RecordingDocument recording =
          schemas::read_recording(ContainedPath{take, "recording" / entry->path().filename()});
      if (recording.sessions.empty()) continue;
      is_any = true;
      const bool is_open = !recording.sessions.back().stopped_utc;
      is_any_open = is_any_open || is_open;
      status.is_held = status.is_held || (is_open && recording.sessions.back().held);
    } catch (const Error&) {
      continue;  // the recorder replaces it at this moment
    }
  }
  status.has_ended = (is_any && !is_any_open) || is_silent(take);
}

/// Returns the latest time at which all cameras that still record have a frame.
std::optional<Nanoseconds> newest_time(const std::vector<CameraTail>& cameras) {
  std::optional<Nanoseconds> newest;
  for (const CameraTail& camera : cameras) {
    if (camera.latest.empty()) continue;
    newest = std::max(newest.value_or(camera.latest.back().time_ns), camera.latest.back().time_ns);
  }
  if (!newest) return std::nullopt;
  Nanoseconds all = *newest;
  for (const CameraTail& camera : cameras) {
    if (camera.latest.empty() || camera.latest.back().time_ns < *newest - camera.patience())
      continue;
    all = std::min(all, camera.latest.back().time_ns);
  }
  return all;
}

}  // namespace

struct LiveTake::State {
  explicit State(fs::path take_folder) : folder(std::move(take_folder)) {
    take.emplace(folder);
    for (const schemas::TakeDocument::Camera& camera : take->document().cameras) {
      cameras.emplace_back(take->file(camera.archive), take->file(camera.journal));
    }
  }

  fs::path folder;
  std::optional<store::Take> take;
  std::vector<CameraTail> cameras;
  std::shared_ptr<store::UnpackedFrames> unpacked = std::make_shared<store::UnpackedFrames>();
  LiveStatus status;
  std::optional<store::FrameSelection> newest;
};

LiveTake::LiveTake(fs::path folder) : state_(std::make_unique<State>(std::move(folder))) {}
LiveTake::~LiveTake() = default;

void LiveTake::update(Nanoseconds now_utc) {
  State& state = *state_;
  for (CameraTail& camera : state.cameras) camera.update();
  const schemas::TakeDocument document = state.take->document();
  // Opened again: a take reads each archive once.
  store::Take next(state.folder, std::make_shared<const TailArchives>(
                                     state.cameras, document, state.take->rig(), state.unpacked));
  using Camera = schemas::TakeDocument::Camera;
  const auto is_same = [](const Camera& a, const Camera& b) {
    return a.id == b.id && a.archive == b.archive && a.journal == b.journal;
  };
  if (!std::ranges::equal(next.document().cameras, document.cameras, is_same)) {
    throw Error::bad_input("the cameras of the take have changed", state.folder.string(),
                           "Open the take again");
  }
  state.take = std::move(next);
  const Nanoseconds now = now_utc - document.epoch_utc;
  const auto age_of = [&](Nanoseconds time) { return static_cast<double>(now - time) * 1e-9; };
  state.newest.reset();
  state.status.age_s.reset();
  if (const auto time = newest_time(state.cameras)) {
    state.newest = store::select_frames(*state.take, *time,
                                        store::default_frame_tolerance(document.nominal_fps));
    state.status.age_s = age_of(*time);
  }
  state.status.cameras.clear();
  for (std::size_t i = 0; i < state.cameras.size(); ++i) {
    const CameraTail& camera = state.cameras[i];
    LiveStatus::Camera of{document.cameras[i].id, camera.fps(), camera.dropped, {}};
    if (!camera.latest.empty()) of.age_s = age_of(camera.latest.back().time_ns);
    state.status.cameras.push_back(std::move(of));
  }
  read_sessions(state.folder, state.status);
}

const LiveStatus& LiveTake::status() const { return state_->status; }
const store::Take& LiveTake::take() const { return *state_->take; }
const std::optional<store::FrameSelection>& LiveTake::newest() const { return state_->newest; }

bool is_being_recorded(const fs::path& take) {
  std::error_code error;
  if (!fs::is_directory(take / "recording", error)) return false;
  LiveStatus status;
  read_sessions(take, status);
  return !status.has_ended;
}

bool lower_priority_of_process() {
  constexpr int kIdleClassOfDisks = 3 << 13, kProcess = 1;  // linux/ioprio.h
  bool is_allowed = true;
  std::error_code error;
  for (fs::directory_iterator entry("/proc/self/task", error), end; !error && entry != end;
       entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    pid_t thread = 0;
    std::from_chars(name.data(), name.data() + name.size(), thread);
    const sched_param none{};
    is_allowed = sched_setscheduler(thread, SCHED_IDLE, &none) == 0 && is_allowed;
    is_allowed = syscall(SYS_ioprio_set, kProcess, thread, kIdleClassOfDisks) == 0 && is_allowed;
  }
  return is_allowed && !error;
}

}  // namespace raystage::replay
