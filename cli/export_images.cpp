// SPDX-License-Identifier: Apache-2.0
// raystage export images: a sequence of image files per camera.
#include "exports/export_images.h"

#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <string>

#include "cli/export.h"
#include "cli/export_options.h"
#include "cli/sandbox_option.h"
#include "cli/threads.h"
#include "exports/exr_color_space.h"
#include "raystage_version.h"

namespace raystage::cli {
namespace {

struct ImagesCommand : ExportOptions {
  std::string format = "jpeg", compression = "zip";
  std::string color_space, rec709_space;
  std::filesystem::path color_config;
};

/// Throws Error (bad input) if a colour space is given for other files than EXR, or a config
/// without a space.
exports::ExrColorSpace color_space_of(const ImagesCommand& options) {
  const bool has_config = !options.color_config.empty();
  if (options.color_space.empty()) {
    if (has_config) {
      throw Error::bad_input("a config without a colour space of it", "--ocio",
                             "Add --color-space NAME");
    }
    if (options.rec709_space.empty()) return {};
  }
  if (!options.rec709_space.empty() && !has_config) {
    throw Error::bad_input("--rec709-space needs a config", "", "Add --ocio CONFIG");
  }
  if (options.format != "exr") {
    throw Error::bad_input("only EXR files are converted to a colour space", "--color-space",
                           "Add --format exr");
  }
  return exports::exr_color_space(options.color_space, options.color_config, options.rec709_space);
}

ExitCode export_images_of(const ImagesCommand& options, const std::stop_token& stop) {
  const store::Take take = open_take(options);
  exports::ImageExportOptions images;
  images.output = options.output;
  images.frames = frame_choice(options);
  images.format = &exports::image_format(options.format);
  images.exr = {options.compression, RAYSTAGE_VERSION, color_space_of(options)};
  Progress progress(!options.quiet);
  images.progress = [&](double done) { progress.report(done); };
  return run_with_threads(options.threads, [&] {
    const exports::ExportReport report = exports::export_images(take, images, stop);
    print_report(report, options.output.string(),
                 fmt::format("{}, {} times", options.format, options.times));
    return report.exit_code();
  });
}

}  // namespace

Subcommand declare_export_images(CommandLine& command) {
  auto options = std::make_shared<ImagesCommand>();
  CommandLine images = command.subcommand("images", "Write a sequence of image files per camera");
  add_take_options(images, *options, "FOLDER",
                   "folder to write, which must not exist: CAMERA/000001.jpg, frames.csv (time of "
                   "each\nfile), rig.json");
  std::vector<std::string> names;
  std::string formats;
  for (const exports::ImageFormat* format : exports::image_formats()) {
    names.emplace_back(format->name());
    formats += fmt::format("\n{}: {}", format->name(), format->description());
  }
  images
      .option("--format FORMAT", options->format, "format of the files (default: jpeg):" + formats)
      .one_of_listed(names);
  images.option("--compression", options->compression, "compression of EXR files (default: zip)")
      .one_of({"none", "zips", "zip"});
  images.option("--color-space,--colour-space NAME", options->color_space,
                "linear colour space of EXR files, as the config names it: of --ocio, else "
                "lin_ap1_scene\n(ACEScg), lin_ap0_scene (ACES2065-1) or lin_rec709_scene (default: "
                "lin_rec709_scene)");
  images.option("--ocio CONFIG", options->color_config,
                "OpenColorIO config with that space; $OCIO is ignored");
  images.option("--rec709-space NAME", options->rec709_space,
                "name of linear Rec.709 in that config (default: its usual names)");
  add_sandbox_option(images);
  add_frame_options(images, *options, OfferedTimes::kImages, "gap");
  add_run_options(images, *options);
  return {images,
          [options](const std::stop_token& stop) { return export_images_of(*options, stop); }};
}

}  // namespace raystage::cli
