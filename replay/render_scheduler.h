// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <stop_token>

namespace raystage::replay {

/// What a job is for. Each client has at most one waiting job of each kind, which a newer one
/// replaces, but for kFile and kSnapshot. A client's jobs run in this order.
enum class JobKind {
  kDocument,    ///< opens a shot; ends the client's other jobs but those that write files
  kFile,        ///< writes files; all of them, in turn
  kKeys,        ///< finds keys of the camera
  kFocus,       ///< finds a focus distance
  kProbe,       ///< reads a pixel
  kMotion,      ///< renders a view that is needed now; ends the client's refinement
  kSource,      ///< shows source frames
  kFolder,      ///< lists a folder
  kThumbnail,   ///< shows a take's thumbnail
  kSnapshot,    ///< renders a frame into a file, beside what the user sees; all of them, in turn
  kRefinement,  ///< renders a view for which the user can wait; a newer one ends it
  kRanges,      ///< computes ranges of motion; any other job of their lane ends it
};

/// Runs the jobs of several clients on two threads: snapshots, refinements and ranges on one, all
/// other jobs on the other, which has the higher priority in TBB. Clients take turns. Thread-safe.
class RenderScheduler {
 public:
  using ClientId = std::int64_t;
  /// `stop` is requested when the result is no longer wanted. May throw Cancelled. Every other
  /// exception ends the program: jobs report their own errors.
  using Job = std::function<void(const std::stop_token& stop)>;

  /// `threads`: of the renderers; 0: all.
  explicit RenderScheduler(int threads);
  /// Ends all jobs.
  ~RenderScheduler();

  /// `dropped`: called if the job never runs, because a newer one of its kind came, too many
  /// files wait, or its client was removed. Must not call the scheduler.
  void submit(ClientId client, JobKind kind, Job job, std::function<void()> dropped = {});
  /// Drops the waiting jobs of a client and requests the running ones to stop, which may end later.
  void remove(ClientId client);
  /// Ends the threads. Jobs that are submitted later never run.
  void end();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace raystage::replay
