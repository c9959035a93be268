// SPDX-License-Identifier: Apache-2.0
// raystage verify: checks a take against its recorded hashes.
#include "store/fixity/verify.h"

#include <fmt/format.h>
#include <tbb/global_control.h>
#include <tbb/info.h>

#include <algorithm>
#include <exception>
#include <map>
#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "base/contained_path.h"
#include "base/error.h"
#include "cli/command.h"
#include "cli/command_line_parsing.h"
#include "cli/follow_links_option.h"
#include "cli/printing.h"
#include "cli/take_event.h"
#include "cli/verify_catalogue.h"
#include "schemas/former_names.h"
#include "schemas/json_text.h"
#include "store/bag_payload.h"
#include "store/fixity/manifest.h"
#include "store/fixity/signature.h"

namespace raystage::cli {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kBytesPerMb = 1e6;
const std::map<std::string, store::VerifyDepth> kDepths{{"sizes", store::VerifyDepth::kSizes},
                                                        {"journal", store::VerifyDepth::kJournal},
                                                        {"hashes", store::VerifyDepth::kHashes}};

struct Options {
  std::string take, json, depth = "hashes", manifest;
  CatalogueCommandOptions catalogue;
  std::filesystem::path signing_key;
  store::Signers signers;
  bool decode = false, quiet = false;
  int threads = 0;
};

std::string frames_text(const std::vector<store::AffectedFrame>& frames) {
  constexpr std::size_t kMax = 4;
  std::string text;
  for (std::size_t i = 0; i < std::min(frames.size(), kMax); ++i) {
    text += fmt::format("{}frame {} at {:.6f} s", i == 0 ? "" : ", ", frames[i].number,
                        static_cast<double>(frames[i].time_ns) / kNanosecondsPerSecond);
  }
  if (frames.size() > kMax) text += fmt::format(" and {} more", frames.size() - kMax);
  return text.empty() ? "" : " [" + text + "]";
}

void print_problem(const store::FixityProblem& problem) {
  print("  {} @{}: {}{}\n", problem.file, problem.offset, problem.what,
        frames_text(problem.frames));
}

/// Prints advice on the cameras; other problems state their own.
void print_advice(const std::string& take, const store::TakeFixityReport& report) {
  bool not_closed = false, damaged = false;
  for (const store::TakeFixityReport::Camera& camera : report.cameras) {
    for (const store::FixityProblem& problem : camera.report.problems) {
      (problem.not_closed ? not_closed : damaged) = true;
    }
  }
  if (damaged) {
    print(
        "`raystage repair {0}` recovers what is not damaged, `raystage repair {0} --from COPY` "
        "takes the rest from a copy\n",
        take);
  } else if (not_closed) {
    print(
        "`raystage record CONFIG --resume -o {0}` continues the recording, `raystage repair {0}` "
        "closes it\n",
        take);
  }
}

void print_text(const Options& options, const store::TakeFixityReport& report) {
  long intact = 0, damaged = 0;
  for (const auto& camera : report.cameras) {
    const bool only_open =
        std::ranges::all_of(camera.report.problems, &store::FixityProblem::not_closed);
    intact += camera.error.empty() && camera.report.is_intact() ? 1 : 0;
    damaged += !camera.error.empty() || !only_open ? 1 : 0;
  }
  const auto cameras = static_cast<long>(report.cameras.size());
  print("{} cameras: {} intact, {} not closed, {} damaged (depth: {}{})\n", cameras, intact,
        cameras - intact - damaged, damaged, options.depth,
        options.decode ? ", every frame decoded" : "");
  for (const store::FixityProblem& problem : report.problems) print_problem(problem);
  for (const auto& camera : report.cameras) {
    if (!camera.error.empty()) print("  {}\n", camera.error);
    for (const store::FixityProblem& problem : camera.report.problems) print_problem(problem);
    if (camera.report.omitted_problems > 0) {
      print("  {}: {} more problems\n", camera.id, camera.report.omitted_problems);
    }
    if (camera.report.unverified_frames > 0) {
      print("  {}: {}\n", camera.id, unverified_text(camera.report.unverified_frames));
    }
    if (!camera.undecodable_frames.empty()) {
      print(
          "  {}: frames of video that refer to damaged or lost ones and cannot be decoded: {}{}\n",
          camera.id, camera.undecodable_frames.size(), frames_text(camera.undecodable_frames));
    }
  }
  const double megabytes = static_cast<double>(report.bytes()) / kBytesPerMb;
  print("{:.1f} MB in {:.3f} s, {:.0f} MB/s\n", megabytes, report.seconds,
        megabytes / std::max(report.seconds, 1e-9));
  print_advice(options.take, report);
}

Json json_of(const std::vector<store::AffectedFrame>& affected) {
  Json frames = Json::array();
  for (const store::AffectedFrame& frame : affected) {
    frames.push_back({{"frame", frame.number}, {"time_ns", frame.time_ns}});
  }
  return frames;
}

Json json_of(const store::FixityProblem& problem) {
  return {{"file", problem.file},
          {"offset", problem.offset},
          {"description", problem.what},
          {"not_closed", problem.not_closed},
          {"frames", json_of(problem.frames)}};
}

Json json_of(const std::vector<store::FixityProblem>& problems) {
  Json json = Json::array();
  for (const store::FixityProblem& problem : problems) json.push_back(json_of(problem));
  return json;
}

Json json_of(const Options& options, const store::TakeFixityReport& report) {
  Json cameras = Json::array();
  for (const auto& camera : report.cameras) {
    Json json{{"id", camera.id},
              {"intact", camera.error.empty() && camera.report.is_intact()},
              {"bytes", camera.bytes}};
    if (options.depth != "sizes") {
      json["frames"] = camera.report.frames;
      json["unverified_frames"] = camera.report.unverified_frames;
    }
    json["problems"] = json_of(camera.report.problems);
    if (!camera.undecodable_frames.empty()) {
      json["undecodable_frames"] = json_of(camera.undecodable_frames);
    }
    if (camera.report.omitted_problems > 0)
      json["omitted_problems"] = camera.report.omitted_problems;
    if (!camera.error.empty()) json["error"] = camera.error;
    cameras.push_back(std::move(json));
  }
  Json json{{"take", options.take},
            {"depth", options.depth},
            {"decoded", options.decode},
            {"intact", report.is_intact()},
            {"bytes", report.bytes()},
            {"seconds", report.seconds},
            {"problems", json_of(report.problems)},
            {"cameras", cameras}};
  constexpr schemas::FormerName kFormerNames[] = {
      {"description", "what"}, {"intact", "whole"}, {"omitted_problems", "more_problems"}};
  schemas::add_former_names(json, kFormerNames);
  return json;
}

/// Throws Error (bad input) for options that do not fit together.
void check_options(const Options& options) {
  const bool is_catalogue = !options.catalogue.folder.empty();
  if (options.take.empty() != is_catalogue) {
    throw Error::bad_input("one take is checked, or the takes below a folder", "",
                           "Give either TAKE or --catalogue FOLDER");
  }
  if (is_catalogue && (options.depth != "hashes" || options.decode || !options.manifest.empty())) {
    throw Error::bad_input("--catalogue compares every byte with its recorded hash", "",
                           "Omit --depth, --decode and --manifest");
  }
  if (!options.signing_key.empty() && options.manifest != "write") {
    throw Error::bad_input("--sign signs the manifest that is written", "", "Add --manifest write");
  }
  if (options.manifest == "write" && options.depth != "hashes") {
    throw Error::bad_input("a manifest states that the take is good, which hashes show", "",
                           "Omit --depth, or give --depth hashes");
  }
  if (options.signers.file.empty()) return;
  if (options.manifest != "check" || options.signers.identity.empty()) {
    throw Error::bad_input("--signers checks the signature of the manifest by one signer", "",
                           "Add --manifest check and --signer NAME");
  }
}

void print_paths(const char* what, const std::vector<std::string>& paths) {
  for (const std::string& path : paths) print("  {}: {}\n", path, what);
}

/// Writes the manifest of a take that has just been verified, and signs it if a key is given.
Json write_manifest(const Options& options, const store::ManifestOptions& hashing) {
  const std::filesystem::path folder = options.take;
  const store::Manifest manifest = store::make_manifest(store::Take(folder), hashing);
  const std::filesystem::path file = folder / store::kManifestFile;
  require_contained({folder, store::kManifestFile});
  require_contained({folder, store::kSignatureFile});
  const std::string text = store::manifest_as_text(manifest);
  if (file_exists(file) && store::read_manifest(folder) != text) {
    throw Error::bad_input("the take has another manifest already, which states other files",
                           file.string(),
                           "See what changed by --manifest check; move that manifest and its "
                           "signature away to write a new one");
  }
  const bool is_signed = !options.signing_key.empty();
  if (is_signed) {
    store::write_signed(file, text, options.signing_key);
  } else if (!file_exists(file)) {
    write_file_atomically(file, text);
  }
  if (options.json != "-") {
    print("manifest: SHA-256 of {} files written to {}{}\n", manifest.files.size(), file.string(),
          is_signed ? ", signed" : "");
  }
  return {{"file", file.string()}, {"files", manifest.files.size()}, {"signed", is_signed}};
}

/// Compares the take with its manifest, after the manifest with its signature if signers are given.
Json check_manifest(const Options& options, const store::ManifestOptions& hashing,
                    bool& is_intact) {
  const std::filesystem::path file = std::filesystem::path(options.take) / store::kManifestFile;
  const bool is_signed = !options.signers.file.empty();
  // The same bytes are checked and compared.
  const std::string text = store::read_manifest(options.take);
  const std::string fault =
      is_signed
          ? store::signature_fault(
                text, std::filesystem::path(options.take) / store::kSignatureFile, options.signers)
          : "";
  const store::ManifestReport report = store::check_manifest(options.take, text, hashing);
  is_intact = report.is_intact() && fault.empty();
  if (options.json != "-") {
    if (is_signed) {
      print("signature: {}\n", fault.empty() ? "good, by " + options.signers.identity : fault);
    }
    print("manifest of \"{}\": {} files, {} changed, {} missing, {} not listed\n",
          report.manifest.take, report.manifest.files.size(), report.changed.size(),
          report.missing.size(), report.unlisted.size());
    print_paths("changed", report.changed);
    print_paths("missing", report.missing);
    print_paths("not listed", report.unlisted);
  }
  Json json{{"file", file.string()},        {"files", report.manifest.files.size()},
            {"intact", report.is_intact()}, {"changed", report.changed},
            {"missing", report.missing},    {"unlisted", report.unlisted}};
  if (is_signed) json["signature"] = fault.empty() ? "good" : fault;
  return json;
}

/// Appends what was found, and which manifest was written, to the take's event log.
void log_verification(const Options& options, const store::TakeFixityReport& report,
                      bool is_as_listed, ExitCode code) {
  const auto intact = std::ranges::count_if(report.cameras, [](const auto& camera) {
    return camera.error.empty() && camera.report.is_intact();
  });
  std::string detail = fmt::format("verify --depth {}", options.depth);
  if (options.decode) detail += " --decode";
  if (options.manifest == "check") detail += " --manifest check";
  std::string note = fmt::format("{} of {} cameras intact", intact, report.cameras.size());
  if (!is_as_listed) note += "; files or the signature are not as the manifest states";
  record_event(options.take, "fixity check", detail, note, outcome_of(code));
  if (options.manifest == "write" && code == ExitCode::kSuccess) {
    record_event(options.take, "message digest calculation", "verify --manifest write",
                 store::kManifestFile);
  }
}

ExitCode verify(const Options& options, const std::stop_token& stop) {
  const tbb::global_control threads(
      tbb::global_control::max_allowed_parallelism,
      static_cast<std::size_t>(options.threads > 0 ? options.threads
                                                   : tbb::info::default_concurrency()));
  Progress progress(!options.quiet);
  store::TakeVerifyOptions deep;
  deep.depth = kDepths.at(options.depth);
  deep.decode = options.decode;
  deep.progress = [&](double share) { progress.report(share); };
  deep.stop = stop;
  const store::ManifestOptions hashing{deep.progress, stop};
  bool is_as_listed = true;
  const store::TakeFixityReport report = [&] {
    try {
      return store::verify_take(options.take, deep);
    } catch (const Error&) {
      // The manifest may say which document is not as it was.
      if (options.manifest == "check" && options.json != "-") {
        check_manifest(options, hashing, is_as_listed);
      }
      throw;
    }
  }();
  if (report.status != RunStatus::kFinished) return ExitCode::kFailed;
  if (options.json != "-") print_text(options, report);
  const bool is_intact = report.is_readable() && report.is_intact();
  Json json = json_of(options, report);
  std::exception_ptr failure;  // reported after the rest, which took long
  try {
    if (options.manifest == "check") {
      json["manifest"] = check_manifest(options, hashing, is_as_listed);
    } else if (options.manifest == "write" && is_intact) {
      store::require_no_bag_payload(options.take);
      json["manifest"] = write_manifest(options, hashing);
    }
  } catch (const Error& error) {
    json["manifest"] = {{"error", error.what()}};
    failure = std::current_exception();
  }
  if (options.json == "-") {
    print(schemas::dump_json(json) + "\n");
  } else if (!options.json.empty()) {
    write_file_atomically(options.json, schemas::dump_json(json) + "\n");
  }
  if (failure) std::rethrow_exception(failure);
  if (!report.is_readable()) return ExitCode::kBadInput;
  if (options.manifest == "write" && !is_intact && options.json != "-") {
    print("no manifest was written: it would state that the take is good\n");
  }
  const ExitCode code = is_intact && is_as_listed ? ExitCode::kSuccess : ExitCode::kFailed;
  log_verification(options, report, is_as_listed, code);
  return code;
}

}  // namespace
}  // namespace raystage::cli

int main(int argc, char** argv) {
  using namespace raystage;
  using namespace raystage::cli;
  CommandLine command(
      "Checks a take against its recorded hashes. Changes nothing but the take's event log; "
      "--manifest\nwrite adds a file.\n"
      "Exit code 0: intact, 1: damaged, not closed, or not as the manifest states, 2: cannot be "
      "read\nat all.",
      "raystage verify");
  Options options;
  command.option("TAKE", options.take, "Folder of the take (or --catalogue)");
  command
      .option("--depth TEXT", options.depth,
              "What to check: sizes = files exist and have their recorded sizes; journal = every "
              "byte except the frames'; hashes = every byte")
      .one_of_listed({"sizes", "journal", "hashes"})
      .show_default();
  command.flag(
      "--decode", options.decode,
      "Also decode every JPEG and check its dimensions; implies --depth hashes (default: off)");
  command
      .option("--manifest TEXT", options.manifest,
              "SHA-256 of every file of the take: check = compare the take with manifest.sha256; "
              "write = write it, if the take is intact (default: neither)")
      .one_of_listed({"check", "write"});
  command
      .option("--sign KEY", options.signing_key,
              "With --manifest write: sign the manifest with this SSH key (ssh-keygen -Y sign)")
      .needs("--manifest");
  command
      .option("--signers FILE", options.signers.file,
              "With --manifest check: the manifest must be signed by one of these allowed signers "
              "(ssh-keygen -Y verify)")
      .needs("--manifest");
  command
      .option("--signer NAME", options.signers.identity,
              "Identity in the file of allowed signers that must have signed")
      .needs("--signers");
  command.option(
      "--json", options.json,
      "Write the result as JSON to this file; - = to stdout, without the text (default: none)");
  command.option("-j,--threads", options.threads, "Cameras at once (default: 0, one per processor)")
      .limits(0, 1024);
  add_catalogue_options(command, options.catalogue);
  add_follow_links_option(command);
  command.flag("-q,--quiet", options.quiet, "No progress on stderr (default: off)");
  return parse_and_run(command, argc, argv, "verify", [&](std::stop_token stop) {
    if (options.decode) options.depth = "hashes";
    check_options(options);
    if (options.catalogue.folder.empty()) return verify(options, stop);
    const tbb::global_control threads(
        tbb::global_control::max_allowed_parallelism,
        static_cast<std::size_t>(options.threads > 0 ? options.threads
                                                     : tbb::info::default_concurrency()));
    return verify_catalogue(options.catalogue, options.json, options.quiet, stop);
  });
}
