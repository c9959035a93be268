// SPDX-License-Identifier: Apache-2.0
// raystage pack --temporal: encodes the frames of a take as video.
#include "cli/pack_temporal.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "cli/command.h"
#include "cli/printing.h"
#include "cli/take_event.h"
#include "cli/threads.h"
#include "cli/view_loss.h"
#include "schemas/json_text.h"
#include "store/packing/pack_temporal.h"

namespace raystage::cli {
namespace {

using Camera = store::TemporalReport::Camera;
constexpr int kDefaultGroup = 12;
constexpr int kHevcCrf = 24, kAv1Crf = 32;
constexpr double kMegabyte = 1e6;

struct MeasuredLoss {
  double target_db = 0, loss_db = 0, reference_db = 0;
  std::string truth;
};

double ratio(const Camera& camera) {
  return static_cast<double>(camera.bytes_before) /
         static_cast<double>(std::max<std::uint64_t>(camera.bytes_after, 1));
}

store::VideoSettings settings_of(const TemporalCommandOptions& options) {
  store::VideoSettings video;
  video.codec = options.codec == "hevc" ? store::VideoCodec::kHevc : store::VideoCodec::kAv1;
  video.group_frames =
      options.references == References::kNone ? 1 : options.group.value_or(kDefaultGroup);
  video.crf = options.crf.value_or(video.codec == store::VideoCodec::kHevc ? kHevcCrf : kAv1Crf);
  return video;
}

store::References references_of(const TemporalCommandOptions& options) {
  return options.references == References::kCameras ? store::References::kCameras
                                                    : store::References::kTime;
}

std::string_view name_of(References references) {
  return references == References::kCameras ? "cameras"
         : references == References::kNone  ? "none"
                                            : "time";
}

void check_options(const TemporalCommandOptions& options, const store::VideoSettings& video) {
  if (!options.crf) return;
  const double least = store::min_crf(video.codec), most = store::max_crf(video.codec);
  const bool is_whole = *options.crf == std::round(*options.crf);
  const bool is_usable = video.codec == store::VideoCodec::kHevc || is_whole;
  if (*options.crf < least || *options.crf > most || !is_usable) {
    throw Error::bad_input(
        fmt::format("{} has no rate factor {}", store::name_of(video.codec), *options.crf), "",
        fmt::format("Use {}{} to {}",
                    video.codec == store::VideoCodec::kAv1 ? "a whole number, " : "", least, most));
  }
}

/// Searches the rate factor. A line per trial goes to stderr.
MeasuredLoss search(const store::Take& take, const std::string& output,
                    const TemporalCommandOptions& options, bool quiet, int threads,
                    store::VideoSettings& video, const std::stop_token& stop) {
  const store::References references = references_of(options);
  const int frames = references == store::References::kCameras ? 1 : video.group_frames;
  const ViewLoss loss(take, output, {options.method, options.views, frames, references, threads},
                      stop);
  MeasuredLoss measured{*options.target_db, 0, loss.reference_db(), loss.truth()};
  std::map<double, double> tried;
  const auto loss_of = [&](double crf) {
    video.crf = crf;
    const double db = loss.loss_db(video);
    tried[crf] = db;
    if (!quiet) fmt::print(stderr, "rate factor {}: {:.3f} dB\n", crf, db);
    return db;
  };
  const int least = video.codec == store::VideoCodec::kHevc ? 4 : 8;
  video.crf = largest_crf_within(take.folder().string(), *options.target_db, least,
                                 static_cast<int>(store::max_crf(video.codec)), loss_of);
  measured.loss_db = tried.at(video.crf);
  return measured;
}

nlohmann::ordered_json json_of(const Camera& camera) {
  return {{"frames", camera.frames},
          {"groups", camera.groups},
          {"frames_in_444", camera.frames_in_444},
          {"bytes_before", camera.bytes_before},
          {"bytes_after", camera.bytes_after},
          {"mean_square_error", camera.mean_square_error},
          {"min_psnr_db", camera.min_psnr_db}};
}

void print_json(const PackCommandOptions& common, References references,
                const store::VideoSettings& video, const store::TemporalReport& report,
                const std::optional<MeasuredLoss>& loss) {
  nlohmann::ordered_json json{{"take", common.take},
                              {"output", common.output},
                              {"codec", store::name_of(video.codec)},
                              {"references", name_of(references)},
                              {"crf", video.crf},
                              {"group_frames", video.group_frames}};
  json.update(json_of(report.total()));
  json["psnr_db"] = report.psnr_db();
  if (loss) {
    json["view_loss"] = {{"target_db", loss->target_db},
                         {"loss_db", loss->loss_db},
                         {"psnr_before_db", loss->reference_db},
                         {"truth", loss->truth}};
  }
  json["seconds"] = report.seconds;
  json["encode_thread_seconds"] = report.encode_thread_seconds;
  json["decode_thread_seconds"] = report.decode_thread_seconds;
  json["cameras"] = nlohmann::ordered_json::array();
  for (const Camera& camera : report.cameras) {
    nlohmann::ordered_json entry{{"id", camera.id}};
    entry.update(json_of(camera));
    json["cameras"].push_back(std::move(entry));
  }
  print(schemas::dump_json(json) + "\n");
}

std::string decibels(double psnr) {
  return std::isfinite(psnr) ? fmt::format("{:.2f} dB", psnr) : "infinite";
}

void print_text(const PackCommandOptions& common, References references,
                const store::VideoSettings& video, const store::TemporalReport& report,
                const std::optional<MeasuredLoss>& loss) {
  const Camera total = report.total();
  print("{}: {} cameras, {} frames, {:.1f} MB -> {:.2f} MB, {:.1f} times smaller; lossy\n",
        common.output, report.cameras.size(), total.frames,
        static_cast<double>(total.bytes_before) / kMegabyte,
        static_cast<double>(total.bytes_after) / kMegabyte, ratio(total));
  print("Codec      {} {}, rate factor {}, {} groups of up to {} {}\n", store::name_of(video.codec),
        total.frames_in_444 == 0              ? "4:2:0"
        : total.frames_in_444 == total.frames ? "4:4:4"
                                              : "4:4:4 and 4:2:0",
        video.crf, total.groups, video.group_frames,
        references == References::kCameras ? "cameras" : "frames");
  if (total.frames == 0) return;
  print("Frames     PSNR {} against the source's Y'CbCr samples, the worst {}\n",
        decibels(report.psnr_db()), decibels(total.min_psnr_db));
  if (loss) {
    print("Views      {:.3f} dB lost of {:.2f} dB PSNR (allowed: {} dB); truth: {}\n",
          loss->loss_db, loss->reference_db, loss->target_db, loss->truth);
  }
  const auto frames = static_cast<double>(total.frames);
  print("Speed      {:.1f} s; per frame {:.1f} ms to encode, {:.1f} ms to decode and compare\n",
        report.seconds, 1000 * report.encode_thread_seconds / frames,
        1000 * report.decode_thread_seconds / frames);
}

}  // namespace

void add_temporal_options(CommandLine& command, TemporalCommandOptions& options) {
  CommandLine group = command.group("Lossy, as video");
  group
      .option(
          "--temporal", options.codec,
          "Encode the frames as HEVC (x265; 4:4:4 where the JPEGs are) or AV1 (SVT-AV1; 4:2:0), 8 "
          "bits: lossy")
      .one_of({"hevc", "av1"});
  group
      .choice("--references", options.references,
              {{"time", References::kTime},
               {"cameras", References::kCameras},
               {"none", References::kNone}},
              "What frames are predicted from: time (earlier frames of the camera's group), "
              "cameras (of "
              "the same instant, along the rows of the array) or none (default: time)")
      .needs("--temporal");
  group
      .option("--group", options.group,
              "Frames of a group, which is decoded as a whole, 1-256; with --references cameras "
              "those of as many cameras (default: 12)")
      .limits(1, store::kMaxGroupFrames)
      .needs("--temporal");
  group
      .option("--crf", options.crf,
              "Rate factor of the encoder, HEVC 0-51, AV1 1-63; larger is smaller and worse "
              "(default: 24, 32)")
      .limits(0.0, 63.0)
      .needs("--temporal");
  group
      .option("--target-db", options.target_db,
              "Search the largest rate factor whose loss in rendered views is at most this, dB of "
              "PSNR: see docs/archivist.md")
      .limits(0.0, 60.0)
      .excludes("--crf")
      .needs("--temporal");
  group
      .option("--views", options.views,
              "Views document with truth images for --target-db (default: cameras that are left "
              "out, in the middle of the take)")
      .needs("--target-db");
  group.option("--method", options.method, "Reconstruction method that renders the views")
      .show_default()
      .needs("--target-db");
}

ExitCode run_pack_temporal(const PackCommandOptions& common, const TemporalCommandOptions& options,
                           const std::stop_token& stop) {
  store::silence_encoders();
  store::TemporalOptions how;
  how.video = settings_of(options);
  how.references = references_of(options);
  check_options(options, how.video);
  const ThreadLimit limit(common.threads);
  const store::Take take(common.take);
  store::require_new_take(take, common.output);
  std::optional<MeasuredLoss> loss;
  if (options.target_db) {
    loss = search(take, common.output, options, common.quiet, common.threads, how.video, stop);
  }
  Progress progress(!common.quiet);
  how.progress = [&](double done) { progress.report(done); };
  how.stop = stop;
  const store::TemporalReport report = store::pack_temporal(take, common.output, how);
  std::string what = fmt::format("{} frames, lossy, references {}, rate factor {}",
                                 report.total().frames, name_of(options.references), how.video.crf);
  if (report.total().frames > 0) what += ", PSNR " + decibels(report.psnr_db());
  record_event(common.output, "migration", "pack --temporal " + options.codec, what);
  if (common.json) {
    print_json(common, options.references, how.video, report, loss);
  } else {
    print_text(common, options.references, how.video, report, loss);
  }
  return ExitCode::kSuccess;
}

}  // namespace raystage::cli
