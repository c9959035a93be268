// SPDX-License-Identifier: Apache-2.0
// Renders the frames of a sequence in increasing order, several in flight. While a frame is
// rendered, the source frames of a later one are read from the disk, and finished files are written
// by FileWriter's thread. A frame that fails is reported; only lack of memory ends the sequence.
#include "compose/sequence.h"

#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <map>
#include <mutex>
#include <new>
#include <set>
#include <string>
#include <vector>

#include "base/atomic_file.h"
#include "base/cancellation.h"
#include "base/parallel.h"
#include "base/stopwatch.h"
#include "compose/exr/exr_deep_file.h"
#include "compose/exr/exr_file.h"
#include "compose/file_writer.h"
#include "compose/frame_compositor.h"
#include "compose/frame_range.h"
#include "compose/sequence_checks.h"
#include "images/exr_reader.h"
#include "store/absent_archives.h"

namespace raystage::compose {
namespace {

const char* view_name(Eye eye) {
  return eye == Eye::kLeft ? "left" : eye == Eye::kRight ? "right" : "";
}

/// Returns the methods of the light fields, such as "depth and focal_plane".
std::string methods_text(const ShotPlan& plan) {
  std::set<std::string> names;
  for (const auto* light_field : plan.light_fields()) {
    names.insert(light_field->reconstruction().method);
  }
  return fmt::format("{}", fmt::join(names, " and "));
}

/// Renders the frames of a sequence. Members are shared by the frames in flight.
class SequenceRun {
 public:
  SequenceRun(const ShotPlan& plan, const SequenceName& name, std::span<const PlannedFrame> frames,
              const FrameCompositor& compositor, const SequenceOptions& options,
              std::stop_token stop)
      : plan_(plan),
        name_(name),
        deep_name_(name.with("deep")),
        frames_(frames),
        compositor_(compositor),
        options_(options),
        stop_(std::move(stop)) {}

  SequenceReport run(int frames_in_flight) {
    const Stopwatch watch;
    try {
      parallel_for_in_order(
          frames_.size(), static_cast<std::size_t>(frames_in_flight),
          [this] { return stop_.stop_requested() || out_of_memory_; },
          [this, frames_in_flight](std::size_t index) {
            read_ahead(index + static_cast<std::size_t>(frames_in_flight));
            process(frames_[index]);
          });
    } catch (const Cancelled&) {
      // The frames in flight are dropped; those that are finished will be written.
    }
    writer_.finish();
    if (out_of_memory_) throw std::bad_alloc();
    report_uncovered_views();
    report_rotten_cameras();
    report_.frames_below_coverage = {below_coverage_.begin(), below_coverage_.end()};
    report_.frames_with_rot = {with_rot_.begin(), with_rot_.end()};
    report_.seconds = watch.ms() / 1e3;
    report_.frames_in_flight = frames_in_flight;
    report_.requested = static_cast<int>(frames_.size());
    report_.frames_read_ahead = compositor_.frames_read_ahead();
    report_.decoding = compositor_.decode_costs();
    report_.light_field_frames_estimated = compositor_.stored_data().derived;
    report_.light_field_frames_loaded = compositor_.stored_data().read;
    const std::size_t done =
        static_cast<std::size_t>(report_.rendered + report_.skipped) + report_.failures.size();
    report_.status = done < frames_.size() ? RunStatus::kStopped : RunStatus::kFinished;
    std::sort(report_.failures.begin(), report_.failures.end(),
              [](const auto& a, const auto& b) { return a.frame < b.frame; });
    return std::move(report_);
  }

 private:
  // Progress counts tenths of a frame.
  static constexpr int kPartsOfFrame = 10, kPartsOfRender = 8;
  static constexpr double kReportedUncoveredShare = 0.02;  // of a view

  /// Requests the source frames of a later frame from the disk. Does nothing if the frame's file
  /// exists and may be kept, as only reading the file can determine.
  void read_ahead(std::size_t index) {
    if (index >= frames_.size()) return;
    if (options_.existing == ExistingFiles::kSkip &&
        file_exists(name_.path(frames_[index].frame))) {
      return;
    }
    compositor_.read_ahead(frames_[index]);
  }

  void process(const PlannedFrame& frame) {
    int parts_left = kPartsOfFrame;
    try {
      process_or_throw(frame, parts_left);
    } catch (const std::bad_alloc&) {
      throw;  // other frames would fail, too; a farm retries with more memory
    } catch (const std::exception& error) {
      fail(frame.frame, error);
    }
    if (!stop_.stop_requested()) advance(parts_left);
  }

  void fail(int frame, const std::exception& error) {
    options_.on_message(fmt::format("frame {} failed: {}", frame, error.what()));
    const std::scoped_lock lock(mutex_);
    const auto* known = dynamic_cast<const Error*>(&error);
    const bool is_bad_input = known != nullptr && known->exit_code() == ExitCode::kBadInput;
    report_.failures.push_back({frame, error.what(), is_bad_input});
  }

  /// Renders a frame and queues its files. `parts_left`: progress that remains after an exception.
  void process_or_throw(const PlannedFrame& frame, int& parts_left) {
    throw_if_cancelled();
    const std::filesystem::path file = name_.path(frame.frame);
    const std::string fingerprint = plan_.fingerprint(frame, options_.chromaticities);
    const std::filesystem::path deep_file = deep_name_.path(frame.frame);
    const auto kept = options_.existing == ExistingFiles::kSkip
                          ? find_complete_exr(exr_, file, fingerprint)
                          : std::nullopt;
    if (kept && (!options_.deep || find_complete_exr(exr_, deep_file, fingerprint))) {
      const FrameQuality& quality = *kept;
      const bool may_lack_cameras = options_.rotten_frames == store::RottenFrames::kAbsent;
      if (may_lack_cameras || quality.rotten_cameras.empty()) {
        const std::scoped_lock lock(mutex_);
        check_quality(frame.frame, quality);
        ++report_.skipped;
        return;
      }
    }
    ExrMetadata metadata = plan_.metadata(frame);
    metadata.fingerprint = fingerprint;
    metadata.program_version = options_.program_version;
    metadata.chromaticities = options_.chromaticities;

    const std::vector<Eye> eyes = plan_.eyes();
    std::vector<CompositedView> painted;
    std::vector<DeepImage> deep(options_.deep ? eyes.size() : 0);
    std::vector<ExrView> views;
    std::vector<ExrCamera> cameras;
    for (const Eye eye : eyes) {
      cameras.push_back(plan_.exr_camera(frame.frame, eye));
      painted.push_back(compositor_.composite_exposure(
          frame, eye, stop_, options_.deep ? &deep[painted.size()] : nullptr));
      if (stop_.stop_requested()) return;
    }
    // After the loop, because views keep references to elements of `painted`.
    for (std::size_t i = 0; i < eyes.size(); ++i) {
      views.push_back(exr_view(painted[i].picture, view_name(eyes[i])));
      for (const double uncovered : painted[i].uncovered_share) {
        metadata.covered_share = std::min(metadata.covered_share, 1 - uncovered);
      }
      render::add_notes(painted[i].picture.notes, metadata.notes);
      std::vector<std::string>& rotten = metadata.rotten_cameras;
      rotten.insert(rotten.end(), painted[i].rotten_cameras.begin(),
                    painted[i].rotten_cameras.end());
    }
    std::ranges::sort(metadata.rotten_cameras);
    const auto repeated =
        std::unique(metadata.rotten_cameras.begin(), metadata.rotten_cameras.end());
    metadata.rotten_cameras.erase(repeated, metadata.rotten_cameras.end());
    advance(kPartsOfRender);
    parts_left -= kPartsOfRender;

    const Stopwatch encoding;
    std::vector<FileWriter::File> files;
    if (options_.deep) {
      files.push_back({deep_file, encode_deep_exr(deep_views(deep, eyes), cameras, metadata)});
    }
    files.push_back({file, encode_exr(views, cameras, metadata)});
    account(painted, metadata, encoding.ms());
    const double write_wait = writer_.write(
        std::move(files),
        [this, frame = frame.frame, parts_left](const FileWriter::WriteResult& written) {
          wrote(frame, written, parts_left);
        });
    parts_left = 0;
    const std::scoped_lock lock(mutex_);
    report_.milliseconds.write_wait += write_wait * 1e3;
  }

  void account(const std::vector<CompositedView>& painted, const ExrMetadata& metadata,
               double encode_ms) {
    const std::scoped_lock lock(mutex_);
    for (const std::string& note : metadata.notes) {
      if (notes_.insert(note).second) options_.on_message(note);
    }
    report_.decoded_bytes_cached =
        std::max(report_.decoded_bytes_cached, compositor_.decoded_bytes_cached());
    check_quality(metadata.frame, {metadata.covered_share, metadata.rotten_cameras});
    StageTimes& ms = report_.milliseconds;
    ms.encode += encode_ms;
    for (const CompositedView& view : painted) {
      for (std::size_t i = 0; i < view.uncovered_share.size(); ++i) {
        if (view.uncovered_share[i] < kReportedUncoveredShare) continue;
        auto& [frames, most] = uncovered_[i];
        frames.insert(metadata.frame);
        most = std::max(most, view.uncovered_share[i]);
      }
      report_.pixels_decoded += view.picture.statistics.pixels_decoded;
      ms.light_fields += view.times.light_fields_ms;
      ms.geometry += view.times.geometry_ms;
      ms.merge += view.times.merge_ms;
    }
  }

  /// Notes a frame that falls short. Locked by the caller.
  void check_quality(int frame, const FrameQuality& quality) {
    if (quality.covered_share < options_.least_coverage) below_coverage_.insert(frame);
    if (!quality.rotten_cameras.empty()) with_rot_.insert(frame);
    rotten_cameras_.insert(quality.rotten_cameras.begin(), quality.rotten_cameras.end());
  }

  /// Runs on the writer's thread, which must not throw.
  void wrote(int frame, const FileWriter::WriteResult& written, int parts) noexcept {
    try {
      if (written.error) {
        try {
          std::rethrow_exception(written.error);
        } catch (const std::bad_alloc&) {
          throw;
        } catch (const std::exception& error) {
          fail(frame, error);
        }
      } else {
        const std::scoped_lock lock(mutex_);
        ++report_.rendered;
        report_.bytes_written += static_cast<std::int64_t>(written.bytes);
        report_.milliseconds.write += written.seconds * 1e3;
      }
      if (!stop_.stop_requested()) advance(parts);
    } catch (const std::bad_alloc&) {
      out_of_memory_ = true;
    }
  }

  static std::vector<ExrDeepView> deep_views(const std::vector<DeepImage>& deep,
                                             const std::vector<Eye>& eyes) {
    std::vector<ExrDeepView> views;
    static_assert(sizeof(DeepImage::Sample) == 5 * sizeof(float));
    for (std::size_t i = 0; i < deep.size(); ++i) {
      const auto& samples = deep[i].samples;
      views.push_back({view_name(eyes[i]),
                       deep[i].begin,
                       {samples.empty() ? nullptr : samples.data()->rgba, 5 * samples.size()}});
    }
    return views;
  }

  /// Reports views that leave the array: their transparent pixels appear black and are easily
  /// missed.
  void report_uncovered_views() const {
    for (const auto& [layer, uncovered_share] : uncovered_) {
      options_.on_message(
          fmt::format("{}up to {:.0f} % of the view is seen by no camera, in frames {}",
                      layer_label(plan_, layer), 100 * uncovered_share.second,
                      format_frame_range(std::vector<int>(uncovered_share.first.begin(),
                                                          uncovered_share.first.end()))));
    }
  }

  void report_rotten_cameras() const {
    if (with_rot_.empty()) return;
    const std::string frames =
        format_frame_range(std::vector<int>(with_rot_.begin(), with_rot_.end()));
    // Also said of frames of an earlier run that are kept.
    options_.on_message(fmt::format(
        "{} {} rendered without cameras whose stored frames were rotten (XXH3): {}. Check the take "
        "with `raystage verify`, and repair it; then render again with --frames {} --existing "
        "overwrite",
        with_rot_.size() == 1 ? "frame" : "frames",
        with_rot_.size() == 1 ? frames + " was" : frames + " were",
        fmt::join(rotten_cameras_, ", "), frames));
  }

  void advance(int parts) {
    const std::int64_t done = parts_done_ += parts;
    options_.progress(static_cast<double>(done) /
                      (static_cast<double>(frames_.size()) * kPartsOfFrame));
  }

  const ShotPlan& plan_;
  const SequenceName& name_;
  const SequenceName deep_name_;
  std::span<const PlannedFrame> frames_;
  const FrameCompositor& compositor_;
  const SequenceOptions& options_;
  std::stop_token stop_;
  std::atomic<std::int64_t> parts_done_ = 0;
  std::atomic<bool> out_of_memory_ = false;  ///< on the writer's thread
  std::mutex mutex_;                         ///< of what follows
  SequenceReport report_;
  std::set<std::string> notes_;  ///< already reported
  /// For each layer: frames with uncovered pixels, and their largest share.
  std::map<std::size_t, std::pair<std::set<int>, double>> uncovered_;
  std::set<int> with_rot_;  ///< frames from which cameras with rotten frames are absent
  std::set<std::string> rotten_cameras_;
  std::set<int> below_coverage_;  ///< frames below SequenceOptions::least_coverage
  images::ExrReader exr_;
  FileWriter writer_{kMaxQueuedFrames};  ///< last member: finishes before the others are destroyed
};

void write_fingerprints(const CheckedSequence& checked, const SequenceOptions& options) {
  std::string text;
  for (const PlannedFrame& frame : checked.frames) {
    text += fmt::format("{} {}\n", frame.frame,
                        checked.plan->fingerprint(frame, options.chromaticities));
  }
  create_folder(options.fingerprints_file.parent_path());
  write_file_atomically(options.fingerprints_file, text);
}

}  // namespace

std::vector<int> frames_to_render(const schemas::ShotDocument& shot,
                                  const std::optional<std::vector<int>>& requested,
                                  const std::function<void(std::string_view)>& say) {
  std::vector<int> frames;
  if (!requested) {
    for (int frame = shot.first_frame; frame <= shot.last_frame; ++frame) frames.push_back(frame);
    return frames;
  }
  std::copy_if(requested->begin(), requested->end(), std::back_inserter(frames),
               [&](int frame) { return frame >= shot.first_frame && frame <= shot.last_frame; });
  const std::string range = fmt::format("{}-{}", shot.first_frame, shot.last_frame);
  if (frames.empty()) {
    throw Error::bad_input(fmt::format("none of the frames {} is in the shot, which has frames {}",
                                       format_frame_range(*requested), range),
                           "", "Request frames of the shot");
  }
  if (frames.size() < requested->size()) {
    say(fmt::format("the shot has frames {}; {} requested frames are outside and are ignored",
                    range, requested->size() - frames.size()));
  }
  return frames;
}

std::string default_output(const std::filesystem::path& shot_file,
                           const schemas::ShotDocument& shot, bool is_draft) {
  const std::string shot_name = shot.name.empty() ? shot_file.stem().string() : shot.name;
  // A draft of some layers hides the others.
  const auto shown =
      std::ranges::find_if(shot.layers, [&](const auto& l) { return !is_draft || l.opacity > 0; });
  const std::string& layer = (shown == shot.layers.end() ? shot.layers.begin() : shown)->name;
  std::string name = layer.empty() ? shot_name : shot_name + "_" + layer;
  // Names are free text and must not add a path or a frame token.
  for (char& c : name) {
    if (c == '/' || c == '#' || c == '@' || c == '%' || c == ' ') c = '_';
  }
  if (is_draft) name += "_draft";
  return (shot_file.parent_path() / "renders" / (name + ".####.exr")).string();
}

CheckedSequence check_sequence(const std::filesystem::path& shot_file,
                               const SequenceOptions& options) {
  auto opened = std::make_unique<const ShotPlan>(
      shot_file, ShotPlanOptions{.fill = options.fill,
                                 .target = options.target,
                                 .draft = options.draft,
                                 .rotten_frames = options.rotten_frames,
                                 .layout = options.layout,
                                 .color_config = options.color_config,
                                 .aovs = options.aovs,
                                 .frames = options.frames,
                                 .cache_folder = options.cache_folder,
                                 .memory_bytes = options.memory_bytes,
                                 .folder = options.folder,
                                 .accepts_missing_archives = options.accepts_missing_archives,
                                 .hosts = options.hosts});
  const ShotPlan& plan = *opened;
  if (plan.hosts() != nullptr) check_distributed_archives(plan, shot_file);
  const schemas::ShotDocument& shot = plan.shot();
  const std::vector<int> numbers = frames_to_render(shot, options.frames, options.on_message);
  std::vector<PlannedFrame> frames = plan.plan(numbers, options.missing);
  plan.check_files(frames);
  if (plan.measures_coverage()) check_requested_aovs(plan, shot_file);
  check_equirectangular_view(plan, shot_file);
  SequenceMemoryPlan memory = plan_sequence_memory(
      plan, frames, {options.memory_bytes, options.frames_in_flight, options.deep});
  SequenceOptions resolved = options;
  if (resolved.output.empty()) {
    resolved.output = default_output(shot_file, shot, options.draft.is_draft());
  }
  SequenceName name = checked_output_name(resolved, frames.size());
  if (options.deep) check_deep_output(plan, shot_file);
  check_plates_not_overwritten(plan, name, shot_file);
  if (options.existing == ExistingFiles::kError) {
    check_existing_files(name, numbers);
    if (options.deep) check_existing_files(name.with("deep"), numbers);
  }
  check_output_folder(name.folder());
  check_disk_space(name.folder(), plan, frames.size(), options);
  return {std::move(opened), std::move(frames), std::move(name), std::move(memory)};
}

namespace {

void report_missing_archives(const ShotPlan& plan, const SequenceOptions& options) {
  for (const LightFieldLayer* light_field : plan.light_fields()) {
    const std::string missing = store::describe_missing_archives(light_field->take());
    if (!missing.empty()) options.on_message(missing);
  }
}

}  // namespace

SequenceReport render_sequence(const std::filesystem::path& shot_file,
                               const SequenceOptions& options, std::stop_token stop) {
  // Processes on several hosts exchange data in their loops and must end together.
  const CancellationScope cancellation(options.hosts == nullptr ? stop : std::stop_token());
  const CheckedSequence checked = check_sequence(shot_file, options);
  throw_if_cancelled();
  const ShotPlan& plan = *checked.plan;
  const SequenceMemoryPlan& memory = checked.memory;
  if (!options.fingerprints_file.empty()) write_fingerprints(checked, options);
  options.on_plan(plan, checked.frames);
  const FrameCompositor compositor(plan, memory);

  report_sequence_warnings(plan, checked.frames, options);
  std::string plan_text =
      fmt::format("writing {} frame{} to {}, {} in flight, {} of cache", checked.frames.size(),
                  checked.frames.size() == 1 ? "" : "s", checked.name.pattern(),
                  memory.frames_in_flight, format_byte_size(memory.cache));
  if (memory.result_cache + memory.working > 0) {
    plan_text += fmt::format(", {} for results of {}, {} of working memory for each frame",
                             format_byte_size(memory.result_cache), methods_text(plan),
                             format_byte_size(memory.working));
  }
  options.on_message(plan_text);
  if (options.hosts == nullptr) report_missing_archives(plan, options);  // otherwise ranks did
  if (!memory.note.empty()) options.on_message(memory.note);
  options.progress(0);
  return SequenceRun(plan, checked.name, checked.frames, compositor, options, std::move(stop))
      .run(memory.frames_in_flight);
}

}  // namespace raystage::compose
