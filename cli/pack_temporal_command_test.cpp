// SPDX-License-Identifier: Apache-2.0
// Whole commands: takes encoded as video, as other commands read them.
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>
#include <vector>

#include "schemas/rig_document.h"
#include "store/take.h"
#include "store/temporal/temporal_frame.h"
#include "testing/cli/render_command_test_data.h"

namespace raystage::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::Not;

struct Encoding {
  std::string codec, references;
};

/// The take of RenderCommandTest, encoded as `packed`.
class PackTemporalCommandTest : public RenderCommandTest,
                                public ::testing::WithParamInterface<Encoding> {
 protected:
  CommandResult pack(const std::string& options, const std::string& take = "take") const {
    return run_raystage("pack " + quoted(take) + " -o " + quoted("packed") + " -q " + options);
  }
  CommandResult pack_as_stated(const std::string& more = "") const {
    return pack("--temporal " + GetParam().codec + " --references " + GetParam().references + " " +
                more);
  }
  CommandResult run_on_packed(const std::string& command, const std::string& options = "") const {
    return run_raystage(command + " " + quoted("packed") + " " + options);
  }
};

TEST_P(PackTemporalCommandTest, TimesAndGapsAreThoseOfTheSource) {
  const CommandResult result = pack_as_stated("--json");
  ASSERT_EQ(result.exit_code, 0) << result.output;
  const auto json = nlohmann::json::parse(result.output);
  EXPECT_EQ(json["codec"], GetParam().codec == "hevc" ? "HEVC" : "AV1");
  EXPECT_EQ(json["references"], GetParam().references);
  EXPECT_EQ(json["frames"], 18);
  EXPECT_EQ(json["cameras"].size(), 9);
  EXPECT_LT(json["bytes_after"], json["bytes_before"]);
  EXPECT_GT(json["psnr_db"], 25);
  EXPECT_LE(json["min_psnr_db"], json["psnr_db"]);
  const store::Take source(path("take")), packed(path("packed"));
  for (int camera = 0; camera < 9; ++camera) {
    const auto was = source.archive(camera).records(), is = packed.archive(camera).records();
    ASSERT_EQ(was.size(), is.size());
    for (std::size_t i = 0; i < was.size(); ++i) {
      EXPECT_EQ(was[i].time_ns, is[i].time_ns);
      EXPECT_EQ(was[i].status, is[i].status);
      EXPECT_EQ(was[i].arrival_ns, is[i].arrival_ns);
    }
  }
  EXPECT_EQ(read_file(path("take") / "rig.json"), read_file(path("packed") / "rig.json"));
}

TEST_P(PackTemporalCommandTest, EveryCommandReadsIt) {
  const CommandResult result = pack_as_stated();
  ASSERT_EQ(result.exit_code, 0) << result.output;
  EXPECT_THAT(result.output, HasSubstr("9 cameras, 18 frames"));
  EXPECT_THAT(result.output, HasSubstr("dB"));
  EXPECT_EQ(run_on_packed("verify", "-q").exit_code, 0);
  const CommandResult decoded = run_on_packed("verify", "--decode -q");
  EXPECT_EQ(decoded.exit_code, 0) << decoded.output;
  const std::string form = std::string(GetParam().codec == "hevc" ? "HEVC" : "AV1") +
                           (GetParam().references == "cameras" ? " across cameras" : "") +
                           ", lossy";
  EXPECT_THAT(run_on_packed("info").output, HasSubstr(form));
  const CommandResult evaluated =
      run_on_packed("evaluate", "--exclude-cameras r1c1 --method focal_plane -q");
  EXPECT_EQ(evaluated.exit_code, 0) << evaluated.output;
  EXPECT_EQ(run_on_packed("repair", "--dry-run -q").exit_code, 0);
  EXPECT_THAT(read_file(path("packed") / "events.jsonl"), HasSubstr("lossy"));
  fs::rename(path("take"), path("source"));
  fs::rename(path("packed"), path("take"));
  const CommandResult rendered = render("a");
  EXPECT_EQ(rendered.exit_code, 0) << rendered.output;
  EXPECT_EQ(files_under(path("a")).size(), kFrames);
}

TEST_P(PackTemporalCommandTest, WhatItCannotReturnIsRefused) {
  ASSERT_EQ(pack_as_stated().exit_code, 0);
  const CommandResult unpacked = run_on_packed("unpack", "-o " + quoted("a") + " -q");
  EXPECT_EQ(unpacked.exit_code, 2);
  EXPECT_THAT(unpacked.output, HasSubstr("the JPEGs that they were made from are not in it"));
  for (const char* options : {"", " --temporal av1"}) {
    const CommandResult again = run_on_packed("pack", "-o " + quoted("a") + " -q" + options);
    EXPECT_EQ(again.exit_code, 2);
    EXPECT_THAT(again.output, HasSubstr("HEVC or AV1"));
  }
  EXPECT_FALSE(fs::exists(path("a")));
  const CommandResult exists = pack_as_stated();
  EXPECT_EQ(exists.exit_code, 2);
}

/// Returns the cameras and numbers of the frames with the same bytes to which another frame refers:
/// pictures of a still scene may be equal. Of the first one if no frame refers to another.
std::vector<std::pair<int, int>> referenced_frames(const store::Take& take) {
  std::map<std::uint64_t, std::vector<std::pair<int, int>>> frames;
  std::set<std::uint64_t> referenced;
  for (int camera = 0; camera < take.camera_count(); ++camera) {
    const store::ArchiveReader& archive = take.archive(camera);
    for (int i = 0; i < static_cast<int>(archive.frames().size()); ++i) {
      const store::FrameBytes stored = archive.stored(i);
      frames[store::hash_of_stored(stored)].emplace_back(camera, i);
      referenced.insert(store::read_frame_link(stored).value().previous);
    }
  }
  for (const std::uint64_t hash : referenced) {
    if (frames.contains(hash)) return frames[hash];
  }
  return {{0, 0}};
}

TEST_P(PackTemporalCommandTest, DamageIsFoundAndRepairedToAGap) {
  ASSERT_EQ(pack_as_stated().exit_code, 0);
  {
    const store::Take packed(path("packed"));
    for (const auto& [camera, frame] : referenced_frames(packed)) {
      const auto at = packed.archive(camera).frames()[frame].offset + 70;
      const fs::path file = packed.folder() / packed.document().cameras[camera].archive;
      std::string bytes = read_file(file);
      bytes[at] ^= 4;
      write_file_atomically(file, bytes);
    }
  }
  const CommandResult verified = run_on_packed("verify", "-q");
  EXPECT_EQ(verified.exit_code, 1);
  EXPECT_THAT(verified.output, HasSubstr("wrong XXH3"));
  EXPECT_EQ(run_on_packed("repair", "-q").exit_code, 3);
  const CommandResult again = run_on_packed("verify", "-q");
  EXPECT_EQ(again.exit_code, 0);
  const bool has_references = GetParam().references != "none";
  EXPECT_EQ(again.output.find("refer to damaged or lost ones") != again.output.npos,
            has_references);
  const CommandResult decoded = run_on_packed("verify", "--decode -q");
  EXPECT_EQ(decoded.exit_code, has_references ? 1 : 0) << decoded.output;
  if (has_references) {
    EXPECT_THAT(decoded.output, HasSubstr("damaged or lost"));
  }
}

INSTANTIATE_TEST_SUITE_P(Encodings, PackTemporalCommandTest,
                         ::testing::Values(Encoding{"hevc", "time"}, Encoding{"hevc", "none"},
                                           Encoding{"av1", "time"}, Encoding{"av1", "cameras"},
                                           Encoding{"hevc", "cameras"}),
                         [](const auto& test) {
                           return test.param.codec + "_" + test.param.references;
                         });

class PackTemporalUsageTest : public PackTemporalCommandTest {};

TEST_P(PackTemporalUsageTest, BadOptionsHaveExitCode2AndLeaveNothing) {
  const std::pair<const char*, const char*> cases[] = {
      {"--temporal vp9", "vp9"},
      {"--temporal av1 --references space", "space"},
      {"--temporal av1 --group 0", "--group"},
      {"--temporal av1 --group 257", "--group"},
      {"--temporal hevc --crf 52", "HEVC has no rate factor 52"},
      {"--temporal av1 --crf 64", "--crf"},
      {"--temporal av1 --crf 0", "AV1 has no rate factor 0"},
      {"--temporal av1 --crf 32.5", "whole number"},
      {"--temporal av1 --crf 30 --target-db 1", "--target-db"},
      {"--temporal av1 --views none.json", "--target-db"},
      {"--crf 30", "--temporal"},
      {"--group 3", "--temporal"},
      {"--references cameras", "--temporal"}};
  for (const auto& [options, what] : cases) {
    const CommandResult result = pack(options);
    EXPECT_EQ(result.exit_code, 2) << options;
    EXPECT_THAT(result.output, HasSubstr(what)) << options;
  }
  EXPECT_FALSE(fs::exists(path("packed")));
}

TEST_P(PackTemporalUsageTest, TheRateFactorIsSearchedForALossInViews) {
  for (const char* references : {"time", "cameras"}) {
    const CommandResult result = pack(
        std::string("--temporal hevc --target-db 3 --method focal_plane --json --references ") +
        references);
    ASSERT_EQ(result.exit_code, 0) << result.output;
    const auto json = nlohmann::json::parse(result.output.substr(result.output.find('{')));
    EXPECT_EQ(json["view_loss"]["target_db"], 3);
    EXPECT_LE(json["view_loss"]["loss_db"], 3);
    EXPECT_GT(json["crf"], 4);
    fs::remove_all(path("packed"));
  }
}

TEST_P(PackTemporalUsageTest, AnExistingTakeIsRefusedBeforeTheSearch) {
  fs::create_directory(path("packed"));
  const CommandResult result = run_raystage("pack " + quoted("take") + " -o " + quoted("packed") +
                                            " --temporal hevc --target-db 3 --method focal_plane");
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.output, HasSubstr("of this name exists"));
  EXPECT_THAT(result.output, Not(HasSubstr("rate factor")));
}

TEST_P(PackTemporalUsageTest, ATakeWithoutFramesHasNoPsnr) {
  const store::Take source(path("take"));
  store::TakeWriter writer(path("empty"), source.document(),
                           schemas::read_rig(source.file("rig.json")));
  writer.commit();
  for (const char* references : {"time", "cameras"}) {
    const CommandResult result =
        pack(std::string("--temporal av1 --references ") + references, "empty");
    EXPECT_EQ(result.exit_code, 0) << result.output;
    EXPECT_THAT(result.output, HasSubstr("0 frames"));
    EXPECT_THAT(result.output, Not(HasSubstr("PSNR")));
    EXPECT_THAT(read_file(path("packed") / "events.jsonl"), Not(HasSubstr("PSNR")));
    EXPECT_EQ(run_on_packed("verify", "--decode -q").exit_code, 0);
    fs::remove_all(path("packed"));
  }
}

INSTANTIATE_TEST_SUITE_P(Once, PackTemporalUsageTest, ::testing::Values(Encoding{"av1", "time"}));

}  // namespace
}  // namespace raystage::testing
