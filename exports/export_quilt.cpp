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
};

OpenedShot open_shot(const QuiltExportOptions& options) {
  std::error_code ignored;
  OpenedShot opened;
  if (std::filesystem::is_directory(options.input, ignored)) {
    const std::filesystem::path folder =
        std::filesystem::absolute(options.input / "").lexically_normal().parent_path();
    const store::Take take(folder);
    opened.file = folder.parent_path() / (folder.filename().string() + ".shot.json");
    opened.shot =
        replay::make_take_shot(take, store::read_timeline(take), folder.filename().string());
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

/// Returns the state of the camera `offset` metres to the right, with the same picture of a plane.
compose::CameraState moved_state(const compose::CameraState& state, double offset,
                                 double screen_m) {
  const compose::StereoSettings pair{2 * std::abs(offset), screen_m};
  return compose::stereo_eye_state(state, pair,
                                   offset < 0 ? compose::Eye::kLeft : compose::Eye::kRight);
}

/// Renders the quilt of a frame.
class QuiltRenderer {
 public:
  QuiltRenderer(const OpenedShot& opened, const QuiltExportOptions& options)
      : options_(options),
        camera_(opened.shot, opened.file),
        scene_(opened.shot, opened.file, {}),
        aspect_(options.aspect > 0 ? options.aspect : 1.0 * opened.shot.width / opened.shot.height),
        view_height_(std::max(1, static_cast<int>(std::lround(options.view_width / aspect_)))),
        zoom_(std::max(1.0, 1.0 * opened.shot.width / opened.shot.height / aspect_)) {}

  int width() const { return options_.columns * options_.view_width; }
  int height() const { return options_.rows * view_height_; }
  double aspect() const { return aspect_; }

  store::RgbImage render(int frame, const std::stop_token& stop, QuiltReport& report,
                         const std::function<void(double)>& progress) const {
    compose::CameraState state = camera_.state(frame);
    state.focal_length_mm *= zoom_;
    report.screen_m = options_.screen_m.value_or(state.focus_m.value_or(kDefaultScreen));
    report.baseline_m = options_.baseline_m.value_or(kInnerShare * array_extent(scene_, state));
    const compose::PlannedFrame planned = scene_.planned(frame);
    const compose::ExrMetadata metadata = scene_.plan().metadata(planned);
    compose::DisplayOptions display;
    display.background = compose::Background::kBlack;
    display.colors = scene_.plan().colors().studio;
    const compose::DisplayTransform transform(display, metadata.color_interop_id,
                                              metadata.color_space);
    store::RgbImage quilt(width(), height());
    const int views = options_.columns * options_.rows;
    bool is_rotten = false;
    for (int i = 0; i < views; ++i) {
      const double share = views > 1 ? static_cast<double>(i) / (views - 1) - 0.5 : 0;
      const compose::CameraState moved =
          moved_state(state, share * report.baseline_m, report.screen_m);
      const compose::CompositedView view =
          scene_.render({frame, replay::make_view_camera(camera_, moved, compose::Eye::kBoth,
                                                         options_.view_width, view_height_)},
                        stop);
      is_rotten = is_rotten || !view.rotten_cameras.empty();
      for (const double uncovered : view.uncovered_share) {
        report.least_covered_share = std::min(report.least_covered_share, 1 - uncovered);
      }
      store::RgbImage picture(view.picture.width, view.picture.height);
      for (int y = 0; y < picture.height; ++y) {
        const std::size_t row = static_cast<std::size_t>(y) * view.picture.width * 4;
        transform.apply_row(std::span(view.picture.rgba)
                                .subspan(row, static_cast<std::size_t>(view.picture.width) * 4),
                            y, picture.row(y));
      }
      replay::copy_into(picture, i % options_.columns * options_.view_width,
                        (options_.rows - 1 - i / options_.columns) * view_height_, quilt);
      progress(static_cast<double>(i + 1) / views);
    }
    report.rotten += is_rotten ? 1 : 0;
    report.held += std::ranges::any_of(planned.shown, &compose::ShownTick::held) ? 1 : 0;
    ++report.frames;
    return quilt;
  }

 private:
  const QuiltExportOptions& options_;
  compose::ShotCamera camera_;
  replay::Scene scene_;
  double aspect_;
  int view_height_;
  double zoom_;  ///< so that views narrower than the shot show its height, not more
};

void check_absent(const std::filesystem::path& file, ExistingFiles existing) {
  std::error_code ignored;
  if (existing == ExistingFiles::kError &&
      std::filesystem::exists(std::filesystem::symlink_status(file, ignored))) {
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

QuiltReport export_quilt(const QuiltExportOptions& options, const std::stop_token& stop) {
  require_valid(options, options.input.string());
  const bool is_movie = options.output.extension() != ".png";
  if (is_movie) movie_extension(*options.codec, options.output);
  const OpenedShot opened = open_shot(options);
  const std::vector<int> frames = frames_of(options, opened.shot, is_movie);
  const double aspect =
      options.aspect > 0 ? options.aspect : 1.0 * opened.shot.width / opened.shot.height;
  QuiltReport report;
  report.views = options.columns * options.rows;
  report.width = options.columns * options.view_width;
  report.height =
      options.rows * std::max(1, static_cast<int>(std::lround(options.view_width / aspect)));
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
  if (is_movie) {
    check_absent(named, options.existing);
  } else {
    for (const int frame : frames) check_absent(name.path(frame), options.existing);
  }
  check_free_space(named, static_cast<double>(report.width) * report.height *
                              static_cast<double>(frames.size()) * (is_movie ? 0.05 : 1.5));
  const CancellationScope scope(stop);
  const QuiltRenderer renderer(opened, options);
  std::unique_ptr<MovieFile> movie;
  const FrameRate rate{opened.shot.fps_numerator, opened.shot.fps_denominator};
  for (std::size_t n = 0; n < frames.size(); ++n) {
    const store::RgbImage quilt = renderer.render(frames[n], stop, report, [&](double part) {
      options.progress((static_cast<double>(n) + part) / static_cast<double>(frames.size()));
    });
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
