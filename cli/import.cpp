// SPDX-License-Identifier: Apache-2.0
// `raystage import`: makes a take of images or movies with cameras.
#include <fmt/format.h>

#include <charconv>
#include <cstdio>
#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include "cli/command.h"
#include "cli/command_line_parsing.h"
#include "cli/threads.h"
#include "ingest/import_source.h"
#include "ingest/import_take.h"
#include "raystage_version.h"

namespace {

using raystage::ExitCode;
using Chroma = raystage::JpegEncodeSettings::Chroma;

constexpr const char* kDescription =
    "Makes a take of images or movies.\n\n"
    "MANIFEST is one of\n"
    "  an import manifest   JSON with \"schema\": \"raystage/import/1\": cameras with intrinsics,\n"
    "                       poses, and image files with times or a movie with times_ns\n"
    "  a NeRF model         transforms.json with its images; each image is a camera at time 0\n"
    "  a COLMAP text model  cameras.txt and images.txt; each image is a camera at time 0\n"
    "or a folder with one of them.\n\n"
    "JPEG files and Motion JPEG movies are stored byte for byte. Other images and movies are\n"
    "encoded once. 16-bit images are rounded to 8 bits. Images of linear light (float, or "
    "manifest\n"
    "with color_space lin_rec709_scene) are clipped to [0, 1] and stored as sRGB codes;\n"
    "floating-point images without that color_space are rejected.";

struct Options {
  std::filesystem::path manifest, take;
  std::string images, epoch = "1970-01-01T00:00:00Z", chroma = "444";
  std::string restart_markers;  // empty, "default" or MCUs between two
  int quality = 95;
  double fps = 24;
  int threads = 0;
  bool quiet = false;
};

void declare(CLI::App& app, Options& options) {
  app.name("raystage import");
  app.add_option("MANIFEST", options.manifest, "Manifest, model or folder")->required();
  app.add_option("-o,--output", options.take, "Folder of the new take; must not exist")
      ->required()
      ->type_name("TAKE");
  app.add_option("--images", options.images,
                 "Folder of the images of a COLMAP or NeRF model (default: images/ near the model, "
                 "or the model's folder)")
      ->type_name("DIR");
  app.add_flag("--restart-markers{default}", options.restart_markers,
               "Rewrite JPEG input with restart markers, so that rectangles can be decoded; "
               "--restart-markers=MCUS sets the MCUs between two (default: as many as make up to "
               "32 pixels, 16 in frames narrower than 640). Pixels stay identical. Without it JPEG "
               "input is stored as it is")
      ->type_name("[=MCUS]");
  app.add_option("--quality", options.quality,
                 "JPEG quality of images that are encoded, libjpeg's scale 1-100 (default: 95)")
      ->check(CLI::Range(1, 100))
      ->type_name("Q");
  app.add_option("--chroma", options.chroma,
                 "Chroma subsampling of images that are encoded: 444, 422 or 420 (default: 444)")
      ->check(CLI::IsMember({"444", "422", "420"}))
      ->type_name("S");
  app.add_option("--epoch", options.epoch,
                 "UTC of time 0 for a COLMAP or NeRF model (default: 1970-01-01T00:00:00Z)")
      ->type_name("UTC");
  app.add_option("--fps", options.fps,
                 "Nominal frames per second for a COLMAP or NeRF model (default: 24)")
      ->check(CLI::Range(1e-3, 1e6))
      ->type_name("F");
  raystage::add_threads_option(app, options.threads);
  app.add_flag("-q,--quiet", options.quiet, "No progress on stderr");
}

/// Returns -1 for "default". The option is text because CLI11 takes a flag's =0 for "not set".
int restart_interval_from(const std::string& text) {
  constexpr int kDefault = -1, kMost = 65535;  // the DRI marker has 16 bits
  if (text == "default") return kDefault;
  int interval = 0;
  const char* end = text.data() + text.size();
  const auto [used, error] = std::from_chars(text.data(), end, interval);
  if (error != std::errc() || used != end || interval < 1 || interval > kMost) {
    throw raystage::Error::bad_input(
        "found " + text + " MCUs between markers, allowed: 1 to " + std::to_string(kMost),
        "--restart-markers", "Omit the number for the default");
  }
  return interval;
}

raystage::ImportSettings settings_from(const Options& options) {
  static const std::map<std::string, Chroma> kChroma{
      {"444", Chroma::k444}, {"422", Chroma::k422}, {"420", Chroma::k420}};
  raystage::ImportSettings settings;
  settings.encode.quality = options.quality;
  settings.encode.chroma = kChroma.at(options.chroma);
  if (!options.restart_markers.empty()) {
    settings.restart_markers = restart_interval_from(options.restart_markers);
    settings.encode.restart_interval = *settings.restart_markers;
  }
  settings.created_by = "raystage " RAYSTAGE_VERSION;
  return settings;
}

ExitCode run(const Options& options, std::stop_token stop) {
  raystage::ModelImportSettings model;
  if (!options.images.empty()) model.images = options.images;
  model.epoch_utc = raystage::parse_utc(options.epoch);
  model.nominal_fps = options.fps;

  const raystage::ThreadLimit limit(options.threads);
  raystage::ImportSettings settings = settings_from(options);
  const auto source = raystage::open_import_source(options.manifest, model);
  raystage::Progress progress(!options.quiet);
  settings.progress = [&](double done) { progress.report(done); };
  const auto summary =
      raystage::import_take(source.manifest, source.base, options.take, settings, stop);
  constexpr double kMegabyte = 1e6;
  fmt::print(
      "{}: {} cameras, {} frames, {:.1f} MB ({} stored unchanged, {} rewritten, {} encoded)\n",
      options.take.string(), summary.cameras, summary.frames,
      static_cast<double>(summary.jpeg_bytes) / kMegabyte, summary.copied, summary.rewritten,
      summary.encoded);
  return ExitCode::kSuccess;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(kDescription, "raystage import");
  Options options;
  declare(app, options);
  return raystage::parse_and_run(app, argc, argv, "import",
                                 [&](std::stop_token stop) { return run(options, stop); });
}
