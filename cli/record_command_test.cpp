// SPDX-License-Identifier: Apache-2.0
// Where raystage record refuses to put the mirror of a take.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "testing/cli/test_command.h"
#include "testing/test_folder.h"

namespace raystage::cli {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

void write_text_file(const fs::path& file, const std::string& text) { std::ofstream(file) << text; }

TEST(RecordCommand, RefusesAMirrorThatIsTheTakeOrBelowIt) {
  const testing::TestFolder folder;
  const fs::path take = folder.path() / "take", config = folder.path() / "record.json";
  write_text_file(config, R"({"schema": "raystage/record/1", "name": "test", "node": "one",
                                  "cameras": [{"id": "c0", "simulated": {"seconds": 0.5}}]})");
  fs::create_directories(take / "below");
  fs::create_directory_symlink(take, folder.path() / "link");
  write_text_file(take / "take.json", "{}");
  const auto record = [&](const fs::path& output, const fs::path& mirror) {
    return testing::run_raystage("record '" + config.string() + "' -o '" + output.string() +
                                 "' --resume --mirror '" + mirror.string() + "'");
  };
  const auto expect_refused = [&](const fs::path& output, const fs::path& mirror,
                                  const std::string& why) {
    const testing::CommandResult result = record(output, mirror);
    EXPECT_EQ(result.exit_code, 2) << result.output;
    EXPECT_THAT(result.output, HasSubstr(why));
    EXPECT_THAT(result.output, HasSubstr("--mirror"));
  };
  expect_refused(take, folder.path(), "the mirror would be the take itself");
  for (const fs::path& mirror : {take, take / "below", folder.path() / "link" / "below"}) {
    expect_refused(take, mirror, "the mirror would be inside of the take");
    EXPECT_FALSE(fs::exists(mirror / "take"));
  }
  expect_refused(take / "", take, "the mirror would be inside of the take");
  // The mirror would be TAKE, in which the take is.
  fs::create_directory(take / "take");
  write_text_file(take / "take" / "take.json", "{}");
  expect_refused(take / "take", folder.path(), "the take would be inside of its mirror");
}

}  // namespace
}  // namespace raystage::cli
