// SPDX-License-Identifier: Apache-2.0
// raystage import: makes a take from images or movies with cameras, or stores depth maps in a take.
#include <fmt/format.h>

#include <charconv>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <map>
#include <optional>
#include <string>

#include "base/atomic_file.h"
#include "cli/command.h"
#include "cli/command_line_parsing.h"
#include "cli/depth_range_hint.h"
#include "cli/follow_links_option.h"
#include "cli/printing.h"
#include "cli/sandbox_option.h"
#include "cli/take_event.h"
#include "cli/threads.h"
#include "depths/import_depths.h"
#include "ingest/import_source.h"
#include "ingest/import_take.h"
#include "raystage_version.h"
#include "schemas/rig_document.h"
#include "store/bag_payload.h"
#include "store/take.h"

namespace {

using namespace raystage;
using namespace raystage::cli;
using Chroma = store::JpegEncodeOptions::Chroma;

constexpr const char* kDescription =
    "Makes a take from images or movies, or with --depth stores depth maps made elsewhere in a\n"
    "take.\n\n"
    "MANIFEST is one of\n"
    "  an import manifest   JSON with \"schema\": \"raystage/import/1\": cameras with intrinsics,\n"
    "                       poses, and image files with times or a movie\n"
    "  a NeRF model         transforms.json with its images; each image is a camera at time 0\n"
    "  a COLMAP text model  cameras.txt and images.txt; each image is a camera at time 0\n"
    "  a facebook360 rig    rig.json with pictures (color/cam0/000000.png, cam0/*.jpg) or\n"
    "                       movies (cam0.mp4) named by the cameras' ids\n"
    "  a Google model       models.json with camera_0001.mp4 etc.\n"
    "or a folder with one of them.\n\n"
    "JPEG files and Motion JPEG movies are stored byte for byte. Other images and movies are\n"
    "encoded once: as JPEG, or as JPEG XL where they have more than 8 bits. Floating-point images\n"
    "become half floats of linear light and keep the primaries of an EXR file; they need a\n"
    "manifest with color_space lin_rec709_scene. Images of 16 bits and movies of 10 bits or more\n"
    "keep their codes. With --bits 8 all are rounded to 8-bit sRGB codes and clipped at white.\n\n"
    "With --depth TAKE it is a folder of depth maps: CAMERA/000001.exr or .png, or CAMERA.exr or\n"
    ".png if the take is a still light field. EXR files hold metres; PNG files hold codes of 16\n"
    "bits, for which --depth-near or --depth-unit is needed. 0, infinity and NaN are unknown\n"
    "depths. Maps cover the whole recorded pictures, with their lens distortion, and have at\n"
    "least 8 pixels and a sixteenth of the pictures' along each side. depth, lumigraph on depths "
    "and merging use them in place of estimated depths.";

struct Options {
  std::filesystem::path manifest, take;
  std::string images, epoch = "1970-01-01T00:00:00Z", chroma = "444";
  std::string bits = "source";
  double distance = 0;
  std::string restart_markers;  // empty, "default" or MCUs between two
  int quality = 95;
  std::optional<double> fps;
  int threads = 0;
  bool quiet = false, rig_only = false;

  // Of depth maps.
  std::filesystem::path depth_take;
  std::string depth_channel;
  std::optional<double> depth_unit, depth_near, depth_far;
  depths::MapNumbers depth_numbers = depths::MapNumbers::kTicks;
  render::DepthQuantity depth_quantity = render::DepthQuantity::kPlanar;
  bool depth_overwrites = false;
};

/// Options of depth maps, which are rejected without --depth.
void declare_depth(CommandLine command, Options& options) {
  command.option("--depth TAKE", options.depth_take,
                 "Store depth maps in this take instead of making one");
  command
      .choice("--depth-kind", options.depth_quantity,
              {{"planar", render::DepthQuantity::kPlanar},
               {"distance", render::DepthQuantity::kDistance}},
              "planar: depth along the camera's axis; distance: from the camera's centre (default: "
              "planar)")
      .needs("--depth");
  command
      .option("--depth-channel NAME", options.depth_channel,
              "EXR channel of the depths (default: Z)")
      .needs("--depth");
  command
      .option("--depth-unit M", options.depth_unit,
              "Metres of the value 1, e.g. 0.001 for PNG files of depth cameras in millimetres "
              "(default: 1 for EXR files)")
      .positive()
      .needs("--depth");
  command
      .option("--depth-near M", options.depth_near,
              "PNG codes are inverse depths, as MPEG's tools write them: depth of code 65535, "
              "metres; code 0 is unknown")
      .positive()
      .needs("--depth")
      .excludes("--depth-unit");
  command
      .option("--depth-far M", options.depth_far,
              "The same: depth that code 0 would have, metres (default: infinity)")
      .positive()
      .needs("--depth-near");
  command
      .choice("--depth-numbers", options.depth_numbers,
              {{"ticks", depths::MapNumbers::kTicks}, {"recorded", depths::MapNumbers::kRecorded}},
              "What 000001 counts: ticks of the timeline, as the frames of shots and of exports at "
              "constant times; or the recorded frames of the camera (default: ticks)")
      .needs("--depth");
  command
      .choice("--depth-existing", options.depth_overwrites, {{"error", false}, {"overwrite", true}},
              "If the take has an imported map of a frame already (default: error)")
      .needs("--depth");
}

void declare(CommandLine& command, Options& options) {
  command.option("MANIFEST", options.manifest, "Manifest, model or folder").required();
  command.option("-o,--output TAKE", options.take,
                 "Folder of the new take; must not exist. Required without --depth");
  command.flag(
      "--rig-only", options.rig_only,
      "Write only the cameras, without pictures: the output is a rig (rig.json) instead of "
      "a take, for raystage info, plan, calibrate and export");
  command.option("--images DIR", options.images,
                 "Folder of the pictures of another program's model (default: the model's folder "
                 "and the usual ones next to it, such as images/ or color/)");
  command.flag("--restart-markers{default} [=MCUS]", options.restart_markers,
               "Rewrite JPEG input with restart markers, so that rectangles can be decoded; "
               "--restart-markers=MCUS sets the MCUs between two (default: as many as make up to "
               "32 pixels, 16 in frames narrower than 640). Pixels stay identical. Without it JPEG "
               "input is stored as it is");
  command
      .option("--bits B", options.bits,
              "Bits of a sample (default: source). source: images and movies of more than 8 bits "
              "are stored as JPEG XL without loss; 8: they are rounded to 8 bits, as JPEG")
      .one_of_listed({"source", "8"});
  command
      .option("--distance D", options.distance,
              "Loss of the JPEG XL pictures, Butteraugli distance: 0 = none, 1 = visually "
              "lossless (default: 0)")
      .range(0.0, 15.0);
  command.option("--quality Q", options.quality, "JPEG quality of encoded images (default: 95)")
      .range(1, 100);
  command.option("--chroma S", options.chroma, "Chroma subsampling when encoding (default: 444)")
      .one_of_listed({"444", "422", "420"});
  command.option("--epoch UTC", options.epoch,
                 "UTC of time 0 for another program's model (default: 1970-01-01T00:00:00Z)");
  command
      .option("--fps F", options.fps,
              "Nominal rate of another program's model, Hz (default: that of its movies, else 24)")
      .range(1e-3, 1e6);
  declare_depth(command.group("Depth maps"), options);
  add_threads_option(command, options.threads);
  add_sandbox_option(command);
  add_follow_links_option(command);
  command.flag("-q,--quiet", options.quiet, "No progress on stderr");
}

/// Returns -1 for "default". The option is text because CLI11 reads =0 of a flag as "not set".
int restart_interval_from(const std::string& text) {
  constexpr int kDefault = -1, kMax = 65535;  // the DRI marker has 16 bits
  if (text == "default") return kDefault;
  int interval = 0;
  const char* end = text.data() + text.size();
  const auto [used, error] = std::from_chars(text.data(), end, interval);
  if (error != std::errc() || used != end || interval < 1 || interval > kMax) {
    throw Error::bad_input(
        "found " + text + " MCUs between markers, allowed: 1 to " + std::to_string(kMax),
        "--restart-markers", "Omit the number for the default");
  }
  return interval;
}

ingest::ImportOptions settings_from(const Options& options) {
  static const std::map<std::string, Chroma> kChroma{
      {"444", Chroma::k444}, {"422", Chroma::k422}, {"420", Chroma::k420}};
  ingest::ImportOptions settings;
  settings.encode.quality = options.quality;
  settings.keep_depth = options.bits == "source";
  settings.distance = options.distance;
  settings.encode.chroma = kChroma.at(options.chroma);
  if (!options.restart_markers.empty()) {
    settings.restart_markers = restart_interval_from(options.restart_markers);
    settings.encode.restart_interval = *settings.restart_markers;
  }
  settings.created_by = "raystage " RAYSTAGE_VERSION;
  return settings;
}

/// Throws Error (bad input) if the rig would replace a file: models have a rig.json, too.
void write_rig_only(const schemas::ImportManifest& manifest, const std::filesystem::path& file) {
  if (file_exists(file)) {
    throw Error::bad_input("the rig's file exists", file.string(), "Give a file that does not");
  }
  const schemas::RigDocument rig = ingest::rig_of(manifest);
  schemas::write_rig(rig, file);
  print("{}: a rig with {} cameras\n", file.string(), rig.cameras.size());
}

ExitCode run_depth_import(const Options& options, const std::stop_token& stop) {
  if (!options.take.empty() || options.rig_only) {
    throw Error::bad_input("depth maps are stored in the take of --depth, not in a new one",
                           options.rig_only ? "--rig-only" : "--output", "Omit this option");
  }
  depths::DepthImportOptions settings;
  settings.encoding.quantity = options.depth_quantity;
  settings.encoding.unit_m = options.depth_unit;
  settings.encoding.channel = options.depth_channel;
  if (options.depth_near) {
    settings.encoding.inverse_range = schemas::DepthRange{
        *options.depth_near, options.depth_far.value_or(std::numeric_limits<double>::infinity())};
  }
  settings.numbers = options.depth_numbers;
  settings.overwrites = options.depth_overwrites;
  settings.created_by = "raystage " RAYSTAGE_VERSION;
  store::require_no_bag_payload(options.depth_take);
  const store::Take take(options.depth_take);
  Progress progress(!options.quiet);
  settings.progress = [&](double done) { progress.report(done); };
  return run_with_threads(options.threads, [&] {
    const auto report = depths::import_depths(take, options.manifest, settings, stop);
    for (const std::string& note : report.notes) print_error("note: {}\n", note);
    constexpr double kPercent = 100;
    print("{}: {} depth maps of {} cameras ({} replaced), {:.1f} % of the pixels unknown\n",
          options.depth_take.string(), report.maps, report.cameras, report.replaced,
          kPercent * report.unknown_share);
    record_event(options.depth_take, "modification",
                 "import --depth " + options.manifest.filename().string(),
                 fmt::format("{} depth maps, {} replaced", report.maps, report.replaced));
    return ExitCode::kSuccess;
  });
}

ExitCode run(const Options& options, std::stop_token stop) {
  if (!options.depth_take.empty()) return run_depth_import(options, stop);
  if (options.take.empty()) {
    throw Error::bad_input("the new take is not given", "--output", "Give its folder: -o TAKE");
  }
  ingest::ModelImportOptions model;
  if (!options.images.empty()) model.images = options.images;
  model.epoch_utc = parse_utc(options.epoch);
  model.nominal_fps = options.fps;
  model.has_pictures = !options.rig_only;

  const ThreadLimit limit(options.threads);
  ingest::ImportOptions settings = settings_from(options);
  const auto source = ingest::open_import_source(options.manifest, model);
  for (const std::string& note : source.notes) print_error("note: {}\n", note);
  if (options.rig_only) {
    write_rig_only(source.manifest, options.take);
    return ExitCode::kSuccess;
  }
  Progress progress(!options.quiet);
  settings.progress = [&](double done) { progress.report(done); };
  const auto summary =
      ingest::import_take(source.manifest, source.base, options.take, settings, stop);
  constexpr double kMegabyte = 1e6;
  const std::string deep =
      summary.deep == 0 ? std::string() : fmt::format(", {} with more than 8 bits", summary.deep);
  print("{}: {} cameras, {} frames, {:.1f} MB ({} stored unchanged, {} rewritten, {} encoded{})\n",
        options.take.string(), summary.cameras, summary.frames,
        static_cast<double>(summary.jpeg_bytes) / kMegabyte, summary.copied, summary.rewritten,
        summary.encoded, deep);
  if (summary.not_finite > 0) {
    print_error("note: {} samples were infinite or not numbers; they were stored as 65504 or 0\n",
                summary.not_finite);
  }
  print_depth_range_hint(options.take);
  record_event(options.take, "ingestion", "import " + options.manifest.filename().string(),
               fmt::format("{} cameras, {} frames", summary.cameras, summary.frames));
  return ExitCode::kSuccess;
}

}  // namespace

int main(int argc, char** argv) {
  CommandLine command(kDescription, "raystage import");
  Options options;
  declare(command, options);
  return parse_and_run(command, argc, argv, "import",
                       [&](std::stop_token stop) { return run(options, stop); });
}
