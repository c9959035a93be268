// SPDX-License-Identifier: Apache-2.0
#include "render/methods.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <map>
#include <set>
#include <string>

#include "base/atomic_file.h"
#include "base/error.h"
#include "testing/test_paths.h"

namespace raystage::render {
namespace {

TEST(Methods, AreFoundByNameAndTheirOptionsAreSound) {
  std::set<std::string_view> names;
  for (const Method* method : methods()) {
    EXPECT_TRUE(names.insert(method->name()).second) << method->name();
    EXPECT_EQ(&method_named(method->name()), method);
    std::set<std::string_view> options;
    for (const OptionSpec& option : method->options()) {
      EXPECT_TRUE(options.insert(option.name).second) << method->name() << ' ' << option.name;
      EXPECT_FALSE(option.help.empty()) << method->name() << ' ' << option.name;
    }
    // Default values must be allowed themselves.
    const MethodOptions fallbacks(method->options(), {}, method->name());
    EXPECT_NO_THROW(MethodOptions(method->options(), fallbacks.values(), method->name()))
        << method->name();
    for (const MethodPreset& preset : method->presets()) {
      const schemas::OptionValues values = options_from_text(preset.options);
      EXPECT_FALSE(values.empty()) << method->name() << ' ' << preset.name;
      EXPECT_NO_THROW(MethodOptions(method->options(), values, method->name())) << preset.options;
    }
  }
  EXPECT_THROW(method_named("focal"), Error);
}

TEST(Methods, AreDescribed) {
  const std::string text = describe_methods();
  EXPECT_THAT(text, ::testing::HasSubstr("\nfocal_plane = blends three cameras per ray"));
  EXPECT_THAT(text, ::testing::HasSubstr("\n    preset fast: step_px=2,aggregation=box"));
  int presets = 0;
  for (const Method* method : methods()) {
    for (const MethodPreset& preset : method->presets()) {
      ++presets;
      EXPECT_THAT(text, ::testing::HasSubstr(std::string(preset.options))) << method->name();
    }
  }
  EXPECT_GT(presets, 0);
}

std::string table_row(std::string_view first, std::string_view second, std::string_view third) {
  return fmt::format("| {} | {} | {} |", first, second, third);
}

/// The table of methods in docs/artist.md.
std::string described_methods() {
  std::string table = "| method | what it does | artefacts | for |\n| --- | --- | --- | --- |\n";
  for (const Method* method : methods()) {
    const MethodDescription about = method->description();
    table += fmt::format("| `{}` | {} | {} | {} |\n", method->name(), about.summary,
                         about.artefacts, about.use);
  }
  return table;
}

/// The table and list in docs/farm.md of what ranks send with default options.
std::string distributed_methods() {
  std::map<DistributionMode, std::string> names;
  for (const Method* method : methods()) {
    std::string& list = names[method->distribution({method->options(), {}, method->name()})];
    list += fmt::format("{}`{}`", list.empty() ? "" : ", ", method->name());
  }
  const std::string equal = "within 1 unit in the last place of half";
  return "| method | what is sent | equal to one process |\n| --- | --- | --- |\n" +
         table_row(names[DistributionMode::kContributions], "sums of weighted samples", equal) +
         "\n" +
         table_row(names[DistributionMode::kLockstep],
                   "once per light field frame: depth maps of neighbouring cameras. Per view: "
                   "warped depths, then sums of samples in three rounds",
                   equal) +
         "\n" +
         table_row(names[DistributionMode::kFetchFrames],
                   "to rank 0: the JPEG segments that the view reads", "byte for byte") +
         "\n| " + names[DistributionMode::kNone] + " | not distributed: gather the archives | |\n";
}

/// Compares the lines of a document from the first line of `expected` to the next blank line with
/// `expected`. If the environment variable RAYSTAGE_WRITE_DOCUMENTS is set, replaces them.
void expect_generated_table(const std::filesystem::path& file, const std::string& expected) {
  std::string text = read_file(file);
  const std::size_t from = text.find(expected.substr(0, expected.find('\n')));
  ASSERT_NE(from, std::string::npos) << file;
  const std::size_t size = text.find("\n\n", from) + 1 - from;
  if (std::getenv("RAYSTAGE_WRITE_DOCUMENTS") != nullptr) {
    write_file_atomically(file, text.replace(from, size, expected));
    return;
  }
  EXPECT_EQ(text.substr(from, size), expected)
      << file << " is out of date: run this test with RAYSTAGE_WRITE_DOCUMENTS=1";
}

// A new method needs no hand in these tables.
TEST(Methods, TablesInTheDocumentsAreUpToDate) {
  const std::filesystem::path docs = testing::source_folder() / "docs";
  expect_generated_table(docs / "artist.md", described_methods());
  expect_generated_table(docs / "farm.md", distributed_methods());
  const std::string performance = read_file(docs / "performance.md");
  for (const Method* method : methods()) {
    const std::string row = fmt::format("\n| `{}`", method->name());
    EXPECT_NE(performance.find(row), std::string::npos)
        << "docs/performance.md has no row of " << method->name() << ": see CONTRIBUTING.md";
  }
}

}  // namespace
}  // namespace raystage::render
