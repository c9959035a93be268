// SPDX-License-Identifier: Apache-2.0
// raystage info: contents of a take and missing frames.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <numeric>
#include <set>
#include <vector>

#include "base/atomic_file.h"
#include "base/cancellation.h"
#include "base/contained_path.h"
#include "cli/command.h"
#include "cli/command_line_parsing.h"
#include "cli/follow_links_option.h"
#include "cli/info_rig.h"
#include "cli/printing.h"
#include "cli/shutter_text.h"
#include "rig/line_time_check.h"
#include "schemas/former_names.h"
#include "schemas/imported_depths_document.h"
#include "schemas/json_text.h"
#include "store/imported_depths.h"
#include "store/take_summary.h"

namespace raystage::cli {
namespace {

using Json = nlohmann::ordered_json;
using Camera = store::TakeSummary::Camera;

constexpr double kBytesPerMb = 1e6;

double seconds(Nanoseconds time) { return static_cast<double>(time) / kNsPerS; }

double megabytes_per_second(const store::TakeSummary& summary) {
  if (summary.duration <= 0) return 0;
  return static_cast<double>(summary.archive_bytes) / kBytesPerMb / seconds(summary.duration);
}

template <typename Keep>
std::string ids_of(const store::TakeSummary& summary, Keep keep) {
  constexpr int kMax = 12;
  std::string text;
  int count = 0;
  for (const Camera& camera : summary.cameras) {
    if (!keep(camera)) continue;
    if (++count <= kMax) text += (text.empty() ? "" : ", ") + camera.id;
  }
  if (count > kMax) text += fmt::format(" and {} more", count - kMax);
  return text;
}

template <typename Keep>
long count_of(const store::TakeSummary& summary, Keep keep) {
  return std::ranges::count_if(summary.cameras, keep);
}

void line(std::string_view name, const std::string& text) { print("{:<12}{}\n", name, text); }

/// Returns "3 dropped by the source, 45 lost at start-up"; empty if nothing is missing.
std::string by_reason(const Camera& camera) {
  std::vector<std::string> reasons;
  for (std::size_t s = 1; s < camera.by_status.size(); ++s) {
    if (camera.by_status[s] == 0) continue;
    reasons.push_back(fmt::format("{} {}", camera.by_status[s],
                                  store::name_of(static_cast<store::FrameStatus>(s))));
  }
  if (camera.lost > 0) reasons.push_back(fmt::format("{} after the archive's end", camera.lost));
  return fmt::format("{}", fmt::join(reasons, ", "));
}

int missing_of(const Camera& camera) {
  return std::reduce(camera.by_status.begin() + 1, camera.by_status.end(), camera.lost);
}

/// Prints only the cameras with the most missing frames if many have some; --json lists all.
void print_missing(const store::TakeSummary& summary) {
  constexpr std::size_t kMax = 8;
  Camera all;
  std::vector<const Camera*> lacking;
  for (const Camera& camera : summary.cameras) {
    for (std::size_t s = 1; s < all.by_status.size(); ++s) all.by_status[s] += camera.by_status[s];
    all.lost += camera.lost;
    if (missing_of(camera) > 0) lacking.push_back(&camera);
  }
  if (lacking.empty()) {
    line("Missing", "no frames recorded as missing");
    return;
  }
  line("Missing",
       fmt::format("{} frames in {} cameras: {}", missing_of(all), lacking.size(), by_reason(all)));
  std::ranges::stable_sort(lacking, std::ranges::greater{},
                           [](const Camera* camera) { return missing_of(*camera); });
  const std::size_t shown = lacking.size() > kMax ? kMax / 2 : lacking.size();
  for (std::size_t i = 0; i < shown; ++i) {
    print("  {:<10}{}\n", lacking[i]->id, by_reason(*lacking[i]));
  }
  if (shown < lacking.size()) {
    print("  and {} cameras more, {} to {} frames each (--json lists them)\n",
          lacking.size() - shown, missing_of(*lacking.back()), missing_of(*lacking[shown]));
  }
}

void print_archives(const store::TakeSummary& summary, const std::string& folder) {
  const auto is_cut = [](const Camera& camera) { return camera.is_cut; };
  const auto open = [](const Camera& camera) {
    return camera.error.empty() && !camera.closed && !camera.is_cut;
  };
  const long not_closed = count_of(summary, open), cut = count_of(summary, is_cut);
  if (not_closed > 0) {
    line("Archives", fmt::format("{} not closed (interrupted, or still recording): {}", not_closed,
                                 ids_of(summary, open)));
  } else if (cut == 0) {
    const auto is_readable = [](const Camera& c) { return c.error.empty(); };
    const auto cameras = static_cast<long>(summary.cameras.size());
    const long readable = count_of(summary, is_readable);
    line("Archives", readable == cameras ? fmt::format("{}, all closed", readable)
                                         : fmt::format("{} of {} can be read", readable, cameras));
  }
  if (cut > 0) {
    line("Archives", fmt::format("{} shorter than when closed: {}", cut, ids_of(summary, is_cut)));
    const bool has_lost_frames = count_of(summary, [](const Camera& c) { return c.lost > 0; }) > 0;
    if (has_lost_frames) {
      print(
          "  `raystage verify {0}` lists the lost frames, `raystage repair {0} --from COPY` "
          "restores them\n",
          folder);
    } else {
      print("  no frame is lost; `raystage repair {0}` writes the end again\n", folder);
    }
  }
  if (not_closed > 0) {
    print(
        "  if interrupted: `raystage record CONFIG --resume -o {0}` continues it, `raystage repair "
        "{0}` closes it\n",
        folder);
  }
  const auto repaired = [](const Camera& c) { return c.recovered > 0 || c.damaged_records > 0; };
  for (const Camera& camera : summary.cameras) {
    if (!camera.error.empty()) print("  {}\n", camera.error);
    if (repaired(camera)) {
      print("  {:<10}{} frames not in the journal, {} damaged journal records\n", camera.id,
            camera.recovered, camera.damaged_records);
    }
    if (camera.unverified > 0) {
      print("  {:<10}{}\n", camera.id, unverified_text(camera.unverified));
    }
  }
}

std::string restart_markers(const store::TakeSummary& summary) {
  const long with = count_of(summary, [](const Camera& c) { return c.restart_markers == true; });
  const long without =
      count_of(summary, [](const Camera& c) { return c.restart_markers == false; });
  if (with + without == 0) {
    const bool is_packed = count_of(summary, [](const Camera& c) { return c.packed; }) > 0;
    return is_packed ? "restart markers: not known while the frames are packed" : "unknown";
  }
  if (without == 0) return "restart markers: parts of frames can be decoded";
  if (with == 0) return "no restart markers: frames are decoded as a whole";
  return fmt::format("restart markers in {} of {} cameras", with, with + without);
}

const char* samples_name(const schemas::PixelEncoding& pixels) {
  return pixels.samples == schemas::PixelEncoding::Samples::kHalf ? "half" : "integer";
}

const char* transfer_name(const schemas::PixelEncoding& pixels) {
  switch (pixels.transfer) {
    case schemas::PixelEncoding::Transfer::kLinear:
      return "linear";
    case schemas::PixelEncoding::Transfer::kSrgb:
      return "srgb";
    case schemas::PixelEncoding::Transfer::kPq:
      return "pq";
    case schemas::PixelEncoding::Transfer::kHlg:
      return "hlg";
  }
  return "unknown";
}

std::string describe(const schemas::PixelEncoding& pixels) {
  const bool is_half = pixels.samples == schemas::PixelEncoding::Samples::kHalf;
  return (is_half ? std::string("half floats of linear light")
                  : fmt::format("{} bits, {}", pixels.bits, transfer_name(pixels))) +
         (pixels.chromaticities ? ", other primaries than Rec.709" : "");
}

/// Returns the forms of samples of more than 8 bits, and their brightest light; empty: none.
std::string deep_pixels(const store::TakeSummary& summary) {
  std::map<std::string, int> forms;
  double peak = 0;
  for (const Camera& camera : summary.cameras) {
    if (!camera.pixels) continue;
    ++forms[describe(*camera.pixels)];
    peak = std::max(peak, camera.pixels->peak);
  }
  std::string text;
  for (const auto& [form, cameras] : forms) {
    text += text.empty() ? "" : "; ";
    text += form;
    if (cameras < static_cast<int>(summary.cameras.size())) {
      text += fmt::format(" in {} of {} cameras", cameras, summary.cameras.size());
    }
  }
  return text.empty() ? text : fmt::format("JPEG XL, {}; up to {:.3g} times white", text, peak);
}

std::string resolutions(const store::TakeSummary& summary) {
  std::set<std::pair<int, int>> sizes;
  for (const Camera& camera : summary.cameras) sizes.emplace(camera.width, camera.height);
  std::string text;
  for (const auto& [width, height] : sizes) {
    text += fmt::format("{}{} x {}", text.empty() ? "" : ", ", width, height);
  }
  return text + " pixels";
}

using ImportedDepths = schemas::ImportedDepthsDocument;

/// The depth maps of a take.
struct DepthMaps {
  std::size_t estimated_sets = 0, estimated = 0;  ///< sets of settings; stored light field frames
  ImportedDepths imported;
  std::string error;  ///< why `imported` could not be read

  std::size_t imported_maps() const {
    std::size_t count = 0;
    for (const ImportedDepths::Camera& camera : imported.cameras) count += camera.maps.size();
    return count;
  }
  double unknown_share() const {
    double sum = 0;
    for (const ImportedDepths::Camera& camera : imported.cameras) {
      for (const ImportedDepths::Map& map : camera.maps) sum += map.unknown_share;
    }
    return sum / static_cast<double>(std::max<std::size_t>(1, imported_maps()));
  }
};

DepthMaps depth_maps_of(const store::Take& take) {
  namespace fs = std::filesystem;
  DepthMaps maps;
  std::error_code error;
  const ContainedPath estimated = take.file("depth");
  const fs::path folder =
      permits_links() || is_contained(estimated) ? estimated.path() : fs::path();
  for (fs::directory_iterator set(folder, error), end; set != end; set.increment(error)) {
    if (!fs::is_directory(set->symlink_status(error))) continue;
    std::set<std::string> instants;
    for (fs::directory_iterator file(set->path(), error); file != end; file.increment(error)) {
      const std::string name = file->path().filename().string();
      if (name.ends_with(".zst") && !name.starts_with('.')) {
        instants.insert(name.substr(0, name.find('.')));
      }
    }
    if (instants.empty()) continue;
    ++maps.estimated_sets;
    maps.estimated += instants.size();
  }
  try {
    maps.imported = store::read_imported_depths(take);
  } catch (const Error& failure) {
    maps.error = failure.what();
  }
  return maps;
}

void print_depth_maps(const DepthMaps& maps) {
  constexpr double kPercent = 100;
  if (!maps.error.empty()) line("Depth maps", maps.error);
  if (const std::size_t imported = maps.imported_maps(); imported > 0) {
    line("Depth maps",
         fmt::format("imported: {} of {} cameras, {:.1f} % of the pixels unknown; "
                     "used in place of estimated ones",
                     imported, maps.imported.cameras.size(), kPercent * maps.unknown_share()));
    for (const ImportedDepths::Import& from : maps.imported.imports) {
      print("  {} from {} ({})\n", format_utc(from.utc), from.folder, from.encoding);
    }
  }
  if (maps.estimated > 0) {
    line("Depth maps",
         fmt::format("estimated: of {} light field frames, in {} set{} of settings "
                     "(depth/, can be deleted)",
                     maps.estimated, maps.estimated_sets, maps.estimated_sets == 1 ? "" : "s"));
  }
}

Json json_of(const DepthMaps& maps) {
  Json imports = Json::array();
  for (const ImportedDepths::Import& from : maps.imported.imports) {
    imports.push_back({{"utc", format_utc(from.utc)},
                       {"by", from.by},
                       {"folder", from.folder},
                       {"encoding", from.encoding}});
  }
  Json json{{"estimated_frames", maps.estimated},
            {"estimated_sets", maps.estimated_sets},
            {"imported", maps.imported_maps()},
            {"imported_cameras", maps.imported.cameras.size()},
            {"imported_unknown_share", maps.unknown_share()},
            {"imports", std::move(imports)}};
  if (!maps.error.empty()) json["error"] = maps.error;
  return json;
}

void print_text(const store::Take& take, const store::TakeSummary& summary) {
  const schemas::TakeDocument& document = take.document();
  const char* unit = document.arbitrary_scale ? "units" : "m";
  line("Take", fmt::format("{} ({})", document.name, take.folder().string()));
  line("Recorded", format_utc(document.epoch_utc) +
                       (document.created_by.empty() ? "" : " by " + document.created_by));
  if (document.derived_from) {
    line("Made from",
         fmt::format("{} by {}", document.derived_from->take, document.derived_from->by));
  }
  const std::string cameras = fmt::format("{}, {}", summary.cameras.size(), resolutions(summary));
  if (summary.calibrated) {
    line("Cameras", fmt::format("{}, {:.4g} {} apart", cameras, summary.spacing, unit));
  } else {
    line("Cameras", cameras);
    line("Spacing", "unknown: the rig is not calibrated");
  }
  if (summary.calibrated) line("Lenses", rig::format_lenses(summary.lenses));
  const auto [fewest, most] = std::ranges::minmax(summary.cameras, {}, &Camera::frames);
  line("Frames",
       fmt::format("{}; {} to {} a camera", summary.frames(), fewest.frames, most.frames));
  const double megabytes = static_cast<double>(summary.bytes_on_disk) / kBytesPerMb;
  if (most.frames > 1) {
    line("Duration", fmt::format("{:.3f} s at {:.6g} Hz (nominal {:.6g} Hz)",
                                 seconds(summary.duration), summary.fps, document.nominal_fps));
    line("On disk",
         fmt::format("{:.1f} MB, {:.1f} MB/s", megabytes, megabytes_per_second(summary)));
  } else {
    line("Duration", "a still light field");
    line("On disk", fmt::format("{:.1f} MB", megabytes));
  }
  for (const Nanoseconds restart : summary.restarts) {
    line("Resumed", fmt::format("at {:.3f} s, after an interruption", seconds(restart)));
  }
  for (const auto& [node, late] : summary.late_nodes) {
    line("Late", fmt::format("node {} started {:.3f} s after its --start-at", node, seconds(late)));
  }
  if (!summary.restarts_error.empty()) line("Resumed", summary.restarts_error);
  const bool has_jpeg = count_of(summary, [](const Camera& c) { return !c.pixels; }) > 0;
  if (has_jpeg) line("Colour", document.color_space);
  line("Clock", fmt::format("{}; time stamps mark {}", document.clock, document.timestamp_event));
  line("Shutter", shutter_text(summary.shutters));
  if (most.frames > 1) {
    if (const auto error = rig::line_time_error(take.rig(), {}, summary.fps,
                                                (take.folder() / "rig.json").string())) {
      line("Warning", error->what());
    }
  }
  if (has_jpeg) line("JPEG", restart_markers(summary));
  if (const std::string text = deep_pixels(summary); !text.empty()) line("Pixels", text);
  const auto is_packed = [](const Camera& c) { return c.packed; };
  if (const long packed = count_of(summary, is_packed); packed > 0) {
    std::uint64_t frames = 0;
    for (const Camera& camera : summary.cameras) {
      frames += static_cast<std::uint64_t>(camera.packed_frames);
    }
    line("Packed", fmt::format("{}: {} frames are packed, {} are JPEG",
                               packed == static_cast<long>(summary.cameras.size())
                                   ? "JPEG XL"
                                   : fmt::format("JPEG XL in {} of {} cameras", packed,
                                                 summary.cameras.size()),
                               frames, summary.frames() - frames));
    print(
        "  packed frames are unpacked whole when they are read; `raystage unpack` returns the JPEG "
        "files\n");
  }
  const auto is_video = [](const Camera& c) { return !c.video.empty(); };
  if (const long lossy = count_of(summary, is_video); lossy > 0) {
    const Camera& first = *std::ranges::find_if(summary.cameras, is_video);
    line("Packed",
         fmt::format("{}{}, lossy: frames are decoded by groups when they are read, and "
                     "passed on as JPEG",
                     first.video,
                     lossy == static_cast<long>(summary.cameras.size())
                         ? ""
                         : fmt::format(" in {} of {} cameras", lossy, summary.cameras.size())));
  }
  if (document.depth_range) {
    const schemas::DepthRange range = *document.depth_range;
    line("Depth", std::isfinite(range.far)
                      ? fmt::format("{:.4g} to {:.4g} {}", range.near, range.far, unit)
                      : fmt::format("{:.4g} {} to infinity", range.near, unit));
  }
  print_depth_maps(depth_maps_of(take));
  if (summary.calibrated && summary.min_alias_free_distance > 0) {
    line("Alias-free",
         fmt::format("beyond {:.4g} {} (thesis eq. 4.3)", summary.min_alias_free_distance, unit));
  }
  print_archives(summary, take.folder().string());
  print_missing(summary);
  if (summary.timeline) {
    const auto& statistics = summary.timeline->statistics;
    line("Timeline",
         fmt::format("{} ticks at {:.6g} Hz; spread mean {:.3f} ms, at most {:.3f} ms; {} absent",
                     summary.timeline->ticks, summary.timeline->fps,
                     statistics.mean_spread_ns / kNsPerMs,
                     static_cast<double>(statistics.max_spread) / kNsPerMs,
                     std::reduce(statistics.absent.begin(), statistics.absent.end())));
  } else {
    line("Timeline", summary.timeline_error);
  }
}

Json json_of(const Camera& camera) {
  Json missing = Json::object();
  for (std::size_t s = 1; s < camera.by_status.size(); ++s) {
    if (camera.by_status[s] > 0) {
      missing[store::name_of(static_cast<store::FrameStatus>(s))] = camera.by_status[s];
    }
  }
  Json json{{"id", camera.id},
            {"width", camera.width},
            {"height", camera.height},
            {"frames", camera.frames},
            {"lost_frames", camera.lost},
            {"missing", missing},
            {"closed", camera.closed},
            {"packed", camera.packed},
            {"packed_frames", camera.packed_frames},
            {"video", camera.video.empty() ? Json() : Json(camera.video)},
            {"bytes", camera.bytes},
            {"recovered_frames", camera.recovered},
            {"damaged_records", camera.damaged_records},
            {"unverified_frames", camera.unverified}};
  json["restart_markers"] = camera.restart_markers ? Json(*camera.restart_markers) : Json();
  if (camera.pixels) {
    json["pixels"] = {{"samples", samples_name(*camera.pixels)},
                      {"bits", camera.pixels->bits},
                      {"transfer", transfer_name(*camera.pixels)},
                      {"peak", camera.pixels->peak}};
    if (camera.pixels->chromaticities) {
      json["pixels"]["chromaticities"] = *camera.pixels->chromaticities;
    }
  }
  if (!camera.error.empty()) json["error"] = camera.error;
  return json;
}

void print_json(const store::Take& take, const store::TakeSummary& summary) {
  const schemas::TakeDocument& document = take.document();
  Json cameras = Json::array();
  for (const Camera& camera : summary.cameras) cameras.push_back(json_of(camera));
  const auto measured = [&](double metres) { return summary.calibrated ? Json(metres) : Json(); };
  Json late = Json::object();
  for (const auto& [node, by] : summary.late_nodes) late[node] = by;
  Json json{{"name", document.name},
            {"epoch_utc", format_utc(document.epoch_utc)},
            {"created_by", document.created_by},
            {"derived_from", document.derived_from ? Json{{"take", document.derived_from->take},
                                                          {"by", document.derived_from->by}}
                                                   : Json()},
            {"color_space", document.color_space},
            {"clock", document.clock},
            {"timestamp_event", document.timestamp_event},
            {"shutter", shutters_as_json(summary.shutters)},
            {"scale", document.arbitrary_scale ? "arbitrary" : "metres"},
            {"nominal_fps", document.nominal_fps},
            {"fps", summary.fps},
            {"first_ns", summary.first},
            {"duration_ns", summary.duration},
            {"resumed_at_ns", summary.restarts},
            {"late_nodes_ns", std::move(late)},
            {"frames", summary.frames()},
            {"bytes_on_disk", summary.bytes_on_disk},
            {"megabytes_per_second", megabytes_per_second(summary)},
            {"calibrated", summary.calibrated},
            {"median_baseline_m", measured(summary.spacing)},
            {"min_alias_free_distance_m", measured(summary.min_alias_free_distance)},
            {"lenses", lenses_as_json(summary.lenses)}};
  if (document.depth_range) {
    const double far = document.depth_range->far;
    json["depth_range_m"] = {document.depth_range->near, std::isfinite(far) ? Json(far) : Json()};
  }
  json["depth_maps"] = json_of(depth_maps_of(take));
  json["timeline"] = Json();
  if (summary.timeline) {
    const auto& statistics = summary.timeline->statistics;
    json["timeline"] = {
        {"fps", summary.timeline->fps},
        {"ticks", summary.timeline->ticks},
        {"spread_ms",
         {{"mean", statistics.mean_spread_ns / kNsPerMs},
          {"median", static_cast<double>(statistics.median_spread) / kNsPerMs},
          {"max", static_cast<double>(statistics.max_spread) / kNsPerMs}}},
        {"absent_total", std::reduce(statistics.absent.begin(), statistics.absent.end())}};
  }
  json["cameras"] = cameras;
  constexpr schemas::FormerName kFormerNames[] = {
      {"timestamp_event", "time_marks"},
      {"median_baseline_m", "spacing_m"},
      {"min_alias_free_distance_m", "alias_free_distance_m"}};
  schemas::add_former_names(json, kFormerNames);
  print(schemas::dump_json(json) + "\n");
}

/// Returns whether a path is a document other than that of a take, which names the folder better.
bool is_rig_file(const std::filesystem::path& path) {
  std::error_code ignored;
  return std::filesystem::is_regular_file(path, ignored) && path.extension() == ".json" &&
         path.filename() != "take.json";
}

ExitCode info(const std::string& folder, bool json) {
  if (is_rig_file(folder)) return info_of_rig(folder, json);
  const store::Take take(folder);
  const store::TakeSummary summary = store::summarise_take(take);
  (json ? print_json : print_text)(take, summary);
  return summary.is_readable() ? ExitCode::kSuccess : ExitCode::kBadInput;
}

}  // namespace
}  // namespace raystage::cli

int main(int argc, char** argv) {
  using namespace raystage;
  using namespace raystage::cli;
  CommandLine command(
      "Shows the contents of a take and what is missing, or of a rig. Exit code 2 if an archive "
      "cannot be read.",
      "raystage info");
  std::string folder;
  bool json = false;
  command.option("TAKE|RIG", folder, "Folder of the take, or a rig (rig.json)").required();
  command.flag("--json", json, "Print as JSON (times in ns, lengths in m)");
  add_follow_links_option(command);
  return parse_and_run(command, argc, argv, "info", [&](std::stop_token stop) {
    const CancellationScope scope(stop);
    return info(folder, json);
  });
}
