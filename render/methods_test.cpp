// SPDX-License-Identifier: Apache-2.0
#include "render/methods.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>
#include <string>

#include "base/atomic_file.h"
#include "base/error.h"

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

/// A new method must be added to the documents.
TEST(Methods, AreAllInTheDocuments) {
  const std::string docs = RAYSTAGE_SOURCE_DIR "/docs/";
  const std::string artist = read_file(docs + "artist.md");
  const std::string performance = read_file(docs + "performance.md");
  const std::string farm = read_file(docs + "farm.md");
  const std::size_t distributed = farm.find("| method | what is sent |");
  const std::size_t refused = farm.find("Not distributed");
  ASSERT_LT(distributed, refused);
  ASSERT_NE(refused, std::string::npos);
  for (const Method* method : methods()) {
    const std::string quoted = "`" + std::string(method->name()) + "`";
    EXPECT_THAT(artist, ::testing::HasSubstr("\n| " + quoted + " | ")) << "docs/artist.md";
    EXPECT_THAT(performance, ::testing::HasSubstr("\n| " + quoted)) << "docs/performance.md";
    const bool is_distributed =
        method->distribution({method->options(), {}, method->name()}) != DistributionMode::kNone;
    const std::size_t from = is_distributed ? distributed : refused;
    const std::string part = farm.substr(from, is_distributed ? refused - from : 600);
    EXPECT_THAT(part, ::testing::HasSubstr(quoted)) << "docs/farm.md";
  }
}

}  // namespace
}  // namespace raystage::render
