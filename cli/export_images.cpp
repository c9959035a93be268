// SPDX-License-Identifier: Apache-2.0
// raystage export images: a sequence of image files per camera.
#include "exports/export_images.h"

#include <fmt/format.h>

#include <memory>

#include "cli/export.h"
#include "cli/export_options.h"
#include "cli/threads.h"
#include "raystage_version.h"

namespace raystage::cli {
namespace {

struct ImagesCommand : ExportOptions {
  std::string format = "jpeg", compression = "zip";
};

ExitCode export_images_of(const ImagesCommand& options, const std::stop_token& stop) {
  const store::Take take(options.take);
  exports::ImageExportOptions images;
  images.output = options.output;
  images.frames = frame_choice(options);
  images.format = &exports::image_format(options.format);
  images.exr = {options.compression, RAYSTAGE_VERSION};
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
  add_frame_options(images, *options, OfferedTimes::kImages, "gap");
  add_run_options(images, *options);
  return {images,
          [options](const std::stop_token& stop) { return export_images_of(*options, stop); }};
}

}  // namespace raystage::cli
