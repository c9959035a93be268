// SPDX-License-Identifier: Apache-2.0
// raystage export movies: a movie per camera.
#include "exports/export_movies.h"

#include <fmt/format.h>

#include <memory>

#include "cli/export.h"
#include "cli/export_options.h"
#include "cli/threads.h"

namespace raystage::cli {
namespace {

struct MoviesCommand : ExportOptions {
  std::string codec = "copy", container;
};

ExitCode export_movies_of(const MoviesCommand& options, const std::stop_token& stop) {
  const store::Take take = open_take(options);
  exports::MovieExportOptions movies;
  movies.output = options.output;
  movies.frames = frame_choice(options);
  movies.codec = &exports::movie_codec(options.codec);
  if (!options.container.empty()) movies.extension = "." + options.container;
  Progress progress(!options.quiet);
  movies.progress = [&](double done) { progress.report(done); };
  return run_with_threads(options.threads, [&] {
    const exports::ExportReport report = exports::export_movies(take, movies, stop);
    const bool constant = movies.frames.times == exports::FrameTimes::kConstant;
    print_report(report, options.output.string(),
                 fmt::format("{}, {} times{}", options.codec, options.times,
                             constant ? fmt::format(", {:.6g} frames/s", report.fps) : ""));
    return report.exit_code();
  });
}

}  // namespace

Subcommand declare_export_movies(CommandLine& command) {
  auto options = std::make_shared<MoviesCommand>();
  CommandLine movies = command.subcommand("movies", "Write a movie per camera");
  add_take_options(movies, *options, "FOLDER",
                   "folder to write, which must not exist: CAMERA.mov or .mkv, frames.csv (time of "
                   "each\nframe), rig.json");
  std::vector<std::string> names;
  std::string codecs;
  for (const exports::MovieCodec* codec : exports::movie_codecs()) {
    names.emplace_back(codec->name());
    codecs += fmt::format("\n{}: {}", codec->name(), codec->description());
  }
  movies
      .option("--codec CODEC", options->codec, "how pictures are stored (default: copy):" + codecs)
      .one_of_listed(names);
  movies
      .option("--container", options->container,
              "container (default: the first one that is listed for the codec)")
      .one_of({"mov", "mkv", "mp4"});
  add_frame_options(movies, *options, OfferedTimes::kAll, "hold");
  add_run_options(movies, *options);
  return {movies,
          [options](const std::stop_token& stop) { return export_movies_of(*options, stop); }};
}

}  // namespace raystage::cli
