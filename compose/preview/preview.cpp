// SPDX-License-Identifier: Apache-2.0
#include "compose/preview/preview.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <set>
#include <system_error>

#include "base/atomic_file.h"
#include "base/error.h"
#include "base/frame_rate.h"
#include "base/options.h"
#include "compose/exr/exr_header.h"
#include "compose/frame_range.h"
#include "compose/preview/contact_sheet.h"
#include "compose/preview/digits.h"
#include "compose/preview/movie_writer.h"
#include "compose/sequence_name.h"
#include "images/image_file.h"

namespace raystage::compose {
namespace {

/// The frames to show: those requested, or every step from the first to the last file.
struct Selection {
  std::vector<int> frames;
  std::set<int> missing;
  int step = 1;
};

Selection select(const PreviewOptions& options) {
  const std::vector<std::string>& sequences = options.pictures_of.sequences;
  std::vector<int> there = existing_frames(sequences.front());
  const std::vector<int> of_first = there;
  for (const std::string& sequence : sequences) {
    const std::vector<int> of_one = existing_frames(sequence);
    if (of_one.empty()) {
      throw Error::bad_input("no file of this sequence exists", sequence,
                             "Check the folder and the number of #");
    }
    std::vector<int> of_all;
    std::ranges::set_intersection(there, of_one, std::back_inserter(of_all));
    there = std::move(of_all);
  }
  Selection selection;
  const std::vector<int>& basis = options.frames ? *options.frames : of_first;
  int step = 0;
  for (std::size_t i = 1; i < basis.size(); ++i) step = std::gcd(step, basis[i] - basis[i - 1]);
  selection.step = std::max(step, 1);
  if (options.frames) {
    selection.frames = *options.frames;
  } else {
    for (int f = of_first.front(); f <= of_first.back(); f += selection.step) {
      selection.frames.push_back(f);
    }
  }
  std::set_difference(selection.frames.begin(), selection.frames.end(), there.begin(), there.end(),
                      std::inserter(selection.missing, selection.missing.end()));
  const bool nothing_to_hold = selection.missing.contains(selection.frames.front());
  if (!selection.missing.empty() && (!options.hold_missing || nothing_to_hold)) {
    const std::vector<int> missing(selection.missing.begin(), selection.missing.end());
    std::vector<std::string> incomplete;
    std::ranges::copy_if(sequences, std::back_inserter(incomplete), [&](const auto& sequence) {
      return !std::ranges::includes(existing_frames(sequence), missing);
    });
    throw Error::bad_input(
        fmt::format("{} of {} frames are missing ({})", missing.size(), selection.frames.size(),
                    format_frame_range(missing)),
        fmt::format("{}", fmt::join(incomplete, ", ")),
        fmt::format(
            "Render them, choose other frames (there are {}), or let missing frames repeat the "
            "last one",
            format_frame_range(there)))
        .concerning({"frames", "missing"});
  }
  return selection;
}

/// Returns the movie's frame rate: a sequence of every n-th frame plays in real time.
FrameRate movie_rate(const PreviewOptions& options, const ExrImage& first, int step) {
  if (options.fps) {
    if (const auto rate = frame_rate_from(*options.fps)) return *rate;
    throw Error::bad_input(fmt::format("{} frames per second cannot be written", *options.fps), "",
                           "Give a number with up to six decimals, up to 1000");
  }
  const std::int64_t denominator = std::int64_t{first.fps_denominator} * step;
  const std::int64_t divisor = std::gcd<std::int64_t>(first.fps_numerator, denominator);
  constexpr std::int64_t kLargest = 1'000'000;  // for steps of years
  return {static_cast<int>(first.fps_numerator / divisor),
          static_cast<int>(std::min(denominator / divisor, kLargest))};
}

std::optional<SequenceName> picture_names(const PreviewOptions& options, std::size_t frames) {
  if (options.pictures.empty()) return std::nullopt;
  SequenceName name(options.pictures);
  if (frames > 1 && !name.has_frame_token()) {
    throw Error::bad_input(fmt::format("{} pictures would all get the same name", frames),
                           options.pictures, "Write NAME.####.png");
  }
  return name;
}

/// Several sequences side by side are no single picture.
bool is_one_picture(const PreviewOptions& options) {
  return options.pictures_of.arrangement != Arrangement::kSideBySide ||
         options.pictures_of.sequences.size() == 1;
}
bool is_spherical(const PreviewOptions& options, const FramePictures& pictures) {
  return is_one_picture(options) && pictures.frame().is_equirectangular;
}
StereoPacking packing_of(const PreviewOptions& options) {
  return is_one_picture(options) ? options.pictures_of.stereo : StereoPacking::kNone;
}

std::string burnt_text(int frame, const ExrImage& image) {
  if (!image.time_code.empty()) return fmt::format("{}  {}", frame, image.time_code);
  return fmt::format("{}  {}", frame,
                     format_time_code(frame, image.fps_numerator, image.fps_denominator));
}

}  // namespace

std::vector<int> existing_frames(const std::string& sequence) {
  const SequenceName name(sequence);
  std::error_code error;
  if (!name.has_frame_token()) {
    return std::filesystem::is_regular_file(name.path(0), error) ? std::vector<int>{0}
                                                                 : std::vector<int>{};
  }
  std::vector<int> frames;
  for (std::filesystem::directory_iterator entry(name.folder(), error), end; !error && entry != end;
       entry.increment(error)) {
    if (const auto frame = name.frame_from_file_name(entry->path().filename().string())) {
      frames.push_back(*frame);
    }
  }
  std::sort(frames.begin(), frames.end());
  return frames;
}

bool PreviewOptions::is_valid(std::string* reason) const {
  return pictures_of.is_valid(reason) &&
         is_within("frames on the contact sheet", sheet_frames, 1, 1e6, reason) &&
         is_within("columns of the contact sheet", sheet_columns, 1, 1e6, reason) &&
         is_within("width of thumbnails (pixels)", thumbnail_width, 1, 65535, reason) &&
         is_within("rate (frames per second)", fps.value_or(1), 1e-3, 1e6, reason);
}

PreviewReport make_preview(const PreviewOptions& options, std::stop_token stop) {
  require_valid(options, "preview");
  const Selection selection = select(options);
  FramePictures of_frames(options.pictures_of);
  const std::vector<int> on_sheet = evenly_spaced_frames(selection.frames, options.sheet_frames);
  const bool want_movie = !options.movie.empty(), want_sheet = !options.contact_sheet.empty();
  const std::optional<SequenceName> pictures = picture_names(options, selection.frames.size());

  PreviewReport report;
  std::unique_ptr<MovieWriter> movie;
  std::vector<store::RgbImage> thumbnails;
  std::size_t done = 0;
  for (const int frame : selection.frames) {
    if (stop.stop_requested()) {
      report.status = RunStatus::kStopped;
      return report;
    }
    const bool sheet = want_sheet && std::binary_search(on_sheet.begin(), on_sheet.end(), frame);
    if (selection.missing.contains(frame)) {
      ++report.held;
    } else {
      of_frames.read(frame);
    }
    if (want_movie || pictures) {
      store::RgbImage shown = of_frames.picture();
      if (options.burn_in) burn_in(burnt_text(frame, of_frames.frame()), shown);
      if (want_movie && !movie) {
        const FrameRate rate = movie_rate(options, of_frames.frame(), selection.step);
        report.fps = rate.fps();
        movie = std::make_unique<MovieWriter>(
            options.movie,
            MovieWriter::Options{shown.width, shown.height, rate.numerator, rate.denominator,
                                 is_spherical(options, of_frames), packing_of(options)});
        report.encoder = movie->encoder();
      }
      if (want_movie) movie->append(shown);
      if (pictures) {
        if (report.frames == 0) create_folder(pictures->folder());
        images::write_image(shown, pictures->path(frame));
      }
    }
    if (sheet) thumbnails.push_back(of_frames.thumbnail(options.thumbnail_width));
    ++report.frames;
    options.progress(static_cast<double>(++done) /
                     (static_cast<double>(selection.frames.size()) + 1));
  }
  if (movie) movie->close();
  if (want_sheet) {
    images::write_image(contact_sheet(thumbnails, on_sheet, options.sheet_columns),
                        options.contact_sheet);
  }
  options.progress(1);
  report.range = of_frames.range_text();
  report.status = RunStatus::kFinished;
  return report;
}

}  // namespace raystage::compose
