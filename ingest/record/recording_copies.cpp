// SPDX-License-Identifier: Apache-2.0
// Writes each frame to the take and to its mirror, independently. A frame stays in memory until
// both have it. When more than half of the memory is used and most of that waits for one copy only,
// that copy is stopped, so that it never costs a frame of the other.
#include "ingest/record/recording_copies.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <utility>

#include "base/error.h"
#include "ingest/record/audit.h"

namespace raystage::ingest {

RecordingCopies::RecordingCopies(std::vector<RecordingTake*> takes, const Frames& frames,
                                 const Options& options)
    : frames_(frames) {
  for (FrameQueue& queue : frames_.queues) queue.set_writers(takes.size());
  for (std::size_t i = 0; i < takes.size(); ++i) {
    RecordingTake* const take = takes[i];
    std::vector<ArchiveWriterThread::Camera> cameras;
    for (std::size_t camera = 0; camera < frames_.queues.size(); ++camera) {
      cameras.push_back({frames_.queues[camera], take->archive(camera), frames_.counters[camera]});
    }
    copies_.push_back(
        {take, std::make_unique<ArchiveWriterThread>(
                   std::move(cameras),
                   ArchiveWriterThread::Options{
                       .hold = options.hold,
                       .writer = i,
                       .release_reserved_space = [take] { take->release_disk_space(); },
                       .drain_timeout_s = options.drain_timeout_s,
                       .flush_interval_s = options.flush_interval_s,
                       .memory = &frames_.memory})});
  }
}

const RecordingCopies::Copy& RecordingCopies::reference() const {
  return *std::ranges::find_if(copies_, &Copy::is_active);
}

RecordingCopies::Copy& RecordingCopies::reference() {
  return *std::ranges::find_if(copies_, &Copy::is_active);
}

std::size_t RecordingCopies::active_count() const {
  return static_cast<std::size_t>(std::ranges::count_if(copies_, &Copy::is_active));
}

/// Returns whether the copy was stopped now.
bool RecordingCopies::stop(Copy& copy, std::string reason) {
  const std::scoped_lock lock(stop_mutex_);
  if (!copy.is_active() || active_count() == 1) return false;
  copy.stop_reason = std::move(reason);
  *copy.is_stopped = true;
  copy.writer->stop();
  return true;
}

std::size_t RecordingCopies::bytes_only_for(std::size_t copy) const {
  std::size_t bytes = 0;
  for (const FrameQueue& queue : frames_.queues) bytes += queue.bytes_only_for(copy);
  return bytes;
}

/// Returns the active copy for which the fewest bytes wait; the first one of several.
std::size_t RecordingCopies::most_complete() const {
  std::size_t best = copies_.size(), fewest = 0;
  for (std::size_t i = 0; i < copies_.size(); ++i) {
    if (!copies_[i].is_active()) continue;
    // What waits for all copies makes no difference.
    const std::size_t waiting = bytes_only_for(i);
    if (best < copies_.size() && waiting >= fewest) continue;
    best = i;
    fewest = waiting;
  }
  return best;
}

void RecordingCopies::watch() {
  if (active_count() == 1) return;
  for (Copy& copy : copies_) {
    if (!copy.is_active()) continue;
    // The disk lost data that it had accepted.
    if (std::string failure = copy.writer->flush_error(); !failure.empty()) {
      stop(copy, std::move(failure));
    }
  }
  constexpr double kMost = 0.5;
  if (frames_.memory.is_under_pressure()) stop_lagging(kMost);
}

bool RecordingCopies::free_memory() {
  constexpr double kQuarter = 0.25;
  return active_count() > 1 && stop_lagging(kQuarter);
}

/// Stops the copy for which alone more than this share of the used memory waits.
bool RecordingCopies::stop_lagging(double share) {
  for (std::size_t i = 0; i < copies_.size(); ++i) {
    if (!copies_[i].is_active()) continue;
    const auto waiting = static_cast<double>(bytes_only_for(i));
    if (waiting <= share * static_cast<double>(frames_.memory.used())) continue;
    std::string failure = copies_[i].writer->write_error();
    if (failure.empty()) {
      failure = fmt::format("its disk is too slow: {:.1f} MB of frames waited for it alone",
                            waiting / 1e6);
    }
    if (stop(copies_[i], std::move(failure))) return true;
  }
  return false;
}

void RecordingCopies::drain(const std::function<void(double)>& progress) {
  for (Copy& copy : copies_) {
    if (!copy.is_active()) continue;
    copy.drain = std::make_unique<Drain>();
    copy.drain->thread = std::jthread(
        [&drain = *copy.drain, &writer = *copy.writer,
         report = &copy == &copies_.front() ? progress : std::function<void(double)>()] {
          const std::string failure =
              exception_message([&] { drain.is_whole = writer.write_remaining(report); });
          if (!failure.empty()) drain.is_whole = false;
          drain.is_over = true;
        });
  }
  wait_for_drains();
  const auto is_whole = [](const Copy& copy) {
    return copy.is_active() && copy.drain && copy.drain->is_whole;
  };
  // Without a whole copy the one that has most gets records of what it lacks.
  const bool one_is_whole = std::ranges::any_of(copies_, is_whole);
  const Copy* const kept = one_is_whole ? nullptr : &copies_[most_complete()];
  for (Copy& copy : copies_) {
    if (is_whole(copy) || &copy == kept) continue;
    std::string failure = copy.writer->write_error();
    stop(copy, failure.empty() ? "its disk did not accept the last frames" : failure);
  }
  if (!one_is_whole) reference().writer->drop_remaining();
  watch();
}

/// Waits until all active copies are written. A copy that hangs is stopped if another is over:
/// whole, or with records of the frames that its disk refuses.
void RecordingCopies::wait_for_drains() {
  using Clock = std::chrono::steady_clock;
  constexpr auto kPoll = std::chrono::milliseconds(2);
  constexpr auto kHangs = std::chrono::seconds(30);
  struct Progress {
    std::size_t waiting = 0;
    Clock::time_point since = Clock::now();
  };
  std::vector<Progress> progress(copies_.size());
  for (;;) {
    bool all_over = true, one_is_over = false;
    for (const Copy& copy : copies_) {
      if (!copy.is_active()) continue;
      all_over = all_over && copy.drain->is_over;
      one_is_over = one_is_over || copy.drain->is_over;
    }
    if (all_over) return;
    for (std::size_t i = 0; i < copies_.size(); ++i) {
      if (!copies_[i].is_active() || copies_[i].drain->is_over) continue;
      std::size_t waiting = 0;
      for (const FrameQueue& queue : frames_.queues) waiting += queue.size(i);
      if (waiting != std::exchange(progress[i].waiting, waiting)) progress[i].since = Clock::now();
      if (one_is_over && Clock::now() - progress[i].since > kHangs) {
        stop(copies_[i], "its disk accepted no data for 30 s");
      }
    }
    std::this_thread::sleep_for(kPoll);
  }
}

void RecordingCopies::close(std::vector<std::string>& problems) {
  for (Copy& copy : copies_) {
    if (!copy.is_active()) continue;  // its disk may hang: see finish()
    std::vector<std::string> own;
    if (const std::string failure = copy.writer->flush_error(); !failure.empty()) {
      own.push_back(failure + " Frames written before that may be lost");
    }
    copy.take->close(own);
    if (own.empty()) continue;
    if (active_count() > 1) {
      stop(copy, own.front());
    } else {
      problems.insert(problems.end(), own.begin(), own.end());
    }
  }
}

/// Joins the threads of a copy that was stopped, and closes it as far as its disk allows that.
void RecordingCopies::give_up(Copy& copy, const schemas::RecordingDocument::Session& session) {
  copy.drain = nullptr;
  copy.writer = nullptr;
  std::vector<std::string> ignored;
  copy.take->close(ignored);
  exception_message([&] { copy.take->write_session(session, false); });
}

void RecordingCopies::compare_with_reference(Copy& copy) {
  try {
    for (std::size_t camera = 0; camera < frames_.queues.size(); ++camera) {
      const RecordingTake::RecordCounts counted = copy.take->count(camera);
      for (std::size_t s = 0; s < store::kFrameStatusCount; ++s) {
        const auto status = static_cast<store::FrameStatus>(s);
        if (counted.by_status[s] == written(camera, status)) continue;
        stop(copy, fmt::format("camera {} has {} records \"{}\" there, not {}",
                               copy.take->document().cameras[camera].id, counted.by_status[s],
                               store::name_of(status), written(camera, status)));
        return;
      }
    }
  } catch (const Error& error) {
    stop(copy, error.what());
  }
}

void RecordingCopies::finish(schemas::RecordingDocument::Session& session,
                             std::vector<std::string> problems) {
  audit_session(*reference().take, *reference().writer, frames_.counters, session,
                std::move(problems));
  const Copy* const audited = &reference();
  for (Copy& copy : copies_) {
    if (copy.is_active() && &copy != audited) compare_with_reference(copy);
  }
  const auto describe = [&] {
    session.copies.clear();
    if (copies_.size() == 1) return;
    for (const Copy& copy : copies_) {
      session.copies.push_back({copy.take->folder().string(), copy.is_active(), copy.stop_reason});
    }
  };
  describe();
  for (Copy& copy : copies_) {
    if (&copy == audited || !copy.is_active()) continue;
    const std::string failure =
        exception_message([&] { copy.take->write_session(session, false); });
    if (!failure.empty()) stop(copy, failure);
  }
  describe();
  const std::string failure =
      exception_message([&] { reference().take->write_session(session, false); });
  if (!failure.empty()) {  // the session is returned to the caller anyway
    session.audit->holds = false;
    session.audit->problems.push_back(failure);
  }
  for (Copy& copy : copies_) {
    if (!copy.is_active()) give_up(copy, session);
  }
}

std::uint64_t RecordingCopies::written(std::size_t camera, store::FrameStatus status) const {
  return reference().writer->written(camera, status);
}

std::uint64_t RecordingCopies::bytes_written() const { return reference().writer->bytes_written(); }

std::string RecordingCopies::write_error() const { return reference().writer->write_error(); }

std::vector<std::filesystem::path> RecordingCopies::active_folders() const {
  std::vector<std::filesystem::path> folders;
  for (const Copy& copy : copies_) {
    if (copy.is_active()) folders.push_back(copy.take->folder());
  }
  return folders;
}

std::vector<RecordingCopies::Status> RecordingCopies::status() const {
  std::vector<Status> all;
  for (std::size_t i = 0; i < copies_.size(); ++i) {
    const Copy& copy = copies_[i];
    all.push_back({copy.take->folder(), copy.is_active() ? std::string() : copy.stop_reason,
                   copy.is_active() ? copy.writer->write_error() : std::string(),
                   bytes_only_for(i)});
  }
  return all;
}

}  // namespace raystage::ingest
