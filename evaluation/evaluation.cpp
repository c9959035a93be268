// SPDX-License-Identifier: Apache-2.0
// Renders the views of a case list and measures their error (PSNR, SSIM; render/common), time and
// decoded pixels. Each view is rendered by a new renderer with empty frame caches, then repeatedly
// for render times. Output: Evaluation; times in ms of wall clock. Cost: repeat + 2 renderings.
#include "evaluation/evaluation.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>

#include "base/atomic_file.h"
#include "base/cancellation.h"
#include "base/error.h"
#include "base/options.h"
#include "base/stopwatch.h"
#include "evaluation/evaluation_cases.h"
#include "images/image_file.h"
#include "render/memory_budgets.h"
#include "render/methods.h"
#include "render/renderer.h"
#include "rig/plenoptic_sampling.h"
#include "rig/rig.h"
#include "store/rotten_frame.h"
#include "store/timeline.h"

namespace raystage::evaluation {
namespace {

/// Returns 1 per pixel that is covered and has a known truth.
std::vector<std::uint8_t> measured_pixels(const render::RenderedView& view,
                                          const GroundTruth& truth) {
  std::vector<std::uint8_t> measured = render::coverage_mask(view);
  for (std::size_t i = 0; i < truth.known.size() && i < measured.size(); ++i) {
    measured[i] &= truth.known[i];
  }
  return measured;
}

double known_share(const GroundTruth& truth) {
  if (truth.known.empty()) return 1;
  const auto known = static_cast<double>(std::ranges::count(truth.known, 1));
  return std::max(1.0, known) / static_cast<double>(truth.known.size());
}

/// Returns the truth of a view; nullopt, with a note, if it is a rotten frame.
std::optional<GroundTruth> intact_truth(const EvaluationCase& subject, Evaluation& evaluation) {
  try {
    return subject.truth();
  } catch (const store::RottenFrame&) {
    evaluation.has_rot = true;
    evaluation.notes.push_back(
        fmt::format("view {} is left out: its truth is a rotten frame", subject.id));
    return std::nullopt;
  }
}

void add_rotten_cameras(const store::Take& take, const render::RenderedView& view,
                        const std::string& id, Evaluation& evaluation) {
  if (view.rotten_cameras.empty()) return;
  evaluation.has_rot = true;
  std::vector<std::string> names;
  for (const int camera : view.rotten_cameras) {
    names.push_back(take.document().cameras[static_cast<std::size_t>(camera)].id);
  }
  evaluation.notes.push_back(fmt::format("view {} lacks cameras whose stored frames are rotten: {}",
                                         id, fmt::join(names, ", ")));
}

double focal_depth_of(const store::Take& take, const EvaluationOptions& settings) {
  if (settings.focal_depth) return *settings.focal_depth;
  if (!take.document().depth_range) {
    throw Error::bad_input("the focal plane cannot be chosen: the take has no depth range",
                           take.folder().string(), "Set the depth of the focal plane in metres")
        .concerning({"focal_depth"});
  }
  return rig::optimal_focal_depth(*take.document().depth_range);
}

ViewEvaluation mean_of(const std::vector<ViewEvaluation>& views) {
  ViewEvaluation mean;
  mean.id = "mean";
  mean.decoded_per_needed = 0;
  double covering = 0, counted = 0;
  for (const ViewEvaluation& view : views) {
    mean.quality.covered += view.quality.covered / static_cast<double>(views.size());
    mean.decode_ms += view.decode_ms / static_cast<double>(views.size());
    mean.render_ms += view.render_ms / static_cast<double>(views.size());
    mean.min_render_ms += view.min_render_ms / static_cast<double>(views.size());
    mean.working_mb += view.working_mb / static_cast<double>(views.size());
    mean.prepare_ms += view.prepare_ms / static_cast<double>(views.size());
    if (std::isnan(view.quality.psnr_db)) continue;
    ++covering;
    mean.quality.psnr_db += view.quality.psnr_db;
    mean.quality.ssim += view.quality.ssim;
    if (!std::isnan(view.decoded_per_needed)) {
      mean.decoded_per_needed += view.decoded_per_needed;
      ++counted;
    }
  }
  std::vector<RegionErrors> regions;
  for (const ViewEvaluation& view : views) {
    if (view.regions) regions.push_back(*view.regions);
  }
  if (!regions.empty()) mean.regions = mean_region_errors(regions);
  std::vector<LightErrors> lights;
  for (const ViewEvaluation& view : views) {
    if (view.light) lights.push_back(*view.light);
  }
  if (!lights.empty()) mean.light = mean_light_errors(lights);
  mean.quality.psnr_db /= covering;  // NaN if no view has covered pixels
  mean.quality.ssim /= covering;
  mean.decoded_per_needed /= counted;
  return mean;
}

/// The true depths of a view, and the regions that they divide it into.
struct KnownRegions {
  TrueDepths depths;
  TruthRegions regions;
};

/// Returns nullopt if the true depths are unknown.
std::optional<KnownRegions> known_regions(const GroundTruth& truth, const schemas::Intrinsics& lens,
                                          double camera_spacing) {
  if (truth.z.empty()) return std::nullopt;
  const TrueDepths depths{truth.image.width, truth.image.height, truth.z,
                          std::max(lens.fx, lens.fy) * camera_spacing};
  return KnownRegions{depths, truth_regions(depths)};
}

/// Returns the largest distance between neighbours of the cameras that contribute.
double camera_spacing_of(const rig::Rig& rig, const std::vector<int>& excluded) {
  std::vector<int> included;
  for (int i = 0; i < static_cast<int>(rig.cameras.size()); ++i) {
    if (std::ranges::find(excluded, i) == excluded.end()) included.push_back(i);
  }
  return included.empty() ? 0 : rig::max_neighbour_baseline(rig, rig::make_topology(rig, included));
}

/// Returns a note on the views outside the take's time, or an empty string. Throws Error (bad
/// input) if all views are outside.
std::string outside_note(const std::vector<EvaluationCase>& subjects, const store::Take& take) {
  const auto outside = static_cast<std::size_t>(std::ranges::count_if(
      subjects, [](const EvaluationCase& subject) { return subject.frames.present() == 0; }));
  if (outside == 0) return {};
  if (outside == subjects.size()) {
    throw Error::bad_input(
        "no view is within the take's time", take.folder().string(),
        "Compare time_ns of the views with the take's time (`raystage info` prints it)");
  }
  return fmt::format("{} of {} views are outside the take's time and empty", outside,
                     subjects.size());
}

double prepare_ms_of(const std::vector<ViewEvaluation>& views) {
  double sum = 0, count = 0;
  for (const ViewEvaluation& view : views) {
    sum += view.prepare_ms;
    count += view.prepare_ms > 0 ? 1 : 0;
  }
  return count > 0 ? sum / count : 0;
}

/// Reads the frames of the views, so that the times of the first setting exclude the disk.
void read_ahead(const store::Take& take, const std::vector<EvaluationCase>& subjects,
                const std::vector<int>& excluded_cameras) {
  std::set<Nanoseconds> seen;
  std::uint64_t sum = 0;
  for (const EvaluationCase& subject : subjects) {
    if (!seen.insert(subject.frames.time_ns).second) continue;
    for (int camera = 0; camera < take.camera_count(); ++camera) {
      if (std::ranges::find(excluded_cameras, camera) != excluded_cameras.end()) continue;
      const bool is_interpolated = subject.frames.is_interpolated(static_cast<std::size_t>(camera));
      for (const int frame : {subject.frames.frame[camera],
                              is_interpolated ? subject.frames.second[camera].frame : -1}) {
        if (frame < 0) continue;
        constexpr std::size_t kPage = 4096;
        const auto jpeg = take.archive(camera).intact_jpeg(frame);
        const std::span<const std::byte> bytes =
            jpeg ? jpeg->bytes() : std::span<const std::byte>();
        for (std::size_t at = 0; at < bytes.size(); at += kPage) {
          sum += static_cast<std::uint64_t>(bytes[at]);
        }
      }
    }
  }
  [[maybe_unused]] volatile const std::uint64_t read = sum;  // or the compiler removes the reads
}

/// Returns all views of the case's light field frame, as a moving shot shows them; none if there
/// are many.
std::vector<render::VirtualCamera> shown_views_of(const EvaluationCase& subject,
                                                  const std::vector<EvaluationCase>& subjects) {
  std::vector<render::VirtualCamera> views;
  for (const EvaluationCase& other : subjects) {
    const bool is_same = other.frames.time_ns == subject.frames.time_ns &&
                         other.frames.frame == subject.frames.frame;
    if (is_same) views.push_back(other.camera);
  }
  if (views.size() > render::kMostFramesOfShownViews) views.clear();
  return views;
}

class TimedView {
 public:
  TimedView(const store::Take& take, const render::RendererOptions& settings,
            const EvaluationCase& subject, const render::ReconstructionOptions& reconstruction)
      : take_(take), settings_(settings), subject_(subject), reconstruction_(reconstruction) {}

  /// Fills the times of `result`. Uses a new renderer, so that no frame is cached.
  render::RenderedView render(int repeat, ViewEvaluation& result) const {
    const render::LightFieldRenderer renderer(take_, settings_);
    const std::size_t kept_before = settings_.result_cache->bytes_held();
    const Stopwatch watch;
    render::RenderedView view = renderer.render(subject_.camera, subject_.frames, reconstruction_);
    const double first_ms = watch.ms() - view.statistics.decode_ms;
    const bool prepared = settings_.result_cache->bytes_held() != kept_before;
    result.decode_ms = view.statistics.decode_ms;
    result.working_mb = static_cast<double>(view.statistics.working_bytes) / 1e6;
    result.render_ms = result.min_render_ms = first_ms;
    if (repeat == 0) return view;

    constexpr double kEnoughMs = 2000;
    std::vector<double> times;
    double sum = 0;
    while (static_cast<int>(times.size()) < repeat && (times.empty() || sum < kEnoughMs)) {
      const Stopwatch again;
      const render::RenderedView same =
          renderer.render(subject_.camera, subject_.frames, reconstruction_);
      times.push_back(again.ms() - same.statistics.decode_ms);
      sum += times.back();
    }
    std::ranges::sort(times);
    const std::size_t half = times.size() / 2;
    result.render_ms = times.size() % 2 == 1 ? times[half] : (times[half - 1] + times[half]) / 2;
    result.min_render_ms = times.front();
    if (prepared) result.prepare_ms = std::max(0.0, first_ms - result.render_ms);
    return view;
  }

  /// Returns the source pixels that `first` decoded (with empty caches) per needed pixel. Counting
  /// takes time, so this rendering is not timed.
  double decoded_per_needed(const render::RenderedView& first) const {
    render::RendererOptions counting = settings_;
    counting.count_needed_pixels = true;
    const render::RenderStatistics counts =
        render::LightFieldRenderer(take_, counting)
            .render(subject_.camera, subject_.frames, reconstruction_)
            .statistics;
    return counts.pixels_needed > 0 ? static_cast<double>(first.statistics.pixels_decoded) /
                                          static_cast<double>(counts.pixels_needed)
                                    : std::numeric_limits<double>::quiet_NaN();
  }

 private:
  const store::Take& take_;
  const render::RendererOptions& settings_;
  const EvaluationCase& subject_;
  const render::ReconstructionOptions& reconstruction_;
};

}  // namespace

std::vector<int> excluded_camera_indices(const store::Take& take,
                                         const std::vector<std::string>& excluded_camera_ids,
                                         int camera_step) {
  std::vector<int> excluded_cameras;
  for (const std::string& id : excluded_camera_ids)
    excluded_cameras.push_back(camera_named(take, id));
  for (const int camera : rig::cameras_off_grid_step(take.rig(), camera_step)) {
    if (std::ranges::find(excluded_cameras, camera) == excluded_cameras.end()) {
      excluded_cameras.push_back(camera);
    }
  }
  return excluded_cameras;
}

namespace {

/// Throws Error (bad input) if the pixels of a view alone need more memory than is granted.
void require_memory(const EvaluationCase& subject, std::size_t granted) {
  constexpr std::size_t kPerPixel =
      48;  // R, G, B, A, coverage and Z as floats; two pictures; errors
  const std::size_t needed = kPerPixel * static_cast<std::size_t>(subject.camera.width) *
                             static_cast<std::size_t>(subject.camera.height);
  if (needed <= granted) return;
  throw Error::bad_input(
      fmt::format("the {}x{} pixels of the view need {:.1f} GB of memory; {:.1f} GB are granted",
                  subject.camera.width, subject.camera.height, static_cast<double>(needed) * 1e-9,
                  static_cast<double>(granted) * 1e-9),
      subject.id, "Increase --memory, or evaluate smaller views")
      .concerning({"memory"});
}

}  // namespace

TemporalStability measure_temporal_stability(std::span<const ViewEvaluation> views) {
  std::map<std::string_view, double> last_of_shot;
  double sum = 0, squares = 0, count = 0;
  TemporalStability temporal_stability;
  for (const ViewEvaluation& view : views) {
    const double psnr = view.quality.psnr_db;
    if (!std::isfinite(psnr)) continue;
    sum += psnr;
    squares += psnr * psnr;
    ++count;
    const auto [last, is_first] = last_of_shot.try_emplace(shot_of_view(view.id), psnr);
    if (!is_first) {
      temporal_stability.max_step_db =
          std::max(temporal_stability.max_step_db, std::abs(psnr - last->second));
    }
    last->second = psnr;
  }
  if (count == 0) return temporal_stability;
  const double mean = sum / count;
  temporal_stability.stddev_db = std::sqrt(std::max(0.0, squares / count - mean * mean));
  return temporal_stability;
}

bool EvaluationOptions::is_valid(std::string* reason) const {
  return is_within("camera step", camera_step, 1, 10000, reason) &&
         is_within("view step", view_step, 1, 1e6, reason) &&
         is_within("repeat", repeat, 0, 1e6, reason);
}

Evaluation evaluate_views(const store::Take& take, const schemas::ViewsDocument& views,
                          const std::filesystem::path& views_folder,
                          const EvaluationOptions& settings,
                          const std::function<void(double)>& progress, std::stop_token stop) {
  require_valid(settings, "evaluation");
  const render::MethodOptions options(render::method_named(settings.method).options(),
                                      settings.options, settings.method);
  if (!views.views.empty() && views.color_space != "srgb_texture") {
    throw Error::bad_input(
        "truth images have the unsupported colour space '" + views.color_space + "'",
        views_folder.string(), "Convert the truth images to srgb_texture");
  }
  Evaluation evaluation;
  evaluation.take = take.document().name;
  evaluation.method = settings.method;
  evaluation.exact_times = settings.exact_times;
  evaluation.options = options.values();
  evaluation.focal_depth = focal_depth_of(take, settings);
  const std::optional<store::Timeline> timeline = store::read_timeline_if_present(take);
  const std::vector<EvaluationCase> subjects =
      make_evaluation_cases(take, timeline ? &*timeline : nullptr, views, views_folder, settings);
  if (auto note = outside_note(subjects, take); !note.empty()) {
    evaluation.notes.push_back(std::move(note));
  }
  const render::ReconstructionOptions reconstruction{
      settings.method, rig::fronto_parallel_plane(take.rig(), evaluation.focal_depth),
      settings.options, settings.fill};
  render::RendererOptions renderer_options;
  const render::MemoryBudgets memory =
      render::split_memory_budget(settings.memory_bytes, reconstruction);
  renderer_options.cache_bytes = memory.cache;
  renderer_options.result_cache_bytes = memory.result_cache;
  renderer_options.working_bytes = memory.working;
  renderer_options.blend_space = settings.blend_space;
  renderer_options.excluded_cameras =
      excluded_camera_indices(take, settings.excluded_camera_ids, settings.camera_step);
  // Do not store data derived from fewer cameras.
  renderer_options.use_take_folder =
      settings.use_take_folder && renderer_options.excluded_cameras.empty();
  renderer_options.result_cache =
      std::make_shared<render::ResultCache>(renderer_options.result_cache_bytes);
  if (timeline) renderer_options.ticks = timeline->ticks;
  evaluation.cameras =
      take.camera_count() - static_cast<int>(renderer_options.excluded_cameras.size());
  if (!settings.image_folder.empty()) create_folder(settings.image_folder);
  read_ahead(take, subjects, renderer_options.excluded_cameras);

  const double camera_spacing = camera_spacing_of(take.rig(), renderer_options.excluded_cameras);
  const CancellationScope cancellation(stop);
  ShotErrors shot_errors;
  std::size_t done = 0;
  const auto report_done = [&] {
    progress(static_cast<double>(++done) / static_cast<double>(subjects.size()));
  };
  for (const EvaluationCase& subject : subjects) {
    if (stop.stop_requested()) {
      throw Error::failed("the evaluation was stopped", take.folder().string(), "Run it again");
    }
    require_memory(subject, settings.memory_bytes);
    const std::optional<GroundTruth> truth = intact_truth(subject, evaluation);
    if (!truth) {
      report_done();
      continue;
    }
    ViewEvaluation result;
    result.id = subject.id;
    render::ReconstructionOptions of_view = reconstruction;
    of_view.focal_plane = rig::fronto_parallel_plane(take.rig(), evaluation.focal_depth,
                                                     subject.camera.pose.viewing_direction());
    of_view.shown_views = shown_views_of(subject, subjects);
    const TimedView timed(take, renderer_options, subject, of_view);
    const render::RenderedView view = timed.render(settings.repeat, result);
    if (settings.count_needed_pixels) result.decoded_per_needed = timed.decoded_per_needed(view);
    const store::RgbImage image = render::srgb_image(view);
    if (!settings.image_folder.empty()) {
      images::write_image(image, settings.image_folder / (subject.id + ".png"));
    }
    const std::vector<std::uint8_t> covered = measured_pixels(view, *truth);
    result.quality = render::compare_images(image, truth->image, covered);
    result.quality.covered /= known_share(*truth);
    const auto known = known_regions(*truth, subject.camera.intrinsics, camera_spacing);
    if (known) {
      result.regions = region_errors({image, truth->image, covered, view.z, view.edges},
                                     known->depths, known->regions, truth->surfaces);
    }
    if (!truth->light.empty()) result.light = light_errors(view, truth->light, covered);
    shot_errors.add(subject.id, image, truth->image, covered,
                    known ? std::span<const std::uint8_t>(known->regions.edge_band)
                          : std::span<const std::uint8_t>());
    if (settings.on_view) {
      settings.on_view({evaluation.views.size(), subjects.size(), subject.id, image, truth->image,
                        covered, known ? &known->regions : nullptr});
    }
    for (const std::string& note : view.notes) {
      if (std::ranges::count(evaluation.notes, note) == 0) evaluation.notes.push_back(note);
    }
    add_rotten_cameras(take, view, subject.id, evaluation);
    evaluation.views.push_back(result);
    report_done();
  }
  if (evaluation.views.empty()) {
    throw Error::bad_input("the truth of every view is a rotten frame", take.folder().string(),
                           "Run `raystage verify` on the take, then `raystage repair`");
  }
  evaluation.mean = mean_of(evaluation.views);
  evaluation.temporal_stability = measure_temporal_stability(evaluation.views);
  evaluation.shots = shot_errors.temporal_stability();
  evaluation.prepare_ms = prepare_ms_of(evaluation.views);
  return evaluation;
}

}  // namespace raystage::evaluation
