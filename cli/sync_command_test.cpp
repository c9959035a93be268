// SPDX-License-Identifier: Apache-2.0
// raystage sync with offsets, flashes and a report, as users run it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "store/jpeg/encode.h"
#include "store/timeline.h"
#include "testing/cli/test_command.h"
#include "testing/store/take_test_data.h"
#include "testing/test_folder.h"

namespace raystage::cli {
namespace {

using ::testing::HasSubstr;

constexpr Nanoseconds kMs = 1'000'000;

struct SyncCommand : ::testing::Test {
  // Two nodes of four cameras; node "b" is 80 ms ahead; a light flashes for 150 ms at 1.5 s.
  SyncCommand() {
    schemas::TakeDocument document = testing::take_document(8, 20);
    for (std::size_t c = 0; c < 8; ++c) document.cameras[c].node = c < 4 ? "a" : "b";
    store::TakeWriter writer(take, document, testing::rig_document(8));
    for (int c = 0; c < 8; ++c) {
      for (int i = 0; i < 50; ++i) {
        const Nanoseconds exposed = 500 * kMs + i * 50 * kMs + (c * 37 % 50) * kMs;
        const bool lit = exposed >= 1500 * kMs && exposed < 1650 * kMs;
        const store::RgbImage image{16, 16, std::vector<std::uint8_t>(768, lit ? 200 : 60)};
        writer.archive(c).append(store::encode_jpeg(image, {.quality = 80}),
                                 exposed + (c < 4 ? 0 : 80 * kMs));
      }
    }
    writer.commit();
  }

  static testing::CommandResult run(const std::string& arguments) {
    return testing::run_raystage("sync " + arguments);
  }

  testing::TestFolder folder;
  std::filesystem::path take = folder.path() / "take";
  std::string quoted = "'" + take.string() + "'";
};

TEST_F(SyncCommand, FlashCorrectsTheNodesClock) {
  const auto [exit_code, output] = run("--flash -q --json " + quoted);
  ASSERT_EQ(exit_code, 0) << output;
  const auto json = nlohmann::json::parse(output);
  const auto& offset = json["flash"]["offsets"][1];
  EXPECT_EQ(offset["group"], "b");
  EXPECT_NEAR(offset["offset_ms"].get<double>(), 80, offset["uncertainty_ms"].get<double>());
  EXPECT_LT(offset["uncertainty_ms"].get<double>(), 25);
  const store::Timeline timeline = store::read_timeline(store::Take(take));
  EXPECT_EQ(timeline.clocks[0].offset_ns, 0);
  EXPECT_NEAR(static_cast<double>(timeline.clocks[7].offset_ns), 80e6, 25e6);
}

TEST_F(SyncCommand, GivenOffsetsAndReport) {
  const auto offsets = folder.path() / "offsets.json", page = folder.path() / "report.html";
  write_file_atomically(offsets, std::string_view(R"({"b": 80})"));
  const auto [exit_code, output] =
      run("--node-offsets '" + offsets.string() + "' --report '" + page.string() + "' " + quoted);
  ASSERT_EQ(exit_code, 0) << output;
  EXPECT_THAT(output, HasSubstr("All 8 cameras run at 20.000 Hz"));
  EXPECT_THAT(read_file(page), HasSubstr("All 8 cameras run at 20.000 Hz"));
  const store::Timeline timeline = store::read_timeline(store::Take(take));
  EXPECT_EQ(timeline.clocks[5].offset_ns, 80 * kMs);
  // With the correct clocks, cameras of both nodes see the light at the same ticks.
  for (const store::FrameSelection& tick : timeline.ticks) {
    if (tick.frame[0] < 0 || tick.frame[4] < 0) continue;
    EXPECT_LE(std::abs(tick.difference[0] - tick.difference[4]), 50 * kMs);
  }
}

TEST_F(SyncCommand, RottenFramesAreMissingInTheNewTakeOrAnErrorOnRequest) {
  {
    const store::FrameRecord frame = store::Take(take).archive(3).frames()[20];
    auto bytes = testing::bytes_of(take / "archive" / "c3.mkv");
    bytes[static_cast<std::size_t>(frame.offset + frame.size / 2)] ^= std::byte{1};
    testing::overwrite(take / "archive" / "c3.mkv", bytes);
  }
  const std::string output = "'" + (folder.path() / "new").string() + "'";
  const auto refused = run("-q --rotten error -o " + output + " " + quoted);
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.output, HasSubstr("frame 20 of camera \"c3\" is not as it was recorded"));
  EXPECT_THAT(refused.output, HasSubstr("raystage repair"));
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "new"));
  const auto without = run("-q --retime blend -o " + output + " " + quoted);
  EXPECT_EQ(without.exit_code, 4) << without.output;
  EXPECT_THAT(without.output, HasSubstr("1 frames were left out"));
  EXPECT_THAT(without.output, HasSubstr("of cameras: c3"));
  std::filesystem::remove_all(folder.path() / "new");
  const auto report = run("-q --json -o " + output + " " + quoted);
  EXPECT_EQ(report.exit_code, 4);
  const auto json = nlohmann::json::parse(report.output);
  EXPECT_EQ(json["retimed"]["rotten"], 1);
  EXPECT_EQ(json["retimed"]["rotten_cameras"][0], "c3");
  EXPECT_EQ(run("-q " + quoted).exit_code, 0) << "the timeline needs no frames";
  EXPECT_EQ(run("-q --rotten absent " + quoted).exit_code, 2) << "there is no new take";
}

TEST_F(SyncCommand, RefusesWhatMakesNoSense) {
  EXPECT_EQ(run("--flash --node-offsets x.json " + quoted).exit_code, 2);
  EXPECT_EQ(run("--flash-clock camera " + quoted).exit_code, 2);
  EXPECT_EQ(run("--timestamps never " + quoted).exit_code, 2);
  const auto former = run("--stamps=never " + quoted);
  EXPECT_EQ(former.exit_code, 2);
  EXPECT_THAT(former.output,
              HasSubstr("--stamps is deprecated and will be removed; use --timestamps"));
  const auto [exit_code, output] = run("-q --flash --flash-window 2 2.5 " + quoted);
  EXPECT_EQ(exit_code, 2);
  EXPECT_THAT(output, HasSubstr("no flash was detected"));
  EXPECT_FALSE(std::filesystem::exists(take / "timeline.zst"));
}

TEST_F(SyncCommand, RetimesIntoANewTake) {
  const std::string before = read_file(take / "archive/c3.mkv");
  for (const char* method : {"nearest", "blend", "flow"}) {
    const std::filesystem::path made = folder.path() / method;
    const auto [exit_code, output] =
        run(std::string("-q --retime ") + method + " -o '" + made.string() + "' " + quoted);
    ASSERT_EQ(exit_code, 0) << output;
    EXPECT_THAT(output, HasSubstr("Retimed    " + made.string()));
    const store::Take retimed(made);
    const store::Timeline timeline = store::read_timeline(retimed);
    int on_tick = 0;
    for (const store::FrameSelection& tick : timeline.ticks)
      on_tick += tick.difference[3] == 0 ? 1 : 0;
    EXPECT_GE(on_tick, std::string_view(method) == "nearest" ? 0 : 46);
    EXPECT_EQ(testing::run_raystage("verify -q '" + made.string() + "'").exit_code, 0);
  }
  EXPECT_EQ(read_file(take / "archive/c3.mkv"), before);
  EXPECT_FALSE(std::filesystem::exists(take / "timeline.zst"));  // only read
  const auto [exit_code, output] =
      run("-q --json --retime blend -o '" + (folder.path() / "json").string() + "' " + quoted);
  ASSERT_EQ(exit_code, 0) << output;
  EXPECT_GT(nlohmann::json::parse(output)["retimed"]["moved"].get<int>(), 300);
}

TEST_F(SyncCommand, RetimingNeedsANewFolder) {
  const auto without = run("--retime flow " + quoted);
  EXPECT_EQ(without.exit_code, 2);
  EXPECT_THAT(without.output, HasSubstr("-o NEWTAKE"));
  const auto existing = run("--retime flow -o " + quoted + " " + quoted);
  EXPECT_EQ(existing.exit_code, 2);
  EXPECT_THAT(existing.output, HasSubstr("the folder exists"));
  const auto inside = run("-o '" + (take / "new").string() + "' " + quoted);
  EXPECT_EQ(inside.exit_code, 2);
  EXPECT_THAT(inside.output, HasSubstr("would be inside of"));
  EXPECT_FALSE(std::filesystem::exists(take / "new"));
  const auto unknown = run("--retime fast -o x " + quoted);
  EXPECT_EQ(unknown.exit_code, 2);
  EXPECT_THAT(unknown.output, HasSubstr("fast not in {blend,flow,nearest}"));
  EXPECT_EQ(run("--flash --flash-window 2 1 " + quoted).exit_code, 2);
  EXPECT_NE(run("--quality 200 -o x " + quoted).exit_code, 0);
  EXPECT_NE(run("--max-gap 100 " + quoted).exit_code, 0);  // needs --output
}

TEST_F(SyncCommand, ATickFallsWhereItIsAskedFor) {
  ASSERT_EQ(run("-q --tick-at 1.0125 " + quoted).exit_code, 0);
  bool found = false;
  for (const store::FrameSelection& tick : store::read_timeline(store::Take(take)).ticks) {
    found = found || std::abs(tick.time_ns - 1'012'500'000) <= 10'000;
  }
  EXPECT_TRUE(found);
}

TEST_F(SyncCommand, RatesOfFilmAreExact) {
  const auto rate_of = [&](const std::string& text) {
    const auto [exit_code, output] = run("-q --fps " + text + " " + quoted);
    EXPECT_EQ(exit_code, 0) << output;
    const bool is_film = output.find("Rate       23.976 Hz (24000/1001)\n") != std::string::npos;
    const double fps = store::read_timeline(store::Take(take)).fps;
    EXPECT_EQ(is_film, fps == 24000.0 / 1001) << output;
    return fps;
  };
  for (const char* text : {"23.98", "23.976", "23.976024", "24000/1001"}) {
    EXPECT_EQ(rate_of(text), 24000.0 / 1001) << text;
  }
  EXPECT_EQ(rate_of("24"), 24);
  EXPECT_EQ(rate_of("23.9775"), 23.9775) << "measured";
  EXPECT_EQ(rate_of("1200"), 1200);
  for (const char* text : {"0", "2e6", "nan", "film", "24000/", "24/0"}) {
    const auto [exit_code, output] = run(std::string("-q --fps ") + text + " " + quoted);
    EXPECT_EQ(exit_code, 2) << text;
    EXPECT_THAT(output, HasSubstr("for example 24, or a ratio up to 1000 Hz"));
  }
}

}  // namespace
}  // namespace raystage::cli
