// SPDX-License-Identifier: Apache-2.0
// Renders quilts. Views are those of parallel cameras on the x axis of the shot's camera with a
// lens shift (off-axis projection), so that the screen's plane has no disparity. Cost: that of
// rendering columns x rows views per frame.
#include "exports/export_quilt.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numeric>
#include <system_error>
#include <utility>

#include "base/atomic_file.h"
#include "base/cancellation.h"
#include "base/frame_rate.h"
#include "base/options.h"
#include "compose/draft_shot.h"
#include "compose/preview/display.h"
#include "compose/sequence_name.h"
#include "exports/quilt_views.h"
#include "images/png_file.h"
#include "replay/picture_layout.h"
#include "replay/scene.h"
#include "replay/take_shot.h"
#include "schemas/shot_document.h"
#include "store/timeline.h"

namespace raystage::exports {
namespace {

constexpr int kMaxQuiltSize = 32768;  // pixels
constexpr double kInnerShare = 0.9;   // of the array's extent
constexpr double kDefaultScreen = 5;  // metres
constexpr double kEyesApart = 0.065;  // metres, for shots without a take

/// A shot with the place that its paths are relative to.
struct OpenedShot {
  schemas::ShotDocument shot;
  std::filesystem::path file;
  std::optional<store::Take> take = {};  ///< that the shot was made for
};

OpenedShot open_shot(const QuiltExportOptions& options) {
  std::error_code ignored;
  OpenedShot opened;
  if (std::filesystem::is_directory(options.input, ignored)) {
    const std::filesystem::path folder =
        std::filesystem::absolute(options.input / "").lexically_normal().parent_path();
    opened.take.emplace(folder);
    opened.file = folder;  // beside which the shot's paths are, and which errors name
    opened.shot = replay::make_take_shot(*opened.take, store::read_timeline(*opened.take),
                                         folder.filename().string());
  } else {
    opened.file = options.input;
    opened.shot = schemas::read_shot(options.input);
  }
  compose::DraftOptions draft;
  draft.method = options.method;
  opened.shot = compose::draft_of_shot(std::move(opened.shot), draft, opened.file.string());
  if (opened.shot.camera.stereo) opened.shot.camera.stereo.reset();
  return opened;
}

std::vector<int> frames_of(const QuiltExportOptions& options, const schemas::ShotDocument& shot,
                           bool is_movie) {
  if (!options.frames) {
    std::vector<int> frames{shot.first_frame};
    if (!is_movie) return frames;
    constexpr int kMaxFrames = 1'000'000;
    if (std::int64_t{shot.last_frame} - shot.first_frame >= kMaxFrames) {
      throw Error::bad_input("the shot has more than a million frames", shot.name,
                             "Choose a range of frames")
          .concerning({"frames"});
    }
    frames.resize(static_cast<std::size_t>(shot.last_frame - shot.first_frame) + 1);
    std::iota(frames.begin(), frames.end(), shot.first_frame);
    return frames;
  }
  for (const int frame : *options.frames) {
    if (frame >= shot.first_frame && frame <= shot.last_frame) continue;
    throw Error::bad_input(fmt::format("frame {} is not in the shot, which has the frames {} to {}",
                                       frame, shot.first_frame, shot.last_frame),
                           options.input.string(), "Choose other frames")
        .concerning({"frames"});
  }
  return *options.frames;
}

/// Returns the extent of all takes' cameras along the x axis of a camera, metres.
double array_extent(const replay::Scene& scene, const compose::CameraState& state) {
  double least = std::numeric_limits<double>::infinity(), most = -least;
  for (const compose::LightFieldLayer* layer : scene.plan().light_fields()) {
    for (const rig::Rig::Camera& camera : layer->take().rig().cameras) {
      const double x = state.pose.world_from_camera_rotation.col(0).dot(camera.pose.position);
      least = std::min(least, x);
      most = std::max(most, x);
    }
  }
  return most > least ? most - least : kEyesApart;
}

/// Renders views from a row of virtual cameras.
class RenderedViews : public QuiltViews {
 public:
  RenderedViews(const OpenedShot& opened, const compose::ShotCamera& camera,
                const QuiltExportOptions& options, QuiltViewShape shape)
      : options_(options), camera_(camera), scene_(opened.shot, opened.file, {}), shape_(shape) {}

  void begin(int frame, QuiltReport& report) override {
    frame_ = frame;
    state_ = camera_.state(frame);
    state_.focal_length_mm *= shape_.zoom;
    report.screen_m = options_.screen_m.value_or(state_.focus_m.value_or(kDefaultScreen));
    report.baseline_m = options_.baseline_m.value_or(kInnerShare * array_extent(scene_, state_));
    planned_ = scene_.planned(frame);
    const compose::ExrMetadata metadata = scene_.plan().metadata(planned_);
    compose::DisplayOptions display;
    display.background = compose::Background::kBlack;
    display.colors = scene_.plan().colors().studio;
    transform_.emplace(display, metadata.color_interop_id, metadata.color_space);
    is_rotten_ = false;
  }

  store::RgbImage view(int index, const std::stop_token& stop, QuiltReport& report) override {
    const int views = options_.columns * options_.rows;
    const double share = views > 1 ? static_cast<double>(index) / (views - 1) - 0.5 : 0;
    const compose::CameraState moved =
        moved_state(state_, share * report.baseline_m, report.screen_m);
    const compose::CompositedView view =
        scene_.render({frame_, replay::make_view_camera(camera_, moved, compose::Eye::kBoth,
                                                        shape_.width, shape_.height)},
                      stop);
    is_rotten_ = is_rotten_ || !view.rotten_cameras.empty();
    for (const double uncovered : view.uncovered_share) {
      report.least_covered_share = std::min(report.least_covered_share, 1 - uncovered);
    }
    store::RgbImage picture(view.picture.width, view.picture.height);
    const std::size_t row = static_cast<std::size_t>(picture.width) * 4;
    for (int y = 0; y < picture.height; ++y) {
      transform_->apply_row(
          std::span(view.picture.rgba).subspan(static_cast<std::size_t>(y) * row, row), y,
          picture.row(y));
    }
    return picture;
  }

  void end(QuiltReport& report) override {
    report.rotten += is_rotten_ ? 1 : 0;
    report.held += std::ranges::any_of(planned_.shown, &compose::ShownTick::held) ? 1 : 0;
  }

 private:
  const QuiltExportOptions& options_;
  const compose::ShotCamera& camera_;
  replay::Scene scene_;
  QuiltViewShape shape_;
  int frame_ = 0;
  compose::CameraState state_;
  compose::PlannedFrame planned_;
  std::optional<compose::DisplayTransform> transform_;
  bool is_rotten_ = false;
};

/// Returns the options with as many views as the row has cameras.
QuiltExportOptions with_views_of_row(QuiltExportOptions options,
                                     const std::optional<store::Take>& take) {
  if (!options.array_row) return options;
  if (!take) {
    throw Error::bad_input("a shot has no row of cameras", options.input.string(),
                           "Give the take, or render views")
        .concerning({"array_row"});
  }
  const auto count = static_cast<int>(cameras_of_row(*take, *options.array_row).size());
  if (options.columns * options.rows != count) {
    options.columns = count;
    options.rows = 1;
  }
  return options;
}

void check_absent(const std::filesystem::path& file, ExistingFiles existing) {
  if (existing == ExistingFiles::kError && is_name_taken(file)) {
    throw Error::bad_input("the file exists", file.string(),
                           "Choose another name, or to overwrite it")
        .concerning({"existing"});
  }
  check_writable(file);
}

}  // namespace

bool QuiltExportOptions::is_valid(std::string* reason) const {
  constexpr double kMaxBaseline = 1000;  // metres
  if (aspect != 0 && !is_within("aspect", aspect, 0.05, 20, reason)) return false;
  if (screen_m && !is_within("screen_m", *screen_m, 1e-3, 1e6, reason)) return false;
  if (baseline_m && !is_within("baseline_m", *baseline_m, 0, kMaxBaseline, reason)) return false;
  if (codec->copies_jpeg()) {
    *reason = "a quilt is made of rendered pictures: its codec cannot copy JPEG";
    return false;
  }
  return is_within("columns", columns, 1, 64, reason) && is_within("rows", rows, 1, 64, reason) &&
         is_within("view_width", view_width, 16, 8192, reason);
}

ExitCode QuiltReport::exit_code() const {
  if (status != RunStatus::kFinished) return ExitCode::kFailed;
  return rotten > 0 ? ExitCode::kFellShort : ExitCode::kSuccess;
}

std::filesystem::path quilt_name(const std::filesystem::path& file, int columns, int rows,
                                 double aspect) {
  const std::string suffix = fmt::format("_qs{}x{}a{:.4g}", columns, rows, aspect);
  // Not stem(): the aspect has a point, too.
  const std::string extension = file.extension().string();
  std::string name = file.filename().string();
  name.resize(name.size() - extension.size());
  if (name.ends_with(suffix)) return file;
  return file.parent_path() / (name + suffix + extension);
}

compose::CameraState moved_state(const compose::CameraState& state, double offset,
                                 double screen_m) {
  const compose::StereoSettings pair{2 * std::abs(offset), screen_m};
  return compose::stereo_eye_state(state, pair,
                                   offset < 0 ? compose::Eye::kLeft : compose::Eye::kRight);
}

namespace {

void require_movie_extension(const QuiltExportOptions& options) {
  const std::vector<std::string> known = options.codec->extensions();
  const std::string extension = options.output.extension().string();
  if (std::ranges::find(known, extension) != known.end()) return;
  throw Error::bad_input(
      fmt::format("the extension is \"{}\"; allowed: .png for pictures, {} for movies of the codec "
                  "{}",
                  extension, fmt::join(known, ", "), options.codec->name()),
      options.output.string(), "Change the name");
}

}  // namespace

QuiltReport export_quilt(const QuiltExportOptions& given, const std::stop_token& stop) {
  require_valid(given, given.input.string());
  const bool is_movie = given.output.extension() != ".png";
  if (is_movie) require_movie_extension(given);
  const OpenedShot opened = open_shot(given);
  const QuiltExportOptions options = with_views_of_row(given, opened.take);
  const std::vector<int> frames = frames_of(options, opened.shot, is_movie);
  const double shot_aspect = 1.0 * opened.shot.width / opened.shot.height;
  const double aspect = options.aspect > 0 ? options.aspect : shot_aspect;
  QuiltViewShape shape;
  shape.width = options.view_width;
  shape.height = std::max(1, static_cast<int>(std::lround(options.view_width / aspect)));
  shape.zoom = std::max(1.0, shot_aspect / aspect);  // a narrower view shows the shot's height
  QuiltReport report;
  report.views = options.columns * options.rows;
  report.width = options.columns * shape.width;
  report.height = options.rows * shape.height;
  if (std::max(report.width, report.height) > kMaxQuiltSize) {
    throw Error::bad_input(fmt::format("the quilt would have {}x{} pixels, allowed: {}",
                                       report.width, report.height, kMaxQuiltSize),
                           options.output.string(), "Choose fewer or smaller views")
        .concerning({"view_width"});
  }
  const std::filesystem::path named =
      quilt_name(options.output, options.columns, options.rows, aspect);
  report.files = named.string();
  const compose::SequenceName name(is_movie ? std::string("unused.png") : named.string());
  if (!is_movie && frames.size() > 1 && !name.has_frame_token()) {
    throw Error::bad_input("several frames need a number in the name of their files",
                           options.output.string(), "Use a name such as DIR/NAME.####.png");
  }
  if (opened.take) check_output_outside(named, *opened.take);
  if (is_movie) {
    check_absent(named, options.existing);
  } else {
    for (const int frame : frames) check_absent(name.path(frame), options.existing);
  }
  const double pixels =
      static_cast<double>(report.width) * report.height * static_cast<double>(frames.size());
  constexpr double kPngBytesPerPixel = 1.5;
  check_free_space(
      named, is_movie ? options.codec->estimated_bytes(0, pixels) : kPngBytesPerPixel * pixels);
  const CancellationScope scope(stop);
  const compose::ShotCamera camera(opened.shot, opened.file);
  const std::unique_ptr<QuiltViews> views =
      options.array_row ? recorded_views(*opened.take, camera, options, frames, shape)
                        : std::make_unique<RenderedViews>(opened, camera, options, shape);
  std::unique_ptr<MovieFile> movie;
  const FrameRate rate{opened.shot.fps_numerator, opened.shot.fps_denominator};
  for (std::size_t n = 0; n < frames.size(); ++n) {
    store::RgbImage quilt(report.width, report.height);
    views->begin(frames[n], report);
    for (int i = 0; i < report.views; ++i) {
      replay::copy_into(views->view(i, stop, report), i % options.columns * shape.width,
                        (options.rows - 1 - i / options.columns) * shape.height, quilt);
      options.progress((static_cast<double>(n) + static_cast<double>(i + 1) / report.views) /
                       static_cast<double>(frames.size()));
    }
    views->end(report);
    ++report.frames;
    if (!is_movie) {
      images::write_png(quilt, name.path(frames[n]));
      continue;
    }
    if (!movie) {
      MovieDescription description;
      description.name = opened.shot.name;
      description.width = quilt.width;
      description.height = quilt.height;
      description.rate = rate;
      movie = options.codec->create(named, description);
    }
    movie->append({}, &quilt,
                  std::llround(static_cast<long double>(n) * kNanosecondsPerSecond *
                               rate.denominator / rate.numerator));
  }
  if (movie) movie->close();
  report.status = RunStatus::kFinished;
  return report;
}

}  // namespace raystage::exports
