// SPDX-License-Identifier: Apache-2.0
// Writes a take whose frames are at the ticks of a timeline. plan_retiming() chooses the source
// frames of each tick. A frame is then copied byte for byte, or computed and encoded: blended, or
// interpolated by optical flow in both directions (frame_interpolation.h, frame_forms.h). Cost per
// interpolated frame: one decode, two flow fields, one interpolation and one encode, less where
// consecutive ticks use the same source frames. Cameras run in parallel.
#include "store/processing/retime/retime_take.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <map>
#include <optional>

#include "base/error.h"
#include "base/options.h"
#include "base/parallel.h"
#include "base/resources.h"
#include "schemas/rig_document.h"
#include "store/processing/motion/frame_interpolation.h"
#include "store/processing/retime/frame_forms.h"

namespace raystage::store {
namespace {

using Clock = std::chrono::steady_clock;
using Kind = RetimedFrame::Kind;

const char* name_of(RetimeMethod method) {
  switch (method) {
    case RetimeMethod::kNearest:
      return "nearest";
    case RetimeMethod::kBlend:
      return "blend";
    case RetimeMethod::kFlow:
      return "flow";
  }
  return "";
}

schemas::TakeDocument retimed_document(const schemas::TakeDocument& original, RetimeMethod method,
                                       Nanoseconds later, const std::string& created_by) {
  schemas::TakeDocument document = original;
  document.created_by = created_by;
  document.epoch_utc -= later;
  document.derived_from = {original.name, std::string("retime ") + name_of(method)};
  for (schemas::TakeDocument::Camera& camera : document.cameras) {
    camera.archive.clear();
    camera.journal.clear();
    camera.node.clear();  // all times are on the array's clock now
  }
  return document;
}

// The reasons for missing frames near a time, from a camera's journal.
class MissingReasons {
 public:
  MissingReasons(const ArchiveReader& archive, const CameraClock& clock) {
    for (const FrameRecord& record : archive.records()) {
      if (record.status != FrameStatus::kStored) {
        by_time_[clock.corrected(record.time_ns)] = record.status;
      }
    }
  }
  std::optional<FrameStatus> near(Nanoseconds time, Nanoseconds within) const {
    const auto found = by_time_.lower_bound(time - within);
    if (found == by_time_.end() || found->first > time + within) return std::nullopt;
    return found->second;
  }

 private:
  std::map<Nanoseconds, FrameStatus> by_time_;
};

// Returns the rig of the new take: optical flow moves rows of a rolling shutter to one time.
schemas::RigDocument retimed_rig(const Take& take, RetimeMethod method) {
  schemas::RigDocument rig = schemas::read_rig(take.file("rig.json"));
  if (method != RetimeMethod::kFlow) return rig;
  for (schemas::RigDocument::Camera& camera : rig.cameras) camera.geometry.line_time_us = 0;
  return rig;
}

// Interpolates between the frames of one camera, in order of time. Decoded frames and flow are
// reused while the source frames stay the same.
class Retimer {
 public:
  Retimer(FrameForm& form, std::string name, RetimeMethod method)
      : form_(form), name_(std::move(name)), method_(method) {}

  std::vector<std::byte> make(const RetimedFrame& frame) {
    load(frame.first, frame.second);
    const MovableFrame &a = side_[0].picture, &b = side_[1].picture;
    if (method_ == RetimeMethod::kBlend) return form_.blend(a, b, frame.part);
    if (!motion_known_) {
      parallel_for(0, 2, [&](int side) {
        const auto from = static_cast<std::size_t>(side);
        motion_[from] = estimators_[from].estimate(side_[from].picture.image.luma,
                                                   side_[1 - from].picture.image.luma);
      });
      motion_known_ = true;
    }
    return form_.interpolate(a, b, motion_, {frame.part, frame.line_part});
  }

 private:
  struct Side {
    std::int32_t frame = -1;
    MovableFrame picture;
  };

  void load(std::int32_t first, std::int32_t second) {
    if (side_[0].frame == first && side_[1].frame == second) return;
    motion_known_ = false;
    if (side_[1].frame == first) std::swap(side_[0], side_[1]);
    load(side_[0], first);
    load(side_[1], second);
    const Luma &a = side_[0].picture.image.luma, &b = side_[1].picture.image.luma;
    if (a.width != b.width || a.height != b.height) {
      throw Error::bad_input(fmt::format("frames {} and {} differ in size", first, second), name_,
                             "Verify the take; use it without retiming until it is repaired");
    }
  }
  void load(Side& side, std::int32_t frame) {
    if (side.frame == frame) return;
    side.picture = form_.read(frame);
    side.frame = frame;
  }

  FrameForm& form_;
  const std::string name_;
  const RetimeMethod method_;
  std::array<Side, 2> side_;
  std::array<FlowField, 2> motion_;  // from each side to the other
  std::array<OpticalFlowEstimator, 2> estimators_;
  bool motion_known_ = false;
};

struct CameraResult {
  RetimeReport report;
  double moving_ms = 0;
};

}  // namespace

RetimeReport retime_take(const Take& take, const Timeline& timeline,
                         const std::vector<std::vector<Nanoseconds>>& times,
                         const RetimeOptions& options, const std::filesystem::path& folder,
                         const std::string& created_by, const std::function<void(double)>& progress,
                         const std::stop_token& stop) {
  require_valid(options, "retiming");
  take.check_not_inside(folder);
  use_one_opencv_thread();
  const auto cameras = static_cast<std::size_t>(take.camera_count());
  // Times in archives are not negative, but corrected times may be.
  const Nanoseconds half = timeline.tolerance + 1;
  const Nanoseconds later = std::max<Nanoseconds>(0, half - timeline.ticks.front().time_ns);

  TakeWriter writer(folder, retimed_document(take.document(), options.method, later, created_by),
                    retimed_rig(take, options.method));
  Timeline retimed;
  retimed.fps = timeline.fps;
  retimed.tolerance = timeline.tolerance;
  retimed.ticks.resize(timeline.ticks.size());
  for (std::size_t k = 0; k < retimed.ticks.size(); ++k) {
    retimed.ticks[k].time_ns = timeline.ticks[k].time_ns + later;
    retimed.ticks[k].frame.assign(cameras, -1);
    retimed.ticks[k].difference.assign(cameras, 0);
  }

  std::vector<CameraResult> results(cameras);
  std::atomic<std::size_t> done = 0;
  const auto retime_camera = [&](std::size_t c) {
    const auto index = static_cast<int>(c);
    const ArchiveReader& from = take.archive(index);
    ArchiveWriter& to = writer.archive(index);
    const std::string name = take.folder().string() + ", camera " + take.document().cameras[c].id;
    const CameraClock clock = timeline.clocks.empty() ? CameraClock{} : timeline.clocks[c];
    const MissingReasons reasons(from, clock);
    const std::unique_ptr<FrameForm> form = frame_form_of(take, index, name, options.quality);
    Retimer retimer(*form, name, options.method);
    RetimeReport& report = results[c].report;
    std::int32_t stored = 0;
    const double line_time_us = take.rig().cameras[c].line_time_us;
    RetimePlanner planner(timeline, c, times[c], options, line_time_us);
    const auto sequence = [](std::int32_t i) {
      return FrameOrigin{kUnknownTime, static_cast<std::uint64_t>(i)};
    };
    // Throws RottenFrame before anything is written.
    const auto write_frame = [&](const RetimedFrame& frame) {
      if (frame.kind == Kind::kUnchanged) {
        to.append(form->unchanged(frame.first), frame.time + later, sequence(frame.first));
        ++report.unchanged;
        if (options.method == RetimeMethod::kFlow && line_time_us != 0) ++report.uncorrected;
        return;
      }
      const auto start = Clock::now();
      const std::vector<std::byte> made = retimer.make(frame);
      results[c].moving_ms +=
          std::chrono::duration<double, std::milli>(Clock::now() - start).count();
      to.append(made, frame.time + later, sequence(frame.part <= 0.5 ? frame.first : frame.second));
      ++report.interpolated;
    };
    for (std::size_t k = 0; k < timeline.ticks.size(); ++k) {
      if (stop.stop_requested()) {
        throw Error::failed("retiming was stopped", folder.string(),
                            "Start it again; no files remain");
      }
      const Nanoseconds tick = timeline.ticks[k].time_ns;
      RetimedFrame frame = planner.plan(k);
      while (frame.kind != Kind::kMissing) {
        try {
          write_frame(frame);
          retimed.ticks[k].frame[c] = stored++;
          retimed.ticks[k].difference[c] = frame.time - tick;
          break;
        } catch (const RottenFrame& rotten) {
          if (options.rotten_frames == RottenFrames::kError) throw;
          planner.exclude(rotten.frame());
          ++report.rotten;
          frame = planner.plan(k);
        }
      }
      if (frame.kind == Kind::kMissing) {
        // Without a record of the loss the frame is only absent in the timeline.
        std::optional<FrameStatus> reason = reasons.near(tick, half);
        if (planner.is_excluded(timeline.ticks[k].frame[c])) reason = FrameStatus::kTorn;
        if (reason) to.append_missing(*reason, tick + later, sequence(0));
        ++report.missing;
      }
      progress(static_cast<double>(++done) / static_cast<double>(cameras * timeline.ticks.size()));
    }
    to.close();
  };
  parallel_for_in_order(
      cameras, static_cast<std::size_t>(available_threads()), [&] { return stop.stop_requested(); },
      retime_camera);
  if (stop.stop_requested()) {
    throw Error::failed("retiming was stopped", folder.string(), "Start it again; no files remain");
  }
  writer.finish();
  write_timeline(retimed, writer.working_folder());
  writer.commit();

  RetimeReport sum;
  sum.status = RunStatus::kFinished;
  double moving_ms = 0;
  for (std::size_t c = 0; c < cameras; ++c) {
    const CameraResult& result = results[c];
    if (result.report.rotten > 0) {
      sum.rotten_cameras.push_back(take.document().cameras[c].id);
      sum.rotten += result.report.rotten;
    }
    sum.interpolated += result.report.interpolated;
    sum.unchanged += result.report.unchanged;
    sum.uncorrected += result.report.uncorrected;
    sum.missing += result.report.missing;
    moving_ms += result.moving_ms;
  }
  if (sum.interpolated > 0)
    sum.ms_per_interpolated = moving_ms / static_cast<double>(sum.interpolated);
  return sum;
}

}  // namespace raystage::store
